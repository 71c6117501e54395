// Page of a tuning: FRFs at the centres of mass, bars of the gap, share of each body.
const BAND = "rgba(31,111,184,.22)";
const FREQ = floats(DATA.freq), LINES = FREQ.length;
const FRFS = {measured: floats(DATA.measured), drawn: floats(DATA.drawn), tuned: floats(DATA.tuned)};
const NOISE = floats(DATA.noise), DEVIATION = DATA.deviation && floats(DATA.deviation);

function curve(kind, channel, view) {
  const {size, angle} = polar(complexes(FRFS[kind], channel, LINES));
  return view === "phase" ? angle : size;
}

function band(channel) {  // 95 % of the tuned model's magnitude, as one outline
  const size = curve("tuned", channel, "magnitude"), x = [], up = [], down = [];
  for (let k = 0; k < LINES; k++) {
    const half = 1.96 * DEVIATION[LINES * channel + k];
    if (size[k] === null || !isFinite(half)) continue;
    x.push(FREQ[k]); up.push(size[k] + half); down.push(Math.max(size[k] - half, size[k] * 1e-3));
  }
  return {x: x.concat([...x].reverse()), y: up.concat(down.reverse())};
}

function decades(channel) {
  // From the lowest measured values but 2 % to the highest of the three curves.
  const sizes = curve("measured", channel, "magnitude").filter(v => v !== null).sort((a, b) => a - b);
  let top = sizes[sizes.length - 1] || 1, low = sizes[Math.floor(0.02 * sizes.length)] || 1e-3;
  for (const kind of ["drawn", "tuned"])
    for (const v of curve(kind, channel, "magnitude")) if (v > top) top = v;
  const range = [Math.log10(low) - 0.35, Math.log10(top) + 0.15];
  return {range, dtick: range[1] - range[0] > 1.3 ? 1 : "D2"};
}

const state = {body: DATA.bodies[0], file: DATA.files[0], view: "magnitude"};

function draw() {
  if (!DATA.channels.length) {
    document.getElementById("overlay").textContent = "No body carries enough sensors to determine its motion.";
    return;
  }
  const chosen = DATA.channels.map((c, i) => ({...c, i}))
    .filter(c => c.body === state.body && c.file === state.file);
  const rows = [...new Set(chosen.map(c => c.direction))], columns = [...new Set(chosen.map(c => c.reference))];
  // The labels of a column's values take 40 pixels beside the plot to its left.
  const width = document.getElementById("overlay").clientWidth || 1100, xgap = Math.min(0.5, Math.max(0.12, 40 * columns.length / width));
  const traces = [], layout = {
    grid: {rows: rows.length, columns: columns.length, pattern: "independent", xgap, ygap: 0.16},
    height: 60 + 175 * rows.length, margin: {l: 62, r: 12, t: 48, b: 44}, showlegend: false, font: FONT,
    paper_bgcolor: PAPER, plot_bgcolor: PAPER, annotations: []
  };
  const channelOf = (direction, reference) => chosen.find(x => x.direction === direction && x.reference === reference);
  const unitOf = (direction, reference) => channelOf(direction, reference)?.unit ?? "";
  rows.forEach((direction, r) => columns.forEach((reference, c) => {
    const channel = channelOf(direction, reference), unit = unitOf(direction, reference);
    const n = r * columns.length + c + 1, tag = n === 1 ? "" : String(n);
    const last = r === rows.length - 1;
    layout["xaxis" + tag] = {showgrid: true, gridcolor: GRID, ticks: "outside", showticklabels: last,
      matches: n === 1 ? undefined : "x", title: last ? {text: "Hz", standoff: 4} : undefined, zeroline: false};
    layout["yaxis" + tag] = {type: state.view === "phase" ? "linear" : "log", gridcolor: GRID, zeroline: false, tickfont: {size: 10},
      exponentformat: "power", title: c === 0 || unit !== unitOf(direction, columns[0]) ?
      {text: direction + " / " + (state.view === "phase" ? "°" : unit), standoff: 4, font: {size: 11}} : undefined};
    if (state.view !== "phase" && channel) Object.assign(layout["yaxis" + tag], decades(channel.i));
    if (state.view === "phase") Object.assign(layout["yaxis" + tag], {range: [-190, 190], tickvals: [-180, -90, 0, 90, 180]});
    if (r === 0) layout.annotations.push({text: (reference.includes(":") ? "hit " : "drive ") + reference, xref: "x" + tag + " domain", yref: "y" + tag + " domain",
      x: 0.5, y: 1.02, yanchor: "bottom", showarrow: false, font: {size: 12}});
    if (!channel) return;
    const add = (name, y, color, width, dash) => traces.push({x: FREQ, y, name, mode: "lines",
      line: {color, width, dash}, xaxis: "x" + tag, yaxis: "y" + tag, hovertemplate: name + " %{y:.3g}<extra></extra>"});
    if (state.view !== "phase") {
      const noise = new Array(LINES);
      for (let k = 0; k < LINES; k++) noise[k] = NOISE[LINES * channel.i + k] || null;
      add("noise", noise, GREY, 0.8, "dot");
      if (DEVIATION) traces.push({...band(channel.i), mode: "lines", fill: "toself", fillcolor: BAND, line: {width: 0},
        xaxis: "x" + tag, yaxis: "y" + tag, hoverinfo: "skip"});
    }
    add("measured", curve("measured", channel.i, state.view), INK, 1.6);
    add("as drawn", curve("drawn", channel.i, state.view), ORANGE, 1.1, "4px,3px");
    add("tuned", curve("tuned", channel.i, state.view), BLUE, 1.3);
  }));
  Plotly.react("overlay", traces, layout, CONFIG);
  document.querySelectorAll("#choose button").forEach(b =>
    b.setAttribute("aria-pressed", String(state[b.dataset.key] === b.dataset.value)));
}

