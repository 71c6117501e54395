// Error budget of a plant: cumulative spectra, shares as bars, Bode plots with bands, poles.
const ERRORS = DATA.errors, CURVES = DATA.curves;
const state = {error: "0", curve: 0, axis: "log"};
const AFTER = BLUE, BEFORE_COLOR = ORANGE;

const line = (x, y, name, color, extra = {}) => ({type: "scatter", mode: "lines", x, y, name, line: {color, width: 1.6, ...extra.line},
  hovertemplate: "%{x:.4g} Hz: %{y:.4g}<extra>" + escaped(name) + "</extra>", ...extra.trace});

// ---- the spectrum of one error ---------------------------------------------------------------

function spectrum() {
  const row = ERRORS[Number(state.error)], data = [], cas = row.cumulative, asd = row.density;
  data.push(line(floats(cas.freq), floats(cas.values), DATA.after, AFTER, {line: {width: 2.4}, trace: {legendgroup: "after"}}));
  if (cas.before) data.push(line(floats(cas.beforeFreq), floats(cas.before), DATA.before, BEFORE_COLOR, {line: {dash: "dash"}, trace: {legendgroup: "before"}}));
  const lower = {yaxis: "y2"}, freq = floats(asd.freq), total = Array.from(floats(asd.total), v => v > 0 ? v : null), sizes = [total];
  data.push(line(freq, total, DATA.after, AFTER, {line: {width: 2.4}, trace: {...lower, showlegend: false, legendgroup: "after"}}));
  if (asd.before) {
    const before = Array.from(floats(asd.before), v => v > 0 ? v : null);
    sizes.push(before);
    data.push(line(floats(asd.beforeFreq), before, DATA.before, BEFORE_COLOR, {line: {dash: "dash"}, trace: {...lower, showlegend: false, legendgroup: "before"}}));
  }
  asd.sources.forEach((packed, k) => {
    const values = Array.from(floats(packed), v => v > 0 ? v : null);
    if (values.some(v => v !== null)) data.push(line(freq, values, DATA.sources[k], HUES[(k + 2) % HUES.length], {line: {width: 1.1}, trace: lower}));
  });
  const x = {type: "log", dtick: "D2", gridcolor: GRID, zeroline: false, ticks: "outside", range: [Math.log10(DATA.band[0]), Math.log10(DATA.band[1])], anchor: "y2"};
  const layout = {...PLOT, height: 560, margin: {l: 76, r: 12, t: 16, b: 46}, xaxis: {...x, title: {text: "Hz", standoff: 4}},
    yaxis: {domain: [0.54, 1], gridcolor: GRID, rangemode: "tozero", title: {text: "rms above / " + row.unit}},
    yaxis2: {domain: [0, 0.46], type: "log", gridcolor: GRID, exponentformat: "power", ...logAxis(sizes), title: {text: row.unit + " / √Hz"}},
    legend: {x: 1.01, y: 1, xanchor: "left"}, showlegend: true};
  Plotly.react("spectrum", data, layout, CONFIG);
  bars("sources", row.sources, "%", value => value < 0);
  bars("modes-of-error", row.modes, "%", value => value < 0);
  bars("joints", row.joints, "%", value => value < 0);
  bars("touches", row.touches, row.unit, value => value > 0);
  press(byId("choice"));
}

