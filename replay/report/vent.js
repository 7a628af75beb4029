// The keys that vent: V outside a text field, Escape twice within a second anywhere. Without confirmation, never disabled.
let escapedAt = -Infinity;
function onVentKey(vent) {
  document.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const writing = e.target.matches && e.target.matches("input:not([type=range]):not([type=checkbox]), textarea, select, [contenteditable]");
    if (e.key === "Escape") {
      if (e.timeStamp - escapedAt < 1000) vent();
      escapedAt = e.timeStamp;
    } else if (!writing && !e.repeat && e.key.toLowerCase() === "v") vent();
  }, true);
}
