// Measured and simulated modes: table, spectra, match probabilities, ratios, amplitudes by hand.
const MODES = DATA.modes, FREQ = floats(DATA.freq), PLACES = DATA.places, IMPACTS = DATA.impacts;
const state = {mode: 0, amplitude: 5, playing: !matchMedia("(prefers-reduced-motion: reduce)").matches,
               place: 0, sensor: 0, above: 0, below: Math.max(0, PLACES.indexOf(DATA.reference)), reading: "reference"};
state.above = Math.max(0, PLACES.findIndex((_, k) => k !== state.below));
const AMPLITUDE = shorts(DATA.amplitude), RATIOS = floats(DATA.ratios);
const CLOSENESS = {reference: shorts(DATA.closeness), largest: shorts(DATA.closeness_largest)};
const SIMULATED = ORANGE;

const isMeasured = mode => mode.frequency !== null;
const label = text => text.replace(":+t", " ").replace(":-t", " −");

// ---- the table -----------------------------------------------------------------------------

function table() {
  const body = document.querySelector("#modes tbody");
  MODES.forEach((mode, k) => {
    const row = element("tr"), none = "-", own = isMeasured(mode), is = mode.simulated !== null;
    row.append(...[String(k + 1), own ? digits(mode.frequency) : none, own ? deviation(mode.frequency_sd) : none,
      own ? (100 * mode.damping).toFixed(2) : none, is ? String(mode.simulated) : "none", is ? digits(mode.simulated_frequency) : none,
      own && is ? (100 * (mode.frequency / mode.simulated_frequency - 1)).toFixed(1) : none, own ? mode.probability.toFixed(3) : none,
      own && is ? mode.mac.toFixed(2) : none].map(text => element("td", text)));
    if (own && is && mode.probability < 0.8) row.cells[7].className = "weak";
    row.onclick = () => choose(k);
    body.append(row);
  });
  arrowKeys();
}

function choose(k) {
  const mode = MODES[k], simulated = mode.simulated === null ? "no simulated mode" : "simulated mode " + mode.simulated + " at " + digits(mode.simulated_frequency) + " Hz";
  turn(k, (isMeasured(mode) ? digits(mode.frequency) + " Hz measured, " : "not measured, ") + simulated);
  byId("evidence").textContent = isMeasured(mode) ? "Channels that distinguish this match from the next candidate: " + mode.telling.map(label).join(", ") + "." : "";
  spectra(); ratio(); closeness(); circles();
}

// ---- along frequency -----------------------------------------------------------------------

const row = (values, first, k) => Array.from({length: FREQ.length}, (_, f) => sizeOf(values[(first * IMPACTS.length + k) * FREQ.length + f]));
const X = Array.from(FREQ), CLEAR = {...PLOT, margin: {l: 70, r: 16, t: 26, b: 44}, hovermode: "closest"};
const XAXIS = {range: DATA.band, gridcolor: GRID, title: {text: "frequency / Hz"}};

const upright = (x, y0, y1, color, width, dash) => ({type: "line", xref: "x", yref: "paper", x0: x, x1: x, y0, y1, line: {color, width, dash}});

function impacts(values, first, extra = {}) {
  return IMPACTS.map((name, k) => ({type: "scatter", mode: "lines", x: X, y: row(values, first, k), name, line: {color: HUES[(k + 2) % HUES.length], width: 1},
    hovertemplate: "%{x:.2f} Hz: %{y:.3g}<extra>" + escaped(name) + "</extra>", ...extra}));
}

// As fig. 11 of the paper: the upper part joins each measured mode with its simulated mode.
function spectra() {
  const found = impacts(AMPLITUDE, state.place), shapes = [], notes = [], top = 0.72;
  MODES.forEach((mode, k) => {
    const width = k === state.mode ? 3 : 1.3;
    if (isMeasured(mode)) shapes.push(upright(mode.frequency, 0, top + 0.06, BLUE, width));
    if (mode.simulated === null) return;
    shapes.push(upright(mode.simulated_frequency, 0.92, 0.97, SIMULATED, width), upright(mode.simulated_frequency, 0, top, SIMULATED, 0.7, "dot"));
    notes.push({x: mode.simulated_frequency, y: 0.975, xref: "x", yref: "paper", yanchor: "bottom", text: String(mode.simulated), showarrow: false, font: {size: 11, color: SIMULATED}});
    if (isMeasured(mode)) shapes.push({type: "line", xref: "x", yref: "paper", x0: mode.frequency, x1: mode.simulated_frequency, y0: top + 0.06, y1: 0.92, line: {color: INK, width}});
  });
  separate(notes);
  const y = {type: "log", domain: [0, top], gridcolor: GRID, exponentformat: "power", title: {text: "amplitude at " + PLACES[state.place] + " / m/s"}, ...logAxis(found.map(t => t.y))};
  Plotly.react("spectra", found, {...CLEAR, height: 430, margin: {...CLEAR.margin, t: 44}, shapes, annotations: notes, xaxis: XAXIS, yaxis: y, legend: {orientation: "h", y: -0.16}}, CONFIG);
}

// Move the labels of two close frequencies apart, so that both can be read.
function separate(notes) {
  const close = 0.015 * (DATA.band[1] - DATA.band[0]);
  notes.sort((a, b) => a.x - b.x);
  notes.forEach((note, k) => {
    if (k && note.x - notes[k - 1].x < close) { notes[k - 1].xanchor = "right"; note.xanchor = "left"; }
  });
}

