// The table of runs: the server filters, sorts and groups; here is a window of rows, the view in the URL, and editing.
const HEIGHT = 44, WINDOW = 100;
const COLUMNS = ["run", "start", "day", "kind", "specimen", "protocol", "cycle", "deployed", "duration", "lowest", "highest", "status", "problem", "tag", "note", "file", "sha256", "commit", "bytes"];
const WIDE = ["tag", "note", "day", "deployed", "cycle", "duration"]; // not on a phone
const look = Object.fromEntries(["where", "sort", "group", "columns", "differs", "all"].map((k) => [k, here.get(k) || ""]));
let rows = [], total = 0, names = [], asked = 0, cursor = 0, last = null, metadataNames = [], drawnVersion = -1;
const selected = new Map(); // name -> row

const keepView = () => history.replaceState(null, "", "?" + new URLSearchParams(Object.entries(look).filter(([, v]) => v)));
function query(offset) { return pageOf("/api/runs", { ...Object.fromEntries(Object.entries(look).filter(([, v]) => v)), offset, limit: WINDOW }); }

// Redraw a view, from its top unless only the recordings changed.
async function load(keep) {
  const mine = ++asked, offset = keep ? Math.max(0, Math.floor($("#table").scrollTop / HEIGHT) - 20) : 0;
  try {
    const said = await ask(query(offset));
    if (mine !== asked) return;
    $("#where").classList.remove("bad");
    if (!keep) { $("#table").scrollTop = 0; cursor = 0; }
    rows = [];
    take(said);
    drawHead();
    draw();
  } catch (error) {
    if (mine !== asked) return;
    $("#where").classList.add("bad");
    $("#said").className = "bad";
    $("#said").textContent = error.message;
  }
}
function take(said) {
  total = said.total;
  names = said.columns;
  drawnVersion = said.version;
  said.rows.forEach((row, k) => { rows[said.offset + k] = row; });
  const filtered = look.where || look.all !== "1";
  $("#said").className = said.problem ? "bad" : "";
  $("#said").innerHTML = said.problem ? html(said.problem) : `${said.total} of ${said.of} recordings` +
    (look.where ? ` · <b class="warn">a filter is on</b> <button id="clear">clear</button>` : filtered && said.total < said.of ? " · tracks, predictions and archived runs are not shown" : "") +
    (look.group ? ` · ${said.groups.length} groups` : "") +
    (said.reading ? ` · <span class="warn">reading ${said.reading[0]} of ${said.reading[1]}</span>` : "");
  const clear = $("#clear");
  if (clear) clear.addEventListener("click", () => { $("#where").value = look.where = ""; changed(); });
}
const waiting = new Set();
async function fill(from, to) {
  for (let at = Math.floor(from / WINDOW) * WINDOW; at < to; at += WINDOW) {
    if (waiting.has(at) || at >= total || (rows[at] && rows[Math.min(total, at + WINDOW) - 1])) continue;
    waiting.add(at);
    const mine = asked;
    ask(query(at)).then((said) => { if (mine === asked) { take(said); draw(); } }).catch(() => {}).finally(() => waiting.delete(at));
  }
}

