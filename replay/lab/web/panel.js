// The operator's panel: a protocol drawn and predicted before it is run, the queue, and the run with its prediction.
let known = [], chart = null, shownRun = "", checking = 0, followedQueue = "";
const field = (id) => $("#" + id).value;

// The protocol as it is being written: compiled by the server, drawn with its limits; an error names the line.
async function check() {
  const mine = ++checking;
  try {
    const said = await tell("protocol", { toml: field("toml") });
    if (mine !== checking) return;
    $("#wrong").textContent = said.beyond;
    $("#draws").textContent = `${said.says}; cells deployed at the start: ${said.deployed}`;
    $("#add").disabled = $("#predict").disabled = Boolean(said.beyond);
    drawProtocol(said);
  } catch (error) {
    if (mine !== checking) return;
    $("#wrong").textContent = error.message;
    $("#add").disabled = $("#predict").disabled = true;
  }
}
function drawProtocol(said) {
  const times = [...new Set(said.channels.flatMap((c) => c.time_s.flatMap((t, k) => [t, k && t === c.time_s[k - 1] ? t + 1e-6 : t])))].sort((a, b) => a - b);
  const at = (c) => times.map((t) => {
    let k = c.time_s.findLastIndex((s) => s <= t + 5e-7);
    if (k < 0) return null;
    if (c.time_s.indexOf(c.time_s[k]) < k && Math.abs(t - c.time_s[k]) < 4e-7) k = c.time_s.indexOf(c.time_s[k]);
    const [t0, t1, p0, p1] = [c.time_s[k], c.time_s[k + 1], c.kpa[k], c.kpa[k + 1]];
    return t1 === undefined || t1 === t0 ? p0 : p0 + ((p1 - p0) * (t - t0)) / (t1 - t0);
  });
  const [low, high] = said.limits, ends = said.channels.flatMap((c) => c.kpa), least = Math.min(...ends, 0), most = Math.max(...ends, 0), room = 0.15 * (most - least || 1);
  const series = said.channels.map((c, k) => ({ label: `channel ${c.channel}`, stroke: color(k ? "predicted" : "inside"), width: 2, points: { show: false } }));
  const limit = { stroke: color("soft"), width: 1, dash: [6, 4], points: { show: false } };
  if (chart) chart.destroy();
  chart = new uPlot({
    width: $("#drawn").clientWidth, height: 150, legend: { show: false }, cursor: { drag: { x: false, y: false } },
    scales: { x: { time: false }, y: { range: [Math.max(least - room, Math.min(low, least)) - 0.02 * room, Math.min(most + room, Math.max(high, most)) + 0.02 * room] } },
    axes: [{ stroke: color("soft"), grid: { stroke: color("line") }, size: 40, label: "s from the main part", labelSize: 16, font: "12px system-ui", labelFont: "11px system-ui" }, { stroke: color("soft"), grid: { stroke: color("line") }, size: 52, label: "kPa", labelSize: 16, font: "12px system-ui", labelFont: "11px system-ui" }],
    series: [{}, ...series, limit, limit],
  }, [times, ...said.channels.map(at), times.map(() => low), times.map(() => high)], $("#drawn"));
}
async function predict() {
  $("#shown").textContent = "predicting… (the first time the model is compiled: up to a minute)";
  const said = await attempt(() => tell("predict", { toml: field("toml") }));
  if (!said) { $("#shown").textContent = ""; return; }
  if (state.bench && state.bench.run) return; // a run has begun meanwhile
  const snaps = said.snaps.map(([t, cell]) => `cell ${cell} at ${t.toFixed(2)} s`).join(", ");
  show("/predicted/" + said.id, `Predicted: ${snaps || "no cell snaps"}; the tip ends at X ${said.end.x_mm.toFixed(2)} mm, Z ${said.end.z_mm.toFixed(2)} mm, Φ ${said.end.phi_deg.toFixed(2)}°`, true);
}
function show(url, text, apart) {
  const frame = $("#stage");
  apart ? frame.setAttribute("sandbox", "allow-scripts") : frame.removeAttribute("sandbox");
  frame.hidden = false;
  frame.src = url;
  $("#shown").textContent = text;
}

