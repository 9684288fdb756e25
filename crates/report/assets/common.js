"use strict";
// What all drawings share: data, colours of the page's theme, sizes.
const root = document.documentElement;
const page = JSON.parse(document.getElementById("data").textContent);
const style = name => getComputedStyle(root).getPropertyValue(name).trim();
const byId = id => document.getElementById(id);
// Distances to the ends of an interval: one number, or both if they differ by more than a half.
function margins(value, low, high, digits) {
  if (value == null || low == null || high == null) return null;
  const below = Math.max(value - low, 0), above = Math.max(high - value, 0), farther = Math.max(below, above);
  return farther <= 1.5 * Math.min(below, above) ? shown(farther, digits) : `−${shown(below, digits)}/+${shown(above, digits)}`;
}
const withMargins = (value, low, high, digits) => {
  const both = margins(value, low, high, digits);
  return shown(value, digits) + (both == null ? "" : both.startsWith("−") ? ` ${both}` : ` ± ${both}`);
};
const shown = (value, digits, unit = "") => value == null ? "-" : value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1") + unit;
const short = d3.format(".3~g");
// On paper a drawing is scaled to its column: a narrower one has larger letters.
const widthOf = element => "print" in root.dataset ? 400 : Math.max(280, Math.min(720, element.clientWidth || 600));

// Colours of speed lines from slow to fast: viridis, whose ends are cut where they vanish on white and on black.
let lineNames = page.lines ?? [...new Set(page.points.map(p => p.line))].sort((a, b) => a - b);
const dark = matchMedia("(prefers-color-scheme: dark)");
const lineColour = name => {
  const at = lineNames.length < 2 ? 0.5 : lineNames.indexOf(name) / (lineNames.length - 1);
  return d3.interpolateViridis(dark.matches && !("print" in root.dataset) ? 0.25 + 0.7 * at : 0.05 + 0.75 * at);
};
const redrawn = [];
const redraw = () => redrawn.forEach(draw => draw());

// A drawing with a name for those who do not see it; its parts are not separate elements for them.
function put(element, plot, name) {
  plot.querySelectorAll("[aria-label]").forEach(part => {
    part.dataset.mark = part.getAttribute("aria-label");
    part.removeAttribute("aria-label");
  });
  plot.setAttribute("role", "img");
  plot.setAttribute("aria-label", name);
  element.replaceChildren(plot);
}
