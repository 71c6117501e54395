// Measured modes: table, complexity plot, mode indicators and stabilisation diagram.
const MODES = DATA.modes, FREQ = floats(DATA.frf.freq);
const state = {mode: 0, amplitude: 5, playing: !matchMedia("(prefers-reduced-motion: reduce)").matches,
               out: 0, inp: 0, map: "error"};
const DASH = {color: GREY, width: 1, dash: "dot"};

// ---- the table of modes --------------------------------------------------------------------


function table() {
  const body = document.querySelector("#modes tbody");
  MODES.forEach((mode, k) => {
    const row = element("tr"), other = mode.other === null;
    row.append(...[String(k + 1), digits(mode.frequency), deviation(mode.frequency_sd), (100 * mode.damping).toFixed(2),
      deviation(100 * mode.damping_sd), mode.phase_collinearity.toFixed(3), mode.orders === null ? "-" : String(mode.orders),
      other ? "-" : digits(mode.other), other ? "-" : mode.other_mac.toFixed(2)].map(text => element("td", text)));
    if (mode.doubtful.length) {
      row.cells[0].textContent += " ?";
      row.cells[0].className = "weak";
      row.cells[0].title = "doubtful: " + mode.doubtful.join("; ");
    }
    if (mode.damping_sd > 0.15 * mode.damping) row.cells[4].className = "weak";
    if (mode.phase_collinearity < 0.8) row.cells[5].className = "weak";
    if (!other && mode.other_mac < 0.7) row.cells[8].className = "weak";
    row.onclick = () => choose(k);
    body.append(row);
  });
  arrowKeys();
}

function choose(k) {
  if (!MODES.length) return;
  const mode = MODES[k];
  turn(k, mode.frequency.toPrecision(5) + " Hz, damping " + (100 * mode.damping).toFixed(2) + " %");
  complexity();
  detail(mode);
  mark();
}

function detail(mode) {
  const list = byId("detail"), rows = [["pole s", complex(mode.real, mode.imaginary) + " rad/s"]];
  if (mode.modal_a_real !== null) rows.push(["modal A", complex(mode.modal_a_real, mode.modal_a_imaginary) + " kg/s"]);
  rows.push(["phase deviation", (mode.phase_deviation * 180 / Math.PI).toFixed(1) + "°"]);
  if (mode.reciprocity !== null) rows.push(["reciprocity", mode.reciprocity.toFixed(3)]);
  rows.push(["moves most", most(state.mode)], ["single-mode methods", byHand(mode.by_hand)]);
  list.replaceChildren(...rows.flatMap(([name, text]) => [element("dt", name), element("dd", text)]));
}

// Estimates by half-power (3 dB) widths and circle fits, a check at channels with a single mode.
function byHand(hand) {
  const texts = [], percent = value => (100 * value).toPrecision(3) + " %";
  if (hand.half_power_damping !== null) texts.push(`3 dB ${percent(hand.half_power_damping)} (${hand.half_power_channels})`);
  if (hand.circle_damping !== null)
    texts.push(`circle ${digits(hand.circle_frequency)} Hz, ${percent(hand.circle_damping)} (${hand.circle_channels})`);
  if (hand.amplitude_difference !== null) texts.push(`C differs by ${percent(hand.amplitude_difference)}`);
  return texts.join("; ") || hand.reason || "-";
}

const complex = (re, im) => re.toPrecision(4) + (im < 0 ? " − " : " + ") + Math.abs(im).toPrecision(4) + " i";

// ---- shapes --------------------------------------------------------------------------------

const OUTPUTS = DATA.outputs, ENTRIES = floats(DATA.model.shapes);  // mode after mode

function entry(mode, out) {
  const k = 2 * (OUTPUTS.length * mode + out);
  return [ENTRIES[k], ENTRIES[k + 1]];
}

const label = text => text.replace(/^acc(?=\d)/, "").replace(":+t", " ").replace(":-t", " −");

function most(mode) {
  const size = OUTPUTS.map((_, k) => Math.hypot(...entry(mode, k))), first = size.indexOf(Math.max(...size));
  return OUTPUTS[first] + " on " + DATA.bodies[first];
}

function complexity() {
  const values = OUTPUTS.map((_, k) => entry(state.mode, k)), reach = 1.1 * Math.max(...values.map(v => Math.hypot(...v))) || 1;
  const x = [], y = [];
  values.forEach(([re, im]) => { x.push(0, re, null); y.push(0, im, null); });
  const axis = {range: [-reach, reach], zeroline: true, zerolinecolor: PALE, gridcolor: GRID, nticks: 4, tickfont: {size: 9}, showticklabels: false};
  Plotly.react("complexity", [
    {type: "scatter", mode: "lines", x, y, line: {color: PALE, width: 1}, hoverinfo: "skip"},
    {type: "scatter", mode: "markers", x: values.map(v => v[0]), y: values.map(v => v[1]), marker: {color: BLUE, size: 4}, text: OUTPUTS,
     hovertemplate: "%{text}: %{x:.3g} + %{y:.3g} i<extra></extra>"}],
    {...PLOT, height: 230, margin: {l: 22, r: 6, t: 6, b: 24}, showlegend: false,
     xaxis: {...axis, title: {text: "Re", standoff: 2, font: {size: 11}}},
     yaxis: {...axis, title: {text: "Im", standoff: 2, font: {size: 11}}, scaleanchor: "x"}}, BARE);
}