// The rig's state. Buttons that would be refused are disabled, with the reason in the text; VENT is never disabled.
onState(({ bench: b }) => {
  const run = b.run, mine = b.control.mine, free = !b.control.holder;
  $("#going").innerHTML = !b.ready ? 'No rig. Start the lab with <code>--rig rig.toml</code>, or with <code>--emulate</code>.'
    : run ? `<dl class="facts"><dt>run</dt><dd>${html(run.recording.split(/[\\/]/).at(-1))}</dd><dt>state</dt><dd class="${run.state === "running" ? "ok" : "warn"}"><b>${html(run.state)}</b></dd><dt>elapsed</dt><dd>${Math.max(0, (Date.now() - run.since_ns / 1e6) / 1000).toFixed(0)} s of ${run.duration_s.toFixed(0)} s</dd><dt>limits</dt><dd>${html(run.limits)}</dd><dt>guardian</dt><dd>${run.guardian ? `process ${run.guardian.pid}; vents when the run is silent for ${run.guardian.heartbeat_s} s` : "none"}</dd></dl>`
    : b.starting ? `<b class="ok">${html(b.starting)} is ${b.finishing ? "being finished" : "starting"}…</b>` : `${html(b.rig)}${b.emulated && b.rig !== "emulator" ? " (emulated)" : ""}: idle${b.limits ? `, limits ${html(b.limits)}` : ""}${b.armed ? ', <b class="warn">armed</b>' : ""}`;
  $("#camera").innerHTML = b.camera === "gopro" ? "The camera is started and stopped with the run, and its video fetched." : b.camera ? `<b class="${run || b.starting ? "warn" : ""}">Camera by hand: press its shutter ${run || b.starting ? "now, and again when the run has ended" : "when the run starts"};</b> then drop the video on the run's page.` : "";
  const can = b.ready && (mine || free);
  $("#arm").disabled = !can;
  $("#arm").textContent = b.armed ? "disarm" : "arm";
  $("#arm").className = b.armed ? "armed" : "";
  $("#start").disabled = !can || !b.armed || !b.queue.items.length || Boolean(run) || Boolean(b.starting);
  for (const [id, off] of [["hold", !run || run.state !== "running"], ["resume", !run || run.state !== "held"], ["stop", !run]]) $("#" + id).disabled = !can || off;
  const c = b.control;
  $("#control").innerHTML = (mine ? "You are in control." : free ? "Nobody is in control; arming takes control." : `<b>${html(c.holder)}</b> is in control; you may watch, and vent at any time.`) +
    (c.watching > 1 ? ` ${c.watching} pages are connected to this rig.` : "") +
    (mine ? ` <button data-control="give">release control</button>` : free ? "" : c.asking ? ` Requested; ${html(c.holder)} has ${c.answer_s} s to answer.` : ` <button data-control="take">request control</button>`) +
    (mine && c.asker ? ` <b class="warn">${html(c.asker)} requests control (${c.answer_s} s)</b> <button data-control="give">give</button> <button data-control="keep">keep</button>` : "");
  const items = b.queue.items;
  $("#held").innerHTML = !items.length ? "empty: choose a protocol below and add it" : b.queue.held ? `<b class="warn">waits: ${html(b.queue.held)}</b>` : b.queue.pause_s ? `next in ${b.queue.pause_s} s` : run || b.starting ? "continues after this run" : b.armed ? "starting" : "waiting: the rig is not armed";
  const text = JSON.stringify([items, can, b.queue.running]);
  if (text !== followedQueue) {
    followedQueue = text;
    $("#queue").innerHTML = items.map((q, k) => `<li>${k + 1}. <b>${html(q.name)}</b> ${html(q.specimen)} ${q.id === b.queue.running ? '<b class="ok">running</b>' : ""} ${q.repeats > 1 ? `${q.done} of ${q.repeats}` : ""}${q.pause_s ? `, ${q.pause_s} s between` : ""}${q.by_hand ? ", cells set by hand" : ""} ${q.said && !q.done ? `<span class="warn">${html(q.said)}</span>` : ""}
      <button data-id="${q.id}" data-by="-1" title="up">↑</button> <button data-id="${q.id}" data-by="1" title="down">↓</button> <button data-id="${q.id}" data-by="0" title="remove">×</button></li>`).join("");
    document.querySelectorAll("#queue button").forEach((x) => { x.disabled = !can; });
  }
  $("#log").innerHTML = [...b.said].reverse().map(([when, text]) => `<li><span class="soft">${when}</span> ${html(text)}</li>`).join("");
  const url = run ? run.url : "";
  if (url && url !== shownRun) show(atThisHost(url).href, `${run.protocol}: the run in progress, with the model beside it. The run itself serves this page, which continues without the lab.`, false);
  if (!url && shownRun) $("#shown").innerHTML = "The run has ended. " + lastRun();
  shownRun = url;
  if (run) lastName = run.recording.split(/[\\/]/).at(-1);
});
let lastName = "";
const lastRun = () => (lastName ? `<a href="${html(pageOf("/run", { name: lastName }))}">open ${html(lastName)}</a>` : "");
$("#control").addEventListener("click", (e) => { if (e.target.dataset.control) attempt(() => tell("control", { do: e.target.dataset.control })); });
$("#queue").addEventListener("click", (e) => {
  const { id, by } = e.target.dataset;
  if (id) attempt(() => tell("queue", by === "0" ? { do: "remove", id } : { do: "move", id, by: Number(by) }));
});
$("#arm").addEventListener("click", () => attempt(() => tell("arm", { on: !state.bench.armed })));
$("#start").addEventListener("click", () => attempt(() => tell("start", {})));
for (const what of ["hold", "resume", "stop"]) $("#" + what).addEventListener("click", () => attempt(() => tell("order", { do: what })));
$("#add").addEventListener("click", () => attempt(() => tell("queue", { do: "add", toml: field("toml"), specimen: field("specimen"), repeats: Number(field("repeats")), pause_s: Number(field("pause")), by_hand: $("#byHand").checked })));
$("#predict").addEventListener("click", predict);
let soon;
// The list shows the file of the text; an edited text is marked as no file's.
const nameIt = () => { const k = known.findIndex((p) => p.toml.trim() === field("toml").trim()); $("#protocols").value = k < 0 ? "" : k; };
$("#toml").addEventListener("input", () => { nameIt(); sessionStorage.protocol = field("toml"); clearTimeout(soon); soon = setTimeout(check, 200); });
$("#specimen").value = localStorage.specimen || "";
$("#specimen").addEventListener("change", () => { localStorage.specimen = field("specimen"); });
$("#protocols").addEventListener("change", (e) => { if (e.target.value === "") return; $("#toml").value = known[e.target.value].toml; sessionStorage.protocol = field("toml"); check(); });
document.addEventListener("theme", check);
addEventListener("resize", () => { clearTimeout(soon); soon = setTimeout(check, 200); });
keys({ g: () => { location.href = "/"; } });
attempt(async () => {
  known = await ask("/api/protocols");
  $("#protocols").innerHTML = '<option value="">as written below</option>' + known.map((p, k) => `<option value="${k}">${html(p.name)}${p.source === "shipped" ? " (comes with straw)" : ""}</option>`).join("");
  $("#toml").value = here.get("protocol") || sessionStorage.protocol || (known[0] ? known.find((p) => p.name.startsWith("fold"))?.toml || known[0].toml : "");
  nameIt();
  await check();
  document.documentElement.dataset.ready = Math.round(performance.now());
});
