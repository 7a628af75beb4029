// The film beside the straw: a small proxy, one of its frames for each of the camera's, with both tips drawn on it.
let filmFrame = -1;

function prepareFilm(run) {
  const video = $("#video");
  $("#film").hidden = !run.film;
  filmFrame = -1;
  if (!run.film) { video.removeAttribute("src"); return; }
  if (!run.film.times) {
    run.film.times = unpack(run.film.time);
    run.film.measured = unpack(run.film.measured);
    run.film.predicted = unpack(run.film.predicted);
  }
  if (video.dataset.run !== run.id) {
    video.src = run.film.src;
    video.dataset.run = run.id;
  }
}

// Frame k of the proxy stands for k / rate of its own time; the middle of it is surely inside.
const mediaTime = (film, k) => (k + 0.5) / film.rate;

function showFilm(run, t, itself) {
  if (!run.film) return;
  const k = indexAt(run.film.times, t + 1e-6);
  if (!itself && k !== filmFrame && !playing) $("#video").currentTime = mediaTime(run.film, k);
  filmFrame = k;
  drawMarks(run.film, k);
}

function playFilm(run, on, speed) {
  const video = $("#video"), film = run.film;
  if (!film || !("requestVideoFrameCallback" in video)) return false;
  if (!on) { video.pause(); return true; }
  const real = (film.times.length - 1) / (film.times[film.times.length - 1] - film.times[0]); // camera frames a second
  video.playbackRate = Math.min(16, Math.max(0.0625, (speed * real) / film.rate));
  if (filmFrame >= film.times.length - 1) video.currentTime = 0;
  video.play();
  video.requestVideoFrameCallback(function frame(at, { mediaTime: time }) {
    if (!playing || shownRun !== run) return;
    setTime(film.times[Math.min(film.times.length - 1, Math.floor(time * film.rate + 0.25))], "film");
    if (video.ended) return play(false);
    video.requestVideoFrameCallback(frame);
  });
  return true;
}
$("#video").addEventListener("ended", () => play(false));

function drawMarks(film, k) {
  const [c, width] = canvasOf("#marks", film.height / film.width), scale = width / film.width;
  for (const [name, cross] of [["measured", 0], ["predicted", Math.PI / 4]]) {
    const u = film[name][2 * k], v = film[name][2 * k + 1];
    if (u === null || v === null) continue;
    for (const [stroke, w] of [["#000000", 4.5], [name === "measured" ? "#ffffff" : "#ff9d47", 2]]) {
      c.strokeStyle = stroke;
      c.lineWidth = w;
      c.beginPath();
      for (const turn of [0, Math.PI / 2]) {
        const dx = 11 * Math.cos(cross + turn), dy = 11 * Math.sin(cross + turn);
        c.moveTo(u * scale - dx, v * scale - dy);
        c.lineTo(u * scale + dx, v * scale + dy);
      }
      c.stroke();
    }
  }
}
