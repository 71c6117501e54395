// Measured and synthesised FRFs, coherence, rigid-body reconstruction, errors, MAC and COMAC.
const UNITS = DATA.units;
const INPUTS = DATA.inputs, LINES = FREQ.length, MODEL = DATA.model;
const MEASURED = floats(DATA.frf.measured), NOISE = floats(DATA.frf.noise), IS_MEASURED = integers(DATA.frf.is_measured);
const COHERENCE = floats(DATA.frf.coherence), HAS_COHERENCE = integers(DATA.frf.has_coherence);
const AS_SOLID = floats(DATA.frf.as_solid), HAS_SOLID = integers(DATA.frf.has_solid);
const PARTICIPATION = floats(MODEL.participation), LOWER = floats(MODEL.lower), UPPER = floats(MODEL.upper);
const ERRORS = Object.fromEntries(Object.entries(DATA.error).map(([name, text]) => [name, floats(text)]));
const times = ([a, b], [c, d]) => [a * c - b * d, a * d + b * c];
const over = ([a, b], [c, d]) => { const size = c * c + d * d; return [(a * c + b * d) / size, (b * c - a * d) / size]; };

// ---- synthesis -----------------------------------------------------------------------------

// Return pole and residue phi_o l_i of each mode; for an input that was not hit phi_o phi_i / a_r.
function residues(out, inp, byShapes) {
  if (byShapes) return MODEL.full.map(mode => [MODEL.poles[mode], over(times(entry(mode, out), entry(mode, inp)), MODEL.modal_a[mode])]);
  return MODEL.poles.map((pole, mode) => {
    const k = 2 * (INPUTS.length * mode + inp);
    return [pole, times(entry(mode, out), [PARTICIPATION[k], PARTICIPATION[k + 1]])];
  });
}

// s^q [sum_r (R_r / (s - s_r) + conjugate term) + v / s^2 + u]
function synthesis(out, inp, byShapes) {
  const rows = residues(out, inp, byShapes), cell = out * INPUTS.length + inp, values = [];
  const [v, u] = byShapes ? [0, 0] : [LOWER[cell], UPPER[cell]];
  for (let k = 0; k < LINES; k++) {
    const s = [MODEL.decay, 2 * Math.PI * FREQ[k]], power = times(s, s), low = over([v, 0], power);
    let sum = [u + low[0], low[1]];
    rows.forEach(([[pr, pi], [re, im]]) => {
      const term = over([re, im], [s[0] - pr, s[1] - pi]), conjugate = over([re, -im], [s[0] - pr, s[1] + pi]);
      sum = [sum[0] + term[0] + conjugate[0], sum[1] + term[1] + conjugate[1]];
    });
    for (let q = 0; q < MODEL.order; q++) sum = times(sum, s);
    values.push(sum);
  }
  return values;
}

const stored = (values, cell) => complexes(values, cell, LINES);
const curves = (values, ...rest) => bodeTraces(FREQ, polar(values), ...rest);

// ---- the chosen FRF ------------------------------------------------------------------------

// Inputs to choose from: those that were hit, then all remaining outputs if a_r is known.
const CHOICES = [...INPUTS.map((name, k) => ({name, row: k, hit: true})),
  ...(DATA.scaled ? OUTPUTS.map((name, k) => ({name, row: k, hit: false})).filter(c => !INPUTS.includes(c.name)) : [])];

