// A specimen's history: its cycles so far, its constants as they were found, findings, and every run in order.
let found = null;
function drawConstants() {
  const box = $("#constants"), all = Object.entries(found.constants);
  box.innerHTML = all.length ? "" : '<p class="soft">none yet: choose runs with tracks in the table of runs, then "identify constants" or "diagnose"</p>';
  for (const [name, points] of all) {
    const sorted = [...points].sort((a, b) => a.cycle - b.cycle), low = Math.min(...sorted.map((p) => p.low)), high = Math.max(...sorted.map((p) => p.high)), wide = high - low || Math.abs(high) || 1;
    const first = sorted[0].cycle, span = sorted.at(-1).cycle - first || 1, x = (c) => 56 + (234 * (c - first)) / span, y = (v) => 74 - (64 * (v - low)) / wide;
    box.insertAdjacentHTML("beforeend", `<figure><b>${html(name)}</b> <span class="soft">${sorted.at(-1).value.toPrecision(4)} (${sorted.at(-1).low.toPrecision(3)} to ${sorted.at(-1).high.toPrecision(3)}) at cycle ${sorted.at(-1).cycle}</span>
      <svg viewBox="0 0 300 90" style="width:100%;max-width:520px" role="img" aria-label="${html(name)} over cycles">${[low, high].filter((v, k, both) => k === 0 || v !== both[0]).map((v) => `<line x1="46" x2="300" y1="${y(v)}" y2="${y(v)}" stroke="var(--line)"/><text x="42" y="${y(v) + 3}" font-size="9" text-anchor="end" fill="var(--soft)">${v.toPrecision(3)}</text>`).join("")}${sorted.map((p) => `<line x1="${x(p.cycle)}" x2="${x(p.cycle)}" y1="${y(p.low)}" y2="${y(p.high)}" stroke="var(--inside)" stroke-width="5" opacity="0.35"/><circle cx="${x(p.cycle)}" cy="${y(p.value)}" r="3.4" fill="var(--inside)"><title>${p.value.toPrecision(5)} at cycle ${p.cycle}</title></circle>`).join("")}
      <text x="56" y="88" font-size="9" text-anchor="middle" fill="var(--soft)">cycle ${first}</text>${sorted.at(-1).cycle > first ? `<text x="290" y="88" font-size="9" text-anchor="middle" fill="var(--soft)">${sorted.at(-1).cycle}</text>` : ""}</svg></figure>`);
  }
}
async function loadSpecimen() {
  found = await subject(pageOf("/api/specimen", { name: here.get("name") || "" }));
  if (!found) return;
  document.title = `${found.name} · straw lab`;
  $("#title").textContent = found.name;
  $("#sums").textContent = `${found.runs.length} runs, ${found.cycles} cycles so far, ${(found.seconds / 60).toFixed(1)} minutes under test, from ${found.first.slice(0, 10)} to ${found.last.slice(0, 10)}.`;
  $("#findings").innerHTML = found.findings.map((f) => `<li><a href="${html(pageOf("/job", { id: f.id }))}">${html(f.title)}</a>: <b>${html(f.verdict || "constants")}</b> ${html(f.causes.join(", "))}</li>`).join("") || '<li class="soft">none yet</li>';
  $("#runs").innerHTML = "<tr><th></th><th class='words'>run</th><th class='words'>start</th><th class='words'>protocol</th><th>cycle</th><th class='words'>status</th><th class='words'>tags</th></tr>" +
    found.runs.map((r) => `<tr><td class="stamp">${stamp(r.preview)}</td><td class="words"><a href="${html(pageOf("/run", { name: r.name }))}">${html(r.cells[0])}</a></td><td class="words">${html(r.cells[1] || "")}</td><td class="words">${html(r.cells[2] || "")}</td><td>${r.cells[3]}</td><td class="words status-${html(r.cells[4] || "")}">${html(r.cells[4] || "")}</td><td class="words">${tagsOf(r.cells[5])}</td></tr>`).join("");
  drawConstants();
  document.documentElement.dataset.ready = Math.round(performance.now());
}
loadSpecimen();
