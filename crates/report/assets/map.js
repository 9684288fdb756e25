// The map and the efficiency over flow, with layers, zoom and a click on a point.
const layer = name => document.querySelector(`input[name=layer][value=${name}]`)?.checked ?? false;
const zoomed = { map: null };
// Drawings are narrower on paper.
const small = () => "print" in root.dataset ? 8.5 : 10;

function words(p) {
  const lines = [
    `step ${p.name}: ${p.line} ${page.units.speed}` + (p.valve == null ? "" : `, valve area ${shown(100 * p.valve, 1)} %`),
    `flow ${shown(p.flow, 2)} ± ${shown(p.flow_half, 2)} ${page.units.flow}`,
    `pressure ratio ${shown(p.pr, 4)} ± ${shown(p.pr_half, 4)}`,
    p.eta == null ? "efficiency not known" : `efficiency ${withMargins(p.eta, p.eta_low, p.eta_high, 2)} %`,
  ];
  if (p.eta_common != null) lines.push(`  common ${shown(p.eta_common, 2)}, own ${shown(p.eta_own, 2)}`);
  if (p.h != null) lines.push(`h ${withMargins(p.h, p.h_low, p.h_high, 0)} W/(m² K)`);
  if (p.dynamic) lines.push(`dynamic ${shown(p.dynamic[0], 2)} %`);
  // Three readings a line: the text is next to the pointer.
  for (let i = 0; i < p.raw.length; i += 3) lines.push(`${i ? "  " : "read "}${p.raw.slice(i, i + 3).join(", ")}`);
  lines.push(p.verdict);
  return lines.join("\n");
}

// Solid and dashed runs of a line; a dashed run reaches to its solid neighbours.
function runs(nodes, out) {
  const pieces = [];
  let piece = [];
  nodes.forEach((node, i) => {
    const belongs = node.out === out || (out && (nodes[i - 1]?.out || nodes[i + 1]?.out));
    if (belongs) piece.push(node);
    else if (piece.length) { pieces.push(piece); piece = []; }
  });
  if (piece.length) pieces.push(piece);
  return pieces;
}

function mapMarks() {
  const marks = [Plot.gridX({ stroke: style("--grid"), strokeOpacity: 1 }), Plot.gridY({ stroke: style("--grid"), strokeOpacity: 1 })];
  const path = (data, options) => marks.push(Plot.line(data, { x: d => d[0] ?? d.flow, y: d => d[1] ?? d.pr, clip: true, ...options }));
  const ink = style("--ink"), soft = style("--soft");
  if (layer("contours")) {
    page.map.contours.forEach((contour, index) => {
      for (const line of contour.paths) path(line, { stroke: style("--accent"), strokeOpacity: 0.55, strokeWidth: 0.9, className: "contour" });
      const longest = d3.greatest(contour.paths, line => line.length);
      // A contour that is hardly longer than its number says more without it.
      if (longest.length < 12) return;
      // Numbers of neighbours are not next to each other.
      const at = longest[Math.floor((index % 2 ? 0.4 : 0.6) * longest.length)];
      marks.push(Plot.text([at], { x: d => d[0], y: d => d[1], text: () => `${contour.eta}`, fill: style("--accent"), stroke: style("--ground"), strokeWidth: 3, fontSize: small(), clip: true }));
    });
  }
  if (layer("lines")) {
    for (const line of page.map.lines.filter(line => line.measured || layer("extrapolated"))) {
      for (const piece of runs(line.nodes, false)) path(piece, { stroke: line.measured ? ink : soft, strokeWidth: 1.2 });
      if (layer("extrapolated")) for (const piece of runs(line.nodes, true)) path(piece, { stroke: soft, strokeDasharray: "4 3", strokeWidth: 1 });
      const end = line.nodes.find(node => !node.out);
      if (end) marks.push(Plot.text([end], { x: "flow", y: "pr", text: () => line.speed, dx: 4, dy: 13, textAnchor: "start", fill: ink, stroke: style("--ground"), strokeWidth: 3, fontSize: small() }));
    }
    path(page.map.surge, { stroke: style("--bad"), strokeDasharray: "6 3", strokeWidth: 1.6 });
    path(page.map.choke, { stroke: style("--doubt"), strokeDasharray: "2 3", strokeWidth: 1.6 });
  }
  page.others.forEach((other, index) => {
    if (!layer(`other${index}`)) return;
    for (const line of other.map.lines.filter(line => line.measured))
      for (const piece of runs(line.nodes, false)) path(piece, { stroke: d3.schemeTableau10[index % 10], strokeDasharray: "7 3", strokeWidth: 1.4 });
  });
  path(page.map.soft, { stroke: style("--bad"), strokeDasharray: "1 4", strokeWidth: 2 });
  if (page.map.sought.length) {
    marks.push(Plot.ruleY(page.map.sought, { y: "pr", x1: d => d.flow - d.flow_half, x2: d => d.flow + d.flow_half, stroke: style("--bad") }));
    marks.push(Plot.dot(page.map.sought, { x: "flow", y: "pr", symbol: "square", fill: style("--bad"), r: 3.5 }));
  }
  return marks;
}

