// Follows a run: listens to the program, fills the page, sends what the operator asks for.
let chosen = null, now = null, rows = [], traced = [], steps = 0, duration = 0, pace = null, over = false;
const TRACE_ROWS = 300, EVENTS = 200, SILENCE = 5000, AGAIN = 500, TRACES_EVERY = 1000;
// The token stays behind the #: no request carries it but in a header.
const token = new URLSearchParams(location.hash.slice(1)).get("token");
const headers = token ? { Authorization: `Bearer ${token}` } : {};
const text = (id, words) => { if (byId(id).textContent !== words) byId(id).textContent = words; };
const capital = words => words[0].toUpperCase() + words.slice(1);
const pause = ms => new Promise(done => setTimeout(done, ms));

function lasting(s) {
  s = Math.max(0, s);
  const minutes = Math.round(s / 60);
  return s < 99.5 ? `${s.toFixed(0)} s` : minutes < 60 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${String(minutes % 60).padStart(2, "0")} min`;
}

function cells(row, words, kind = "td") {
  row.replaceChildren(...words.map(word => { const cell = document.createElement(kind); cell.textContent = word; return cell; }));
  return row;
}

function choose(step) {
  chosen = step;
  drawMap();
  drawEta();
}

// What it waits for: the operator, the gas to settle, or the end of the time at the point.
function waits(step) {
  if (now.holds) return "held by the operator, until it is let go on";
  const after = now.t_s - step.start_s, left = lasting(step.end_s - now.t_s);
  if (now.stops) return `the run stops at its end, in ${left}`;
  if (step.settle_s != null && after < step.settle_s) return `waits for speed, flow and pressure ratio to settle, expected in ${lasting(step.settle_s - after)}; ends in ${left}`;
  return `waits for the heat to move through the window of identification; ends in ${left}`;
}

// Stop and safe work without the stream of readings, for which the server may have no room.
function showButtons() {
  const pressed = { hold: !connected || now?.holds || now?.stops, "go-on": !connected || !now?.holds, stop: connected && now?.stops };
  document.querySelectorAll("button[data-ask]").forEach(button => { button.disabled = over || Boolean(pressed[button.dataset.ask]); });
}

function showNow() {
  showButtons();
  if (!now) return;
  const step = now.step;
  text("phase", over ? "The run has ended" : step ? `${step.step ? `Step ${step.step} of ${Math.max(steps, step.step)}` : "A step once more"}: ${step.place}` : capital(now.phase));
  text("where", over || !step ? "" : `${capital(waits(step))}.`);
  byId("bar").value = over ? 1 : duration ? Math.min(1, now.t_s / (now.t_s + now.left_s || 1)) : 0;
  const paced = pace ? now.left_s / pace : null;
  const half = now.left_half_s >= 0.5 ? ` ± ${lasting(now.left_half_s)}` : "";
  const done = paced == null ? "" : `, at about ${new Date(Date.now() + 1000 * paced).toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit" })}` + (pace === 1 ? "" : ` (the rig's time runs ${short(pace)} times as fast)`);
  text("left", over ? "" : `${lasting(now.t_s)} of rig time done, ${lasting(now.left_s)}${half} to the end${done}.`);
  const body = byId("readings");
  now.readings.forEach((r, i) => {
    const row = body.rows[i] ?? body.insertRow();
    const bound = b => b == null ? "-" : short(b);
    // The last twentieth before a limit is marked.
    const near = (r.high != null && r.value > 0.95 * r.high) || (r.low != null && r.value < 1.05 * r.low);
    const beyond = (r.high != null && r.value > r.high) || (r.low != null && r.value < r.low);
    const state = r.high == null && r.low == null ? "no limit" : beyond ? "beyond" : near ? "near" : "within";
    cells(row, [r.symbol, r.shown, r.unit, state, bound(r.low), bound(r.high), r.what]);
    row.cells[3].className = beyond ? "unusable" : near && state !== "no limit" ? "doubtful" : "";
  });
  while (body.rows.length > now.readings.length) body.deleteRow(-1);
}

function drawTraces() {
  traced.at = Date.now();
  const box = byId("traces");
  traced.forEach((channel, i) => {
    let figure = box.children[i];
    if (!figure) {
      figure = document.createElement("figure");
      figure.append(document.createElement("div"), document.createElement("figcaption"));
      box.append(figure);
    }
    const [holder, caption] = figure.children;
    const reads = now?.readings.find(r => r.symbol === channel.name);
    caption.textContent = reads ? `${channel.name} ${reads.shown} ${channel.unit}, ${reads.what}` : `${channel.name}, ${channel.unit}`;
    const seen = rows.filter(row => row[i + 1] != null);
    put(holder, Plot.plot({
      width: widthOf(holder), height: 172, marginTop: 28, marginLeft: 56, marginBottom: 40, style: { background: "transparent", color: style("--ink"), fontSize: "12px" },
      x: { label: "rig time, min" }, y: { label: channel.unit, nice: true },
      marks: [Plot.gridY({ stroke: style("--grid"), strokeOpacity: 1 }), Plot.line(seen, { x: row => row[0] / 60, y: row => row[i + 1], stroke: style("--accent") })],
    }), `${channel.name} over the last minutes, in ${channel.unit}`);
  });
}

function addPoint(p) {
  const row = byId("points").insertRow(0);
  row.dataset.step = p.step;
  cells(row, [p.name, p.line, shown(p.flow, 2), shown(p.pr, 4), shown(p.eta, 2), margins(p.eta, p.eta_low, p.eta_high, 2) ?? "-", shown(p.h, 0), p.verdict, (p.warnings[0] ?? "").replaceAll("`", "")]);
  row.cells[7].className = p.verdict;
  row.addEventListener("click", () => choose(p.step));
}

function addEvent(event) {
  const item = document.createElement("li");
  item.textContent = `${event.t_s.toFixed(0)} s: ${event.message}`;
  byId("events").prepend(item);
  while (byId("events").children.length > EVENTS) byId("events").lastChild.remove();
}

function ended(outcome, file) {
  if (outcome == null) return;
  over = true;
  text("connection", `${outcome} ${file ? `The page of the run is ${file}.` : ""}`);
  showNow();
}

const take = {
  snapshot(s) {
    ({ now, rows, traced, steps, pace } = s);
    duration = s.duration_s;
    document.title = `${s.campaign}, live`;
    text("title", `Campaign ${s.campaign}, machine ${s.machine}`);
    text("speed-head", `speed ${s.units.speed}`);
    text("flow-head", `flow ${s.units.flow}`);
    Object.assign(page, { units: s.units, points: s.points, planned: s.planned, map: s.map });
    lineNames = s.lines;
    byId("points").replaceChildren();
    byId("events").replaceChildren();
    s.points.forEach(addPoint);
    s.events.forEach(addEvent);
    choose(chosen);
    drawTraces();
    showNow();
    ended(s.outcome, s.page);
  },
  tick(t) {
    now = t.now;
    // The state that a browser begins with may hold rows that come again.
    rows = [...rows, ...t.rows.filter(row => row[0] > (rows.at(-1)?.[0] ?? -1))].slice(-TRACE_ROWS);
    showNow();
    if (t.rows.length && Date.now() - traced.at > TRACES_EVERY) drawTraces();
  },
  point(p) {
    page.points.push(p);
    addPoint(p);
    drawMap();
    drawEta();
  },
  map(m) {
    page.map = m.map;
    drawMap();
  },
  event: addEvent,
  end(e) { ended(e.outcome, e.page); },
};

let connected = false;
function isConnected(yes, words) {
  connected = yes;
  if (!over) text("connection", words);
  root.dataset.connected = String(yes);
  showNow();
}

async function follow() {
  while (!over) {
    const ends = new AbortController();
    let silent = setTimeout(() => ends.abort(), SILENCE);
    try {
      const answer = await fetch("events", { headers, cache: "no-store", signal: ends.signal });
      if (!answer.ok) throw new Error(answer.status === 401 ? "the token is missing or wrong: open the address as the program printed it" : `the program answers ${answer.status}`);
      isConnected(true, "Connected.");
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      for (let got = ""; ;) {
        const { value, done } = await reader.read();
        if (done) break;
        clearTimeout(silent);
        silent = setTimeout(() => ends.abort(), SILENCE);
        const events = (got + value).split("\n\n");
        got = events.pop();
        for (const event of events.filter(e => e.startsWith("data: "))) {
          const message = JSON.parse(event.slice(6));
          take[message.type]?.(message);
        }
      }
      isConnected(false, "The connection is lost; the run goes on. Connecting again.");
    } catch (error) {
      // What a browser calls a silence or a refused connection says nothing to people.
      const why = error instanceof TypeError || error.name === "AbortError" ? "" : ` (${error.message})`;
      isConnected(false, `Not connected${why}; the run goes on. Connecting again.`);
    } finally {
      clearTimeout(silent);
    }
    if (!over) await pause(AGAIN);
  }
}

let asked = null;
document.querySelectorAll("button[data-ask]").forEach(button => button.addEventListener("click", () => {
  asked = button;
  byId("question").textContent = button.dataset.question;
  byId("sure").showModal();
}));
byId("no").addEventListener("click", () => byId("sure").close());
byId("yes").addEventListener("click", async () => {
  byId("sure").close();
  try {
    const answer = await fetch(`ask/${asked.dataset.ask}`, { method: "POST", headers });
    if (!answer.ok) throw new Error(answer.status);
  } catch (error) {
    text("connection", `“${asked.textContent}” did not reach the program (${error.message}). Press it again, or stop the run at its terminal.`);
  }
});
document.querySelectorAll("input[name=layer]").forEach(box => box.addEventListener("change", () => { drawMap(); drawEta(); }));
byId("whole").addEventListener("click", () => { zoomed.map = null; drawMap(); });
redrawn.push(drawTraces);
dark.addEventListener("change", redraw);
let resized;
addEventListener("resize", () => { clearTimeout(resized); resized = setTimeout(redraw, 150); });
root.dataset.drawn = "true";
follow();
