// Rigid-body checks: results, detected faults, deviation along frequency.

function tableOf(columns, rows) {  // columns: heading and class
  const table = element("table"), head = element("tr"), top = element("thead"), body = element("tbody");
  head.append(...columns.map(([name, side]) => element("th", name, {className: side})));
  for (const texts of rows) {
    const row = element("tr");
    row.append(...texts.map((text, n) => element("td", String(text), {className: columns[n][1]})));
    body.append(row);
  }
  top.append(head); table.append(top, body);
  return table;
}

function faults() {
  const place = byId("solid-faults"), named = DATA.solid.flatMap(check => check.faults.map(fault => [check.body, ...fault]));
  const hidden = DATA.solid.filter(check => check.twins.length || check.unseen.length);
  if (named.length) {
    place.append(element("h3", "Detected faults"));
    place.append(tableOf([["body", "name"], ["fault", "name"], ["place", "name"], ["direction", "name"], ["parameters", "name"], ["probability", ""], ["residual over noise if corrected", ""]], named));
    const more = DATA.solid.filter(check => check.more).map(check => check.body);
    if (more.length) place.append(element("p", "A significant residual remains on " + more.join(", ") + ".", {className: "soft"}));
  }
  if (hidden.length) {
    place.append(element("h3", "Limits of these channels"));
    place.append(tableOf([["body", "name"], ["confounded faults", "name"], ["unidentifiable faults", "name"]],
      hidden.map(check => [check.body, check.twins.map(pair => pair.join(" = ")).join("; ") || "-", check.unseen.join("; ") || "-"])));
  }
}

function solid() {
  if (!DATA.solid.length) return;
  const rows = DATA.solid.map(check => [check.body, check.channels, check.spare, check.solid_to === null ? "-" : check.solid_to.toPrecision(4), check.words]);
  byId("solid").append(tableOf([["body", "name"], ["channels", ""], ["redundant", ""], ["solid up to / Hz", ""], ["result", "name"]], rows));
  faults();
  const lines = DATA.solid.map((check, k) => ({type: "scatter", mode: "lines", x: floats(check.freq), y: Array.from(floats(check.deviation)), name: check.body,
    line: {color: HUES[k % HUES.length], width: 1.3}, hovertemplate: "%{x:.5g} Hz: %{y:.3g} %<extra>" + escaped(check.body) + "</extra>"}));
  Plotly.newPlot("solid-lines", lines, {...PLOT, height: 280, margin: {l: 60, r: 12, t: 34, b: 44}, showlegend: true,
    xaxis: {title: {text: "frequency / Hz", standoff: 4}, gridcolor: GRID, zeroline: false},
    yaxis: {gridcolor: GRID, zeroline: false, range: [0, Math.max(5, 1.1 * Math.max(...lines.flatMap(line => line.y)))], title: {text: "deviation from a solid / %"}},
    legend: {orientation: "h", x: 0, y: 1.01, xanchor: "left", yanchor: "bottom"}}, CONFIG);
}