function ratio() {
  const mode = MODES[state.mode], shapes = [], own = isMeasured(mode) ? upright(mode.frequency, 0, 1, BLUE, 1.5) : null;
  const lines = IMPACTS.map((name, k) => {
    const above = row(AMPLITUDE, state.above, k), below = row(AMPLITUDE, state.below, k);
    return {type: "scatter", mode: "lines", x: X, y: above.map((v, f) => v === null || !below[f] ? null : v / below[f]), name, line: {color: HUES[(k + 2) % HUES.length], width: 1.2},
      hovertemplate: "%{x:.2f} Hz: %{y:.3g}<extra>" + escaped(name) + "</extra>"};
  });
  if (own) shapes.push(own);
  if (mode.at !== null) {
    const value = RATIOS[mode.at * PLACES.length + state.above] / RATIOS[mode.at * PLACES.length + state.below];
    lines.push({type: "scatter", mode: "lines", x: [X[0], X[X.length - 1]], y: [value, value], name: "simulated mode " + mode.simulated, line: {color: SIMULATED, width: 2, dash: "dash"}});
  }
  const y = {type: "log", gridcolor: GRID, exponentformat: "power", title: {text: PLACES[state.above] + " over " + PLACES[state.below]}, ...logAxis(lines.map(t => t.y))};
  Plotly.react("ratio", lines, {...CLEAR, height: 320, shapes, xaxis: XAXIS, yaxis: y, legend: {orientation: "h", y: -0.22}}, CONFIG);
}

// As figs. 9 and 10 of the paper.
function closeness() {
  const mode = MODES[state.mode], place = byId("closeness");
  place.hidden = byId("reading").hidden = mode.at === null;
  if (mode.at === null) return;
  const lines = impacts(CLOSENESS[state.reading], mode.at, {opacity: 0.55});
  const mean = X.map((_, f) => lines.reduce((sum, t) => sum + (t.y[f] ?? 0), 0) / lines.length);
  lines.push({type: "scatter", mode: "lines", x: X, y: mean, name: "mean", line: {color: INK, width: 2.4}});
  const shapes = [upright(mode.simulated_frequency, 0, 1, SIMULATED, 1.5, "dash")];
  if (isMeasured(mode)) shapes.push(upright(mode.frequency, 0, 1, BLUE, 1.5));
  Plotly.react("closeness", lines, {...CLEAR, height: 300, shapes, xaxis: XAXIS, yaxis: {gridcolor: GRID, rangemode: "tozero", title: {text: "1 / norm²"}},
    legend: {orientation: "h", y: -0.22}}, CONFIG);
}

function pick(place, key, text, redraw) {
  const select = element("select");
  PLACES.forEach((name, k) => select.append(element("option", name, {value: k, selected: k === state[key]})));
  select.onchange = () => { state[key] = Number(select.value); redraw(); };
  const box = element("label", text + " ", {className: "soft"});
  box.append(select);
  byId(place).append(box);
}

function readings() {
  const select = element("select");
  for (const [value, text] of [["reference", "that place"], ["largest", "the largest of each mode"]]) select.append(element("option", text, {value}));
  select.onchange = () => { state.reading = select.value; closeness(); };
  const box = element("label", "simulated ratios to ", {className: "soft"});
  box.append(select);
  byId("reading").append(box);
}

// ---- match probabilities -------------------------------------------------------------------

function heat(place, packed, title, text) {
  const values = floats(packed), count = DATA.shown.length, measured = MODES.slice(0, DATA.measured);
  const z = measured.map((_, m) => Array.from(values.slice(m * count, (m + 1) * count)));
  Plotly.newPlot(place, [{type: "heatmap", z, x: DATA.shown.map((n, k) => n + ": " + digits(DATA.shown_hz[k])), y: measured.map(mode => digits(mode.frequency)),
    zmin: 0, zmax: 1, colorscale: BLUES, colorbar: {thickness: 10}, text: z.map(r => r.map(v => v < 0.005 ? "" : v.toFixed(2))), texttemplate: "%{text}",
    hovertemplate: "measured %{y} Hz, simulated %{x} Hz: %{z:.3g}<extra></extra>"}],
    {...PLOT, height: 340, margin: {l: 70, r: 10, t: 34, b: 60}, title: {text: title, font: {size: 14}}, xaxis: {type: "category", title: {text: "simulated / Hz"}},
      yaxis: {type: "category", title: {text: "measured / Hz"}}, annotations: []}, BARE);
  byId(place).on("plotly_click", event => choose(event.points[0].pointIndex[0]));
}

// ---- by hand -------------------------------------------------------------------------------

function hands() {
  const body = document.querySelector("#hands tbody");
  MODES.forEach((mode, k) => (mode.by_hand ?? []).forEach((hand, n) => {
    const line = element("tr"), off = Math.abs(hand.maximum - hand.least_squares) / Math.abs(hand.least_squares);
    const name = text => element("td", text, {className: "name"});
    line.append(element("td", n ? "" : String(k + 1)), name(label(hand.channel)), name(hand.impact.replace(/.*[\\/]/, "")),
      ...[digits(hand.lower), digits(hand.peak), digits(hand.upper), (100 * hand.damping).toFixed(2), percentOf(circleOf(mode, hand.channel).damping), n ? "" : (100 * mode.damping).toFixed(2),
        hand.least_squares.toPrecision(4), hand.maximum.toPrecision(4), (100 * off).toFixed(1)].map(text => element("td", text)));
    body.append(line);
  }));
}

byId("reference").textContent = DATA.reference;
readings();
table();
pick("place", "place", "place", spectra);
pick("over", "above", "place", ratio);
pick("over", "below", "over", ratio);
byId("matches").hidden = !DATA.measured || !DATA.shown.length;
if (!byId("matches").hidden) { heat("probability", DATA.probability, "Probability"); heat("mac", DATA.mac, "MAC of signed shapes"); }
hands();
sensors();
film();
start();
chooseFirst();