// The point whose transient is shown; on paper none is.
const ringed = p => p.step === chosen && !("print" in root.dataset);
const drawnPoints = () => page.points.filter(p => p.flow != null && (!p.repeat || layer("repeats")));
const pointMarks = (data, y) => [
  Plot.dot(data, {
    x: "flow", y, r: p => (ringed(p) ? 7 : 4.5), symbol: p => (p.verdict === "good" ? "circle" : "diamond"),
    fill: p => (p.eta == null ? "none" : lineColour(p.line)), stroke: p => (ringed(p) ? style("--bad") : style("--ground")),
    strokeWidth: p => (ringed(p) ? 2.5 : 0.8), className: "points", clip: true,
  }),
  Plot.tip(data, Plot.pointer({ x: "flow", y, title: words, fill: style("--ground"), stroke: style("--line"), fontSize: 12, lineWidth: innerWidth < 700 ? 24 : 42 })),
];

// Each mark knows its step; a click takes the point under the pointer, as the text next to it does.
function clickable(plot, data) {
  d3.select(plot).selectAll("g.points path, g.points circle").each(function () {
    const p = data[d3.select(this).datum()];
    if (p) d3.select(this).attr("class", "point").attr("data-step", p.step);
  });
  plot.addEventListener("click", () => { if (plot.value) choose(plot.value.step, true); });
}

function drawMap() {
  const element = byId("map-plot"), data = drawnPoints();
  const ahead = page.planned ?? [];
  const all = [...ahead.map(p => [p.flow, p.pr]), ...data.map(p => [p.flow, p.pr]), ...page.map.lines.filter(l => l.measured).flatMap(l => l.nodes.filter(n => !n.out).map(n => [n.flow, n.pr]))];
  const padded = ([low, high]) => [low - 0.04 * (high - low), high + 0.04 * (high - low)];
  const home = { x: padded(d3.extent(all, d => d[0])), y: padded(d3.extent(all, d => d[1])) };
  const view = zoomed.map ?? home;
  const width = widthOf(element), height = Math.round(0.78 * width);
  const intervals = layer("intervals")
    ? [Plot.ruleY(data, { y: "pr", x1: p => p.flow - p.flow_half, x2: p => p.flow + p.flow_half, stroke: p => lineColour(p.line), strokeOpacity: 0.7, clip: true })]
    : [];
  const plot = Plot.plot({
    width, height, marginLeft: 48, marginRight: 26, marginBottom: 42, style: { background: "transparent", color: style("--ink"), fontSize: "12px" },
    x: { domain: view.x, label: `corrected flow, ${page.units.flow}` }, y: { domain: view.y, label: "total pressure ratio P2/P1" },
    marks: [...mapMarks(), Plot.dot(ahead, { x: "flow", y: "pr", r: 3, stroke: style("--soft"), clip: true }), ...intervals, ...pointMarks(data, "pr")],
  });
  clickable(plot, data);
  const x = plot.scale("x"), y = plot.scale("y");
  // Dragging and the wheel move the domain; the wheel alone scrolls the page unless Ctrl is held or the map is zoomed.
  const zoom = d3.zoom().scaleExtent([1, 40]).filter(event => event.type !== "wheel" || event.ctrlKey || event.metaKey || zoomed.map)
    .on("end", event => {
      if (!event.sourceEvent) return;
      const t = event.transform;
      const moved = (scale, range, k, shift) => range.map(pixel => scale.invert((pixel - shift) / k));
      const next = { x: moved(x, x.range, t.k, t.x), y: moved(y, y.range, t.k, t.y) };
      if (t.k === 1 && Math.hypot(t.x, t.y) < 3) return;
      zoomed.map = next;
      drawMap();
    });
  d3.select(plot).call(zoom).on("dblclick.zoom", null);
  put(element, plot, `Compressor map: ${data.length} points on ${page.map.lines.filter(l => l.measured).length} speed lines; the same numbers stand in the tables below.`);
}

