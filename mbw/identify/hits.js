// Hits of raw records: averages of each reference, spectral densities of force and motion.
Object.assign(state, {hits: 0, channel: 0, signal: "record"});
const KIND = {accelerance: ["acceleration", "m/s²", "rad/s²"], mobility: ["velocity", "m/s", "rad/s"], receptance: ["displacement", "m", "rad"]};
const turns = name => /:[+-]r/.test(name);
const short = value => String(Number(value.toPrecision(3)));
const several = key => new Set(DATA.hits.map(row => row[key])).size > 1;

// Heading, class and text of each column.
const HIT_COLUMNS = [
  ["force at", "name", row => row.reference],
  ...(several("test") ? [["file", "name", row => row.test]] : []),
  ...(several("setup") ? [["set-up", "name", row => row.setup === null ? "-" : row.setup]] : []),
  ["hits", "", row => row.kept + row.rejected.length],
  ["averaged", "", row => row.kept],
  ["peaks", "", row => Array.from(new Set([row.peaks[0], row.peaks[row.peaks.length - 1]].map(short))).join(" .. ") + " " + row.unit],
  ["estimator", "name", row => row.estimator],
  ["rate / Hz", "", row => String(Number(row.rate.toPrecision(6)))],
  ["block / s", "", row => row.block_s.toPrecision(4)],
  ["before the hit / s", "", row => short(row.pretrigger)],
  ["force window / s", "", row => row.force_window >= row.block_s ? "none" : short(row.force_window)],
  ["exponential τ / s", "", row => row.exponential_tau ? short(row.exponential_tau) : "none"],
  ["added to ζ / %", "", row => row.exponential_tau ? "≤ " + (100 * row.added).toPrecision(2) : "-"],
  ["response at block end / %", "", row => short(100 * row.left)],
];

const rejection = hit => "hit " + hit.hit + " at " + short(hit.time) + " s of record " + hit.record + ": " + hit.reason;

function hitsTable() {
  const made = element("table"), head = element("tr"), top = element("thead"), body = element("tbody");
  HIT_COLUMNS.forEach(([name, side]) => head.append(element("th", name, {className: side})));
  DATA.hits.forEach((row, k) => {
    const line = element("tr");
    line.append(...HIT_COLUMNS.map(([, side, text]) => element("td", String(text(row)), {className: side})));
    line.onclick = () => { state.hits = k; hitsChannels(); hitsPlot(); };
    body.append(line);
    if (!row.rejected.length) return;
    const below = element("tr"), cell = element("td", undefined, {className: "name soft", colSpan: HIT_COLUMNS.length});
    cell.append(...row.rejected.map(hit => element("div", "left out: " + rejection(hit))));
    below.append(cell);
    body.append(below);
  });
  top.append(head); made.append(top, body);
  byId("hits").append(made);
}

function hitsChooser() {
  const force = element("select", undefined, {id: "hits-force"}), motion = element("select", undefined, {id: "hits-motion"});
  DATA.hits.forEach((row, k) => force.add(new Option(row.reference + (several("setup") && row.setup !== null ? "  (" + row.setup + ")" : several("test") ? "  (" + row.test + ")" : ""), k)));
  force.onchange = () => { state.hits = Number(force.value); hitsChannels(); hitsPlot(); };
  motion.onchange = () => { state.channel = Number(motion.value); hitsPlot(); };
  byId("hits-chosen").append("force at ", force, " and motion at ", motion);
  if (DATA.hits[0].record) buttons(byId("hits-chosen"), "signal", [["record", "record"], ["block", "first averaged hit"]], hitsTime);
}

// The channels of the chosen reference; the one shown before stays where it has it.
function hitsChannels() {
  const motion = byId("hits-motion"), before = motion.selectedIndex < 0 ? "" : motion.options[motion.selectedIndex].text;
  const names = DATA.hits[state.hits].outputs;
  motion.replaceChildren(...names.map((name, k) => new Option(name, k)));
  state.channel = Math.max(0, names.indexOf(before));
}

function density(source, values, axis, name, line) {
  const x = floats(source.freq), y = Array.from(values, v => v > 0 ? v : null);
  return {type: "scatter", mode: "lines", x, y, yaxis: axis, name, line, hovertemplate: "%{x:.5g} Hz: %{y:.3g}<extra>" + escaped(name) + "</extra>"};
}

