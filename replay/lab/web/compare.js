// Several recordings over each other, and the settings in which they differ.
const names = (here.get("runs") || "").split("|").filter(Boolean);
let said = null;
const drawAll = () => said && drawCurves($("#curves"), said.runs);
attempt(async () => {
  said = await ask(pageOf("/api/compare", { runs: names.join("|") }));
  $("#title").textContent = `${said.runs.length} recordings`;
  $("#legend").innerHTML = said.runs.map((r, k) => `<span><i style="border-color:${PALETTE[k % PALETTE.length]}"></i><a href="${html(pageOf("/run", { name: r.name }))}">${html(r.label)}</a></span>`).join("");
  const rows = Object.entries(said.settings);
  $("#settings").innerHTML = rows.length ? `<tr><th></th>${said.runs.map((r, k) => `<th style="color:${PALETTE[k % PALETTE.length]}">${k + 1}</th>`).join("")}</tr>` + rows.map(([k, values]) => `<tr><td>${html(k)}</td>${values.map((v) => `<td class="words" title="${html(v)}">${html(v.length > 28 ? v.slice(0, 27) + "…" : v)}</td>`).join("")}</tr>`).join("") : "<tr><td>nothing: their settings are the same</td></tr>";
  drawAll();
  document.documentElement.dataset.ready = Math.round(performance.now());
});
for (const kind of ["replay", "diagnose"]) $("#" + kind).addEventListener("click", () => attempt(async () => { const job = await tell("job", { kind, names }); location.href = pageOf("/job", { id: job.id }); }));
addEventListener("resize", drawAll);
document.addEventListener("theme", drawAll);
keys({ b: () => history.back() });
