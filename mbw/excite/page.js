// Page of mbw excite: tables of limits and intervals; spectrum, period and coherence.
const LAYOUT = {...PLOT, height: 300, margin: {l: 80, r: 20, t: 10, b: 45}, showlegend: true, legend: {orientation: "h", y: 1.15}};
const freq = Array.from(floats(DATA.freq));

function fill(place, rows) {
  const body = byId(place).querySelector("tbody");
  rows.forEach(cells => {
    const row = element("tr", "", {});
    cells.forEach(cell => row.append(element("td", typeof cell === "number" ? cell.toPrecision(4) : cell, {className: typeof cell === "number" ? "" : "name"})));
    body.append(row);
  });
}

function draw(place, x, lines, xaxis, yaxis) {
  const traces = lines.map((line, k) => ({type: "scatter", mode: "lines", x, y: Array.from(line.values), name: escaped(line.name),
    line: {color: HUES[k % HUES.length], width: 1.3}}));
  Plotly.react(place, traces, {...LAYOUT, xaxis: {gridcolor: GRID, ...xaxis}, yaxis: {gridcolor: GRID, ...yaxis}}, CONFIG);
}

const named = key => DATA.drives.map(drive => ({name: drive.name + " [" + drive.unit + "]", values: floats(drive[key])}));
fill("limits", DATA.limits.map(r => [r.drive, r.what, r.reached, r.limit, r.unit, 100 * r.reached / r.limit]));
fill("parameters", DATA.parameters.map(r => [r.parameter, r.nominal, r.interval[0], r.interval[1], r.unit, r.determined ? "yes" : "no"]));
draw("spectrum", freq, named("amplitude"), {title: {text: "frequency / Hz"}}, {title: {text: "amplitude"}, type: "log", exponentformat: "power"});
draw("period", Array.from(floats(DATA.time)), named("period"), {title: {text: "time / s"}}, {title: {text: "signal"}});
draw("coherence", freq, DATA.coherence.map(row => ({name: row.name, values: floats(row.values)})), {title: {text: "frequency / Hz"}}, {title: {text: "coherence"}, range: [0, 1.02]});