function hitsPlot() {
  const row = DATA.hits[state.hits], output = row.outputs[state.channel], [word, metres, radians] = KIND[DATA.quantity];
  const column = source => { const n = floats(source.freq).length; return floats(source.motion).slice(state.channel * n, (state.channel + 1) * n); };
  const force = [], motion = [], noise = {color: GREY, width: 1.2};
  if (row.noise) {
    force.push(density(row.noise, floats(row.noise.force), "y", "noise before the hits", noise));
    motion.push({...density(row.noise, column(row.noise), "y2", "noise before the hits", noise), showlegend: false});
  }
  force.push(density(row.densities, floats(row.densities.force), "y", "force " + row.reference, {color: RED, width: 1.5}));
  motion.push(density(row.densities, column(row.densities), "y2", "motion " + output, {color: BLUE, width: 1.5}));
  for (const trace of [...force, ...motion]) trace.legendgroup = trace.name;
  const y = {type: "log", gridcolor: GRID, zeroline: false, exponentformat: "power"}, last = floats(row.densities.freq);
  const unit = (turns(output) ? radians : metres) + "/√Hz", pushes = turns(row.reference) ? ["moment", "N m"] : ["force", "N"];
  const band = {type: "rect", layer: "below", xref: "x", yref: "paper", x0: FREQ[0], x1: FREQ[LINES - 1], y0: 0, y1: 1, fillcolor: hue("hover"), line: {width: 0}};
  Plotly.react("hits-plot", [...force, ...motion], {...PLOT, height: 460, margin: {l: 76, r: 12, t: 34, b: 44}, shapes: [band],
    xaxis: {title: {text: "frequency / Hz; shaded: the band of the modes", standoff: 4}, range: [0, last[last.length - 1]], gridcolor: GRID, zeroline: false, ticks: "outside", anchor: "y2"},
    yaxis: {...y, domain: [0.54, 1], ...logAxis(force.map(t => t.y)), title: {text: pushes[0] + " / (" + pushes[1] + "/√Hz)"}},
    yaxis2: {...y, domain: [0, 0.48], ...logAxis(motion.map(t => t.y)), title: {text: (turns(output) ? "angular " : "") + word + " / (" + unit + ")"}},
    legend: {orientation: "h", x: 0, y: 1.01, xanchor: "left", yanchor: "bottom"}}, CONFIG);
  byId("hits-force").value = state.hits; byId("hits-motion").value = state.channel;
  hitsTime();
  hitsNormalised();
}

// Words and units of the chosen force and motion.
function hitsUnits() {
  const row = DATA.hits[state.hits], output = row.outputs[state.channel], [word, metres, radians] = KIND[DATA.quantity];
  return {row, output, push: turns(row.reference) ? ["moment", "N m"] : ["force", "N"], motion: [(turns(output) ? "angular " : "") + word, turns(output) ? radians : metres]};
}

const channelOf = source => { const values = floats(source.motion), n = floats(source.force).length; return values.slice(state.channel * n, (state.channel + 1) * n); };

// Signals as recorded (seed, fig. 1.5a); dotted lines: averaged hits, grey: hits left out.
function hitsTime() {
  const {row, output, push, motion} = hitsUnits(), source = row[state.signal];
  if (!source) return;
  const x = floats(source.time), last = x[x.length - 1], isWhole = state.signal === "record";
  const trace = (y, axis, name, color) => ({type: "scatter", mode: "lines", x, y, yaxis: axis, name, line: {color, width: 1.2}, hovertemplate: "%{x:.5g} s: %{y:.4g}<extra>" + escaped(name) + "</extra>"});
  const mark = (time, color) => ({type: "line", xref: "x", yref: "paper", x0: time, x1: time, y0: 0, y1: 1, layer: "below", line: {color, width: 1, dash: "dot"}});
  Plotly.react("hits-time", [trace(floats(source.force), "y", push[0] + " " + row.reference, RED), trace(channelOf(source), "y2", motion[0] + " " + output, BLUE)],
    {...PLOT, height: 380, margin: {l: 76, r: 12, t: 34, b: 44}, shapes: isWhole ? [...source.kept.map(t => mark(t, INK)), ...source.rejected.map(t => mark(t, PALE))] : [],
    xaxis: {title: {text: "time in record " + source.number + " / s" + (isWhole ? "; dotted: hits, grey where left out" : ""), standoff: 4}, range: [x[0], last], gridcolor: GRID, zeroline: false, ticks: "outside", anchor: "y2"},
    yaxis: {domain: [0.54, 1], gridcolor: GRID, title: {text: push[0] + " / " + push[1]}}, yaxis2: {domain: [0, 0.46], gridcolor: GRID, title: {text: motion[0] + " / " + motion[1]}},
    legend: {orientation: "h", x: 0, y: 1.01, xanchor: "left", yanchor: "bottom"}}, CONFIG);
  press(byId("hits-chosen"));
}

// Both densities over their largest value, in one axis (seed, fig. 1.5b).
function hitsNormalised() {
  const {row, output} = hitsUnits(), source = row.densities, last = floats(source.freq);
  const curve = (values, name, color) => { const most = Math.max(...values); return density(source, Array.from(values, v => v / most), "y", name, {color, width: 1.5}); };
  const data = [curve(channelOf(source), "motion " + output, BLUE), curve(floats(source.force), "force " + row.reference, RED)];
  Plotly.react("hits-normalised", data, {...PLOT, height: 300, margin: {l: 76, r: 12, t: 34, b: 44},
    xaxis: {title: {text: "frequency / Hz", standoff: 4}, range: [0, last[last.length - 1]], gridcolor: GRID, zeroline: false, ticks: "outside"},
    yaxis: {type: "log", gridcolor: GRID, zeroline: false, exponentformat: "power", ...logAxis(data.map(t => t.y)), title: {text: "amplitude spectral density<br>over its largest value"}},
    legend: {orientation: "h", x: 0, y: 1.01, xanchor: "left", yanchor: "bottom"}}, CONFIG);
}

function hits() {
  if (!DATA.hits.length) return;
  hitsTable();
  hitsChooser();
  hitsChannels();
  hitsPlot();
}
