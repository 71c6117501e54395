// Damping over frequency: the table with its standard deviations, the model as drawn, and tuned.

function modeChart() {
  const {table, drawn, tuned} = DATA;
  const label = (p, k) => p.freq[k].toFixed(2) + " Hz, " + p.damping[k].toFixed(2) + " %" + (p.moves[k] ? "<br>" + escaped(p.moves[k]) : "");
  const series = (name, p, marker, extra) => ({type: "scatter", mode: "markers", name, x: p.freq, y: p.damping, marker,
    text: p.freq.map((_, k) => label(p, k)), hovertemplate: "%{text}<extra>" + name + "</extra>", ...extra});
  const bars = (array) => ({type: "data", array, color: GREY, thickness: 1.2, width: 3});
  const sizes = [table, drawn, tuned].flatMap(p => p.damping).filter(v => v > 0);
  const ends = [Math.min(...sizes), Math.max(...sizes)].map(Math.log10);
  Plotly.newPlot("modes", [
    series("as drawn", drawn, {symbol: "x-thin-open", size: 9, color: ORANGE, line: {width: 2}}),
    series("table", table, {symbol: "circle-open", size: 13, color: INK, line: {width: 1.6}},
      {error_x: bars(table.freq_sd), error_y: bars(table.damping_sd)}),
    series("tuned", tuned, {symbol: "circle", size: 7, color: BLUE})], {
    ...PLOT, height: 380, margin: {l: 64, r: 12, t: 8, b: 46}, legend: {orientation: "h", x: 0, y: 1.09},
    xaxis: {title: {text: "natural frequency / Hz", standoff: 6}, gridcolor: GRID, rangemode: "tozero"},
    yaxis: {title: {text: "damping ratio / %", standoff: 6}, type: "log", gridcolor: GRID, range: [ends[0] - 0.15, ends[1] + 0.15], dtick: ends[1] - ends[0] > 1.3 ? 1 : "D1"}}, CONFIG);
}

modeChart();
