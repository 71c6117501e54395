// Map of the excess of every channel in every test, re-tuned and with the effect.
const SIDES = [["retuned_excess", "re-tuned"], ...(AFTER ? [["after_excess", "with the effect"]] : [])];
const ROWS = [...new Set(CHANNELS.map(c => c.body))].flatMap(body => OUTPUTS.filter(o => CHANNELS.some(c => c.output === o && c.body === body))
  .map(output => ({body, output})));

// Return a box around the chosen channel, and lines between bodies.
function marks() {
  const chosen = CHANNELS[state.channel], row = ROWS.findIndex(r => r.output === chosen.output), shapes = [];
  SIDES.forEach((_, s) => shapes.push({type: "rect", xref: s ? "x2" : "x", x0: chosen.test - 0.5, x1: chosen.test + 0.5, y0: row - 0.5, y1: row + 0.5,
    line: {color: ORANGE, width: 2}}));
  ROWS.forEach((r, k) => { if (k && r.body !== ROWS[k - 1].body) shapes.push({type: "line", xref: "paper", x0: 0, x1: 1, y0: k - 0.5, y1: k - 0.5,
    line: {color: SOFT, width: 1}}); });
  return shapes;
}

function frame() {
  const place = byId("map");
  if (place.layout) Plotly.relayout(place, {shapes: marks()});
}

function heat() {
  const of = new Map(CHANNELS.map((c, k) => [c.output + "|" + c.test, k]));
  const values = CHANNELS.flatMap(c => SIDES.map(([key]) => c[key])).filter(v => v !== null);
  if (!values.length) { byId("map").textContent = "The noise of the measurement is not known."; return; }
  const most = Math.max(3, ...values), row = ROWS.length > 150 ? 6 : 12, several = SIDES.length > 1;
  const data = SIDES.map(([key, name], s) => {
    const cells = ROWS.map(r => TESTS.map((_, t) => of.get(r.output + "|" + t)));
    return {type: "heatmap", name, xaxis: s ? "x2" : "x", xgap: 1, ygap: 1, colorscale: BLUES, zmin: 0, zmax: Math.log10(most), hoverongaps: false,
      z: cells.map(list => list.map(k => k === undefined || CHANNELS[k][key] === null ? null : Math.log10(Math.max(CHANNELS[k][key], 1e-3)))),
      customdata: cells.map(list => list.map(k => k === undefined ? [] : [label(CHANNELS[k].output), label(TESTS[CHANNELS[k].test]), short(CHANNELS[k][key]), k])),
      hovertemplate: "%{customdata[0]}, hit at %{customdata[1]}: excess %{customdata[2]}<extra>" + name + "</extra>", showscale: !s,
      colorbar: {thickness: 10, outlinewidth: 0, len: 200, lenmode: "pixels", y: 1, yanchor: "top", tickvals: TICKS.map(Math.log10), ticktext: TICKS.map(String)}};
  });
  const axis = (s, domain) => ({domain, tickvals: TESTS.map((_, k) => k), ticktext: TESTS.map(label), tickangle: -60, tickfont: {size: 10}, showgrid: false, zeroline: false,
    anchor: "y", automargin: true, range: [-0.5, TESTS.length - 0.5]});
  const names = [...new Set(ROWS.map(r => r.body))].map(body => {
    const rows = ROWS.map((r, k) => r.body === body ? k : -1).filter(k => k >= 0);
    return {text: escaped(body), xref: "paper", x: 0, xshift: -58, xanchor: "right", y: (rows[0] + rows[rows.length - 1]) / 2, showarrow: false, font: {size: 11}};
  });
  const titles = SIDES.map(([, name], s) => ({text: "<b>" + name + "</b>", xref: (s ? "x2" : "x") + " domain", x: 0.5, yref: "paper", y: 1, yanchor: "bottom", showarrow: false}));
  Plotly.newPlot("map", data, {...PLOT, height: 110 + row * ROWS.length, margin: {l: 150, r: 10, t: 26, b: 60}, annotations: [...names, ...titles], shapes: marks(),
    xaxis: axis(0, several ? [0, 0.48] : [0, 1]), ...(several ? {xaxis2: axis(1, [0.52, 1])} : {}),
    yaxis: {range: [ROWS.length - 0.5, -0.5], showgrid: false, zeroline: false, tickfont: {size: 9}, tickvals: ROWS.map((_, k) => k),
      ticktext: ROWS.map(r => label(r.output) + (CHANNELS.some(c => c.output === r.output && c.out) ? " ✕" : "")), showticklabels: row > 8}}, BARE)
    .then(place => place.on("plotly_click", event => { const [, , , k] = event.points[0].customdata; if (k !== undefined) choose(k); }));
}

chooser();
state.channel = best(gain);
heat();
frf();
