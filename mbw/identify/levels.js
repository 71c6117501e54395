// Level check: change of frequency and damping of each mode against the level of the hits.

function levels() {
  if (!DATA.levels) return;
  const check = DATA.levels, moving = check.modes.filter(mode => mode.frequency_changes || mode.damping_changes);
  byId("level-words").textContent = check.words;
  if (!check.modes.length) return;
  const strength = mode => Math.max(...mode.frequency.map((f, k) => Math.abs(f / mode.frequency[0] - 1) + Math.abs(mode.damping[k] - mode.damping[0])));
  const shown = moving.slice().sort((a, b) => strength(b) - strength(a)).slice(0, HUES.length);
  const traces = check.modes.flatMap(mode => {
    const hue = shown.indexOf(mode), line = {color: hue < 0 ? GREY : HUES[hue], width: hue < 0 ? 0.8 : 1.8};
    const name = mode.frequency[0].toPrecision(4) + " Hz", common = {type: "scatter", mode: "lines+markers", x: check.level, name, legendgroup: name, line,
      marker: {color: line.color, size: hue < 0 ? 3 : 6}, opacity: hue < 0 ? 0.5 : 1};
    const bars = (sd, unit) => ({type: "data", array: sd.map(v => 2 * unit * v), color: line.color, thickness: 1, width: 3});
    return [
      {...common, y: mode.frequency.map(f => 100 * (f / mode.frequency[0] - 1)), error_y: bars(mode.frequency_sd, 100 / mode.frequency[0]), showlegend: hue >= 0,
        hovertemplate: "%{x:.4g} " + check.unit + ": %{y:+.3g} %<extra>" + name + "</extra>"},
      {...common, y: mode.damping.map(z => 100 * (z - mode.damping[0])), error_y: bars(mode.damping_sd, 100), xaxis: "x2", yaxis: "y2", showlegend: false,
        hovertemplate: "%{x:.4g} " + check.unit + ": %{y:+.3g} %<extra>" + name + "</extra>"}];
  });
  const reach = which => {  // the others may have wide bars
    const used = shown.length ? shown : check.modes;
    const ends = used.flatMap(mode => mode.frequency.map((f, k) => which ? [100 * (mode.damping[k] - mode.damping[0]), 200 * mode.damping_sd[k]]
      : [100 * (f / mode.frequency[0] - 1), 200 * mode.frequency_sd[k] / f]));
    const low = Math.min(...ends.map(([v, bar]) => v - bar)), high = Math.max(...ends.map(([v, bar]) => v + bar)), margin = 0.06 * (high - low || 1);
    return [low - margin, high + margin];
  };
  const axis = (title, domain) => ({type: "log", domain, title: {text: title, standoff: 6}, gridcolor: GRID, zeroline: false, tickvals: check.level, ticktext: check.level.map(v => String(Number(v.toPrecision(4))))});
  Plotly.newPlot("level-plot", traces, {...PLOT, height: 340, margin: {l: 64, r: 12, t: 34, b: 48}, showlegend: shown.length > 0,
    xaxis: axis("level" + (check.unit ? " / " + check.unit : ""), [0, 0.45]), xaxis2: {...axis("level" + (check.unit ? " / " + check.unit : ""), [0.55, 1]), anchor: "y2"},
    yaxis: {gridcolor: GRID, zerolinecolor: GREY, range: reach(0), title: {text: "change of frequency / %"}},
    yaxis2: {gridcolor: GRID, zerolinecolor: GREY, range: reach(1), title: {text: "change of damping ratio / % of critical"}, anchor: "x2"},
    legend: {orientation: "h", x: 0, y: 1.01, xanchor: "left", yanchor: "bottom"}}, CONFIG);
}
