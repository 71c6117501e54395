// Hammer tips side by side: energy of the force and coherence of each.
const TIPS = DATA.tips, colourOf = name => HUES[TIPS.findIndex(tip => tip.name === name) % HUES.length];
const MIN_COHERENCE = 0.9;

function curve(tip, key, axis) {
  const x = floats(tip.freq), y = Array.from(floats(tip[key]), v => v > 0 ? v : null);
  return {type: "scatter", mode: "lines", x, y, yaxis: axis, name: tip.name, legendgroup: tip.name, showlegend: axis === "y" || !tip.energy, line: {color: colourOf(tip.name), width: 1.6},
    hovertemplate: "%{x:.5g} Hz: %{y:.4g}<extra>" + escaped(tip.name) + "</extra>"};
}

// The last line within 20 dB of the largest.
function limitOf(tip) {
  const x = floats(tip.freq), y = floats(tip.energy), k = x.reduce((best, v, n) => Math.abs(v - tip.limit) < Math.abs(x[best] - tip.limit) ? n : best, 0);
  return {type: "scatter", mode: "markers", x: [x[k]], y: [y[k]], yaxis: "y", name: tip.name, showlegend: false, legendgroup: tip.name, marker: {color: colourOf(tip.name), size: 9},
    hovertemplate: "last line within 20 dB: %{x:.5g} Hz<extra>" + escaped(tip.name) + "</extra>"};
}

function tipsPlot() {
  const data = TIPS.flatMap(tip => [...(tip.energy ? [curve(tip, "energy", "y"), limitOf(tip)] : []), ...(tip.coherence ? [curve(tip, "coherence", "y2")] : [])]);
  const energies = data.filter(trace => trace.yaxis === "y" && trace.mode === "lines").map(trace => trace.y), last = Math.max(...TIPS.map(tip => floats(tip.freq).at(-1)));
  const bars = DATA.strongest.map(part => ({type: "rect", xref: "x", yref: "paper", x0: part.low, x1: part.high, y0: 0.43, y1: 0.45, fillcolor: colourOf(part.name), line: {width: 0}}));
  const line = {type: "line", xref: "paper", yref: "y2", x0: 0, x1: 1, y0: MIN_COHERENCE, y1: MIN_COHERENCE, line: {color: GREY, width: 1, dash: "dash"}};
  Plotly.newPlot("tips", data, {...PLOT, height: 620, margin: {l: 76, r: 12, t: 40, b: 44}, shapes: [...bars, line],
    xaxis: {title: {text: "frequency / Hz", standoff: 4}, range: [0, last], gridcolor: GRID, zeroline: false, ticks: "outside", anchor: "y2"},
    yaxis: {type: "log", domain: [0.47, 1], gridcolor: GRID, exponentformat: "power", ...(energies.length ? logAxis(energies) : {}), title: {text: "energy of the force / (N² s/Hz)"}},
    yaxis2: {domain: [0, 0.4], range: [0, 1.03], gridcolor: GRID, zeroline: false, title: {text: "median coherence"}},
    legend: {orientation: "h", x: 0, y: 1.01, xanchor: "left", yanchor: "bottom"}}, CONFIG);
}

function tipsTable() {
  const table = element("table"), head = element("tr"), top = element("thead"), body = element("tbody"), number = value => value === null ? "-" : String(Number(value.toPrecision(4)));
  const columns = [["tip", tip => tip.name], ["averaged hits", tip => tip.hits || "-"], ["median peak / N", tip => number(tip.peak)], ["force within 20 dB up to / Hz", tip => number(tip.limit)],
    ["band with coherence above 0.9 / Hz", tip => tip.band ? tip.band.map(number).join(" .. ") : "-"]];
  head.append(...columns.map(([name], k) => element("th", name, {className: k ? "" : "name"})));
  for (const tip of TIPS) {
    const row = element("tr");
    row.append(...columns.map(([, text], k) => element("td", String(text(tip)), {className: k ? "" : "name"})));
    body.append(row);
  }
  top.append(head); table.append(top, body);
  byId("tips-table").append(table);
}

tipsPlot();
tipsTable();
