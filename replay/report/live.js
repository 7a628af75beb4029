// A run that goes on: rows arrive 30 times a second and everything grows; the view follows until somebody moves it.
let following = true, waiting = false, updates = 0;
const TOLD = ["time", "measured", "command", "inside", "x_m", "z_m", "phi_rad", "zeta", "phi"];

function take(run, rows) {
  const a = arraysOf(run), known = run.straw.bent / 2;
  for (const row of rows) {
    const r = Object.fromEntries(TOLD.map((name, k) => [name, row[k]]));
    a.time.push(r.time);
    a.shapeTime.push(r.time);
    a.pressureTime.push(r.time);
    a.pressure.push(r.measured);
    a.command.push(r.command);
    a.inside.push(r.inside);
    for (const name of ["x_m", "z_m", "phi_rad"]) a[name].predicted.push(r[name]);
    a.zeta.push(r.zeta);
    a.phi.push(r.phi);
    // a cell that bends is one that snaps: from now on it has a colour
    r.phi.forEach((phi, n) => {
      if (Math.abs(phi) < known || run.snapping.includes(n + 1)) return;
      run.snapping.push(n + 1);
      run.snaps.push([r.time, "predicted"]);
      run.changed = true;
    });
  }
}

function grow(run) {
  waiting = false;
  updates++;
  if (run.changed) { run.changed = false; run.feeds = drawCharts(run); }
  charts.forEach((chart, k) => chart.setData(run.feeds[k]()));
  const [start, end] = spanOf(run);
  $("#time").min = start;
  $("#time").max = end;
  if (following) setTime(end);
}

function follow(run) {
  const source = new EventSource("/events");
  source.onmessage = (e) => {
    take(run, JSON.parse(e.data));
    if (!waiting) { waiting = true; requestAnimationFrame(() => grow(run)); }
  };
  source.addEventListener("end", () => {
    source.close();
    $(".sentence").textContent = "The run has ended; this is what the model did under the pressure that was measured.";
  });
  source.onerror = () => { if (source.readyState === EventSource.CLOSED) $(".sentence").textContent = "The rig's process is gone; what arrived is shown."; };
}
document.addEventListener("keydown", (e) => { if (["ArrowLeft", "n", "p", "Home", " "].includes(e.key)) following = false; if (e.key === "End") following = true; });
$("#time").addEventListener("input", () => { following = false; });
$("#charts").addEventListener("mouseenter", () => { following = false; });
$("#charts").addEventListener("mouseleave", () => { following = true; });
follow(runs[0]);