function frf() {
  const choice = CHOICES[state.inp], out = state.out, cell = out * INPUTS.length + choice.row, there = choice.hit && IS_MEASURED[cell] === 1, data = [];
  const synthesised = synthesis(out, choice.row, !choice.hit), sizes = [synthesised.map(v => Math.hypot(...v) || null)];
  if (there) {
    const measured = stored(MEASURED, cell), start = LINES * cell;
    sizes.push(measured.map(v => Math.hypot(...v) || null), Array.from(NOISE.slice(start, start + LINES), v => v || null));
    data.push({type: "scatter", mode: "lines", x: FREQ, y: NOISE.slice(start, start + LINES), name: "noise, one standard deviation",
      line: {color: PALE, width: 1}, hovertemplate: "%{x:.5g} Hz: %{y:.3g}<extra>noise</extra>"});
    data.push({type: "scatter", mode: "lines", x: FREQ, y: measured.map((v, k) => Math.hypot(v[0] - synthesised[k][0], v[1] - synthesised[k][1])), name: "difference",
      line: {color: "#f0c596", width: 1}, visible: "legendonly", hovertemplate: "%{x:.5g} Hz: %{y:.3g}<extra>difference</extra>"});
    data.push(...curves(measured, "measured", {color: INK, width: 1.8}));
    if (HAS_SOLID[cell]) data.push(...curves(stored(AS_SOLID, cell), "as a solid body", {color: GREEN, width: 1.4}, {visible: "legendonly"}));
  }
  data.push(...curves(synthesised, choice.hit ? "synthesised" : "synthesised, by shapes and modal A alone", {color: ORANGE, width: 1.5}));
  const drivePoint = OUTPUTS.indexOf(choice.name);
  if (choice.hit && DATA.scaled && drivePoint >= 0)
    data.push(...curves(synthesis(out, drivePoint, true), "by shapes and modal A alone", {color: BLUE, width: 1.2, dash: "dot"}, {visible: "legendonly"}));
  if (COHERENCE.length) data.push(coherence(cell, there && HAS_COHERENCE[cell] === 1));
  for (const trace of data) trace.uid = trace.name + (trace.yaxis || "");  // keeps the choices of the legend
  const [top, middle] = COHERENCE.length ? [0.47, [0.22, 0.43]] : [0.36, [0, 0.3]], third = {range: [0, 1.03], domain: [0, 0.17], gridcolor: GRID, zeroline: false, title: {text: "coherence"}};
  Plotly.react("frf", data, {...PLOT, height: COHERENCE.length ? 660 : 540, margin: {l: 76, r: 12, t: 54, b: 44}, shapes: marks(),
    xaxis: {title: {text: "frequency / Hz", standoff: 4}, gridcolor: GRID, zeroline: false, ticks: "outside", anchor: COHERENCE.length ? "y3" : "y2"},
    ...(COHERENCE.length ? {yaxis3: third} : {}),
    ...bodeAxes(sizes, DATA.quantity + " / (" + UNITS.motion[out] + "/" + (choice.hit ? UNITS.force : UNITS.output_as_force)[choice.row] + ")", [top, middle]),
    legend: {orientation: "h", x: 0, y: 1.01, xanchor: "left", yanchor: "bottom", uirevision: "kept"}}, CONFIG);
  byId("frf-remark").textContent = remark(choice, cell, there);
  byId("out").value = out; byId("inp").value = state.inp;
  const heat = byId("error-map");
  if (heat.layout) Plotly.relayout(heat, {shapes: box()});
}

function coherence(cell, there) {
  const y = there ? COHERENCE.slice(LINES * cell, LINES * (cell + 1)) : Array(LINES).fill(null);
  return {type: "scatter", mode: "lines", x: FREQ, y, yaxis: "y3", name: "coherence", showlegend: false, line: {color: INK, width: 1.3},
    hovertemplate: "%{x:.5g} Hz: %{y:.4f}<extra>coherence</extra>"};
}

// Difference between a measured FRF and its rigid-body reconstruction, relative to its norm.
function solidDifference(cell) {
  let difference = 0, size = 0;
  for (let k = 2 * LINES * cell; k < 2 * LINES * (cell + 1); k++) { difference += (MEASURED[k] - AS_SOLID[k]) ** 2; size += MEASURED[k] ** 2; }
  return Math.sqrt(difference / size);
}

function remark(choice, cell, there) {
  if (!choice.hit) return "Not measured: synthesised from the shapes and their scaling (modal A) alone, without the residual terms of modes outside the band: these are known only for inputs that were hit.";
  if (!there) return "This FRF was not measured.";
  const share = name => (100 * ERRORS[name][cell]).toPrecision(3) + " %";
  let text = "Error " + share("error") + " of the measured FRF; the noise alone would cause " + share("noise") + "; FRAC " + ERRORS.frac[cell].toFixed(4) + ".";
  if (ERRORS.reciprocal_error.length) text += " By shapes and modal A alone, without residual terms: " + share("reciprocal_error") + ".";
  if (HAS_SOLID[cell]) text += " Difference to the motion of a solid body: " + (100 * solidDifference(cell)).toPrecision(3) + " %.";
  return text;
}

