// Time: one moment for the straw, the film, the plane and all cursors; played, dragged or stepped.
const SPEEDS = [0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1];
let now = 0, playing = false, speed = 0.1, shownRun = null, before = 0;

function setTime(t, from) {
  if (!shownRun) return;
  const [start, end] = spanOf(shownRun);
  now = Math.min(end, Math.max(start, t));
  drawStraw(shownRun, now);
  drawPlane(shownRun, now);
  showFilm(shownRun, now, from === "film");
  moveCursors(now, from);
  $("#time").value = now;
  $("#now").textContent = now.toFixed(4) + " s";
}

function prepareTime(run) {
  shownRun = run;
  const [start, end] = spanOf(run), slider = $("#time");
  slider.min = start;
  slider.max = end;
  prepareFilm(run);
  // start at the first snap, else at the end
  setTime(run.at ?? (run.snaps.length ? Math.min(...run.snaps.map(([t]) => t)) + 0.05 : run.live ? end : start));
}

function play(on) {
  playing = on;
  $("#play").textContent = on ? "❚❚" : "▶";
  const film = playFilm(shownRun, on, speed);
  if (!on || film) return; // the film's own frames carry time along
  if (now >= spanOf(shownRun)[1] - 1e-6) setTime(spanOf(shownRun)[0]);
  before = performance.now();
  requestAnimationFrame(tick);
}

function tick(at) {
  if (!playing) return;
  const t = now + ((at - before) / 1e3) * speed;
  before = at;
  setTime(t);
  if (t >= spanOf(shownRun)[1]) return play(false);
  requestAnimationFrame(tick);
}

function setSpeed(value) {
  speed = value;
  $("#speed").value = String(value);
  if (playing) play(true);
}

function step(samples) {
  play(false);
  const times = arraysOf(shownRun).shapeTime;
  setTime(times[Math.min(times.length - 1, Math.max(0, indexAt(times, now + 1e-6) + samples))]);
}

// To the next or previous event.
function jump(direction) {
  const times = [...shownRun.events.map(([t]) => t), ...shownRun.snaps.map(([t]) => t)].sort((p, q) => p - q);
  const next = direction > 0 ? times.find((t) => t > now + 1e-3) : times.reverse().find((t) => t < now - 1e-3);
  play(false);
  if (next !== undefined) setTime(next);
}

function zoomBy(factor) {
  const { min, max } = charts[0].scales.x, half = ((max - min) * factor) / 2, [start, end] = spanOf(shownRun);
  const middle = factor < 1 ? now : (min + max) / 2;
  charts[0].setScale("x", { min: Math.max(start, middle - half), max: Math.min(end, middle + half) });
}

const KEYS = {
  " ": () => play(!playing), ArrowLeft: (e) => step(e.shiftKey ? -10 : -1), ArrowRight: (e) => step(e.shiftKey ? 10 : 1),
  n: () => jump(1), p: () => jump(-1), Home: () => setTime(spanOf(shownRun)[0]), End: () => setTime(spanOf(shownRun)[1]),
  "[": () => setSpeed(SPEEDS[Math.max(0, SPEEDS.indexOf(speed) - 1)]),
  "]": () => setSpeed(SPEEDS[Math.min(SPEEDS.length - 1, SPEEDS.indexOf(speed) + 1)]),
  "+": () => zoomBy(0.5), "=": () => zoomBy(0.5), "-": () => zoomBy(2),
  0: () => { const [min, max] = spanOf(shownRun); charts[0].setScale("x", { min, max }); },
  ArrowDown: () => show(shown + 1), ArrowUp: () => show(shown - 1), d: toggleTheme,
  "?": () => ($("#keys").open ? $("#keys").close() : $("#keys").showModal()),
};
document.addEventListener("keydown", (e) => {
  if (e.ctrlKey || e.metaKey || e.altKey) return;
  if (e.key !== "?" && $("#keys").open) return;
  if (/^[1-9]$/.test(e.key)) { chosenCell = Number(e.key); setTime(now); return; }
  const does = KEYS[e.key];
  if (!does) return;
  e.preventDefault();
  if (document.activeElement && document.activeElement !== document.body) document.activeElement.blur();
  does(e);
});
$("#play").addEventListener("click", () => play(!playing));
$("#time").addEventListener("input", (e) => { play(false); setTime(Number(e.target.value)); });
$("#speed").innerHTML = SPEEDS.map((s) => `<option value="${s}">${s >= 1 ? "" : "1/"}${s >= 1 ? s : Math.round(1 / s)} speed</option>`).join("");
$("#speed").addEventListener("change", (e) => setSpeed(Number(e.target.value)));
$("#speed").value = String(speed);
$("#help").addEventListener("click", () => $("#keys").showModal());
$("#keys").addEventListener("click", () => $("#keys").close());

function toggleTheme() {
  const root = document.documentElement;
  root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark";
  redraw();
}
const wantsDark = matchMedia("(prefers-color-scheme: dark)");
const followTheme = () => { document.documentElement.dataset.theme = wantsDark.matches ? "dark" : "light"; };
followTheme();
wantsDark.addEventListener("change", () => { followTheme(); redraw(); });