function button(key, value, label) {
  const b = document.createElement("button");
  b.textContent = label || value; b.dataset.key = key; b.dataset.value = value;
  b.onclick = () => { state[key] = value; draw(); };
  return b;
}
const nav = document.getElementById("choose");
DATA.bodies.forEach(body => nav.append(button("body", body)));
if (DATA.files.length > 1) {
  const select = document.createElement("select");
  DATA.files.forEach(file => select.add(new Option(file, file)));
  select.onchange = () => { state.file = select.value; draw(); };
  nav.append(select);
}
const space = document.createElement("span"); space.className = "gap"; nav.append(space);
nav.append(button("view", "magnitude"), button("view", "phase"));
const keys = document.createElement("span");
keys.innerHTML = '<i class="key" style="border-color:var(--measured)"></i>measured<i class="key" style="border-color:var(--drawn);' +
  'border-top-style:dashed"></i>as drawn<i class="key" style="border-color:var(--tuned)"></i>tuned' +
  (DEVIATION ? '<i class="key band"></i>95 % of the tuned model' : '') +
  '<i class="key" style="border-color:var(--noise);border-top-style:dotted"></i>noise';
nav.append(keys);
draw();

const small = {height: 280, margin: {l: 60, r: 12, t: 40, b: 40}, font: FONT, paper_bgcolor: PAPER, plot_bgcolor: PAPER};
Plotly.newPlot("gap", DATA.gap.map(g => ({type: "bar", name: g.name, x: ["at the sensors", "at the centres of mass"], y: g.error,
  marker: {color: g.color}, text: g.error.map(v => v === null ? "" : v.toPrecision(2)), textposition: "outside",
  cliponaxis: false, hovertemplate: g.name + " %{y:.3g}<extra></extra>"})),
  {...small, title: {text: "Error", x: 0.02, font: {size: 14}}, barmode: "group", yaxis: {gridcolor: GRID, rangemode: "tozero"},
   legend: {orientation: "h", y: 1.16, x: 0.2}}, {...CONFIG, displayModeBar: false});
Plotly.newPlot("where", [{type: "bar", orientation: "h", y: DATA.where.map(w => w.body).reverse(),
  x: DATA.where.map(w => 100 * w.share).reverse(), marker: {color: BLUE}, text: DATA.where.map(w =>
  "excess " + w.excess.toPrecision(2)).reverse(), textposition: "auto", textangle: 0, cliponaxis: false, hovertemplate: "%{x:.0f} %<extra></extra>"}],
  {...small, margin: {l: 120, r: 20, t: 40, b: 40}, title: {text: "Share of the remaining gap, by body", x: 0.02, font: {size: 14}},
   xaxis: {ticksuffix: " %", gridcolor: GRID, rangemode: "tozero"}}, {...CONFIG, displayModeBar: false});
