// Control loops of a plant: Bode and Nyquist plots of the loop gain with its margins, sensitivity.
const WORST = HUES[3], SHADE = "rgba(31,111,184,0.22)", VIEW = 2.2;  // of the Nyquist plot

// Return the loop gain of a curve: frequencies, pairs, magnitude and phase.
function loopGain(curve) {
  const freq = floats(curve.freq), values = complexes(floats(curve.values), 0, freq.length);
  return {freq, values, ...polar(values)};
}

function sensitivitySizes({values}) {
  return values.map(([re, im]) => 1 / Math.hypot(1 + re, im));
}

function complementarySizes({values}) {
  return values.map(([re, im]) => Math.hypot(re, im) / Math.hypot(1 + re, im));
}

const decibels = factor => (20 * Math.log10(factor)).toFixed(1) + " dB";

function loopBode(loop, gain) {
  const sizes = [gain.size], data = [];
  if (loop.worst) {
    const worst = loopGain(loop.worst);
    sizes.push(worst.size);
    data.push(...bodeTraces(worst.freq, worst, "worst machine", {color: WORST, width: 1.2}));
  }
  if (loop.before) {
    const before = loopGain(loop.before);
    sizes.push(before.size);
    data.push(...bodeTraces(before.freq, before, DATA.before, {color: ORANGE, width: 1.5, dash: "dash"}));
  }
  data.push(...bodeTraces(gain.freq, gain, "loop gain", {color: BLUE, width: 2}));
  const shapes = [{type: "line", xref: "paper", x0: 0, x1: 1, y0: 1, y1: 1, line: {color: INK, width: 1, dash: "dot"}},
    ...[-180, 180].map(y => ({type: "line", xref: "paper", x0: 0, x1: 1, yref: "y2", y0: y, y1: y, line: {color: INK, width: 1, dash: "dot"}}))];
  const mark = (x, y, axis, text) => data.push({type: "scatter", mode: "lines+markers+text", x: [x, x], y, yaxis: axis, showlegend: false, text: ["", text],
    textposition: "middle right", textfont: {size: 12}, line: {color: INK, width: 2}, marker: {color: INK, size: [0, 8]}, hovertemplate: "%{x:.4g} Hz: " + text + "<extra></extra>"});
  if (loop.gain[0]) mark(loop.gain[0], [1, 1 / loop.gain[1]], "y", " gain " + decibels(loop.gain[1]));
  if (loop.reduction[0]) mark(loop.reduction[0], [1, 1 / loop.reduction[1]], "y", " gain " + decibels(loop.reduction[1]));
  if (loop.phase[0]) mark(loop.phase[0], [loop.phase[1] < 0 ? 180 : -180, loop.phase[1] < 0 ? 180 + loop.phase[1] : loop.phase[1] - 180], "y2", " phase " + loop.phase[1].toFixed(1) + "°");
  const axes = bodeAxes(sizes, "loop gain");
  const x = {type: "log", dtick: "D2", gridcolor: GRID, zeroline: false, ticks: "outside", anchor: "y2", title: {text: "Hz", standoff: 4}};
  Plotly.react("loop-gain", data, {...PLOT, height: 520, margin: {l: 76, r: 12, t: 34, b: 46}, shapes, xaxis: x, ...axes,
    title: {text: "loop gain of " + escaped(loop.name), font: {size: 14}}, legend: {x: 1.01, y: 1, xanchor: "left"}, showlegend: true}, CONFIG);
}

function nyquist(loop, gain) {
  const trace = ({values, freq}, name, color, width, extra = {}) => {
    const near = values.map(v => Math.hypot(...v) < 4 * VIEW ? v : [null, null]);
    return {type: "scatter", mode: "lines", x: near.map(v => v[0]), y: near.map(v => v[1]), name, line: {color, width}, customdata: freq,
      hovertemplate: "%{customdata:.4g} Hz: %{x:.3g} + %{y:.3g}i<extra>" + escaped(name) + "</extra>", ...extra};
  };
  const data = loop.samples.map((curve, k) => trace(loopGain(curve), "machines of the posterior", SHADE, 1, {showlegend: !k, legendgroup: "samples", hoverinfo: "skip", hovertemplate: null}));
  if (loop.worst) data.push(trace(loopGain(loop.worst), "worst machine", WORST, 1.2));
  if (loop.before) data.push(trace(loopGain(loop.before), DATA.before, ORANGE, 1.5, {line: {color: ORANGE, width: 1.5, dash: "dash"}}));
  data.push(trace(gain, "loop gain", BLUE, 2));
  const points = [["critical point", -1, 0, "x-thin"]], angle = loop.phase[0] && loop.phase[1] * Math.PI / 180;
  if (loop.gain[0]) points.push(["gain margin " + decibels(loop.gain[1]), -1 / loop.gain[1], 0, "circle"]);
  if (loop.reduction[0]) points.push(["gain reduction " + decibels(loop.reduction[1]), -1 / loop.reduction[1], 0, "circle"]);
  if (loop.phase[0]) points.push(["phase margin " + loop.phase[1].toFixed(1) + "°", -Math.cos(angle), -Math.sin(angle), "square"]);
  const nearest = gain.values.reduce((best, [re, im]) => Math.hypot(1 + re, im) < Math.hypot(1 + best[0], best[1]) ? [re, im] : best, [1e9, 0]);
  points.push(["modulus margin " + loop.modulus[1].toFixed(2), ...nearest, "diamond"]);
  points.forEach(([name, x, y, symbol]) => data.push({type: "scatter", mode: "markers", x: [x], y: [y], name, marker: {symbol, size: 9, color: INK, line: {color: INK, width: 2}}, hovertemplate: escaped(name) + "<extra></extra>"}));
  const circle = (x, radius, color, dash) => ({type: "circle", x0: x - radius, x1: x + radius, y0: -radius, y1: radius, line: {color, width: 1.2, dash}});
  const shapes = [circle(0, 1, GREY, "solid"), circle(-1, loop.modulus[1], INK, "dot")];
  const axis = {gridcolor: GRID, zerolinecolor: GREY};
  Plotly.react("nyquist", data, {...PLOT, height: 520, margin: {l: 54, r: 8, t: 8, b: 40}, shapes, showlegend: true, legend: {orientation: "h", y: -0.14},
    xaxis: {...axis, range: [-VIEW, VIEW], title: {text: "real part", standoff: 4}},
    yaxis: {...axis, range: [-VIEW, VIEW], scaleanchor: "x", title: {text: "imaginary part"}}}, CONFIG);
}