// Bars of shares or changes; what is against the reader is orange.
function bars(place, rows, unit, isAdverse) {
  const names = rows.map(r => r[0]), values = rows.map(r => r[1]), span = Math.max(...values.map(Math.abs), 1e-12);
  const low = Math.min(0, ...values), top = Math.max(0, ...values), room = 0.3 * Math.max(top - low, span);
  const data = [{type: "bar", orientation: "h", y: names.map((_, k) => k), x: values, text: values.map(v => (unit === "%" ? v.toFixed(1) : (v > 0 ? "+" : "") + v.toPrecision(3)) + " " + unit),
    textposition: "outside", cliponaxis: false, marker: {color: values.map(v => isAdverse(v) ? ORANGE : BLUE)}, hovertext: names, hovertemplate: "%{hovertext}: %{text}<extra></extra>"}];
  const layout = {...PLOT, height: 60 + 24 * names.length, margin: {l: 10, r: 10, t: 4, b: 30}, bargap: 0.35, showlegend: false,
    xaxis: {gridcolor: GRID, zerolinecolor: GREY, range: [low < 0 ? low - room : 0, top > 0 ? top + room : 0], ticksuffix: unit === "%" ? " %" : ""},
    yaxis: {tickvals: names.map((_, k) => k), ticktext: names.map(n => escaped(n) + " "), range: [names.length - 0.5, -0.5], automargin: true, showgrid: false, zeroline: false}};
  Plotly.react(place, data, layout, BARE);
}

// ---- Bode plots with bands -------------------------------------------------------------------

// Return filled areas between two curves, one for each run without gaps.
function band(x, low, high, extra) {
  const runs = [];
  low.forEach((v, k) => { if (v !== null) (k && low[k - 1] !== null ? runs[runs.length - 1] : runs[runs.push([]) - 1]).push(k); });
  return runs.map((run, k) => ({type: "scatter", mode: "lines", line: {width: 0}, hoverinfo: "skip", legendgroup: "band", fill: "toself",
    fillcolor: "rgba(31,111,184,0.22)", showlegend: !k, ...extra, ...(k ? {showlegend: false} : {}),
    x: [...run.map(n => x[n]), ...run.slice().reverse().map(n => x[n])], y: [...run.map(n => low[n]), ...run.slice().reverse().map(n => high[n])]}));
}

function bode() {
  const k = state.curve, port = CURVES.ports[k], freq = floats(CURVES.freq), count = freq.length, data = [], sizes = [];
  const after = polar(complexes(floats(CURVES.values), k, count));
  sizes.push(after.size);
  if (CURVES.magnitude) {
    const spread = floats(CURVES.magnitude).slice(k * count, (k + 1) * count), turn = floats(CURVES.phase).slice(k * count, (k + 1) * count);
    const edge = sign => after.size.map((v, n) => v === null ? null : v * Math.exp(sign * 1.96 * spread[n]));
    const angle = sign => after.angle.map((v, n) => v === null ? null : v + sign * 1.96 * turn[n] * 180 / Math.PI);
    data.push(...band(freq, edge(-1), edge(1), {name: "95 % interval"}), ...band(freq, angle(-1), angle(1), {yaxis: "y2", showlegend: false}));
  }
  if (CURVES.before) {
    const before = polar(complexes(floats(CURVES.before), k, count));
    sizes.push(before.size);
    data.push(...bodeTraces(freq, before, DATA.before, {color: BEFORE_COLOR, width: 1.5, dash: "dash"}));
  }
  data.push(...bodeTraces(freq, after, DATA.after, {color: AFTER, width: 2}, {legendgroup: "after"}));
  const x = {type: state.axis, ...(state.axis === "log" ? {dtick: "D2"} : {}), gridcolor: GRID, zeroline: false, ticks: "outside", anchor: "y2"};
  Plotly.react("bode", data, {...PLOT, height: 540, margin: {l: 76, r: 12, t: 34, b: 46}, title: {text: escaped(port[0]), font: {size: 14}},
    xaxis: {...x, title: {text: "Hz", standoff: 4}}, ...bodeAxes(sizes, port[1]), legend: {x: 1.01, y: 1, xanchor: "left"}, showlegend: true}, CONFIG);
  press(byId("curves"));
}

// ---- poles -----------------------------------------------------------------------------------