function drawEta() {
  const element = byId("eta-plot"), data = drawnPoints().filter(p => p.eta != null);
  const width = widthOf(element), height = Math.round(0.78 * width), marks = [];
  marks.push(Plot.gridX({ stroke: style("--grid"), strokeOpacity: 1 }), Plot.gridY({ stroke: style("--grid"), strokeOpacity: 1 }));
  // While the map fills up, the axis is that of all points to come.
  const flows = [...(page.planned ?? []).map(p => p.flow), ...(page.planned ? data.map(p => p.flow) : [])];
  const low = d3.min(data, p => p.eta_low ?? p.eta), high = d3.max(data, p => p.eta_high ?? p.eta);
  if (layer("lines"))
    for (const line of page.map.lines.filter(l => l.measured)) {
      const nodes = line.eta;
      const name = d3.least(lineNames, n => Math.abs(n - line.speed));
      marks.push(Plot.areaY(nodes, { x: "flow", y1: n => n.eta - n.half, y2: n => n.eta + n.half, fill: lineColour(name), fillOpacity: 0.15, clip: true }));
      marks.push(Plot.line(nodes, { x: "flow", y: "eta", stroke: lineColour(name), clip: true }));
      // Its speed is written below its last point towards choke, or where the line leaves what is drawn.
      const end = d3.greatest(nodes, n => n.flow), last = d3.greatest(data.filter(p => p.line === name), p => p.flow);
      const eta = end && last ? Math.max(low, Math.min(end.eta, last.eta_low ?? last.eta)) : end?.eta;
      if (end) marks.push(Plot.text([{ flow: end.flow, eta }], { x: "flow", y: "eta", text: () => line.speed, dy: 14, textAnchor: "middle", fill: style("--ink"), stroke: style("--ground"), strokeWidth: 3, fontSize: small() }));
    }
  if (layer("intervals")) marks.push(Plot.ruleX(data.filter(p => p.eta_low != null), { x: "flow", y1: "eta_low", y2: "eta_high", stroke: p => lineColour(p.line) }));
  if (layer("dynamic")) {
    const two = data.filter(p => p.dynamic);
    marks.push(Plot.ruleX(two, { x: "flow", y1: p => p.dynamic[1], y2: p => p.dynamic[2], stroke: style("--doubt"), strokeOpacity: 0.6, clip: true }));
    marks.push(Plot.dot(two, { x: "flow", y: p => p.dynamic[0], symbol: "times", stroke: style("--doubt"), clip: true }));
  }
  page.others.forEach((other, index) => {
    if (!layer(`other${index}`)) return;
    for (const line of other.map.lines.filter(l => l.measured))
      marks.push(Plot.line(line.eta, { x: "flow", y: "eta", stroke: d3.schemeTableau10[index % 10], strokeDasharray: "7 3", clip: true }));
  });
  marks.push(...pointMarks(data, "eta"));
  const plot = Plot.plot({
    width, height, marginLeft: 48, marginBottom: 42, style: { background: "transparent", color: style("--ink"), fontSize: "12px" },
    x: { label: `corrected flow, ${page.units.flow}`, domain: flows.length ? d3.extent(flows) : undefined, nice: true, inset: 8 }, y: { domain: low == null ? [0, 100] : [Math.max(0, low - 2), high + 2], label: "efficiency, %" }, marks,
  });
  clickable(plot, data);
  put(element, plot, `Efficiency over corrected flow of ${data.length} points, between ${shown(low, 1)} and ${shown(high, 1)} %.`);
}

