"use strict";
// Draws the chosen run: one chart a channel with its residual below, all sharing time axis and cursor.
const runs = JSON.parse(document.getElementById("data").textContent);
const unpack = (text) => {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return Array.from(new Float32Array(bytes.buffer), (v) => (isFinite(v) ? v : null));
};
// A stretch without valid samples is a gap in the curves, not a straight line across it.
const withGaps = (s) => {
  const steps = s.time.slice(1).map((t, k) => t - s.time[k]);
  const usual = [...steps].sort((a, b) => a - b)[Math.floor(steps.length / 2)];
  for (let k = steps.length; k > 0; k--) {
    if (steps[k - 1] < 2.5 * usual) continue;
    s.time.splice(k, 0, s.time[k - 1] + usual);
    for (const name of ["measured", "sigma", "predicted"]) s[name].splice(k, 0, null);
  }
  return s;
};
const color = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
const fixed = (value, digits) => (value === null || !isFinite(value) ? "–" : value.toFixed(digits));
const html = (text) => text.replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);

const head = ["run", "X rms / µm", "Z rms / µm", "Φ rms / mrad", "X, Z, Φ within 2σ", "worst / σ"];
document.querySelector("#runs thead").innerHTML = "<tr>" + head.map((h) => `<th>${h}</th>`).join("") + "</tr>";
const body = document.querySelector("#runs tbody");
runs.forEach((run, i) => {
  const s = run.signals;
  const all = [s.x_m, s.z_m, s.phi_rad];
  const share = (q) => (q.within === null ? "–" : Math.round(100 * q.within) + " %");
  const worst = Math.sqrt(Math.max(...all.map((q) => (q.chi2 === null ? NaN : q.chi2))));
  const row = document.createElement("tr");
  row.innerHTML =
    `<td>${html(run.id)}</td><td>${fixed(s.x_m.rmse * 1e3, 1)}</td><td>${fixed(s.z_m.rmse * 1e3, 1)}</td>` +
    `<td>${fixed((s.phi_rad.rmse * 1e3 * Math.PI) / 180, 2)}</td><td>${all.map(share).join(" · ")}</td>` +
    `<td>${fixed(worst, 1)}</td>`;
  row.addEventListener("click", () => show(i));
  body.append(row);
});

let charts = [];
let shown = 0;
const axis = (size, label, space) => ({
  space, stroke: color("soft"), grid: { stroke: color("line"), width: 1 }, ticks: { stroke: color("line") }, size, label,
  labelSize: label ? 18 : 0, font: "12px system-ui, sans-serif", labelFont: "11px system-ui, sans-serif",
});

// Event marks: a hairline where the recording says something happened.
const marks = (events) => ({
  hooks: {
    draw: [(u) => {
      const c = u.ctx;
      c.save();
      c.strokeStyle = color("soft");
      c.setLineDash([2, 4]);
      for (const [time] of events) {
        const x = Math.round(u.valToPos(time, "x", true));
        if (x < u.bbox.left || x > u.bbox.left + u.bbox.width) continue;
        c.beginPath();
        c.moveTo(x, u.bbox.top);
        c.lineTo(x, u.bbox.top + u.bbox.height);
        c.stroke();
      }
      c.restore();
    }],
  },
});

const zoom = (u) => {
  const { min, max } = u.scales.x;
  for (const other of charts) {
    if (other !== u && (other.scales.x.min !== min || other.scales.x.max !== max)) other.setScale("x", { min, max });
  }
};

function draw({ title, note, height, data, series, bands, events, span, unit, last, scales }) {
  const box = document.createElement("div");
  box.className = "chart";
  if (title) box.innerHTML = `<h3>${title}<small>${note}</small><output></output></h3>`;
  const readout = box.querySelector("output");
  // What the curves say under the cursor; the cursor is shared, so every chart answers at once.
  const read = (u) => {
    const i = u.cursor.idx;
    if (!readout) return;
    const here = series.map((q, k) => [q, i === null || i === undefined ? null : u.data[k + 1][i]]).filter(([q, v]) => q.width > 0 && v !== null);
    readout.textContent = here.length ? `${u.data[0][i].toFixed(4)} s: ` + here.map(([q, v]) => `${q.label} ${v.toFixed(3)}`).join(", ") : "";
  };
  document.getElementById("charts").append(box);
  const chart = new uPlot({
    width: document.getElementById("charts").clientWidth, height,
    scales: { x: { time: false, range: (u, min, max) => (min === max ? span : [min, max]) }, ...scales },
    axes: [last ? axis(40, "time since the run's zero / s", 50) : { ...axis(6, undefined, 50), values: (u, v) => v.map(() => ""), ticks: { show: false } }, axis(62, unit, unit.startsWith("residual") ? 16 : 30)],
    series: [{ label: "s", value: (u, v) => (v === null ? "" : v.toFixed(4)) }, ...series],
    bands, legend: { show: false }, cursor: { y: false, sync: { key: "straw" }, drag: { x: true, y: false }, points: { size: 6 } },
    plugins: [marks(events)], hooks: { setScale: [(u, key) => key === "x" && zoom(u)], setCursor: [read] },
  }, data, box);
  charts.push(chart);
}