function drawHead() {
  const by = look.sort.replace("-", "") || "start", down = !look.sort || look.sort.startsWith("-");
  $("#table thead").innerHTML = `<tr><th><input type="checkbox" id="every" title="select all that are shown"></th><th></th>${look.group ? `<th>${html(look.group)}</th>` : ""}<th class="stamp"></th>` +
    names.map(([n, title]) => `<th data-name="${html(n)}" class="${WIDE.includes(n) ? "wide" : ""}" title="sort by ${html(n)}">${html(title)}${n === by ? (down ? " ↓" : " ↑") : ""}</th>`).join("") + "</tr>";
  document.querySelectorAll("#table th[data-name]").forEach((head) => head.addEventListener("click", () => {
    const name = head.dataset.name;
    look.sort = look.sort === name ? "-" + name : look.sort === "-" + name ? name : name === "start" && !look.sort ? "start" : name;
    changed();
  }));
  $("#every").addEventListener("change", (e) => { for (const row of rows) if (row) e.target.checked ? selected.set(row.name, row) : selected.delete(row.name); draw(); });
}
function draw() {
  const box = $("#table"), from = Math.max(0, Math.floor(box.scrollTop / HEIGHT) - 12), to = Math.min(total, from + Math.ceil(box.clientHeight / HEIGHT) + 30);
  fill(from, to);
  const wide = names.length + (look.group ? 4 : 3);
  const gap = (n) => (n > 0 ? `<tr style="height:${n * HEIGHT}px"><td colspan="${wide}" style="height:${n * HEIGHT}px;border:0"></td></tr>` : "");
  let out = gap(from);
  for (let k = from; k < to; k++) out += rows[k] ? rowOf(rows[k], k) : `<tr><td colspan="${wide}">…</td></tr>`;
  if (!document.querySelector(".cell-edit")) $("#table tbody").innerHTML = out + gap(total - to) || `<tr><td colspan="${wide}">no recording here${look.where ? " passes the filter" : "; drive one from the Rig page, or copy some into the folder"}</td></tr>`;
  drawChosen();
}
function rowOf(row, k) {
  const first = !look.group || !rows[k - 1] || rows[k - 1].group !== row.group;
  const star = row.marks.includes("star"), archived = row.marks.includes("archive");
  const flags = (row.marks.includes("lock") ? " 🔒" : "") + (row.kind === "part" ? ' <button data-recover="1" title="makes a complete file of what is on disk; the cut file stays">recover</button>' : "");
  return `<tr class="row${k === cursor ? " cursor" : ""}${selected.has(row.name) ? " selected" : ""}${archived ? " archived" : ""}" data-k="${k}">` +
    `<td><input type="checkbox" aria-label="select" ${selected.has(row.name) ? "checked" : ""}></td>` +
    `<td><button class="star${star ? " on" : ""}" title="star" aria-label="star">${star ? "★" : "☆"}</button></td>` +
    (look.group ? `<td class="group">${first ? html(row.group) : ""}</td>` : "") +
    `<td class="stamp">${stamp(row.preview)}</td>` +
    names.map(([n], i) => cellOf(row, n, row.cells[i], i ? "" : flags)).join("") + "</tr>";
}
function cellOf(row, name, value, flags) {
  const wide = WIDE.includes(name) ? " wide" : "";
  if (name === "tag") return `<td class="wide" data-edit="tag" title="click to edit">${tagsOf(value)}</td>`;
  if (name === "note") return `<td class="wide" data-edit="note" title="${html((value || []).join("\n") || "click to write a note")}">${html((value || []).at(-1) || "")}</td>`;
  if (name === "specimen" && value) return `<td><a href="${html(pageOf("/specimen", { name: value }))}">${html(value)}</a></td>`;
  if (typeof value === "number") return `<td class="number${wide}">${Number.isInteger(value) ? value : value.toFixed(value < 10 ? 2 : 1)}</td>`;
  const mark = name === "status" || name === "kind" ? ` ${name}-${html(value || row.kind)}` : "";
  const cut = name === "status" && row.kind === "part" ? "cut off" : value;
  return `<td class="${mark}${wide}" title="${html(name === "status" ? row.problem || "" : value ?? "")}">${html(cut ?? "")}${flags}</td>`;
}

