// Chart of the pulls: shifts of the tolerances in units of their prior's standard deviation.

function pulls() {
  const {points, kinds, trouble, bound} = DATA.pulls;
  const last = kinds.length - 1, seen = kinds.map(() => 0), red = RED;
  // Offsets by the golden ratio keep points of one kind apart.
  const at = points.map(p => last - p.kind + 0.62 * ((0.618034 * seen[p.kind]++) % 1 - 0.5));
  // Where a pull would squash all others, the axis is logarithmic beyond the implausible ones.
  const most = Math.max(0, ...points.map(p => Math.abs(p.pull))), wide = most > 3 * trouble;
  const place = x => !wide || Math.abs(x) <= trouble ? x : Math.sign(x) * trouble * (1 + 0.6 * Math.log(Math.abs(x) / trouble));
  const reach = Math.max(6, 1.12 * place(most)), steps = [0, ...[2, 4, 10, 30, 100, 300, 1000, 3000].filter(x => place(x) <= reach).flatMap(x => [x, -x])];
  const across = points.map(p => place(p.pull));
  const colours = points.map(p => Math.abs(p.pull) > trouble ? red : BLUE);
  const line = (x, color, dash) => ({type: "line", x0: x, x1: x, yref: "paper", y0: 0, y1: 1, line: {color, width: 1, dash}, layer: "below"});
  // Labels stand outside of the points; inside if the name would not fit there.
  const label = p => p.name + (wide ? " " + (p.pull > 0 ? "+" : "") + p.pull.toPrecision(3) : "");
  const fits = p => (reach - Math.abs(place(p.pull))) / (2 * reach) * 400 > 6.3 * label(p).length;
  const beside = p => fits(p) === (p.pull > 0) ? {xanchor: "left", xshift: 6} : {xanchor: "right", xshift: -6};
  const labelled = [];
  points.slice(0, 8).forEach((p, k) => {
    const apart = labelled.every(l => Math.abs(at[l] - at[k]) > 0.55 || Math.abs(across[l] - across[k]) > 0.45 * reach);
    if (labelled.length < 4 && apart && Math.abs(p.pull) > 2) labelled.push(k);
  });
  Plotly.newPlot("pulls", [{type: "scatter", mode: "markers", x: across, y: at,
    marker: {size: 7, color: points.map((p, k) => p.vague ? PAPER : colours[k]), opacity: 0.8, line: {color: colours, width: 1}},
    text: points.map(p => "<b>" + escaped(p.name) + "</b> " + p.pull.toFixed(1) + "<br>" + escaped(p.text)),
    hovertemplate: "%{text}<extra></extra>"}], {
    height: 76 + 34 * kinds.length, margin: {l: 20, r: 12, t: 8, b: 42}, font: FONT, paper_bgcolor: PAPER, plot_bgcolor: PAPER,
    showlegend: false, hoverlabel: {align: "left"},
    xaxis: {range: [-reach, reach], gridcolor: GRID, zerolinecolor: GREY, 
      ...(wide ? {tickvals: steps.map(place), ticktext: steps.map(x => (x > 0 ? "+" : "") + x)} : {}), tickangle: 0,
      title: {text: "pull / prior standard deviations" + (wide ? ", logarithmic beyond " + trouble : ""), standoff: 4}},
    yaxis: {range: [-0.6, last + 0.6], tickvals: kinds.map((_, k) => last - k), ticktext: kinds, automargin: true, showgrid: false, zeroline: false},
    shapes: [...kinds.slice(1).map((_, k) => ({type: "line", xref: "paper", x0: 0, x1: 1, y0: k + 0.5, y1: k + 0.5,
      line: {color: GRID, width: 1}, layer: "below"})),
      ...[-1, 1].flatMap(s => [line(s * bound, GREY, "4px,3px"), line(s * trouble, red, "4px,3px")])],
    annotations: labelled.map(k => ({x: across[k], y: at[k], text: escaped(label(points[k])), showarrow: false, font: {size: 11},
      ...beside(points[k]), bgcolor: "rgba(255,255,255,.75)"}))
  }, {...CONFIG, displayModeBar: false});
}
if (DATA.pulls.points.length) pulls();
