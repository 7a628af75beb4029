// A thumbnail of a recording: pressure against time, and the path of the tip.
function stamp(preview) {
  let out = "";
  const { t, p, x, z } = preview;
  if (p && p.length > 1) {
    const low = Math.min(0, ...p), high = Math.max(0, ...p), wide = high - low || 1;
    const at = (v) => (34 - (32 * (v - low)) / wide).toFixed(1);
    out += `<svg viewBox="0 0 68 36" preserveAspectRatio="none" role="img" aria-label="pressure"><line class="z" x1="0" x2="68" y1="${at(0)}" y2="${at(0)}"/><polyline class="p" points="${p.map((v, k) => `${((68 * t[k]) / 1000).toFixed(1)},${at(v)}`).join(" ")}"/></svg>`;
  }
  if (x && x.length > 1) {
    const [x0, x1, z0, z1] = [Math.min(...x), Math.max(...x), Math.min(...z), Math.max(...z)], scale = Math.min(62 / (x1 - x0 || 1), 32 / (z1 - z0 || 1));
    const px = (v) => (34 + (v - (x0 + x1) / 2) * scale).toFixed(1), pz = (v) => (18 - (v - (z0 + z1) / 2) * scale).toFixed(1);
    out += `<svg viewBox="0 0 68 36" role="img" aria-label="path of the tip"><polyline class="t" points="${x.map((v, k) => `${px(v)},${pz(z[k])}`).join(" ")}"/></svg>`;
  }
  return out;
}
const tagsOf = (tags) => (tags || []).map((t) => `<span class="tag">${html(t)}</span>`).join("");
