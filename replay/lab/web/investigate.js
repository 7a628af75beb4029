// The closed loop: the posterior after each round, the next proposal with its prediction, approval, and the log.
const value = (id) => $("#" + id).value.trim();
const worded = (name) => String(name || "").replaceAll("_", " ").replaceAll("+", " + ");
let chosen = here.get("log") || "", loop = null, drawn = "", listed = "", filledFor = "";

// One posterior: a bar for each hypothesis; named causes are bold.
function bars(row) {
  const named = new Set(row.causes);
  return row.probability.map(([name, p]) => `<div class="bar"><span class="${named.size && name.split("+").every((c) => named.has(c)) ? "named" : ""}">${html(worded(name))}</span>
    <i role="img" aria-label="${(100 * p).toFixed(1)} %"><b style="width:${(100 * p).toFixed(1)}%"></b></i><em>${p >= 0.005 ? p.toFixed(2) : "&lt; 0.01"}</em></div>`).join("");
}
function card(row, k) {
  const ran = row.ran, found = row.page ? ` <a href="${html(`/found/${encodeURIComponent(loop.name)}/${row.page}`)}" target="_blank">details</a>` : "";
  return `<div class="round"><h3>${row.probability.length ? `${k + 1}. ${html(worded(row.verdict))}${row.causes.length ? `: ${html(row.causes.map(worded).join(", "))}` : ""}` : `${k + 1}. ${html(row.says)}`}</h3>
    ${row.probability.length ? `<p class="soft">${html(row.says)}${found}</p>${bars(row)}` : ""}
    ${row.proposed ? `<p class="soft">then: ${html(row.proposed.why)}${row.who ? `; ${row.who === "nobody" ? "not approved" : "approved by " + html(row.who)}` : ""}</p>` : ""}
    ${ran ? `<p class="${ran.status === "success" ? "ok" : "warn"}">${html(ran.status)}: <a href="${html(pageOf("/run", { name: ran.recording }))}">${html(ran.recording)}</a> <span class="soft">${(60 * ran.minutes).toFixed(1)} s${ran.snaps === null ? "" : `, ${ran.snaps} snaps`}</span> ${html(ran.reason || "")}</p>` : ""}</div>`;
}
function doing() {
  const p = loop.pulse, stopped = loop.stopped;
  const spent = `${loop.spent.rounds} rounds, ${loop.spent.minutes.toFixed(2)} minutes of driving, ${loop.spent.snaps} snaps so far`;
  if (loop.waits) return `<b class="warn">Waits for your yes or no.</b> <span class="soft">${spent}</span>`;
  if (p) return `<b class="ok">${html(p.doing)}${p.total ? ` ${p.done} of ${p.total}` : ""}…</b> <span class="soft">${spent}</span>`;
  if (stopped) return `<b class="${["complete", "named", "within_tolerance"].includes(stopped.reason) ? "ok" : "warn"}">Stopped: ${html(worded(stopped.reason))}</b> (${html(stopped.means)}). ${html(stopped.says)} <span class="soft">${spent}</span>`;
  if (loop.cut) return `<b class="warn">Its process ended without a reason.</b> The button continues where its log ends. <span class="soft">${spent}</span>`;
  return "begins…";
}
function show() {
  const n = loop.next, p = loop.pulse;
  $("#doing").innerHTML = doing();
  $("#complaint").textContent = loop.complaint;
  $("#begin").textContent = loop.rounds.length || loop.stopped ? "continue" : "investigate";
  $("#begin").hidden = Boolean(p);
  $("#end").hidden = !p;
  document.querySelectorAll("#options input").forEach((x) => { x.disabled = Boolean(p); });
  $("#nextCard").hidden = !n;
  if (n) {
    $("#why").textContent = n.why + (n.run_before ? `; run ${n.run_before} times before: a repeat is the most informative` : "");
    $("#says").textContent = n.plan.says + (n.opening ? "" : `; ${n.information_nats.toFixed(2)} nats expected, ${n.separation_sigma.toFixed(0)} sigma apart`) + (n.runs > 1 ? `; some ${n.runs} runs of it are expected to be needed, each is diagnosed before the next` : "");
    $("#hand").textContent = n.plan.hand;
    $("#yes").disabled = $("#no").disabled = !loop.waits;
    $("#asks").textContent = loop.waits ? "" : p ? "" : "No process waits for an answer: continue first.";
    const key = n.round + n.protocol + document.documentElement.dataset.theme;
    if (key !== drawn) {
      drawn = key;
      $("#protocol").textContent = n.protocol;
      drawCurves($("#curves"), [{ signals: n.signals }]);
      if (!Object.keys(n.signals).length) $("#curves").innerHTML = '<p class="soft">too long to be drawn</p>';
    }
  } else drawn = "";
  $("#known").innerHTML = loop.rounds.map(card).reverse().join("") || '<p class="soft">nothing yet</p>';
  const open = $("#log");
  open.innerHTML = [...loop.log].reverse().map(([when, kind, text]) => `<li><span class="soft">${html(when.slice(0, 19).replace("T", " "))}</span> <b>${html(kind)}</b> ${html(text)}</li>`).join("");
  if (filledFor !== chosen) {
    filledFor = chosen;
    if (loop.specimen) $("#specimen").value = loop.specimen;
    for (const [id, asked] of Object.entries(loop.asked_for)) if (asked && $("#" + id)) $("#" + id).value = asked;
  }
}
async function list() {
  const { logs, specimens } = await ask("/api/loops");
  const text = JSON.stringify([logs, specimens, chosen]);
  if (text === listed) return;
  listed = text;
  if (!chosen && logs.length && !here.has("new")) chosen = (logs.find((l) => l.alive) || logs.at(-1)).name;
  $("#specimens").innerHTML = specimens.map((s) => `<option value="${html(s)}">`).join("");
  if (!value("specimen") && specimens.length === 1) $("#specimen").value = specimens[0];
  $("#logs").innerHTML = '<option value="">another specimen</option>' + logs.map((l) => `<option value="${html(l.name)}"${l.name === chosen ? " selected" : ""}>${html(l.name.replace(/^investigate-|\.jsonl$/g, ""))} (${l.alive ? "running" : l.reason ? worded(l.reason) : "cut"}, ${l.rounds} rounds)</option>`).join("");
}
let timer = 0;
async function look() {
  clearTimeout(timer);
  try {
    await list();
    const wanted = chosen;
    if (wanted) {
      const said = await ask(pageOf("/api/loop", { log: wanted }));
      if (wanted === chosen) { loop = said; show(); }
    }
  } catch (error) { $("#complaint").textContent = error.message; }
  document.documentElement.dataset.ready = Math.round(performance.now());
  clearTimeout(timer);
  timer = setTimeout(look, loop && loop.pulse ? 700 : 3000);
}
onState(({ bench: b }) => {
  $("#fastLabel").hidden = !b.emulated;
  $("#begin").disabled = !b.ready;
  $("#begin").title = b.ready ? "" : "start the lab with --rig rig.toml, or with --emulate";
});
$("#begin").addEventListener("click", () => attempt(async () => {
  const given = Object.fromEntries(["specimen", "certainty", "rounds", "minutes", "snaps", "tolerance"].map((id) => [id, value(id)]));
  const said = await tell("investigate", { do: "start", ...given, fast: $("#fast").checked });
  chosen = filledFor = said.log;
  setTimeout(look, 300);
}));
const answer = (yes) => attempt(async () => { toast((await tell("investigate", { do: "answer", log: chosen, yes })).says); setTimeout(look, 300); });
$("#yes").addEventListener("click", () => answer(true));
$("#no").addEventListener("click", () => answer(false));
$("#end").addEventListener("click", () => attempt(async () => { toast((await tell("investigate", { do: "stop", log: chosen })).says); setTimeout(look, 300); }));
$("#logs").addEventListener("change", (e) => {
  chosen = e.target.value;
  loop = null;
  drawn = listed = "";
  for (const id of ["known", "log"]) $("#" + id).innerHTML = "";
  $("#doing").textContent = $("#complaint").textContent = "";
  $("#nextCard").hidden = $("#end").hidden = true;
  $("#begin").hidden = false;
  $("#begin").textContent = "investigate";
  history.replaceState(null, "", chosen ? pageOf("/investigate", { log: chosen }) : "/investigate?new=1");
  look();
});
document.addEventListener("theme", () => loop && show());
addEventListener("resize", () => { drawn = ""; if (loop) show(); });
keys({ g: () => { location.href = "/"; } });
look();
