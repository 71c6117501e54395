// Bars of the gap; the scripts that follow share this state.
const CHANNELS = DATA.channels, TESTS = DATA.tests, AFTER = DATA.has_after;
const state = {channel: 0, place: 0, mode: 0, amplitude: 0, playing: false};
const TICKS = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000];  // of excess
const short = value => value === null ? "-" : String(Number(value.toPrecision(3)));

const two = value => String(Number(value.toPrecision(2)));

function gapBars() {
  const rows = DATA.gap, place = byId("gap");
  if (!rows.length) { place.textContent = "The noise of the measurement is not known: no excess can be stated."; return; }
  const least = rows.some(r => Math.min(r.excess, r.interval ? r.interval[0] : 1) < 0.9) ? 0.5 : 0.8, top = Math.max(...rows.map(r => Math.max(r.excess, r.interval ? r.interval[1] : 0)), 3);
  const ends = rows.map(r => r.interval ? [Math.max(r.interval[0], least), r.interval[1]] : [r.excess, r.excess]);
  const text = rows.map(r => "<b>" + short(r.excess) + "</b>" + (r.error === null ? "" : "  error " + short(100 * r.error) + " %") +
    (r.interval ? "  95 %: " + two(Math.max(r.interval[0], 0)) + " … " + two(r.interval[1]) : ""));
  const room = 30 + 7 * Math.max(...text.map(line => line.replace(/<[^>]*>/g, "").length));
  const data = [{type: "bar", orientation: "h", y: rows.map(r => r.name), base: rows.map(() => 1), x: rows.map(r => r.excess - 1),
    marker: {color: rows.map(r => r.colour)}, width: 0.62, hoverinfo: "skip"}];
  rows.forEach((r, k) => { if (r.interval) data.push({type: "scatter", mode: "markers", x: [r.excess], y: [r.name], marker: {size: 1, color: INK}, hoverinfo: "skip",
    showlegend: false, error_x: {type: "data", symmetric: false, array: [ends[k][1] - r.excess], arrayminus: [r.excess - ends[k][0]], color: INK, thickness: 1.5, width: 5}}); });
  const notes = rows.map((r, k) => ({x: Math.log10(Math.max(1, r.excess, ends[k][1])), y: r.name, text: text[k], xanchor: "left", showarrow: false, xshift: 10, align: "left"}));
  Plotly.newPlot(place, data, {...PLOT, showlegend: false, height: 66 + 40 * rows.length, margin: {l: 110, r: room, t: 8, b: 40}, annotations: [...notes,
      {x: 0, y: 1, yref: "paper", yanchor: "top", text: "noise", textangle: -90, showarrow: false, xanchor: "right", font: {size: 11, color: SOFT}}],
    shapes: [{type: "line", x0: 1, x1: 1, yref: "paper", y0: 0, y1: 1, line: {color: INK, width: 1.5, dash: "dot"}}],
    xaxis: {type: "log", range: [Math.log10(least), Math.log10(top * 1.1)], gridcolor: GRID, zeroline: false, tickvals: TICKS, title: {text: "excess: gap over noise", standoff: 6}},
    yaxis: {autorange: "reversed", ticksuffix: " ", showgrid: false, zeroline: false}}, BARE);
}

gapBars();
