"use strict";
// Data, colours, numbers: what every other part of the page uses.
const unpack = (text) => {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return Array.from(new Float32Array(bytes.buffer), (v) => (isFinite(v) ? v : null));
};
// Rows of whole numbers times a scale: what the shapes of all frusta are packed in.
const unpackRows = ({ data, scale, width }) => {
  const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
  const flat = new Int16Array(bytes.buffer);
  const rows = [];
  for (let k = 0; k < flat.length; k += width) rows.push(Float32Array.from(flat.subarray(k, k + width), (v) => v * scale));
  return rows;
};
const $ = (selector) => document.querySelector(selector);
// Colours of the theme, looked up once, as that is costly thirty times a second.
const colors = {};
const color = (name) => {
  const key = document.documentElement.dataset.theme + name;
  return (colors[key] ??= getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim());
};
const fixed = (value, digits) => (value === null || value === undefined || !isFinite(value) ? "–" : value.toFixed(digits));
const html = (text) => String(text).replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);
// Index of the last time at or before t; 0 before the first.
const indexAt = (times, t) => {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t) low = middle; else high = middle - 1;
  }
  return low;
};
// A canvas as large as its place, sharp on every screen; drawing is in CSS pixels.
const canvasOf = (selector, ratio) => {
  const canvas = $(selector), dpr = window.devicePixelRatio || 1;
  const width = canvas.parentElement.clientWidth, height = Math.round(width * ratio);
  if (canvas.width !== Math.round(width * dpr) || canvas.height !== Math.round(height * dpr)) {
    canvas.width = Math.round(width * dpr);
    canvas.height = Math.round(height * dpr);
    canvas.style.height = height + "px";
  }
  const c = canvas.getContext("2d");
  c.setTransform(dpr, 0, 0, dpr, 0, 0);
  c.clearRect(0, 0, width, height);
  return [c, width, height];
};
// A stretch without valid samples is a gap in the curves, not a straight line across it.
const withGaps = (time, columns) => {
  const steps = time.slice(1).map((t, k) => t - time[k]);
  const usual = [...steps].sort((a, b) => a - b)[Math.floor(steps.length / 2)];
  for (let k = steps.length; k > 0; k--) {
    if (steps[k - 1] < 2.5 * usual) continue;
    time.splice(k, 0, time[k - 1] + usual);
    for (const column of columns) column.splice(k, 0, null);
  }
};
// A run's arrays, unpacked when it is first shown.
const arraysOf = (run) => {
  if (run.arrays) return run.arrays;
  if (run.live) { // nothing yet
    const a = (run.arrays = { time: [], shapeTime: [], zeta: [], phi: [], inside: [], pressureTime: [], pressure: [], command: [], others: {} });
    for (const name of Object.keys(run.signals)) a[name] = { measured: null, predicted: [] };
    return a;
  }
  const time = unpack(run.time), a = { time };
  for (const [name, s] of Object.entries(run.signals)) {
    a[name] = { measured: s.measured && unpack(s.measured), sigma: s.sigma && unpack(s.sigma), predicted: unpack(s.predicted), before: s.before && unpack(s.before) };
  }
  withGaps(time, Object.keys(run.signals).flatMap((n) => [a[n].measured, a[n].sigma, a[n].predicted, a[n].before].filter(Boolean)));
  a.shapeTime = run.shape ? unpack(run.shape.time) : time; // a system without a shape has its samples only
  if (run.shape) {
    a.zeta = unpackRows(run.shape.zeta);
    a.phi = unpackRows(run.shape.phi);
    a.inside = unpack(run.shape.inside);
  }
  if (run.shapeBefore) a.before = { time: unpack(run.shapeBefore.time), zeta: unpackRows(run.shapeBefore.zeta), phi: unpackRows(run.shapeBefore.phi) };
  a.pressureTime = run.pressure ? unpack(run.pressure.time) : [];
  if (!run.pressure) return (run.arrays = a);
  a.pressure = unpack(run.pressure.measured);
  a.command = run.pressure.command ? unpack(run.pressure.command) : a.pressureTime.map(() => null);
  return (run.arrays = a);
};
