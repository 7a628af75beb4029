// The page itself: which run is shown, and redrawing it when the window changes.
const runs = JSON.parse(document.getElementById("data").textContent);
let shown = 0;

function show(i) {
  play(false);
  shown = (i + runs.length) % runs.length;
  redraw(true);
}

function redraw(fresh) {
  const run = runs[shown], at = now;
  shownRun = run;
  markChosen();
  statesKey();
  $("#run h2").textContent = run.id;
  $("#run .facts").textContent = [
    run.role === "running" ? "" : run.role, ...(run.straw ? [run.specimen || "unnamed specimen", `cells deployed at the start: ${run.deployed}`, `cycle ${run.cycle}`] : []), run.file,
    run.sha && `SHA-256 ${run.sha.slice(0, 12)}…`].filter(Boolean).join(" · ");
  $("#run .lost").innerHTML = run.lost.map((s) => `<li>${html(s)}</li>`).join("");
  $("#toml").textContent = run.toml;
  run.feeds = drawCharts(run);
  if (!run.live) drawNumbers(run);
  prepareTime(run);
  if (fresh !== true) setTime(at);
}
let resized;
window.addEventListener("resize", () => { clearTimeout(resized); resized = setTimeout(redraw, 150); });
// Paper is white, whatever the screen was, and its charts are as wide as the paper.
let themeBefore;
window.addEventListener("beforeprint", () => { themeBefore = document.documentElement.dataset.theme; document.documentElement.dataset.theme = "light"; redraw(); });
window.addEventListener("afterprint", () => { document.documentElement.dataset.theme = themeBefore; redraw(); });
if (!runs[0].live) drawTable(runs);
redraw(true);
document.documentElement.dataset.ready = Math.round(performance.now()); // ms, for the benchmark
