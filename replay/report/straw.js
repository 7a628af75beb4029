// The straw as it moves: cells coloured by state, its board, and where the tip was measured.
const STATES = { F: ["folded", "folded"], D: ["deployed", "deployed"], B: ["bent", "bent"] };
const stateOf = (run, zeta, phi) => (Math.abs(phi) > run.straw.bent / 2 ? "B" : zeta > 0 ? "D" : "F");

// Joints, axes and radii in metres from a row of zeta and phi; a row has one entry a frustum, or the even ones only.
function chainOf(run, zeta, phi) {
  const s = run.straw, both = zeta.length === 2 * s.cells, cells = [];
  let x = 0, z = 0, angle = s.phi0;
  for (let n = 0; n < s.cells; n++) {
    const z1 = both ? zeta[2 * n] : s.zeta0[n], f1 = both ? phi[2 * n] : 0;
    const z2 = both ? zeta[2 * n + 1] : zeta[n], f2 = both ? phi[2 * n + 1] : phi[n];
    const base = [x, z, angle];
    angle += f1;
    const ux = Math.sin(angle), uz = Math.cos(angle);
    const middle = [x + z1 * ux, z + z1 * uz, angle];
    x += (z1 + z2) * ux;
    z += (z1 + z2) * uz;
    angle += f2;
    cells.push({ base, middle, end: [x, z, angle], state: stateOf(run, z2, f2), zeta: z2, phi: f2 });
  }
  return cells;
}

// What must fit on the canvas, over all of the run.
function reachOf(run) {
  if (run.reach) return run.reach;
  const a = arraysOf(run), s = run.straw;
  const b = { x: [-0.006, 0.006], z: [-s.rO * 1.15, s.rO * 1.15] };
  if (run.live) { // the rest of the motion is unknown: room for all cells deployed, and a swing
    const long = s.cells * (s.zeta0[0] + 3e-3) + s.board, [sin, cos] = [Math.sin(s.phi0), Math.cos(s.phi0)], swing = 0.35 * long;
    for (const [u, v] of [[long * sin + swing * cos, long * cos - swing * sin], [long * sin - swing * cos, long * cos + swing * sin]]) {
      b.x = [Math.min(b.x[0], u), Math.max(b.x[1], u)];
      b.z = [Math.min(b.z[0], v), Math.max(b.z[1], v)];
    }
    return (run.reach = b);
  }
  const step = Math.max(1, Math.floor(a.zeta.length / 600));
  const states = a.zeta.map((zeta, k) => [zeta, a.phi[k]]).concat(a.before ? a.before.zeta.map((zeta, k) => [zeta, a.before.phi[k]]) : []);
  for (let k = 0; k < states.length; k += step) {
    const cells = chainOf(run, ...states[k]), [x, z, angle] = cells[cells.length - 1].end;
    const [sin, cos] = [Math.sin(angle), Math.cos(angle)], corners = cells.map(({ end }) => end);
    for (const across of [-s.rO, s.rO]) corners.push([x + s.board * sin + across * cos, z + s.board * cos - across * sin]);
    for (const [u, v] of corners) {
      b.x = [Math.min(b.x[0], u - 2e-3), Math.max(b.x[1], u + 3e-3)];
      b.z = [Math.min(b.z[0], v - 2e-3), Math.max(b.z[1], v + 2e-3)];
    }
  }
  return (run.reach = b);
}

