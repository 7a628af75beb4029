// Curves against time: one chart a channel with its residual below; all share axis, zoom and cursor.
let charts = [], moving = false;
const axis = (size, label, space) => ({
  space, stroke: color("soft"), grid: { stroke: color("line"), width: 1 }, ticks: { stroke: color("line") }, size, label,
  labelSize: label ? 18 : 0, font: "12px system-ui, sans-serif", labelFont: "11px system-ui, sans-serif",
});

// A hairline at each event of the recording, and a mark at each snap: filled for the model, open for the camera.
const marks = (run) => ({
  hooks: {
    draw: [(u) => {
      const c = u.ctx, dpr = window.devicePixelRatio || 1, inside = (x) => x >= u.bbox.left && x <= u.bbox.left + u.bbox.width;
      c.save();
      c.strokeStyle = color("soft");
      c.setLineDash([2, 4]);
      for (const [time] of run.events) {
        const x = Math.round(u.valToPos(time, "x", true));
        if (!inside(x)) continue;
        c.beginPath();
        c.moveTo(x, u.bbox.top);
        c.lineTo(x, u.bbox.top + u.bbox.height);
        c.stroke();
      }
      c.setLineDash([]);
      const size = 4.5 * dpr;
      for (const [time, name] of run.snaps) {
        const x = u.valToPos(time, "x", true);
        if (!inside(x)) continue;
        c.beginPath();
        c.moveTo(x - size, u.bbox.top);
        c.lineTo(x + size, u.bbox.top);
        c.lineTo(x, u.bbox.top + 1.8 * size);
        c.closePath();
        c.fillStyle = c.strokeStyle = color(name);
        c.lineWidth = 1.5 * dpr;
        name === "predicted" ? c.fill() : c.stroke();
      }
      c.restore();
    }],
  },
});

const shareZoom = (u) => {
  const { min, max } = u.scales.x;
  for (const other of charts) {
    if (other !== u && (other.scales.x.min !== min || other.scales.x.max !== max)) other.setScale("x", { min, max });
  }
  if (moving) return;
  moving = true; // the same moment has another place on the axis
  requestAnimationFrame(() => { moving = false; moveCursors(now); });
};

function addChart({ title, note, height, data, series, bands, run, span, unit, last, scales }) {
  const box = document.createElement("div");
  box.className = "chart";
  if (title) box.innerHTML = `<h3>${title}<small>${note}</small><output></output></h3>`;
  $("#charts").append(box);
  const readout = box.querySelector("output");
  const read = (u) => {
    const i = u.cursor.idx;
    if (u.cursor.event && u.cursor.left >= 0) { // the mouse moved: everything else follows
      u.cursor.event = null;
      setTime(u.posToVal(u.cursor.left, "x"), u);
    }
    if (!readout || i === null || i === undefined || u.data[0][i] === undefined) return;
    const here = series.map((q, k) => [q, u.data[k + 1][i]]).filter(([q, v]) => q.width > 0 && !q.quiet && v !== null && v !== undefined);
    readout.textContent = here.map(([q, v]) => `${q.label} ${v.toFixed(3)}`).join(", ");
  };
  const chart = new uPlot({
    width: $("#charts").clientWidth, height,
    scales: { x: { time: false, range: (u, min, max) => (min === max ? span() : [min, max]) }, ...scales },
    axes: [last ? axis(40, "time since the run's zero / s", 50) : { ...axis(6, undefined, 50), values: (u, v) => v.map(() => ""), ticks: { show: false } }, axis(62, unit, unit.startsWith("residual") ? 16 : 30)],
    series: [{}, ...series], bands: bands || [], legend: { show: false },
    cursor: { y: false, drag: { x: true, y: false }, points: { size: 6 }, lock: false },
    plugins: [marks(run)], hooks: { setScale: [(u, key) => key === "x" && shareZoom(u)], setCursor: [read] },
  }, data, box);
  charts.push(chart);
  return chart;
}

// the measurement is a broad line, so that the model on top of it hides nothing
const line = (label, name, width, dash) => ({ label, stroke: color(name), width, dash, points: { show: false } });
const hidden = { stroke: "transparent", width: 0, points: { show: false }, quiet: true };
const evenRow = (run, rows, n) => rows.map((row) => (row.length === 2 * run.straw.cells ? row[2 * n + 1] : row[n]));

function signalNote(s) {
  const m = s.metrics;
  if (!m) return "";
  const digits = s.unit === "deg" ? 3 : 4, f = s.factor;
  const late = m.lag_at_bound ? `lag beyond ${fixed(m.lag_bound_s * 1e3, 0)} ms` : m.lag_s === null ? "" : `lag ${fixed(m.lag_s * 1e3, 1)} ± ${fixed(m.lag_sigma_s * 1e3, 1)} ms`;
  return `bias ${fixed(m.bias * f, digits)}, RMS ${fixed(m.rmse * f, digits)}, largest ${fixed(m.max_abs * f, digits)} ${s.unit} at ${fixed(m.max_at_s, 2)} s · ${late}`;
}