function chooser() {
  const place = byId("cell"), out = element("select", undefined, {id: "out"}), inp = element("select", undefined, {id: "inp"});
  OUTPUTS.forEach((name, k) => out.add(new Option(name + "  (" + DATA.bodies[k] + ")", k)));
  const groups = [["hit", CHOICES.filter(c => c.hit)], ["synthesised only", CHOICES.filter(c => !c.hit)]];
  for (const [name, list] of groups) if (list.length) {
    const group = element("optgroup", undefined, {label: name});
    list.forEach(choice => group.append(new Option(choice.name, CHOICES.indexOf(choice))));
    inp.append(group);
  }
  out.onchange = () => { state.out = Number(out.value); frf(); };
  inp.onchange = () => { state.inp = Number(inp.value); frf(); };
  place.append("motion at ", out, " per force at ", inp);
}

// ---- the map of errors ---------------------------------------------------------------------

const MAPS = [["error", "error"], ["ratio", "error / noise"], ["frac", "1 − FRAC"]];
const LEAST = {error: 10, ratio: 2, frac: 0.05};  // lowest value of the darkest blue, so that small errors look small
const WIDE = OUTPUTS.length >= INPUTS.length;  // outputs along x

function box() {
  const choice = CHOICES[state.inp];
  if (!choice.hit) return [];
  const [x, y] = WIDE ? [state.out, choice.row] : [choice.row, state.out];
  return [{type: "rect", x0: x - 0.5, x1: x + 0.5, y0: y - 0.5, y1: y + 0.5, line: {color: ORANGE, width: 2}}];
}

const ticks = (names, size) => names.length > 130 ? {showticklabels: false} : {tickvals: names.map((_, k) => k), ticktext: names.map(label), tickfont: {size}};

function errorMap() {
  const value = (out, inp) => {
    const cell = out * INPUTS.length + inp;
    if (!IS_MEASURED[cell]) return null;
    if (state.map === "ratio") return ERRORS.noise[cell] > 0 ? ERRORS.error[cell] / ERRORS.noise[cell] : null;
    return state.map === "frac" ? 1 - ERRORS.frac[cell] : 100 * ERRORS.error[cell];
  };
  const [rows, columns] = WIDE ? [INPUTS, OUTPUTS] : [OUTPUTS, INPUTS];
  const z = rows.map((_, r) => columns.map((_, c) => WIDE ? value(c, r) : value(r, c)));
  const suffix = state.map === "error" ? " %" : "", names = rows.map((row, r) => columns.map((column, c) => WIDE ? column + " / " + row : row + " / " + column));
  const quiet = Array.from(IS_MEASURED.keys()).filter(cell => IS_MEASURED[cell] && ERRORS.noise[cell] <= 0.3);  // noisier channels do not set the colour scale
  const most = Math.max(...quiet.map(cell => value(Math.floor(cell / INPUTS.length), cell % INPUTS.length)));
  const trace = {type: "heatmap", z, customdata: names, xgap: 1, ygap: 1, colorscale: BLUES, zmin: 0, zmax: Math.max(LEAST[state.map], most), hoverongaps: false,
    hovertemplate: "%{customdata}: %{z:.3g}" + suffix + "<extra></extra>", colorbar: {thickness: 12, ticksuffix: suffix, outlinewidth: 0}};
  Plotly.react("error-map", [trace], {...PLOT, height: Math.min(900, 120 + 24 * rows.length + 40), margin: {l: 60, r: 10, t: 8, b: 62}, shapes: box(),
    xaxis: {...ticks(columns, 10), tickangle: -90, showgrid: false, zeroline: false, title: {text: WIDE ? "motion at" : "force at", standoff: 6}},
    yaxis: {...ticks(rows, 11), autorange: "reversed", showgrid: false, zeroline: false, title: {text: WIDE ? "force at" : "motion at", standoff: 6}}}, BARE)
    .then(place => {
      if (place.dataset.listens) return;
      place.dataset.listens = "yes";
      place.on("plotly_click", event => { const {x, y} = event.points[0]; [state.out, state.inp] = WIDE ? [x, y] : [y, x]; frf(); });
    });
  press(byId("errors"));
}