function show(i) {
  shown = i;
  charts.forEach((chart) => chart.destroy());
  charts = [];
  document.getElementById("charts").innerHTML = "";
  [...body.children].forEach((row, k) => row.classList.toggle("chosen", k === i));
  const run = runs[i];
  document.querySelector("#run h2").textContent = run.id;
  document.querySelector("#run .facts").textContent =
    `${run.specimen || "unnamed specimen"} · cells deployed at the start: ${run.deployed} · cycle ${run.cycle} · ` +
    `${run.file} · SHA-256 ${run.sha.slice(0, 12)}…`;
  document.querySelector("#run .lost").innerHTML = run.lost.map((s) => `<li>${html(s)}</li>`).join("");
  document.getElementById("straw").textContent = run.straw;
  const p = run.pressure;
  const pressureTime = unpack(p.time);
  // the measurement is a broad line, so that the model on top of it hides nothing
  const line = (label, name, width, dash) => ({ label, stroke: color(name), width, dash, points: { show: false } });
  const signals = Object.values(run.signals).map((s) => {
    const data = { time: unpack(s.time), measured: unpack(s.measured), sigma: unpack(s.sigma), predicted: unpack(s.predicted) };
    return { ...s, ...withGaps(data) };
  });
  const ends = [...signals.map((s) => s.time), pressureTime].map((t) => [t[0], t[t.length - 1]]);
  const span = [Math.min(...ends.map((e) => e[0])), Math.max(...ends.map((e) => e[1]))];
  const common = { events: run.events, span, bands: [], last: false };
  const hidden = { stroke: "transparent", width: 0, points: { show: false } };
  for (const s of signals) {
    const known = s.chi2 !== null;
    const low = s.measured.map((m, k) => (known && m !== null ? m - 2 * s.sigma[k] : null));
    const high = s.measured.map((m, k) => (known && m !== null ? m + 2 * s.sigma[k] : null));
    const digits = s.unit === "deg" ? 3 : 4;
    const note = `bias ${fixed(s.bias, digits)}, RMS ${fixed(s.rmse, digits)}, largest ${fixed(s.max, digits)} ${s.unit} at ` +
      `${fixed(s.maxAt, 2)} s · RMS ${fixed(100 * s.nrmse, 1)} % of the range`;
    draw({
      ...common, title: s.title, note, height: 170, unit: s.unit, data: [s.time, high, low, s.measured, s.predicted],
      series: [{ label: "+2σ", ...hidden }, { label: "−2σ", ...hidden }, line("measured", "measured", 3.2), line("model", "predicted", 1.3)],
      bands: [{ series: [1, 2], fill: color("band") }],
    });
    // The residual's scale never shrinks below 4 sigma, so that noise looks like noise.
    const residual = s.predicted.map((v, k) => (v === null ? null : (v - s.measured[k]) / (known ? s.sigma[k] : 1)));
    const least = known ? 4 : 0;
    draw({
      ...common, height: 90, unit: known ? "residual / σ" : `residual / ${s.unit}`, data: [s.time, residual],
      series: [line("residual", "predicted", 1)],
      scales: { y: { range: (u, min, max) => { const r = Math.max(least, 1.1 * Math.max(-min, max)); return [-r, r]; } } },
    });
  }
  const pressure = [pressureTime, unpack(p.measured), p.command ? unpack(p.command) : pressureTime.map(() => null), unpack(p.inside)];
  draw({
    ...common, title: "Pressure", note: "gauge; the measured one drives the model", height: 190, unit: "kPa", data: pressure,
    series: [line("measured", "measured", 3.2), line("command", "command", 1.4, [6, 4]), line("inside", "inside", 1.3)],
    last: true,
  });
  charts.forEach((chart) => chart.setScale("x", { min: span[0], max: span[1] }));
}

document.addEventListener("keydown", (e) => {
  const by = { ArrowDown: 1, ArrowUp: -1 }[e.key];
  if (!by || runs.length < 2) return;
  e.preventDefault();
  show((shown + by + runs.length) % runs.length);
});
let resized;
window.addEventListener("resize", () => { clearTimeout(resized); resized = setTimeout(() => show(shown), 150); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => show(shown));
show(0);