// Actions on the selected recordings.
function drawChosen() {
  const box = $("#chosen"), n = selected.size;
  box.hidden = n === 0;
  box.innerHTML = `<b>${n} selected</b> <button data-do="overlay">overlay and differences (o)</button> <button data-do="replay">replay</button> <button data-do="diagnose">diagnose</button>
    <button data-do="identify">identify constants</button> <button data-do="star">star</button> <button data-do="archive">archive</button> <button data-do="lock">lock</button> <button data-do="none">none</button>`;
}
$("#chosen").addEventListener("click", (e) => {
  const what = e.target.dataset.do, chosen = [...selected.values()];
  if (!what) return;
  if (what === "none") { selected.clear(); draw(); }
  else if (what === "overlay") overlay();
  else if (["star", "archive", "lock"].includes(what)) mark(what, chosen);
  else attempt(async () => { const job = await tell("job", { kind: what, names: chosen.map((r) => r.name) }); location.href = pageOf("/job", { id: job.id }); });
});
const overlay = () => { if (selected.size) location.href = pageOf("/compare", { runs: [...selected.keys()].join("|") }); };

// Marks: on for all, unless all have it; each can be undone.
function mark(what, chosen) {
  if (!chosen.length) return;
  const on = !chosen.every((row) => row.marks.includes(what)), names = chosen.map((row) => row.name);
  attempt(async () => {
    await tell("say", { names, kind: on ? "mark" : "unmark", text: what });
    if (what === "archive") {
      names.forEach((name) => selected.delete(name));
      toast(`${names.length} ${on ? "archived: hidden, not deleted" : "back in the table"}`, () => attempt(async () => { await tell("say", { names, kind: on ? "unmark" : "mark", text: what }); load(true); }));
    }
    load(true);
  });
}
const at = () => rows[cursor];
function edit(k, what) {
  const cell = document.querySelector(`tr[data-k="${k}"] [data-edit="${what}"]`), row = rows[k];
  if (!cell || !row) return;
  const i = names.findIndex(([n]) => n === what), before = row.cells[i] || [];
  const input = document.createElement("input");
  input.className = "cell-edit";
  input.value = what === "tag" ? before.join(" ") : "";
  input.placeholder = what === "tag" ? "tags, one word each" : "a note; Enter saves it";
  cell.replaceChildren(input);
  input.focus();
  let done = false;
  const end = async (keep) => {
    if (done) return;
    done = true;
    const text = input.value.trim();
    input.remove();
    if (keep) await attempt(async () => {
      if (what === "note") { if (text) await tell("say", { names: [row.name], kind: "note", text }); }
      else {
        const after = text.split(/[\s,]+/).filter(Boolean);
        for (const tag of after.filter((t) => !before.includes(t))) await tell("say", { names: [row.name], kind: "tag", text: tag });
        for (const tag of before.filter((t) => !after.includes(t))) await tell("say", { names: [row.name], kind: "untag", text: tag });
      }
    });
    await load(true);
    $("#table").focus();
  };
  input.addEventListener("keydown", (e) => { if (e.key === "Enter") end(true); else if (e.key === "Escape") end(false); });
  input.addEventListener("blur", () => end(true));
}

