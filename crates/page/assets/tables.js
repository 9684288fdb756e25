// Tables are sorted by a click on a head and copied with a button; then everything is drawn.
document.querySelectorAll("table.data").forEach(table => {
  const body = table.tBodies[0];
  const key = (row, column) => { const cell = row.cells[column]; return cell.dataset.sort === undefined ? cell.textContent : Number(cell.dataset.sort); };
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = head.textContent;
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      [...table.tHead.rows[0].cells].forEach(other => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const order = (a, b) => { const [x, y] = [key(a, column), key(b, column)]; return (typeof x === typeof y ? d3.ascending(x, y) : typeof x === "number" ? -1 : 1) * (down ? -1 : 1); };
      body.append(...[...body.rows].sort(order));
    });
  });
  const copy = document.createElement("button");
  copy.type = "button";
  copy.textContent = "copy";
  copy.setAttribute("aria-label", `copy the table ${table.caption.textContent}`);
  table.caption.append(copy);
  copy.addEventListener("click", async () => {
    const text = [...table.rows].map(row => [...row.cells].map(cell => cell.textContent).join("\t")).join("\n");
    try { await navigator.clipboard.writeText(text); copy.textContent = "copied"; } catch { copy.textContent = "not allowed here"; }
    setTimeout(() => { copy.textContent = "copy"; }, 1500);
  });
  body.addEventListener("click", event => {
    const row = event.target.closest("tr[data-step]");
    if (row && !getSelection().toString()) choose(Number(row.dataset.step), true);
  });
});
document.querySelectorAll("input[name=layer]").forEach(box => box.addEventListener("change", () => { drawMap(); drawEta(); }));
byId("whole").addEventListener("click", () => { zoomed.map = null; drawMap(); });
byId("step-choice").addEventListener("change", event => choose(Number(event.target.value), false));
dark.addEventListener("change", redraw);
// Print is always light.
addEventListener("beforeprint", () => { root.dataset.print = ""; redraw(); });
addEventListener("afterprint", () => { delete root.dataset.print; redraw(); });
let resized;
addEventListener("resize", () => { clearTimeout(resized); resized = setTimeout(redraw, 150); });
redraw();
root.dataset.drawn = "true";