function drawStraw(run, t) {
  if (!run.straw) return; // a system that has no drawing
  const a = arraysOf(run), s = run.straw, r = reachOf(run);
  if (!a.zeta.length) return;
  const ratio = Math.min(0.6, Math.max(0.42, (r.z[1] - r.z[0]) / (r.x[1] - r.x[0]))), [c, width, height] = canvasOf("#straw", ratio);
  const scale = Math.min((width - 16) / (r.x[1] - r.x[0]), (height - 16) / (r.z[1] - r.z[0]));
  const px = (x) => width / 2 + (x - (r.x[0] + r.x[1]) / 2) * scale, pz = (z) => height / 2 - (z - (r.z[0] + r.z[1]) / 2) * scale;
  // a point at some height across the axis of a frame (x, z, angle)
  const side = ([x, z, angle], across) => [px(x + across * Math.cos(angle)), pz(z - across * Math.sin(angle))];
  const k = indexAt(a.shapeTime, t), cells = chainOf(run, a.zeta[k], a.phi[k]), ink = color("ink");
  c.lineJoin = "round";
  // the clamp
  c.fillStyle = color("line");
  const [left, right] = [side([0, 0, s.phi0], -s.rO * 1.1), side([0, 0, s.phi0], s.rO * 1.1)];
  const back = 5e-3 * scale, [bx, bz] = [-Math.sin(s.phi0) * back, Math.cos(s.phi0) * back];
  polygon(c, [left, right, [right[0] + bx, right[1] + bz], [left[0] + bx, left[1] + bz]]);
  c.fill();
  const quad = (one, r1, two, r2) => polygon(c, [side(one, -r1), side(one, r1), side(two, r2), side(two, -r2)]);
  cells.forEach(({ base, middle, end, state }, n) => {
    c.fillStyle = color(STATES[state][0]);
    c.strokeStyle = ink;
    c.lineWidth = 0.8;
    for (const [one, r1, two, r2] of [[base, s.rI, middle, s.rO], [middle, s.rO, end, s.rI]]) {
      quad(one, r1, two, r2);
      c.globalAlpha = 0.62;
      c.fill();
      c.globalAlpha = 1;
      c.stroke();
    }
  });
  c.fillStyle = ink;
  c.font = "600 11px system-ui, sans-serif";
  c.textAlign = "center";
  let last = -Infinity; // a number that would touch the one before is left out
  cells.forEach(({ middle }, n) => {
    const [tx, ty] = side(middle, -s.rO - 11 / scale);
    if (tx - last < 10) return;
    c.fillText(n + 1, tx, ty + 4);
    last = tx;
  });
  const tip = cells[cells.length - 1].end;
  if (a.before) { // the base model's straw: its outline, and its tip
    const i = indexAt(a.before.time, t), other = chainOf(run, a.before.zeta[i], a.before.phi[i]);
    c.strokeStyle = color("before");
    c.lineWidth = 1.2;
    for (const { base, middle, end } of other) {
      for (const [one, r1, two, r2] of [[base, s.rI, middle, s.rO], [middle, s.rO, end, s.rI]]) { quad(one, r1, two, r2); c.stroke(); }
    }
    drawBoard(c, side, other[other.length - 1].end, s, color("before"), [], scale);
  }
  drawBoard(c, side, tip, s, color("predicted"), [], scale);
  const j = indexAt(a.time, t), m = (name) => (a[name].measured ? a[name].measured[j] / run.signals[name].factor : null);
  const seen = [m("x_m"), m("z_m"), m("phi_rad")];
  if (a.x_m.measured && a.x_m.measured[j] !== null && t >= a.time[0] - 0.01) drawBoard(c, side, seen, s, color("measured"), [5, 4], scale);
  // a scale of 10 mm
  c.strokeStyle = c.fillStyle = color("soft");
  c.lineWidth = 2;
  c.beginPath();
  c.moveTo(width - 12 - 0.01 * scale, height - 8);
  c.lineTo(width - 12, height - 8);
  c.stroke();
  c.textAlign = "right";
  c.font = "11px system-ui, sans-serif";
  c.fillText("10 mm", width - 12, height - 13);
}

// The board on its stalk, at the tip and square to its axis; colour is the model's, dashed ink the camera's.
function drawBoard(c, side, tip, s, stroke, dash, scale) {
  const out = [tip[0] + s.board * Math.sin(tip[2]), tip[1] + s.board * Math.cos(tip[2]), tip[2]];
  c.strokeStyle = c.fillStyle = stroke;
  c.lineWidth = dash.length ? 2.2 : 3.4;
  c.setLineDash(dash);
  c.beginPath();
  c.moveTo(...side(tip, 0));
  c.lineTo(...side(out, 0));
  c.moveTo(...side(out, -s.rO));
  c.lineTo(...side(out, s.rO));
  c.stroke();
  c.setLineDash([]);
  c.beginPath();
  c.arc(...side(tip, 0), 3.4, 0, 7);
  dash.length ? c.stroke() : c.fill();
}

function polygon(c, points) {
  c.beginPath();
  points.forEach((p, k) => (k ? c.lineTo(...p) : c.moveTo(...p)));
  c.closePath();
}

function statesKey() {
  if (!runs[0].straw) return;
  $("#states").innerHTML = Object.values(STATES).map(([name, word]) => `<span class="box" style="background:var(--${name})"></span>${word}`).join("") +
    ` <span class="entry base"><span class="swatch before"></span>base model</span> <span class="entry"><span class="swatch predicted"></span>${runs[0].who || "model"}'s tip</span>` + (document.body.className === "live" ? "" : ` <span class="mark measured">┄</span> measured tip`);
}
