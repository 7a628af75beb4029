// Common to every page of the lab: the connections to the server and to the run itself, VENT, names, small helpers.
const here = new URLSearchParams(location.search);
const state = { bench: null, listeners: [] };
const onState = (listener) => { state.listeners.push(listener); if (state.bench) listener(state); };
const pageOf = (path, query) => path + "?" + new URLSearchParams(query);
const me = (sessionStorage.me ??= [...crypto.getRandomValues(new Uint8Array(10))].map((b) => b.toString(36)).join(""));
const nameOf = () => localStorage.strawName || "somebody";

async function ask(path) {
  const answer = await fetch(path);
  const said = await answer.json();
  if (!answer.ok) throw new Error(said.error);
  return said;
}
async function tell(action, body) {
  const answer = await fetch("/api/" + action, {
    method: "POST", headers: { "Content-Type": "application/json", "X-Straw": "1" }, body: JSON.stringify({ who: me, name: nameOf(), ...body }),
  });
  const said = await answer.json();
  if (!answer.ok) throw new Error(said.error);
  return said;
}
// A request of the user; if it is refused the reason is shown.
const attempt = async (does) => { try { return await does(); } catch (error) { toast(error.message, null, true); return null; } };
// What a page is about; where it cannot be had, the page says why and shows nothing else.
async function subject(path) {
  try { return await ask(path); } catch (error) { $("#title").textContent = error.message; $(".two").remove(); return null; }
}
let toastGone;
function toast(text, undo, bad) {
  const box = $("#toast");
  box.textContent = text;
  box.className = bad ? "bad" : "";
  if (undo) {
    const button = document.createElement("button");
    button.textContent = "undo";
    button.addEventListener("click", () => { box.hidden = true; undo(); });
    box.append(button);
  }
  box.hidden = false;
  clearTimeout(toastGone);
  toastGone = setTimeout(() => { box.hidden = true; }, undo ? 12000 : 6000);
}

// The connection to the lab's server, which sends the rig's state; silence is reported after a second and a half.
let line, heardAt = performance.now(), refused = 0;
function connect() {
  line = new WebSocket(`ws://${location.host}/ws`);
  line.onopen = () => { refused = 0; line.send(JSON.stringify({ id: me, name: nameOf() })); };
  line.onmessage = (e) => {
    const said = JSON.parse(e.data);
    heardAt = performance.now();
    if (said.vented) { toast(said.vented); return; }
    Object.assign(state, said);
    reachRun(said.bench.run);
    showBar();
    state.listeners.forEach((listener) => listener(state));
  };
  line.onclose = () => { refused++; setTimeout(connect, Math.min(3000, 300 * refused)); };
}
// The connection to the run's own process, which is independent of the lab: it vents while the lab is frozen or closed.
let direct = null, directTo = "";
function reachRun(run) {
  const url = run ? run.url : "";
  if (url === directTo) return;
  directTo = url;
  if (direct) direct.close();
  direct = null;
  if (!url) return;
  direct = new WebSocket(socketOf(url) + "&rows=0");
}
const atThisHost = (url) => { const found = new URL(url); found.hostname = location.hostname; return found; };
const socketOf = (url) => { const found = atThisHost(url); return `ws://${found.host}/feed${found.search}`; };

function vent() {
  $("#vent").classList.add("sent");
  setTimeout(() => $("#vent").classList.remove("sent"), 400);
  const order = JSON.stringify({ do: "vent", who: nameOf() });
  if (direct && direct.readyState === WebSocket.OPEN) direct.send(order);
  if (line.readyState === WebSocket.OPEN) line.send(order);
  tell("vent", {}).then((said) => toast("VENT: " + said.says)).catch(() => {});
  document.dispatchEvent(new Event("vented"));
}
$("#vent").addEventListener("pointerdown", vent); // at the press, not at the release
$("#vent").addEventListener("keydown", (e) => { if (e.key === "Enter" || e.key === " ") vent(); });
onVentKey(vent);
addEventListener("message", (e) => { if (e.data === "vent") vent(); }); // from the page of a run inside this one

function showBar() {
  const b = state.bench;
  const run = b && b.run;
  $("#rig").innerHTML = !b ? "" : !b.ready ? "no rig" : `${html(b.rig)}${b.emulated && b.rig !== "emulator" ? " (emulated)" : ""} · ` +
    (run ? `<span class="ok">${html(run.state)}: ${html(run.protocol)}</span>` : b.starting ? (b.finishing ? "finishing…" : "starting…") : b.armed ? '<span class="warn">armed</span>' : "idle");
  const silent = (performance.now() - heardAt) / 1000, lost = silent > 1.5, box = $("#lost");
  box.hidden = !lost;
  if (lost) {
    const reached = direct && direct.readyState === WebSocket.OPEN;
    box.textContent = `The lab's server has not answered for ${silent.toFixed(0)} s. ` +
      (directTo ? (reached ? "VENT still reaches the run itself. " : "The run continues by itself and vents at its end. ") : "") +
      "On the machine: press V and Enter in the terminal of straw lab, or run: straw rig tell vent" +
      (refused > 3 ? ". If the lab was started again, open the address that it printed." : "");
  }
}
setInterval(showBar, 500);
$("#name").value = localStorage.strawName || "";
$("#name").addEventListener("change", (e) => { localStorage.strawName = e.target.value; line.send(JSON.stringify({ id: me, name: nameOf() })); });
document.querySelectorAll("#bar nav a").forEach((a) => a.classList.toggle("here", document.body.classList.contains(a.dataset.page)));
const wantsDark = matchMedia("(prefers-color-scheme: dark)");
const followTheme = () => { document.documentElement.dataset.theme = wantsDark.matches ? "dark" : "light"; document.dispatchEvent(new Event("theme")); };
followTheme();
wantsDark.addEventListener("change", followTheme);
// Keys of a page, outside text fields.
function keys(map) {
  document.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || /INPUT|TEXTAREA|SELECT/.test(e.target.tagName) || document.querySelector("dialog[open]")) return;
    const does = map[e.key];
    if (!does) return;
    e.preventDefault();
    does(e);
  });
}
connect();