// ---- MAC and COMAC -------------------------------------------------------------------------

function macPlot(id, text, columns, titles, pairs) {
  const values = floats(text), n = columns.length, z = MODES.map((_, r) => Array.from(values.slice(r * n, (r + 1) * n)));
  if (!n || !MODES.length) { byId(id).textContent = ""; return; }
  const few = Math.max(n, MODES.length) <= 24;
  const trace = {type: "heatmap", z, zmin: 0, zmax: 1, colorscale: BLUES, xgap: 1, ygap: 1, colorbar: {thickness: 10, outlinewidth: 0, len: 0.6},
    text: z.map(row => row.map(v => v >= 0.3 ? v.toFixed(2) : "")), texttemplate: few ? "%{text}" : undefined, textfont: {size: 8},
    customdata: z.map((row, r) => row.map((_, c) => [digits(MODES[r].frequency), digits(columns[c])])),
    hovertemplate: "%{customdata[0]} Hz, %{customdata[1]} Hz: %{z:.3f}<extra></extra>"};
  const names = list => list.map(v => v.toFixed(1));
  const shapes = pairs.map(([r, c]) => ({type: "rect", x0: c - 0.5, x1: c + 0.5, y0: r - 0.5, y1: r + 0.5, line: {color: ORANGE, width: 1.5}}));
  Plotly.newPlot(id, [trace], {...PLOT, height: 500, margin: {l: 70, r: 4, t: 34, b: 66}, shapes, title: {text: titles[0], font: {size: 13}, x: 0.02, y: 0.985},
    xaxis: {tickvals: columns.map((_, k) => k), ticktext: names(columns), tickangle: -90, tickfont: {size: 10}, showgrid: false, zeroline: false, title: {text: titles[1], standoff: 6}},
    yaxis: {tickvals: MODES.map((_, k) => k), ticktext: names(MODES.map(m => m.frequency)), tickfont: {size: 10}, autorange: "reversed", showgrid: false, zeroline: false,
      title: {text: "measured / Hz", standoff: 6}}}, BARE).then(place => place.on("plotly_click", event => choose(event.points[0].y)));
}

function comacPlot(id, source, title) {
  const values = floats(source.values), known = integers(source.known), shown = Array.from(values.keys()).filter(k => known[k]);
  if (!shown.length) return;
  const lack = shown.map(k => 1 - values[k]), color = lack.map(v => v > 0.2 ? RED : v > 0.05 ? ORANGE : BLUE);
  Plotly.newPlot(id, [{type: "bar", x: shown.map((_, i) => i), y: lack, marker: {color}, customdata: shown.map(k => [OUTPUTS[k], DATA.bodies[k], values[k]]),
    hovertemplate: "%{customdata[0]} on %{customdata[1]}: COMAC %{customdata[2]:.4f}<extra></extra>"}],
    {...PLOT, height: 250, margin: {l: 60, r: 10, t: 30, b: 60}, bargap: 0.25, title: {text: title, font: {size: 13}, x: 0.02, y: 0.98},
     xaxis: {...ticks(shown.map(k => OUTPUTS[k]), 10), tickangle: -90, showgrid: false, zeroline: false},
     yaxis: {range: [0, Math.max(0.05, 1.1 * Math.max(...lack))], gridcolor: GRID, title: {text: "1 − COMAC"}}}, BARE);
}

film();
table();
indicators();
chooser();
buttons(byId("errors"), "map", MAPS, errorMap);
frf();
errorMap();
hits();
levels();
macPlot("auto-mac", DATA.mac, MODES.map(m => m.frequency), ["AutoMAC of the measured shapes", "measured / Hz"], []);
macPlot("other-mac", DATA.other.mac, DATA.other.freq, ["MAC of measured shapes with " + escaped(DATA.other.name), "reference / Hz"], DATA.other.pairs);
comacPlot("other-comac", DATA.other.comac, "COMAC of each channel over all mode pairs with " + escaped(DATA.other.name));
comacPlot("solid-comac", DATA.comac, "COMAC of each channel: measured shapes and shapes of its body as a solid");
solid();
reconstructions();
chooseFirst();
start();
