// Tables: all runs at once with small pictures of each, and the metrics of the one that is shown.
const COLUMNS = [
  ["run", (r) => html(r.id), (r) => r.id], ["", (r) => html(r.role), (r) => r.role],
  ...[["x_m", "X", "µm", 1e6, 1], ["z_m", "Z", "µm", 1e6, 1], ["phi_rad", "Φ", "mrad", 1e3, 2]].map(([n, title, unit, f, digits]) => [
    `${title} rms / ${unit}`, (r) => fixed(r.signals[n].metrics.rmse * f, digits), (r) => r.signals[n].metrics.rmse]),
  ["X, Z, Φ within 2σ", (r) => each(r, (m) => (m.within_2_sigma === null ? "–" : Math.round(100 * m.within_2_sigma) + " %")), (r) => r.signals.x_m.metrics.within_2_sigma],
  ["X, Z, Φ reduced χ²", (r) => each(r, (m) => short(m.reduced_chi2)), (r) => Math.max(...Object.values(r.signals).map((s) => s.metrics.reduced_chi2 ?? -1))],
  ["Φ lag / ms", (r) => { const m = r.signals.phi_rad.metrics; return m.lag_at_bound ? "beyond" : `${fixed(m.lag_s * 1e3, 1)} ± ${fixed(m.lag_sigma_s * 1e3, 1)}`; }, (r) => Math.abs(r.signals.phi_rad.metrics.lag_s)],
  ["snaps late by / ms", (r) => r.pairs.map((p) => (p.late === null ? (p.measured ? "missed" : "extra") : fixed(p.late * 1e3, 1))).join(" · ") || "no snap", (r) => Math.max(0, ...r.pairs.map((p) => Math.abs(p.late ?? 9)))],
  ["off / resolvable", (r) => r.quantities.filter((q) => q.verdict === "off").length + " / " + r.quantities.filter((q) => q.verdict !== "no statement").length, (r) => r.quantities.filter((q) => q.verdict === "off").length],
];
const each = (r, f) => ["x_m", "z_m", "phi_rad"].map((n) => f(r.signals[n].metrics)).join(" · ");
const short = (v) => (v === null ? "–" : v < 10 ? v.toFixed(1) : Math.round(v));

function drawTable(runs) {
  $("#runs thead").innerHTML = "<tr>" + COLUMNS.map(([title]) => `<th title="click to sort">${title}</th>`).join("") + "</tr>";
  const body = $("#runs tbody"), order = runs.map((_, i) => i);
  const fill = () => {
    body.innerHTML = "";
    for (const i of order) {
      const row = document.createElement("tr");
      row.dataset.run = i;
      row.innerHTML = COLUMNS.map(([, text]) => `<td>${text(runs[i])}</td>`).join("");
      row.addEventListener("click", () => show(i));
      body.append(row);
    }
    markChosen();
  };
  document.querySelectorAll("#runs th").forEach((head, k) => head.addEventListener("click", () => {
    const by = COLUMNS[k][2];
    order.sort((p, q) => (by(runs[p]) < by(runs[q]) ? -1 : by(runs[p]) > by(runs[q]) ? 1 : p - q));
    if (head.dataset.up) order.reverse();
    head.dataset.up = head.dataset.up ? "" : "1";
    fill();
  }));
  fill();
  if (runs.length > 1) drawMultiples(runs);
}

// X, Z and Phi of every run side by side; each row scaled to the measurement.
function drawMultiples(runs) {
  $("#multiples").innerHTML = runs.map((run, i) => {
    const rows = Object.values(run.signals).map((s, row) => {
      const seen = unpack(s.small.measured), said = unpack(s.small.predicted), all = [...seen, ...said].filter((v) => v !== null);
      const low = Math.min(...all), high = Math.max(...all), n = seen.length;
      const path = (values) => values.map((v, k) => (v === null ? "" : `${((200 * k) / (n - 1)).toFixed(1)},${(row * 34 + 30 - (28 * (v - low)) / (high - low || 1)).toFixed(1)}`)).join(" ");
      return `<polyline class="m" points="${path(seen)}"/><polyline class="p" points="${path(said)}"/>`;
    });
    return `<button data-run="${i}" title="X, Z and Φ, measured and model">${html(run.id)} <small>${html(run.role)}</small><svg viewBox="0 0 200 100" preserveAspectRatio="none">${rows.join("")}</svg></button>`;
  }).join("");
  document.querySelectorAll("#multiples button").forEach((b) => b.addEventListener("click", () => show(Number(b.dataset.run))));
}

function markChosen() {
  document.querySelectorAll("#runs tbody tr, #multiples button").forEach((e) => e.classList.toggle("chosen", Number(e.dataset.run) === shown));
}

const ROWS = [
  ["samples, overlap", (m) => `${m.n}, ${fixed(m.overlap_s, 2)} s`], ["bias", (m, f) => `${fixed(m.bias * f, 4)} ± ${fixed(m.bias_sigma * f, 4)}`],
  ["RMSE", (m, f) => fixed(m.rmse * f, 4)], ["RMSE over the measured range", (m) => fixed(100 * m.nrmse_of_range, 2) + " %"],
  ["largest, at", (m, f) => `${fixed(m.max_abs * f, 4)}, ${fixed(m.max_at_s, 3)} s`],
  ["Sprague-Geers M, P, C", (m) => [m.sprague_geers_m, m.sprague_geers_p, m.sprague_geers_c].map((v) => fixed(v, 4)).join(", ")],
  ["lag (model late > 0)", (m) => (m.lag_at_bound ? `at the bound, ${fixed(m.lag_bound_s * 1e3, 0)} ms: no lag explains it` : `${fixed(m.lag_s * 1e3, 2)} ± ${fixed(m.lag_sigma_s * 1e3, 2)} ms`)],
  ["RMSE after the lag", (m, f) => fixed(m.rmse_after_lag * f, 4)], ["within 2σ", (m) => (m.within_2_sigma === null ? "–" : fixed(100 * m.within_2_sigma, 1) + " %")],
  ["reduced χ² (noise alone: 1 ±)", (m) => (m.reduced_chi2 === null ? "–" : `${fixed(m.reduced_chi2, 2)} (± ${fixed(m.reduced_chi2_sigma, 2)})`)],
];