// Every chart of a run, and how each is fed again when a live run grows.
function drawCharts(run) {
  charts.forEach((chart) => chart.destroy());
  charts = [];
  $("#charts").innerHTML = "";
  const a = arraysOf(run), feeds = [];
  const span = () => spanOf(run);
  const add = (options, feed) => { addChart({ run, span, ...options, data: feed() }); feeds.push(feed); };
  for (const [name, s] of Object.entries(run.signals)) {
    const q = a[name], known = s.known, title = { title: s.title, note: signalNote(s), unit: s.unit };
    if (!q.measured) {
      add({ ...title, height: 130, series: [line("model", "predicted", 1.8)] }, () => [a.time, q.predicted]);
      continue;
    }
    const low = q.measured.map((m, k) => (known && m !== null ? m - 2 * q.sigma[k] : null));
    const high = q.measured.map((m, k) => (known && m !== null ? m + 2 * q.sigma[k] : null));
    add({
      ...title, height: 150, series: [hidden, hidden, line("measured", "measured", 3.2), ...(q.before ? [line("base", "before", 1.3)] : []), line(run.who || "model", "predicted", 1.3)],
      bands: [{ series: [1, 2], fill: color("band") }],
    }, () => [a.time, high, low, q.measured, ...(q.before ? [q.before] : []), q.predicted]);
    // The residual's scale is at least 4 sigma, so that noise is recognised as noise.
    const off = (said) => said.map((v, k) => (v === null || q.measured[k] === null ? null : (v - q.measured[k]) / (known ? q.sigma[k] : 1)));
    const residual = off(q.predicted), others = q.before ? [off(q.before)] : [];
    const least = known ? 4 : 0;
    add({
      height: 80, last: run.brief && !run.pressure && q === a[Object.keys(run.signals).pop()], unit: known ? "residual / σ" : `residual / ${s.unit}`, series: [...others.map(() => line("base", "before", 1)), line("residual", "predicted", 1)],
      scales: { y: { range: (u, min, max) => { const r = Math.max(least, 1.1 * Math.max(-min, max)); return [-r, r]; } } },
    }, () => [a.time, ...others, residual]);
  }
  if (run.pressure) add({
    title: "Pressure", note: "gauge; the measured one drives the model", last: run.brief, height: 150, unit: "kPa",
    series: [line("measured", "measured", 3.2), line("command", "command", 1.4, [6, 4]), line("inside", "inside", 1.6, [2, 3])],
  }, () => [a.pressureTime, a.pressure, a.command, resample(a.shapeTime, a.inside, a.pressureTime)]);
  // Other channels and sensors, if any.
  for (const name of Object.keys(a.others || {})) {
    add({ title: html(name.split(" / ")[0]), note: "", height: 90, unit: name.split(" / ")[1] || "", series: [line("measured", "measured", 1.6)] }, () => [a.pressureTime, a.others[name]]);
  }
  const [min, max] = span();
  const whole = () => { charts.forEach((chart) => chart.setScale("x", { min, max })); return feeds; };
  if (run.brief) return whole();
  // The cells in time, as in the paper's Figs. 6 e, f and 7 e, f: those that snap in colour, the rest grey.
  const cells = [...Array(run.straw.cells).keys()];
  const quietFirst = cells.sort((p, q) => run.snapping.includes(p + 1) - run.snapping.includes(q + 1));
  const lines = quietFirst.map((n) => ({ label: `cell ${n + 1}`, stroke: cellColor(run, n + 1), width: run.snapping.includes(n + 1) ? 1.8 : 0.8, points: { show: false }, quiet: !run.snapping.includes(n + 1) }));
  const names = run.snapping.length ? "in colour: " + run.snapping.map((cell) => `<span style="color:${cellColor(run, cell)}">cell ${cell}</span>`).join(", ") : "no cell snaps";
  const rows = (rows, factor) => () => [a.shapeTime, ...quietFirst.map((n) => Array.from(evenRow(run, rows, n), (v) => v * factor))];
  add({ title: "Cells, ζ", note: names, height: 120, unit: "mm", series: lines }, rows(a.zeta, 1e3));
  add({ title: "Cells, φ", note: "", height: 140, unit: "rad", series: lines, last: true }, rows(a.phi, 1));
  return whole();
}

function resample(time, values, at) {
  let k = 0;
  return at.map((t) => {
    while (k + 2 < time.length && time[k + 1] < t) k++;
    if (k + 1 >= time.length || t < time[0] - 0.02 || t > time[time.length - 1] + 0.02) return null;
    const share = Math.min(1, Math.max(0, (t - time[k]) / (time[k + 1] - time[k])));
    return values[k] + share * (values[k + 1] - values[k]);
  });
}

function spanOf(run) {
  const a = arraysOf(run), ends = [a.time, a.pressureTime, a.shapeTime].filter((t) => t.length).map((t) => [t[0], t[t.length - 1]]);
  return ends.length ? [Math.min(...ends.map((e) => e[0])), Math.max(...ends.map((e) => e[1]))] : [0, 1];
}

// The cursor of all charts at a time, except the one the mouse is in.
function moveCursors(t, except) {
  for (const u of charts) {
    if (u === except) continue;
    const left = u.valToPos(t, "x");
    u.setCursor({ left: left < 0 || left > u.bbox.width / (window.devicePixelRatio || 1) ? -10 : left, top: 5 }, true);
  }
}
