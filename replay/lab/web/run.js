// One recording: its curves, metadata, notes and tags in place, lineage both ways.
let shown = null;
const name = here.get("name");
async function loadRun() {
  const path = pageOf("/api/run", { name });
  const said = await (shown ? attempt(() => ask(path)) : subject(path)); // what is shown stays where it cannot be read again
  if (!said) return;
  shown = said;
  document.title = `${said.facts.run} · straw lab`;
  $("#title").innerHTML = `${html(said.facts.run)} <span class="soft">${html(said.kind)} · ${html(said.name)}</span>`;
  $("#problem").textContent = [...new Set([said.problem, ...(said.lost || [])])].filter(Boolean).join(" · ");
  const raw = said.kind === "run", withTip = said.tracks.length || said.signals.X;
  $("#actions").innerHTML = ["star", "lock", "archive"].map((m) => `<button data-mark="${m}">${said.marks.includes(m) ? { star: "★ starred", lock: "🔒 unlock", archive: "take out of the archive" }[m] : { star: "☆ star", lock: "lock", archive: "archive" }[m]}</button>`).join(" ") +
    (raw && withTip ? ' <button data-job="replay" class="go">replay page</button> <button data-job="diagnose">diagnose</button>' : "") +
    (said.kind === "part" ? ' <button data-recover="1" class="go">recover: make a complete file of what is on disk</button>' : "") +
    (said.attachments && said.attachments["protocol.toml"] ? ' <button data-again="1">run its protocol again</button>' : "") +
    (raw && !withTip ? `<span class="soft">no tip yet: film it and track it: straw track VIDEO --run ${html(said.name)}</span>` : "");
  $("#drop").hidden = !(raw || said.kind === "part");
  $("#facts").innerHTML = Object.entries(said.facts).filter(([, v]) => v).map(([k, v]) => `<dt>${html(k)}</dt><dd>${k === "specimen" ? `<a href="${html(pageOf("/specimen", { name: v }))}">${html(v)}</a>` : html(v)}</dd>`).join("") + `<dt>SHA-256</dt><dd>${html(said.sha256 || "")}</dd>`;
  $("#tags").innerHTML = said.tags.map((t) => `<span class="tag">${html(t)} <a href="#" data-untag="${html(t)}" title="remove">×</a></span>`).join("") || '<span class="soft">none</span>';
  $("#notes").innerHTML = said.notes.map(([line, when, text]) => `<li><span class="soft">${html(when.slice(0, 16).replace("T", " "))}</span> <span data-note="${line}" title="click to change">${html(text)}</span> <a href="#" data-unnote="${line}" title="remove it (the file keeps it)">×</a></li>`).join("") || '<li class="soft">none</li>';
  $("#lineage").innerHTML = said.lineage.map((l) => `<li>${html(l.relation)}: ${l.name ? `<a href="${html(pageOf("/run", { name: l.name }))}">${html(l.name)}</a>` : l.job ? `<a href="${html(pageOf("/job", { id: l.job }))}">${html(l.says || "look")}</a>` : l.calibration ? `<a href="${html(pageOf("/", { where: `calibration_sha256 = ${l.calibration}`, all: 1 }))}" title="the tracks made with it">${html(l.file)}</a> (${html(l.says)})` : html(l.file || "not in this folder")} <span class="soft">${html((l.sha256 || "").slice(0, 12))}</span></li>`).join("") || '<li class="soft">nothing yet</li>';
  $("#events").innerHTML = (said.events || []).map(([t, kind, text]) => `<li><b>${t.toFixed(3)} s</b> ${html(kind)}: ${html(text)}</li>`).join("");
  $("#metadata").innerHTML = Object.entries({ ...said.metadata, ...said.software }).map(([k, v]) => `<dt>${html(k)}</dt><dd>${html(v)}</dd>`).join("");
  $("#attached").innerHTML = Object.entries(said.attachments || {}).map(([k, v]) => `<h3>${html(k)}</h3><pre>${html(v)}</pre>`).join("") || "none";
  drawCurves($("#curves"), [{ signals: said.signals }], said.events);
  if (!Object.keys(said.signals).length) $("#curves").innerHTML = '<p class="soft">nothing to draw</p>';
  document.documentElement.dataset.ready = Math.round(performance.now());
}
const sayIt = (kind, text, more) => attempt(async () => { await tell("say", { names: [shown.name], kind, text, ...more }); await loadRun(); });
document.addEventListener("click", (e) => {
  const { mark, job, recover, again, untag, unnote, note } = e.target.dataset;
  if (untag || unnote) e.preventDefault();
  if (mark) sayIt(shown.marks.includes(mark) ? "unmark" : "mark", mark).then(() => mark === "archive" && toast("archived: hidden, not deleted", () => sayIt("unmark", "archive")));
  if (untag) sayIt("untag", untag);
  if (unnote) sayIt("unnote", unnote).then(() => toast("note removed", null));
  if (note) {
    const text = prompt("the note", e.target.textContent);
    if (text && text !== e.target.textContent) sayIt("note", text, { instead_of: Number(note) });
  }
  if (job) attempt(async () => { const made = await tell("job", { kind: job, names: [shown.name] }); location.href = pageOf("/job", { id: made.id }); });
  if (recover) attempt(async () => { const done = await tell("recover", { name: shown.name }); location.href = pageOf("/run", { name: done.path }); });
  if (again) location.href = pageOf("/panel", { protocol: shown.attachments["protocol.toml"] });
});
$("#newTag").addEventListener("keydown", async (e) => { if (e.key === "Enter") for (const t of e.target.value.split(/[\s,]+/).filter(Boolean)) { e.target.value = ""; await sayIt("tag", t); } });
$("#newNote").addEventListener("keydown", (e) => { if (e.key === "Enter" && e.target.value.trim()) { sayIt("note", e.target.value.trim()); e.target.value = ""; } });
addEventListener("resize", () => shown && drawCurves($("#curves"), [{ signals: shown.signals }], shown.events));
document.addEventListener("theme", () => shown && drawCurves($("#curves"), [{ signals: shown.signals }], shown.events));
async function takeFilm(file) {
  if (!file || !shown) return;
  $("#film").textContent = `copying ${file.name} (${(file.size / 1e6).toFixed(0)} MB)…`;
  const answer = await fetch(pageOf("/api/film", { name: shown.name, file: file.name }), { method: "POST", headers: { "Content-Type": "application/octet-stream", "X-Straw": "1" }, body: file }).catch((e) => ({ ok: false, json: () => ({ error: e.message }) }));
  const said = await answer.json();
  $("#film").textContent = answer.ok ? `${said.film} is stored beside the run. Track it: ${said.track} (S: when its first frame was taken, in s after the run's zero; where an LED blinked, --clock C.json in its place, from straw clock ${said.film} --run ${shown.name} -o C.json)` : said.error;
  if (answer.ok) loadRun();
}
$("#pickFilm").addEventListener("change", (e) => takeFilm(e.target.files[0]));
$("#drop").addEventListener("dragover", (e) => e.preventDefault());
$("#drop").addEventListener("drop", (e) => { e.preventDefault(); takeFilm(e.dataTransfer.files[0]); });
keys({ b: () => history.back() });
loadRun();
