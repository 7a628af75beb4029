// A run in progress: rows arrive 30 times a second; the view follows until the user moves it.
let following = true, waiting = false, updates = 0;
const TOLD = ["time", "measured", "command", "inside", "x_m", "z_m", "phi_rad", "zeta", "phi", "others"];

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
    for (const [name, value] of Object.entries(r.others)) {
      if (!a.others[name]) { a.others[name] = a.time.slice(1).map(() => null); run.changed = true; }
      a.others[name].push(value);
    }
    // a cell that bends is one that snaps: from here on it has a colour
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

let orders, ended = false, heardAt = performance.now(), answered = "";

function follow(run) {
  orders = new WebSocket(`ws://${location.host}/feed`);
  orders.onmessage = (e) => {
    const said = JSON.parse(e.data);
    heardAt = performance.now();
    if (said.end) { ended = true; sentence("The run has ended; this is what the model did under the pressure that was measured."); return; }
    if (said.state || said.error) { answered = said.error || said.state; showState(run); return; }
    if (said.guardian) run.guardian = said.guardian;
    for (const [time, kind, text] of said.events) {
      run.events.push([time, kind]);
      $("#log").insertAdjacentHTML("afterbegin", `<li><b>${time.toFixed(2)} s</b> ${html(kind)}: ${html(text)}</li>`);
      if (kind === "hold") answered = "held";
      if (kind === "resume") answered = "running";
      if (kind === "vent" || kind === "abort") sentence(`${kind}: ${text}`);
    }
    if (said.rows.length) {
      take(run, said.rows);
      if (!waiting) { waiting = true; requestAnimationFrame(() => grow(run)); }
    }
    showState(run);
  };
  orders.onclose = () => { if (!ended) sentence("The page of this run has ended; what had arrived is shown. The run's own process vents, or its guardian does."); showState(run); };
}
const sentence = (text) => { $(".sentence").textContent = text; };
const order = (what) => { if (orders.readyState === WebSocket.OPEN) orders.send(JSON.stringify({ do: what, who: "the run's own page" })); };

// Orders to a run from its own page; within the lab's page only those that the lab does not have.
function drawOrders(run) {
  $("header").insertAdjacentHTML("beforeend", `<p id="orders">${run.orders ? `<button class="vent" data-do="vent">VENT <kbd>V</kbd></button>
    <button data-do="hold">hold</button> <button data-do="resume">resume</button> <button data-do="stop">stop and vent</button>` : ""} <span id="state"></span></p>`);
  $("#curves").insertAdjacentHTML("beforeend", `<details open><summary>Events</summary><ul id="log"></ul></details>`);
  document.querySelectorAll("#orders button").forEach((b) => b.addEventListener("click", () => order(b.dataset.do)));
  onVentKey(() => {
    order("vent");
    if (parent !== window) parent.postMessage("vent", "*"); // the page around this one has more ways to the rig
  });
  setInterval(() => showState(run), 500);
}
function showState(run) {
  const silent = (performance.now() - heardAt) / 1e3, lost = !ended && (silent > 1.5 || orders.readyState > 1);
  $("#state").className = lost ? "off" : "";
  $("#state").textContent = ended ? "ended" : lost ? `no data for ${silent.toFixed(0)} s; on the machine: straw rig tell vent` :
    `${answered || "running"}${run.guardian ? ` · guardian: process ${run.guardian.pid}, vents when the run is silent for ${run.guardian.heartbeat_s} s` : ""}`;
}
document.addEventListener("keydown", (e) => { if (["ArrowLeft", "n", "p", "Home", " "].includes(e.key)) following = false; if (e.key === "End") following = true; });
$("#time").addEventListener("input", () => { following = false; });
$("#charts").addEventListener("mouseenter", () => { following = false; });
$("#charts").addEventListener("mouseleave", () => { following = true; });
if (runs[0].rows) { // predicted, not run: all of it is there
  take(runs[0], runs[0].rows);
  grow(runs[0]);
  onVentKey(() => { if (parent !== window) parent.postMessage("vent", "*"); });
} else {
  drawOrders(runs[0]);
  follow(runs[0]);
}