// ---- indicators ----------------------------------------------------------------------------

const KINDS = [
  ["negative or too high damping", "#e3a59f", "x-thin", 4, "legendonly"], ["new pole", PALE, "circle", 3, true],
  ["frequency stable", GREY, "circle-open", 5, true], ["frequency and damping stable", BLUE, "circle-open", 6, true],
  ["stable, participation too", BLUE, "circle", 5, true]];

function diagram() {
  const source = DATA.indicators, order = integers(source.order), kind = integers(source.kind);
  const freq = floats(source.freq), damping = floats(source.damping);
  return KINDS.map(([name, color, symbol, size, visible], number) => {
    const poles = Array.from(kind.keys()).filter(k => kind[k] === number);
    return {type: "scatter", mode: "markers", name, visible, yaxis: "y", x: poles.map(k => freq[k]), y: poles.map(k => order[k]),
      marker: {color, symbol, size, line: {color, width: 1}}, customdata: poles.map(k => 100 * damping[k]),
      hovertemplate: "order %{y}: %{x:.4f} Hz, %{customdata:.3f} %<extra>" + name + "</extra>"};
  });
}

const SHADES = [INK, BLUE, ORANGE, GREEN, PURPLE, GREY];

function values(text, axis, name) {
  const all = floats(text), n = FREQ.length;
  return Array.from({length: Math.min(all.length / n, SHADES.length)}, (_, k) => ({type: "scatter", mode: "lines", x: FREQ, y: all.slice(k * n, (k + 1) * n),
    yaxis: axis, name: name + " " + (k + 1), showlegend: false, line: {color: SHADES[k], width: 1.3}, hovertemplate: "%{x:.5g} Hz: %{y:.3g}<extra>" + name + " " + (k + 1) + "</extra>"}));
}

// The unit of the singular values, squared; FRFs of several kinds have none in common.
function cmifUnit() {
  const motions = new Set(UNITS.motion), forces = new Set(UNITS.force);
  return motions.size === 1 && forces.size === 1 ? "(" + [...motions][0] + "/" + [...forces][0] + ")²" : "mixed units²";
}

function indicators() {
  const singular = values(DATA.indicators.cmif, "y2", "CMIF"), dips = values(DATA.indicators.mmif, "y3", "MMIF");
  const positive = singular.map(t => Array.from(t.y).map(v => v > 0 ? v : null));
  const y = {gridcolor: GRID, zeroline: false};
  Plotly.newPlot("indicators", [...diagram(), ...singular, ...dips], {...PLOT, height: 700, margin: {l: 76, r: 12, t: 52, b: 44}, hovermode: "closest",
    xaxis: {title: {text: "frequency / Hz", standoff: 4}, range: [FREQ[0], FREQ[FREQ.length - 1]], gridcolor: GRID, zeroline: false, ticks: "outside", anchor: "y3"},
    yaxis: {...y, domain: [0.6, 1], title: {text: "model order"}, rangemode: "tozero"},
    yaxis2: {...y, domain: [0.24, 0.56], type: "log", exponentformat: "power", ...logAxis(positive), title: {text: "CMIF / " + cmifUnit()}},
    yaxis3: {...y, domain: [0, 0.2], range: [-0.03, 1.03], title: {text: "MMIF"}},
    legend: {orientation: "h", x: 0, y: 1.01, xanchor: "left", yanchor: "bottom"}}, CONFIG).then(place => {
    place.on("plotly_click", event => choose(nearest(event.points[0].x)));
    mark();
  });
}

function nearest(frequency) {
  let best = 0;
  MODES.forEach((mode, k) => { if (Math.abs(mode.frequency - frequency) < Math.abs(MODES[best].frequency - frequency)) best = k; });
  return best;
}

// Return the modes as vertical lines; the chosen one is thicker.
function marks() {
  return MODES.map((mode, k) => ({type: "line", layer: "below", xref: "x", yref: "paper", x0: mode.frequency, x1: mode.frequency, y0: 0, y1: 1,
    line: k === state.mode ? {color: ORANGE, width: 1.6} : DASH}));
}

function mark() {
  for (const id of ["indicators", "frf"]) if (byId(id).layout) Plotly.relayout(id, {shapes: marks()});
}