$("#table tbody").addEventListener("click", (e) => {
  const tr = e.target.closest("tr.row");
  if (!tr || e.target.closest("a, .cell-edit")) return;
  const k = Number(tr.dataset.k), row = rows[k];
  if (e.target.type === "checkbox") {
    const on = e.target.checked, [low, high] = e.shiftKey && last !== null ? [Math.min(k, last), Math.max(k, last)] : [k, k];
    for (let i = low; i <= high; i++) if (rows[i]) on ? selected.set(rows[i].name, rows[i]) : selected.delete(rows[i].name);
    last = k;
    cursor = k;
    draw();
  } else if (e.target.closest(".star")) mark("star", [row]);
  else if (e.target.dataset.recover) attempt(async () => { const done = await tell("recover", { name: row.name }); toast(`${done.path} is whole; ${done.lost.join("; ")}`); load(true); });
  else if (e.target.closest("[data-edit]")) { cursor = k; edit(k, e.target.closest("[data-edit]").dataset.edit); }
  else location.href = row.kind === "running" ? "/panel" : pageOf("/run", { name: row.name });
});
function moveCursor(by, e) {
  if (e.shiftKey && at()) selected.set(at().name, at());
  cursor = Math.max(0, Math.min(total - 1, cursor + by));
  if (e.shiftKey && at()) selected.set(at().name, at());
  const box = $("#table"), top = cursor * HEIGHT;
  if (top < box.scrollTop) box.scrollTop = top;
  if (top + 2 * HEIGHT > box.scrollTop + box.clientHeight - 10) box.scrollTop = top + 2.5 * HEIGHT - box.clientHeight;
  draw();
}
keys({
  "/": () => $("#where").focus(), j: (e) => moveCursor(1, e), k: (e) => moveCursor(-1, e), ArrowDown: (e) => moveCursor(1, e), ArrowUp: (e) => moveCursor(-1, e),
  J: (e) => moveCursor(1, e), K: (e) => moveCursor(-1, e), PageDown: (e) => moveCursor(10, e), PageUp: (e) => moveCursor(-10, e),
  x: () => { const row = at(); if (row) { selected.has(row.name) ? selected.delete(row.name) : selected.set(row.name, row); draw(); } },
  Enter: () => { if (at()) location.href = pageOf("/run", { name: at().name }); },
  s: () => at() && mark("star", selected.size ? [...selected.values()] : [at()]), e: () => at() && mark("archive", selected.size ? [...selected.values()] : [at()]),
  l: () => at() && mark("lock", selected.size ? [...selected.values()] : [at()]), t: () => edit(cursor, "tag"), n: () => edit(cursor, "note"), o: overlay,
  g: () => { location.href = "/panel"; }, "?": () => $("#keys").showModal(),
});
let soon;
const changed = () => { keepView(); load(false); };
$("#where").addEventListener("input", (e) => { look.where = e.target.value; clearTimeout(soon); soon = setTimeout(changed, 120); });
$("#where").addEventListener("keydown", (e) => { if (e.key === "Escape" || e.key === "Enter") { e.target.blur(); $("#table").focus(); } });
$("#group").innerHTML = ["", "specimen", "protocol", "cycle", "day", "status", "deployed"].map((g) => `<option value="${g}">${g || "none"}</option>`).join("");
$("#group").addEventListener("change", (e) => { look.group = e.target.value; changed(); });
for (const box of ["differs", "all"]) $("#" + box).addEventListener("change", (e) => { look[box] = e.target.checked ? "1" : ""; changed(); });
$("#table").addEventListener("scroll", () => requestAnimationFrame(draw));
$("#help").addEventListener("click", () => $("#keys").showModal());
$("#keys").addEventListener("click", () => $("#keys").close());
$("#pick").addEventListener("click", async () => {
  const metadata = (await attempt(() => ask(pageOf("/api/columns", {})))) || { metadata: [] };
  const now = names.map(([n]) => n);
  $("#columnList").innerHTML = [...COLUMNS, ...metadata.metadata].map((n) => `<label style="display:inline-block;width:48%"><input type="checkbox" value="${html(n)}" ${now.includes(n) ? "checked" : ""}> ${html(n)}</label>`).join("");
  $("#columns").showModal();
});
$("#columnsDone").addEventListener("click", () => {
  const chosen = [...document.querySelectorAll("#columnList input:checked")].map((b) => b.value), now = names.map(([n]) => n);
  look.columns = [...now.filter((n) => chosen.includes(n)), ...chosen.filter((n) => !now.includes(n))].join(",");
  $("#columns").close();
  changed();
});
$("#where").value = look.where;
$("#group").value = look.group;
$("#differs").checked = look.differs === "1";
$("#all").checked = look.all === "1";
onState((s) => { if (drawnVersion >= 0 && s.version !== drawnVersion && !document.querySelector(".cell-edit")) { drawnVersion = s.version; load(true); } });
addEventListener("resize", draw);
load(false).then(() => { document.documentElement.dataset.ready = Math.round(performance.now()); });
