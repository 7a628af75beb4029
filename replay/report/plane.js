// The configuration plane of Figs. 6 d and 7 d: every cell's active frustum on its energy under the pressure of the moment.
const PLANE = { zeta: [-3.4e-3, 3.2e-3], phi: [-0.36, 0.36], step: 2e-3 };
let chosenCell = null;

// Equation 7, J.
const reducedEnergy = (f, zeta, phi) => {
  const k = f.C2 - 4 * f.C1 * f.zeta0 * f.zeta0, z2 = zeta * zeta, r = f.rI * f.rI * phi * phi;
  return 2 * f.C1 * z2 * z2 + k * z2 + 0.75 * f.C1 * r * r + (k / 2) * r + 6 * f.C1 * z2 * r - 2 * f.C2 * f.zeta0 * zeta;
};
// Finite elements' polynomial with its end at the slant, as in model/terms/shell_energy.py, J.
const shellEnergy = (f, zeta, phi) => {
  const [end, width, stiff, , ...c] = f.wall, w = f.rI * phi;
  let stored = 0;
  const [u, v] = [zeta + w, zeta - w].map((x) => {
    const beyond = Math.abs(x) - end;
    if (beyond <= 0) return x;
    stored += stiff * beyond ** 3;
    return Math.sign(x) * (end + width * Math.tanh(beyond / width));
  });
  const z = (u + v) / 2 / end, w2 = ((u - v) / 2 / end) ** 2;
  for (let j = 0, at = 0; j <= 5; at += 11 - 2 * j++) {
    let p = 0;
    for (let i = 10 - 2 * j; i >= 0; i--) p = p * z + c[at + i];
    stored += w2 ** j * p;
  }
  return stored;
};
// Energy of the walls and of the pressure on a sealed straw's frustum, J.
const energyOf = (f, zeta, phi, pressure) => {
  const share = f.wall.length ? f.wall[3] : 0;
  let stored = -f.area * pressure * zeta;
  if (share) stored += share * shellEnergy(f, zeta, phi);
  if (share !== 1) stored += (1 - share) * reducedEnergy(f, zeta, phi);
  return stored;
};
const cellShown = (run) => Math.min(chosenCell ?? run.snapping[0] ?? 1, run.straw.cells);
const rgb = (text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16));

function drawPlane(run, t) {
  const a = arraysOf(run), [c, width, height] = canvasOf("#plane", 0.62);
  if (!a.zeta.length) return;
  const box = { left: 44, top: 6, width: width - 52, height: height - 42 };
  const px = (zeta) => box.left + (box.width * (zeta - PLANE.zeta[0])) / (PLANE.zeta[1] - PLANE.zeta[0]);
  const py = (phi) => box.top + (box.height * (PLANE.phi[1] - phi)) / (PLANE.phi[1] - PLANE.phi[0]);
  const k = indexAt(a.shapeTime, t), cell = cellShown(run), pressure = a.inside[k] * 1e3;
  landscape(c, box, run.straw.frusta[cell - 1], pressure);
  c.save();
  c.beginPath();
  c.rect(box.left, box.top, box.width, box.height);
  c.clip();
  const even = (row, n) => (row.length === 2 * run.straw.cells ? row[2 * n + 1] : row[n]);
  // where the cells that snap have been, and the last tenth of a second of all
  for (let n = 0; n < run.straw.cells; n++) {
    const snaps = run.snapping.includes(n + 1), from = snaps ? 0 : indexAt(a.shapeTime, t - 0.1);
    c.beginPath();
    for (let i = from; i <= k; i++) c.lineTo(px(even(a.zeta[i], n)), py(even(a.phi[i], n)));
    c.strokeStyle = cellColor(run, n + 1);
    c.lineWidth = snaps ? 1.4 : 1;
    c.stroke();
  }
  c.font = "600 10px system-ui, sans-serif";
  c.textAlign = "center";
  const order = [...Array(run.straw.cells).keys()].sort((p, q) => run.snapping.includes(p + 1) - run.snapping.includes(q + 1));
  const places = [];
  for (const n of order) {
    const zeta = even(a.zeta[k], n), phi = even(a.phi[k], n), x = px(zeta), y = py(phi);
    c.beginPath();
    c.arc(x, y, n + 1 === cell ? 7.5 : 5.5, 0, 7);
    c.fillStyle = color(STATES[stateOf(run, zeta, phi)][0]);
    c.fill();
    c.strokeStyle = color("ink");
    c.lineWidth = n + 1 === cell ? 2.2 : 1;
    c.stroke();
    const near = places.find((p) => Math.hypot(p.x - x, p.y - y) < 18);
    if (near) { near.cells.push(n + 1); near.y = Math.min(near.y, y); } else places.push({ x, y, cells: [n + 1] });
  }
  c.fillStyle = color("ink");
  for (const p of places) c.fillText(ranges(p.cells), Math.min(p.x, box.left + box.width - 18), p.y - 11);
  c.restore();
  frame(c, box, px, py);
  $("#planeNote").innerHTML = `each cell's active frustum on the energy of cell ${cell} (keys 1–9) at ${fixed(pressure / 1e3, 1)} kPa inside, a line every ${PLANE.step * 1e3} mJ`;
}