function drawNumbers(run) {
  const signals = Object.values(run.signals);
  const verdict = { off: "the model is off", "cannot be resolved": "its error cannot be resolved", "no statement": "no statement: σ unknown" };
  const cell = (s) => (s ? `${fixed(s.start, 4)} s, turn ${fixed((s.turn * 180) / Math.PI, 1)}°, hinge ${fixed(s.hinge * 1e3, 1)} mm → ${s.cell ? "cell " + s.cell : "no cell of the model's"}` : "none");
  $("#numbers").innerHTML =
    `<h3>Signals</h3><div class="scroll"><table><tr><th></th>${signals.map((s) => `<th>${s.title} / ${s.unit}</th>`).join("")}</tr>` +
    ROWS.map(([name, f]) => `<tr><td>${name}</td>${signals.map((s) => `<td>${f(s.metrics, s.factor)}</td>`).join("")}</tr>`).join("") +
    `<tr><td>verdict</td>${signals.map((s) => `<td class="${s.verdict === "off" ? "off" : ""}">${verdict[s.verdict]}</td>`).join("")}</tr></table></div>` +
    (run.pairs.length ? `<h3>Snaps</h3><div class="scroll"><table><tr><th></th><th class="words">measured</th><th class="words">model</th><th>model late by</th></tr>` +
      run.pairs.map((p, k) => `<tr><td>${k + 1}</td><td class="words">${cell(p.measured)}</td><td class="words">${cell(p.predicted)}</td><td>${p.late === null ? "not in both" : fixed(p.late * 1e3, 2) + " ms"}</td></tr>`).join("") +
      `</table></div><p class="facts">${html(run.order)}</p>` : "") +
    `<h3>Validation of the model</h3><div class="scroll"><table><tr><th></th><th>measured</th><th>model</th><th>E = model − measured</th><th>2 u<sub>val</sub></th><th class="words">of it: measurement, integration, inputs</th><th class="words"></th></tr>` +
    run.quantities.map((q) => `<tr><td>${html(q.name)} / ${q.unit}</td><td>${fixed(q.measured, q.digits)}</td><td>${fixed(q.predicted, q.digits)}</td><td>${fixed(q.error, q.digits)}</td><td>${q.u_val === null ? "–" : fixed(2 * q.u_val, q.digits)}</td><td class="words">${[q.u_data, q.u_num, q.u_input].map((v) => (v === null ? "–" : v.toPrecision(2))).join(", ")}</td><td class="words ${q.verdict === "off" ? "off" : ""}">${q.verdict === "off" ? "off" : q.verdict}</td></tr>`).join("") +
    `</table></div><p class="facts">An error below 2 u<sub>val</sub> cannot be resolved with these data: it says nothing for or against the model. One in twenty is above it by chance. ${html(run.inputs)}</p>` +
    (run.threeWays ? threeWays(run.threeWays) : "");
}

// The same protocol on the rig, behind the emulator's wire and in the model: curves over each other and what differs.
function threeWays({ signals, differences }) {
  const styles = { recording: "m", emulator: "e", model: "p" };
  const pictures = Object.entries(signals).map(([name, { unit, curves }]) => {
    const all = Object.values(curves).flatMap((q) => q.value), times = Object.values(curves).flatMap((q) => q.time);
    const [low, high, start, end] = [Math.min(...all), Math.max(...all), Math.min(...times), Math.max(...times)];
    const path = (q) => q.time.map((t, k) => `${((200 * (t - start)) / (end - start)).toFixed(1)},${(96 - (92 * (q.value[k] - low)) / (high - low || 1)).toFixed(1)}`).join(" ");
    return `<figure>${html(name)} / ${html(unit)}<svg viewBox="0 0 200 100" preserveAspectRatio="none">` +
      Object.entries(curves).map(([who, q]) => `<polyline class="${styles[who]}" points="${path(q)}"/>`).join("") + "</svg></figure>";
  });
  return `<h3>The same protocol on recording, emulator and model</h3><p class="key"><span class="swatch measured"></span> recording <span class="swatch inside"></span> emulator <span class="swatch predicted"></span> model under the controller's nominal response</p>` +
    `<div class="ways">${pictures.join("")}</div><div class="scroll"><table><tr><th></th><th></th><th>bias</th><th>RMS</th><th>largest</th><th>at</th><th>lag</th></tr>` +
    differences.map((d) => `<tr><td>${html(d.other)} − ${html(d.one)}</td><td>${html(d.signal)} / ${html(d.unit)}</td><td>${fixed(d.bias, 4)}</td><td>${fixed(d.rmse, 4)}</td><td>${fixed(d.max, 4)}</td><td>${fixed(d.at, 3)} s</td><td>${d.beyond ? "beyond" : d.lag === null ? "–" : `${fixed(d.lag * 1e3, 2)} ± ${fixed(d.lagSigma * 1e3, 2)} ms`}</td></tr>`).join("") + "</table></div>";
}
