// Curves of several recordings over each other: one plot a signal, all on one time axis; a legend of what varies.
const PALETTE = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8a6d3b", "#7f3fbf", "#5c666e", "#b00020"];
let plots = [];
function drawCurves(box, runs, events) {
  plots.forEach((p) => p.destroy());
  plots = [];
  box.innerHTML = "";
  const names = [...new Set(runs.flatMap((run) => Object.keys(run.signals)))].sort((a, b) => rank(a) - rank(b));
  const pairs = names.filter((n) => !(n.startsWith("command") && names.includes(n.replace("command", "pressure"))));
  for (const name of pairs) {
    const shown = runs.flatMap((run, k) => [[name, 1.6, []], [name.replace("pressure", "command"), 1, [5, 4]]]
      .filter(([n], i) => run.signals[n] && (i === 0 || n !== name)).map(([n, width, dash]) => ({ ...run.signals[n], width, dash, stroke: PALETTE[k % PALETTE.length], label: run.label || n, paths: n.startsWith("command") ? uPlot.paths.stepped({ align: 1 }) : undefined })));
    if (!shown.length) continue;
    const place = document.createElement("div");
    place.className = "plot";
    place.innerHTML = `<h3>${html(name)} <span class="soft"></span></h3>`;
    box.append(place);
    const data = uPlot.join(shown.map((s) => [s.time_s, s.values]));
    const axis = (label) => ({ space: label.startsWith("time") ? 50 : 28, stroke: color("soft"), grid: { stroke: color("line"), width: 1 }, ticks: { stroke: color("line") }, label, labelSize: 16, size: label.startsWith("time") ? 40 : 56, font: "12px system-ui", labelFont: "11px system-ui" });
    plots.push(new uPlot({
      width: box.clientWidth, height: 170, legend: { show: false }, scales: { x: { time: false } },
      cursor: { sync: { key: "runs" }, drag: { x: true, y: false } },
      axes: [axis("time since the run's zero / s"), axis(shown[0].unit)],
      series: [{}, ...shown.map((s) => ({ label: s.label, stroke: s.stroke, width: s.width, dash: s.dash, paths: s.paths, spanGaps: true, pxAlign: 0, points: { show: false } }))],
      hooks: {
        setCursor: [(u) => {
          const i = u.cursor.idx, out = place.querySelector("h3 span");
          out.textContent = i === null || i === undefined ? "" : `${u.data[0][i].toFixed(3)} s: ` + u.series.slice(1).map((s, k) => near(u.data[k + 1], i)).filter((v) => v !== null).map((v) => v.toFixed(3)).join(", ") + " " + shown[0].unit;
        }],
        draw: [(u) => drawEvents(u, events || [])],
        setScale: [(u, key) => { if (key === "x") for (const other of plots) if (other !== u && (other.scales.x.min !== u.scales.x.min || other.scales.x.max !== u.scales.x.max)) other.setScale("x", { min: u.scales.x.min, max: u.scales.x.max }); }],
      },
    }, data, place));
  }
}
const rank = (name) => ["X", "Z", "Phi", "press", "comm", "flow"].findIndex((n) => name.startsWith(n)) + (parseInt(name.split(" ")[1], 10) || 0) / 10;
function near(column, i) { for (let k = 0; k < 40; k++) for (const j of [i - k, i + k]) if (column[j] !== null && column[j] !== undefined) return column[j]; return null; }
function drawEvents(u, events) {
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
}