const PALETTE = ["#d55e00", "#0072b2", "#cc79a7", "#e69f00", "#009e73", "#56b4e9"];
const cellColor = (run, cell) => (run.snapping.includes(cell) ? PALETTE[run.snapping.indexOf(cell) % PALETTE.length] : color("command"));

// 1, 2, 3, 5 as 1–3 5
const ranges = (cells) => {
  const sorted = [...cells].sort((p, q) => p - q), parts = [];
  for (const cell of sorted) {
    const last = parts[parts.length - 1];
    if (last && cell === last[1] + 1) last[1] = cell; else parts.push([cell, cell]);
  }
  return parts.map(([from, to]) => (from === to ? from : `${from}–${to}`)).join(" ");
};

// Shades and lines of equal energy, one cell of the grid a pixel of a small picture that is then stretched.
const grid = document.createElement("canvas");
let drawn = "";
function landscape(c, box, frustum, pressure) {
  const wanted = [frustum.C1, frustum.C2, frustum.wall, Math.round(pressure / 50), color("low")].join();
  if (wanted !== drawn) paint(frustum, pressure);
  drawn = wanted;
  c.imageSmoothingEnabled = true;
  c.drawImage(grid, box.left, box.top, box.width, box.height);
}

function paint(frustum, pressure) {
  const w = (grid.width = 240), h = (grid.height = 160), g = grid.getContext("2d"), image = g.createImageData(w, h);
  const values = new Float32Array(w * h);
  let low = Infinity;
  for (let j = 0; j < h; j++) {
    const phi = PLANE.phi[1] + ((PLANE.phi[0] - PLANE.phi[1]) * (j + 0.5)) / h;
    for (let i = 0; i < w; i++) {
      const e = energyOf(frustum, PLANE.zeta[0] + ((PLANE.zeta[1] - PLANE.zeta[0]) * (i + 0.5)) / w, phi, pressure);
      values[j * w + i] = e;
      if (e < low) low = e;
    }
  }
  const deep = rgb(color("high")), shallow = rgb(color("low")), top = 0.05;
  for (let k = 0; k < w * h; k++) {
    const level = Math.floor((values[k] - low) / PLANE.step);
    const edge = (k % w && Math.floor((values[k - 1] - low) / PLANE.step) !== level) || (k >= w && Math.floor((values[k - w] - low) / PLANE.step) !== level);
    const q = Math.sqrt(Math.min(1, (level * PLANE.step) / top)), towards = edge ? q + (1 - q) * 0.6 : q;
    for (let j = 0; j < 3; j++) image.data[4 * k + j] = deep[j] + (shallow[j] - deep[j]) * towards;
    image.data[4 * k + 3] = 255;
  }
  g.putImageData(image, 0, 0);
}

function frame(c, box, px, py) {
  c.strokeStyle = color("line");
  c.strokeRect(box.left, box.top, box.width, box.height);
  c.fillStyle = color("soft");
  c.font = "11px system-ui, sans-serif";
  c.textAlign = "center";
  for (const mm of [-3, -2, -1, 0, 1, 2, 3]) c.fillText(mm, px(mm * 1e-3), box.top + box.height + 14);
  c.fillText("ζ of the active frustum / mm", box.left + box.width / 2, box.top + box.height + 30);
  c.textAlign = "right";
  for (const phi of [-0.3, -0.15, 0, 0.15, 0.3]) c.fillText(phi, box.left - 5, py(phi) + 4);
  c.save();
  c.translate(10, box.top + box.height / 2);
  c.rotate(-Math.PI / 2);
  c.textAlign = "center";
  c.fillText("φ / rad", 0, 0);
  c.restore();
}