function poles() {
  const trace = (rows, name, color, symbol) => ({type: "scatter", mode: "markers", x: rows.map(r => r[0]), y: rows.map(r => 100 * r[1]), name,
    marker: {color, symbol, size: 9, line: {color, width: 1.6}}, hovertemplate: "%{x:.4g} Hz, %{y:.3g} %<extra>" + escaped(name) + "</extra>"});
  const data = [];
  if (DATA.samples.length) data.push({...trace(DATA.samples, "machines of the posterior", "rgba(31,111,184,0.25)", "circle"), marker: {color: "rgba(31,111,184,0.25)", size: 4}});
  if (DATA.polesBefore) data.push(trace(DATA.polesBefore, DATA.before, BEFORE_COLOR, "x-thin"));
  data.push(trace(DATA.poles, DATA.after, AFTER, "circle-open"));
  Plotly.react("poles", data, {...PLOT, height: 400, margin: {l: 76, r: 12, t: 16, b: 46}, showlegend: true, legend: {x: 1.01, y: 1, xanchor: "left"},
    xaxis: {type: "log", dtick: "D2", gridcolor: GRID, zeroline: false, ticks: "outside", title: {text: "natural frequency / Hz", standoff: 4}},
    yaxis: {type: "log", dtick: "D2", gridcolor: GRID, title: {text: "damping ratio / %"}, exponentformat: "none"}}, CONFIG);
}

// ---- struts ----------------------------------------------------------------------------------

function struts() {
  if (!DATA.struts) return;
  const data = [];
  DATA.struts.loci.forEach((locus, k) => {
    const color = HUES[k % HUES.length], marker = {type: "scatter", mode: "markers", showlegend: false, hoverinfo: "skip", legendgroup: locus.name};
    data.push({type: "scatter", mode: "lines", x: locus.x, y: locus.y, name: locus.name, legendgroup: locus.name, line: {color, width: 1.8},
      customdata: locus.gain, hovertemplate: "%{x:.4g} + %{y:.4g}i Hz, g = %{customdata:.4g} rad/s<extra>" + escaped(locus.name) + "</extra>"});
    data.push({...marker, x: [locus.best[0]], y: [locus.best[1]], marker: {color, size: 10, symbol: "circle-open", line: {color, width: 2}}});
    if (!k) data.push({...marker, x: [locus.x[0]], y: [locus.y[0]], marker: {color: INK, size: 10, symbol: "x-thin", line: {color: INK, width: 2}}});
  });
  const axis = {gridcolor: GRID, zerolinecolor: GREY};
  Plotly.react("locus", data, {...PLOT, height: 420, margin: {l: 60, r: 10, t: 8, b: 46}, legend: {orientation: "h", y: -0.18},
    xaxis: {...axis, title: {text: "real part / Hz", standoff: 4}}, yaxis: {...axis, rangemode: "tozero", title: {text: "imaginary part / Hz"}}}, CONFIG);
  const frames = DATA.struts.frames;
  if (!frames) { byId("coupling").textContent = "Frames need six struts."; return; }
  const freq = floats(frames.freq), curves = frames.names.map((name, k) => line(freq, floats(frames.coupling[k]), name, HUES[k]));
  Plotly.react("coupling", curves, {...PLOT, height: 420, margin: {l: 66, r: 10, t: 8, b: 46}, legend: {orientation: "h", y: -0.18}, showlegend: true,
    xaxis: {type: "log", dtick: "D2", gridcolor: GRID, title: {text: "Hz", standoff: 4}},
    yaxis: {type: "log", gridcolor: GRID, exponentformat: "power", title: {text: "largest coupling"}}}, CONFIG);
}

function panels() {
  buttons(byId("choice"), "error", ERRORS.map((row, k) => [String(k), row.name]), spectrum);
  const select = element("select");
  CURVES.ports.forEach((port, k) => select.add(new Option(port[0], String(k))));
  select.onchange = () => { state.curve = Number(select.value); bode(); };
  byId("curves").append(select, element("span", "", {className: "gap"}));
  buttons(byId("curves"), "axis", [["log", "log"], ["linear", "linear"]], bode);
}

panels();
spectrum();
bode();
poles();
struts();
