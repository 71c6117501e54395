// Circles in the Nyquist plane: measured lines, fitted circle, natural frequency, half-power points.
const NYQUIST = {...DATA.circles, freq: floats(DATA.circles.freq), values: floats(DATA.circles.values), fitted: integers(DATA.circles.fitted),
  centre: floats(DATA.circles.centre), radius: floats(DATA.circles.radius), resonance: floats(DATA.circles.resonance), simulated: floats(DATA.circles.simulated)};
const CHANNELS = DATA.channels, TURN = Array.from({length: 181}, (_, k) => k * Math.PI / 90);

const percentOf = value => value === null || value === undefined ? "-" : (100 * value).toFixed(2);
const circleOf = (mode, channel) => mode.circles.find(circle => circle.channel === channel) ?? {damping: null};
const twoDigits = value => (Math.abs(value) < 0.005 ? 0 : value).toFixed(2);
const complexAt = (list, k) => [list[2 * k], list[2 * k + 1]];

function sensors() {
  const select = element("select", undefined, {id: "channel"}), box = element("label", "channel ", {className: "soft"});
  CHANNELS.forEach((name, k) => select.append(element("option", label(name), {value: k})));
  select.onchange = () => { state.sensor = Number(select.value); circlePlot(); };
  box.append(select);
  byId("sensor").append(box);
}

// The table of all channels for the chosen mode; a click on a line chooses its channel.
function circles() {
  const mode = MODES[state.mode], measured = isMeasured(mode);
  byId("nyquist").hidden = !measured;
  if (!measured) return;
  const body = document.querySelector("#circles tbody"), base = mode.base, shape = k => NYQUIST.simulated[state.mode * CHANNELS.length + k];
  if (base >= 0) state.sensor = base;
  body.replaceChildren(...mode.circles.map((circle, k) => {
    const line = element("tr"), simulated = base < 0 ? NaN : shape(k) / shape(base);
    line.append(element("td", label(circle.channel), {className: "name"}), ...(circle.amplitude === null ? ["-", "-", "-", "-"] :
      [digits(circle.frequency), percentOf(circle.damping), circle.amplitude.toPrecision(3), twoDigits(circle.amplitude / mode.circles[base].amplitude)])
      .concat(Number.isFinite(simulated) ? twoDigits(simulated) : "-", circle.scatter === null ? "-" : (100 * circle.scatter).toFixed(1)).map(text => element("td", text)));
    line.onclick = () => { state.sensor = k; circlePlot(); };
    return line;
  }));
  circlePlot();
}

function circlePlot() {
  const mode = MODES[state.mode], at = state.mode * CHANNELS.length + state.sensor, circle = mode.circles[state.sensor];
  byId("channel").value = state.sensor;
  document.querySelectorAll("#circles tbody tr").forEach((line, k) => line.setAttribute("aria-selected", String(k === state.sensor)));
  const traces = [true, false].map(inside => lines(at, inside));
  if (circle.amplitude !== null) traces.push(...fitted(at, circle));
  const axis = {gridcolor: GRID, zerolinecolor: GREY, exponentformat: "power", automargin: true};
  Plotly.react("circle", traces, {...PLOT, height: 500, margin: {l: 70, r: 20, t: 34, b: 50}, title: {text: escaped(label(circle.channel)) + ", mode " + (state.mode + 1), font: {size: 14}},
    xaxis: {...axis, title: {text: "Re y / (m/s)"}}, yaxis: {...axis, title: {text: "Im y / (m/s)"}, scaleanchor: "x"}, legend: {orientation: "h", y: -0.2}}, CONFIG);
  byId("circle-text").textContent = sentence(mode, circle);
}

// Measured lines of a mode and channel, those within the fitted band or the others.
function lines(at, inside) {
  const x = [], y = [], text = [], first = state.mode * NYQUIST.lines;
  for (let k = 0; k < NYQUIST.lines; k++) {
    if (!Number.isFinite(NYQUIST.freq[first + k]) || Boolean(NYQUIST.fitted[first + k]) !== inside) continue;
    const value = complexAt(NYQUIST.values, at * NYQUIST.lines + k);
    x.push(value[0]); y.push(value[1]); text.push(digits(NYQUIST.freq[first + k]) + " Hz");
  }
  return {type: "scatter", mode: "markers", x, y, text, name: inside ? "measured, fitted" : "measured, beside the fit",
    marker: {size: inside ? 6 : 5, color: inside ? BLUE : PAPER, line: {color: inside ? BLUE : GREY, width: 1}}, hovertemplate: "%{text}<extra></extra>"};
}

// The circle, its natural frequency and its half-power points, with their frequencies beside them.
function fitted(at, circle) {
  const [a, b] = complexAt(NYQUIST.centre, at), r = NYQUIST.radius[at], [u, v] = complexAt(NYQUIST.resonance, at), turned = [b - v, u - a];
  const side = (x, y) => (y > b + 0.5 * r ? "top" : y < b - 0.5 * r ? "bottom" : "middle") + " " + (x > a + 0.5 * r ? "right" : x < a - 0.5 * r ? "left" : "center");
  const hertz = [1 - circle.damping, 1 + circle.damping].map(factor => digits(factor * circle.frequency) + " Hz"), ends = [[a + turned[0], b + turned[1]], [a - turned[0], b - turned[1]]];
  return [{type: "scatter", mode: "lines", x: TURN.map(t => a + r * Math.cos(t)), y: TURN.map(t => b + r * Math.sin(t)), name: "circle", line: {color: ORANGE, width: 2}, hoverinfo: "skip"},
    {type: "scatter", mode: "lines+markers+text", x: ends.map(p => p[0]), y: ends.map(p => p[1]), text: hertz, textposition: ends.map(p => side(...p)), name: "half-power points",
      line: {color: GREY, width: 1, dash: "dot"}, marker: {symbol: "square", size: 10, color: ORANGE, line: {color: INK, width: 1}}, cliponaxis: false, hoverinfo: "skip"},
    {type: "scatter", mode: "lines+markers+text", x: [a, u], y: [b, v], text: ["", digits(circle.frequency) + " Hz"], textposition: side(u, v), name: "natural frequency",
      line: {color: GREY, width: 1, dash: "dot"}, marker: {symbol: ["cross-thin-open", "star"], size: [9, 16], color: INK}, cliponaxis: false, hoverinfo: "skip"}];
}

function sentence(mode, circle) {
  const name = label(circle.channel) + ", " + circle.impact.replace(/.*[\\/]/, "") + ": ";
  if (circle.amplitude === null) return name + "no circle. " + circle.reason + ".";
  const hand = mode.by_hand.find(row => row.channel === circle.channel);
  return name + "natural frequency " + digits(circle.frequency) + " Hz (poles: " + digits(mode.frequency) + "), damping ratio " + percentOf(circle.damping) + " % (poles: "
    + percentOf(mode.damping) + (hand ? ", 3 dB: " + percentOf(hand.damping) : "") + "), C = " + circle.amplitude.toPrecision(3) + " m/s"
    + (hand ? " (least squares: " + Math.abs(hand.least_squares).toPrecision(3) + ")" : "") + "; the lines scatter by " + (100 * circle.scatter).toFixed(1) + " % of the radius.";
}
