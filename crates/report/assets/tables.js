// Every table is copied with a button, and sorted by a click on a head if it has heads; then everything is drawn.
async function copied(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    // Where a browser gives pages from disk no clipboard, the older way still works.
    const holder = document.createElement("textarea");
    holder.value = text;
    document.body.append(holder);
    holder.select();
    const done = document.execCommand("copy");
    holder.remove();
    return done;
  }
}

const number = text => (/^[-+]?[\d.]/.test(text) ? parseFloat(text) : text);

document.querySelectorAll("main table").forEach(table => {
  // A first row of heads alone is the head.
  if (!table.tHead && table.rows.length > 1 && [...table.rows[0].cells].every(cell => cell.tagName === "TH")) {
    table.createTHead().append(table.rows[0]);
    table.tHead.querySelectorAll("th").forEach(head => head.setAttribute("scope", "col"));
  }
  const body = table.tBodies[0];
  if (!body) return;
  const key = (row, column) => {
    const cell = row.cells[column];
    return !cell ? "" : cell.dataset.sort === undefined ? number(cell.textContent.trim()) : Number(cell.dataset.sort);
  };
  const heads = table.tHead ? [...table.tHead.rows[0].cells] : [];
  heads.forEach((head, column) => {
    if (!head.textContent.trim()) return;
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = head.textContent;
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      heads.forEach(other => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const order = (a, b) => {
        const [x, y] = [key(a, column), key(b, column)];
        return (typeof x === typeof y ? d3.ascending(x, y) : typeof x === "number" ? -1 : 1) * (down ? -1 : 1);
      };
      body.append(...[...body.rows].sort(order));
    });
  });
  const text = () => [...table.rows].map(row => [...row.cells].map(cell => cell.textContent.trim()).join("\t")).join("\n");
  const name = table.caption?.textContent ?? table.closest("[role=region]")?.getAttribute("aria-label") ?? "table";
  const copy = document.createElement("button");
  copy.type = "button";
  copy.textContent = "copy";
  copy.className = "copy";
  if (!table.caption) copy.style.marginLeft = "0";
  copy.setAttribute("aria-label", `copy the table ${name}`);
  (table.caption ?? table.createCaption()).append(copy);
  copy.addEventListener("click", async () => {
    copy.textContent = (await copied(text())) ? "copied" : "not allowed here";
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
