// The diagnosis page's replacement of the replay page's table and plane: a button for each recording.
const drawPlane = () => {}, drawNumbers = () => {};

function drawTable(runs) {
  if (runs.length > 1) {
    $("#multiples").innerHTML = runs.map((run, i) => `<button data-run="${i}">${html(run.id)} <small>${html(run.role)}</small></button>`).join("");
    document.querySelectorAll("#multiples button").forEach((b) => b.addEventListener("click", () => show(Number(b.dataset.run))));
  }
  $("#who").textContent = runs[0].who;
  if (!runs[0].straw) $("#straw").parentElement.remove();
  if (!runs[0].pressure) document.querySelectorAll(".pressure").forEach((e) => e.remove());
}

// Also after drawing: charts start at the interval in which the models differ most.
function markChosen() {
  document.querySelectorAll("#multiples button").forEach((e) => e.classList.toggle("chosen", Number(e.dataset.run) === shown));
  const run = runs[shown];
  if (run.window) requestAnimationFrame(() => charts.length && charts[0].setScale("x", { min: run.window[0], max: run.window[1] }));
}
