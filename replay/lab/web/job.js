// A command that the lab started: its progress, its output, and the page that it made.
const id = here.get("id") || "";
const far = (p) => (p && p.total ? ` · ${p.what}: ${p.done} of ${p.total}` : "");
async function look() {
  let job;
  try { job = await ask(pageOf("/api/job", { id })); } catch (error) { $("#how").textContent = error.message; return; }
  $("#title").textContent = job.title;
  $("#how").textContent = job.waits ? "waits until one of two others is done" : job.running ? `running… ${job.seconds.toFixed(0)} s${far(job.progress)}` : job.well ? job.seconds ? `done in ${job.seconds.toFixed(0)} s` : "done" : `failed (${job.seconds.toFixed(0)} s)`;
  $("#text").textContent = job.said;
  $("#stop").hidden = !job.running;
  if (job.page && $("#stage").hidden) { $("#stage").hidden = false; $("#stage").src = `/made/${id}`; }
  if (job.running) setTimeout(look, 700);
  else document.documentElement.dataset.ready = Math.round(performance.now());
}
$("#stop").addEventListener("click", () => attempt(() => tell("stopjob", { id })));
look();