function sensitivity(loop, gain) {
  const line = (x, y, name, color, width, dash = "solid", extra = {}) => ({type: "scatter", mode: "lines", x, y, name, line: {color, width, dash},
    hovertemplate: "%{x:.4g} Hz: %{y:.4g}<extra>" + escaped(name) + "</extra>", ...extra});
  const data = loop.samples.map((curve, k) => {
    const sample = loopGain(curve);
    return line(sample.freq, sensitivitySizes(sample), "|S| of machines of the posterior", SHADE, 1, "solid", {showlegend: !k, legendgroup: "samples", hoverinfo: "skip", hovertemplate: null});
  });
  const own = sensitivitySizes(gain), complementary = complementarySizes(gain), sizes = [own, complementary];
  if (loop.worst) {
    const worst = loopGain(loop.worst);
    data.push(line(worst.freq, sensitivitySizes(worst), "|S| of the worst machine", WORST, 1.2));
  }
  if (loop.before) {
    const before = loopGain(loop.before);
    data.push(line(before.freq, sensitivitySizes(before), "|S|, " + DATA.before, ORANGE, 1.5, "dash"));
  }
  data.push(line(gain.freq, complementary, "|T|", HUES[2], 1.6), line(gain.freq, own, "|S|", BLUE, 2));
  if (loop.weight) {
    const inverse = Array.from(floats(loop.weight.inverse));
    sizes.push(inverse);
    data.push(line(floats(loop.weight.freq), inverse, "1 / |W|", INK, 1.2, "dash"));
  }
  data.push({type: "scatter", mode: "markers", x: [loop.modulus[0]], y: [1 / loop.modulus[1]], name: "sensitivity peak " + (1 / loop.modulus[1]).toFixed(2), marker: {size: 8, color: INK},
    hovertemplate: "%{x:.4g} Hz: %{y:.3g}<extra>sensitivity peak</extra>"});
  const range = logAxis(sizes);
  Plotly.react("sensitivity", data, {...PLOT, height: 520, margin: {l: 64, r: 8, t: 8, b: 40}, showlegend: true, legend: {orientation: "h", y: -0.14},
    xaxis: {type: "log", dtick: "D2", gridcolor: GRID, zeroline: false, ticks: "outside", title: {text: "Hz", standoff: 4}},
    yaxis: {type: "log", gridcolor: GRID, exponentformat: "power", ...range, title: {text: "magnitude"}}}, CONFIG);
}

function referenceStep(loop) {
  const place = byId("reference-step");
  if (!loop.step) { Plotly.purge(place); place.textContent = "The loop gain stays below one: the loop follows no reference."; return; }
  if (!place.data) place.textContent = "";
  const time = floats(loop.step.time), value = loop.step.final, level = size => ({type: "line", xref: "paper", x0: 0, x1: 1, y0: size, y1: size, line: {color: GREY, width: 1, dash: "dot"}});
  Plotly.react(place, [{type: "scatter", mode: "lines", x: time, y: floats(loop.step.response), line: {color: BLUE, width: 2, simplify: false}, hovertemplate: "%{x:.4g} s: %{y:.4g}<extra></extra>"}],
    {...PLOT, height: 320, margin: {l: 64, r: 12, t: 34, b: 46}, showlegend: false, shapes: [level(0.98 * value), level(1.02 * value)], title: {text: escaped(loop.step.sentence), font: {size: 13}},
      xaxis: {gridcolor: GRID, zeroline: false, ticks: "outside", title: {text: "s", standoff: 4}}, yaxis: {gridcolor: GRID, zerolinecolor: GREY, title: {text: "measured per reference"}}}, CONFIG);
}

function drawLoop() {
  const loop = DATA.margins.loops[Number(state.loop)], gain = loopGain(loop);
  loopBode(loop, gain);
  nyquist(loop, gain);
  sensitivity(loop, gain);
  referenceStep(loop);
  press(byId("loop-choice"));
}

if (DATA.margins) {
  state.loop = "0";
  buttons(byId("loop-choice"), "loop", DATA.margins.loops.map((loop, k) => [String(k), loop.name]), drawLoop);
  drawLoop();
}
