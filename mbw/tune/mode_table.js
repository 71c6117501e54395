// Damping over frequency: the table with its standard deviations, the model as drawn, and tuned.

function modeChart() {
  const table = DATA.modes.filter(m => m.damping !== null), [drawn, tuned] = ["as_drawn", "tuned"].map(key => DATA.modes.map(m => m[key]).filter(m => m));
  const label = m => m.frequency.toFixed(2) + " Hz, " + (100 * m.damping).toFixed(2) + " %" + (m.motion || m.largest ? "<br>" + escaped(m.motion || m.largest) : "");
  const series = (name, modes, marker, extra) => ({type: "scatter", mode: "markers", name, x: modes.map(m => m.frequency), y: modes.map(m => 100 * m.damping), marker,
    text: modes.map(label), hovertemplate: "%{text}<extra>" + name + "</extra>", ...extra});
  const bars = (array) => ({type: "data", array, color: GREY, thickness: 1.2, width: 3});
  const sizes = [table, drawn, tuned].flatMap(modes => modes.map(m => 100 * m.damping)).filter(v => v > 0);
  const ends = [Math.min(...sizes), Math.max(...sizes)].map(Math.log10);
  Plotly.newPlot("modes", [
    series("as drawn", drawn, {symbol: "x-thin-open", size: 9, color: ORANGE, line: {width: 2}}),
    series("table", table, {symbol: "circle-open", size: 13, color: INK, line: {width: 1.6}},
      {error_x: bars(table.map(m => m.frequency_sd)), error_y: bars(table.map(m => 100 * m.damping_sd))}),
    series("tuned", tuned, {symbol: "circle", size: 7, color: BLUE})], {
    ...PLOT, height: 380, margin: {l: 64, r: 12, t: 8, b: 46}, legend: {orientation: "h", x: 0, y: 1.09},
    xaxis: {title: {text: "natural frequency / Hz", standoff: 6}, gridcolor: GRID, rangemode: "tozero"},
    yaxis: {title: {text: "damping ratio / %", standoff: 6}, type: "log", gridcolor: GRID, range: [ends[0] - 0.15, ends[1] + 0.15], dtick: ends[1] - ends[0] > 1.3 ? 1 : "D1"}}, CONFIG);
}

modeChart();
