// The transient of the chosen point; at first that of the first jump, because the first step has none.
let chosen = (page.points[1] ?? page.points[0])?.step ?? null;

function frame(element, options) {
  const width = widthOf(element);
  return { width, height: 250, marginTop: 30, marginLeft: 56, marginBottom: 36, style: { background: "transparent", color: style("--ink"), fontSize: "12px" }, ...options };
}

// What is known of a point, a line each.
function stepWords(step, p) {
  const sentence = text => text[0].toUpperCase() + text.slice(1) + (/[.!?]$/.test(text) ? "" : ".");
  const both = p.eta_common == null ? "" : `; of it common to all points ± ${shown(p.eta_common, 2)}, its own ± ${shown(p.eta_own, 2)}`;
  const fits = step.fits.map(fit => `${fit.channel} ${shown(fit.rms_k, 3)} K`).join(", ");
  return [
    `Step ${p.name}, ${p.verdict}: ${p.line} ${page.units.speed} corrected` + (p.valve == null ? "" : `, valve area ${shown(100 * p.valve, 1)} %`),
    (p.eta == null ? "efficiency not known" : `efficiency ${withMargins(p.eta, p.eta_low, p.eta_high, 2)} %${both}`) +
      (p.dynamic ? `; by the dynamic method ${shown(p.dynamic[0], 2)} %` : ""),
    `corrected flow ${shown(p.flow, 2)} ± ${shown(p.flow_half, 2)} ${page.units.flow}, pressure ratio ${shown(p.pr, 4)} ± ${shown(p.pr_half, 4)}` +
      (p.h == null ? "" : `, h ${withMargins(p.h, p.h_low, p.h_high, 0)} W/(m² K)`),
    p.raw.length ? `readings at the end: ${p.raw.join(", ")}` : null,
    fits ? `residual of the fit, rms: ${fits}` : null,
    ...p.warnings.map(sentence),
  ].filter(Boolean);
}

function drawStep() {
  const step = page.steps.find(s => s.step === chosen), point = page.points.find(p => p.step === chosen);
  const box = byId("step-plots");
  byId("step-choice").value = String(chosen);
  document.querySelectorAll("tr[data-step]").forEach(row => row.classList.toggle("chosen", Number(row.dataset.step) === chosen));
  if (!step || !point) { box.replaceChildren(); byId("step-words").textContent = "This step has no readings."; return; }
  const list = document.createElement("ul");
  list.append(...stepWords(step, point).map(words => { const item = document.createElement("li"); item.textContent = words; return item; }));
  byId("step-words").replaceChildren(list);
  const figures = [];
  const add = (names, title, extra) => {
    const channels = names.map(name => step.channels.find(c => c.name === name)).filter(Boolean);
    if (!channels.length) return;
    const figure = document.createElement("figure"), holder = document.createElement("div"), caption = document.createElement("figcaption");
    figure.append(holder, caption);
    box.append(figure);
    caption.textContent = title;
    figures.push([holder, channels, extra, title]);
  };
  box.replaceChildren();
  const titles = {
    T2: "T2 measured (dots) and by the fit (line); the shaded window was evaluated",
    Tc: "Housing temperature Tc measured (dots) and by the housing's heat balance (line)",
  };
  for (const name of ["T2", "Tc"]) {
    const fit = step.fits.find(f => f.channel === name);
    add([name], fit ? titles[name] : name === "T2" ? "T2" : "Housing temperature Tc", fit && { fit });
    if (fit) add([name], `${name} residual: measured minus fitted, K`, { left: fit });
  }
  add(["N"], "Shaft speed N");
  add(["m"], "Compressor flow, measured");
  add(["P2", "P3"], "Pressures P2 and P3");
  for (const [holder, channels, extra, title] of figures) {
    const rows = channels.flatMap(c => c.values.map((v, i) => ({ t: step.t[i], v, name: c.name }))).filter(r => r.v != null);
    const marks = [Plot.gridY({ stroke: style("--grid"), strokeOpacity: 1 })];
    if (step.window) marks.push(Plot.rectX([step.window], { x1: d => d[0], x2: d => d[1], fill: style("--accent"), fillOpacity: 0.08 }));
    if (extra?.left) {
      const left = extra.left.t.map((t, i) => ({ t, v: extra.left.left_k[i] })).filter(r => r.v != null);
      marks.push(Plot.ruleY([0], { stroke: style("--soft") }), Plot.dot(left, { x: "t", y: "v", r: 2, fill: style("--ink") }));
    } else if (extra?.fit) {
      marks.push(Plot.dot(rows, { x: "t", y: "v", r: 2, fill: style("--soft") }));
      marks.push(Plot.line(extra.fit.t.map((t, i) => ({ t, v: extra.fit.fitted[i] })), { x: "t", y: "v", stroke: style("--accent"), strokeWidth: 2 }));
    } else {
      marks.push(Plot.line(rows, { x: "t", y: "v", z: "name", stroke: d => (d.name === channels[0].name ? style("--accent") : style("--doubt")) }));
      if (channels.length > 1) marks.push(Plot.text(rows, Plot.selectLast({ x: "t", y: "v", z: "name", text: "name", dx: -12, dy: -8, fill: style("--ink") })));
    }
    put(holder, Plot.plot(frame(holder, { x: { label: "time after the change of setpoints, s" }, y: { label: extra?.left ? "K" : channels[0].unit, nice: true }, marks })), `${title}, step ${point.name}`);
  }
}

function choose(step, jump) {
  chosen = step;
  drawMap();
  drawEta();
  drawStep();
  if (jump) byId("step").scrollIntoView({ behavior: matchMedia("(prefers-reduced-motion: reduce)").matches ? "auto" : "smooth" });
}
redrawn.push(drawStep);