function drawPlan() {
  const element = byId("plan-plot");
  if (!element) return;
  const stops = page.points.filter(p => p.flow != null).sort((a, b) => a.step - b.step);
  const jumps = d3.pairs(stops).map(([from, to], i) => ({ from, to, i }));
  const shade = i => d3.interpolateLab(style("--accent"), style("--grid"))(jumps.length < 2 ? 0 : 0.85 * i / (jumps.length - 1));
  const width = Math.max(280, Math.min(900, element.clientWidth || 800));
  // Numbers of steps at one place stand in one row: repeats never come back to the very same numbers.
  const span = of => Math.max(1e-9, d3.max(stops, of) - d3.min(stops, of));
  const [flowSpan, prSpan] = [span(p => p.flow), span(p => p.pr)];
  const places = [];
  for (const p of stops) {
    const near = places.find(q => Math.hypot((q.flow - p.flow) / flowSpan, (q.pr - p.pr) / prSpan) < 0.015);
    if (near) near.steps.push(p.step);
    else places.push({ flow: p.flow, pr: p.pr, steps: [p.step] });
  }
  // A number that would stand on another one is left to the table.
  const height = Math.round(0.6 * width), boxes = [];
  const pixel = p => [(p.flow - d3.min(stops, q => q.flow)) / flowSpan * (width - 96), (d3.max(stops, q => q.pr) - p.pr) / prSpan * (height - 90)];
  const lowest = d3.max(places, p => pixel(p)[1]);
  for (const p of places) {
    const wide = 3.4 * p.steps.join(", ").length, [place, level] = pixel(p);
    // A row of numbers stays inside the drawing; the lowest one is below its point, where no other point is.
    p.dx = Math.max(wide - 60, Math.min(width - 64 - wide, place)) - place;
    p.dy = level === lowest ? 12 : -9;
    const [x, y] = [place + p.dx, level + p.dy];
    p.named = boxes.every(([left, right, at]) => Math.abs(at - y) > 10 || x - wide > right || x + wide < left);
    if (p.named) boxes.push([x - wide, x + wide, y]);
  }
  const plot = Plot.plot({
    width, height, marginLeft: 48, marginBottom: 42, style: { background: "transparent", color: style("--ink"), fontSize: "12px" },
    x: { label: `corrected flow, ${page.units.flow}`, inset: 14 }, y: { label: "total pressure ratio P2/P1", inset: 14 },
    marks: [
      Plot.arrow([...jumps].reverse(), { x1: d => d.from.flow, y1: d => d.from.pr, x2: d => d.to.flow, y2: d => d.to.pr, stroke: d => shade(d.i), strokeWidth: d => (d.i < 5 ? 2 : 1), bend: 12, inset: 5, headLength: 6 }),
      Plot.dot(places, { x: "flow", y: "pr", fill: style("--ground"), stroke: style("--ink"), r: 3.5 }),
      ...places.filter(p => p.named).map(p => Plot.text([p], { x: "flow", y: "pr", text: p => p.steps.join(", "), dx: p.dx, dy: p.dy, fontSize: 10, fill: style("--ink"), stroke: style("--ground"), strokeWidth: 3 })),
    ],
  });
  put(element, plot, `The ${jumps.length} jumps of the plan in their order; the table below lists them.`);
}

// Which dashed lines are whose.
page.others.forEach((other, index) => {
  const box = document.querySelector(`input[name=layer][value=other${index}]`);
  if (box) box.parentElement.style.borderBottom = `2px dashed ${d3.schemeTableau10[index % 10]}`;
});

redrawn.push(drawMap, drawEta, drawPlan);
