// FRF of the chosen channel: measured, re-tuned, with the effect.
const FREQ = floats(DATA.frf.freq), LINES = FREQ.length;
const KINDS = [["measured", "measured", {color: INK, width: 1.8}], ["retuned", "re-tuned", {color: ORANGE, width: 1.3, dash: "5px,3px"}],
  ["after", "with the effect", {color: BLUE, width: 1.3}]].filter(([kind]) => DATA.frf[kind] !== undefined);
const FRFS = Object.fromEntries(KINDS.map(([kind]) => [kind, shorts(DATA.frf[kind])]));
const NOISE = shorts(DATA.frf.noise), CORRECTED = shorts(DATA.frf.corrected);
const OUTPUTS = [...new Set(CHANNELS.map(c => c.output))];
const label = text => text.replace(/:\+t?/, " ").replace(/:-t?/, " −");

function frf() {
  const k = state.channel, channel = CHANNELS[k], data = [], sizes = [];
  const noise = Array.from(NOISE.slice(LINES * k, LINES * (k + 1)), sizeOf);
  const corrected = DATA.frf.corrected_channels.indexOf(k);
  if (corrected >= 0) data.push(...bodeTraces(FREQ, unpackedPolar(CORRECTED, corrected, LINES), "measured, without the effect", {color: GREY, width: 1.8}));
  for (const [kind, name, line] of KINDS) {
    const values = unpackedPolar(FRFS[kind], k, LINES);
    if (kind === "after" && channel.after_excess === null) continue;
    sizes.push(values.size);
    data.push(...bodeTraces(FREQ, values, name, line));
  }
  if (Math.max(...noise) > 10 ** logAxis(sizes).range[0]) data.unshift({type: "scatter", mode: "lines", x: FREQ, y: noise, name: "noise",
    line: {color: PALE, width: 1}, hovertemplate: "%{x:.5g} Hz: %{y:.3g}<extra>noise</extra>"});
  Plotly.react("frf", data, {...PLOT, height: Math.min(800, Math.max(560, 12 * ROWS.length)), margin: {l: 70, r: 16, t: 58, b: 44},
    xaxis: {title: {text: "frequency / Hz", standoff: 4}, range: [FREQ[0], FREQ[LINES - 1]], gridcolor: GRID, zeroline: false, ticks: "outside", anchor: "y2"},
    ...bodeAxes(sizes, DATA.frf.quantity + " / (" + channel.unit + ")"),
    legend: {orientation: "h", x: 0, y: 1.01, xanchor: "left", yanchor: "bottom"}}, CONFIG);
  byId("out").value = channel.output; byId("test").value = channel.test;
  byId("frf-remark").textContent = remark(channel);
  frame();
}

function remark(channel) {
  const share = value => (100 * value).toPrecision(3) + " %", times = value => value === null ? "" : " (excess " + short(value) + ")";
  let text = "Error re-tuned " + share(channel.retuned_error) + times(channel.retuned_excess);
  if (AFTER) text += channel.after_error === null ? ", with the effect not comparable" :
    ", with the effect " + share(channel.after_error) + times(channel.after_excess);
  text += "; the noise alone would cause " + share(channel.noise) + ".";
  return channel.out ? text + " The search left this channel out." : text;
}

// Reduction of a channel's squared excess by the effect; without an effect the squared excess.
const gain = c => c.retuned_excess === null ? -Infinity : c.retuned_excess ** 2 - (AFTER && c.after_excess !== null ? c.after_excess ** 2 : 0);
const worst = c => (AFTER ? c.after_excess : c.retuned_excess) ?? -Infinity;
const best = measure => CHANNELS.reduce((first, c, k) => measure(c) > measure(CHANNELS[first]) ? k : first, 0);

function choose(k) { state.channel = k; frf(); }

function chooser() {
  const place = byId("cell"), out = element("select", undefined, {id: "out"}), test = element("select", undefined, {id: "test"});
  for (const body of new Set(CHANNELS.map(c => c.body))) {
    const group = element("optgroup", undefined, {label: body});
    OUTPUTS.filter(o => CHANNELS.some(c => c.output === o && c.body === body)).forEach(o => group.append(new Option(label(o), o)));
    out.append(group);
  }
  TESTS.forEach((name, k) => test.add(new Option(label(name), k)));
  const find = () => CHANNELS.findIndex(c => c.output === out.value && c.test === Number(test.value));
  out.onchange = test.onchange = () => {
    const k = find();
    if (k >= 0) { choose(k); return; }
    byId("frf-remark").textContent = "This channel was not measured in this test.";
    Plotly.react("frf", [], byId("frf").layout, CONFIG);
  };
  place.append("motion at ", out, " hit at ", test, element("span", "", {className: "gap"}));
  if (AFTER) place.append(element("button", "largest gain", {id: "most", onclick: () => choose(best(gain))}));
  place.append(element("button", AFTER ? "largest remaining gap" : "largest gap", {id: "worst", onclick: () => choose(best(worst))}));
}
