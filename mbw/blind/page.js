// Grades of a blind test: success rates by groups, reliability, confusion matrix, all cases.
const SHOWN = ["effect_first", "place_first", "both", "where_first", "false_alarm", "unknown_rejected"];
const state = {split: "all"};
const LAYOUT = {font: FONT, paper_bgcolor: PAPER, plot_bgcolor: PAPER, margin: {l: 60, r: 12, t: 30, b: 44}};

function groups() {
  const scores = DATA.verdicts;
  return state.split === "all" ? {"all cases": scores.all} : scores[state.split];
}

// Return the best rate of the baselines in a group: the highest, for a false alarm the lowest.
function baseline(name, label) {
  const rates = Object.values(DATA.baselines).map(b => b.scores).filter(Boolean)
    .map(s => (state.split === "all" ? s.all : s[state.split][label])).filter(Boolean)
    .map(g => g.rates[name]).filter(r => r && r.rate !== null).map(r => r.rate);
  return rates.length ? (name === "false_alarm" ? Math.min(...rates) : Math.max(...rates)) : null;
}

function rates() {
  const list = Object.entries(groups()), traces = [];
  SHOWN.forEach((name, k) => {
    const rows = list.map(([label, g]) => ({label, ...(g.rates[name] || {}), base: baseline(name, label)}))
      .filter(r => r.n);
    traces.push({type: "bar", name: name.replace(/_/g, " "), x: rows.map(r => r.label), y: rows.map(r => r.rate),
      offsetgroup: String(k), marker: {color: HUES[k]}, text: rows.map(r => "n " + Math.round(r.n)), textposition: "outside",
      customdata: rows.map(r => [r.low, r.high, r.base]), cliponaxis: false,
      hovertemplate: "%{y:.0%}, %{customdata[0]:.0%} to %{customdata[1]:.0%}, %{text}<br>best baseline %{customdata[2]:.0%}",
      error_y: {type: "data", symmetric: false, array: rows.map(r => r.high - r.rate),
                arrayminus: rows.map(r => r.rate - r.low), color: INK, thickness: 1.2}});
    traces.push({type: "bar", x: rows.map(r => r.label), y: rows.map(r => r.base), showlegend: false, hoverinfo: "skip",
      offsetgroup: String(k), marker: {color: "rgba(0,0,0,0)", line: {color: GREY, width: 2}}});
  });
  Plotly.react("rates", traces, {...LAYOUT, barmode: "group", height: 380,
    yaxis: {range: [0, 1.12], tickformat: ".0%", gridcolor: GRID}, xaxis: {type: "category", automargin: true},
    legend: {orientation: "h", y: 1.14}}, CONFIG);
  press(byId("split"));
}

function diagram() {
  const bins = DATA.verdicts.calibration.first.bins.filter(b => b.true.n);
  Plotly.react("diagram", [
    {x: [0, 1], y: [0, 1], mode: "lines", line: {color: GREY, dash: "dot"}, hoverinfo: "skip"},
    {x: bins.map(b => b.stated), y: bins.map(b => b.true.rate), mode: "markers+text",
     text: bins.map(b => "n " + b.true.n), textposition: "bottom center", marker: {color: BLUE, size: 9},
     error_y: {type: "data", symmetric: false, array: bins.map(b => b.true.high - b.true.rate),
               arrayminus: bins.map(b => b.true.rate - b.true.low), color: BLUE}}
  ], {...LAYOUT, height: 420, showlegend: false, xaxis: {range: [0, 1.02], title: {text: "stated probability"}, tickformat: ".0%"},
      yaxis: {range: [-0.08, 1.05], title: {text: "rate of success"}, tickformat: ".0%"}}, CONFIG);
}

function confusion() {
  const matrix = DATA.verdicts.confusion.effects, rows = Object.keys(matrix).sort();
  const columns = [...new Set(rows.flatMap(r => Object.keys(matrix[r])))].sort();
  const z = rows.map(r => columns.map(c => matrix[r][c] || 0));
  Plotly.react("confusion", [{type: "heatmap", x: columns, y: rows, z, colorscale: [[0, PAPER], [1, BLUE]],
    showscale: false, text: z.map(r => r.map(v => v || "")), texttemplate: "%{text}", xgap: 1, ygap: 1}],
    {...LAYOUT, height: Math.max(420, 80 + 18 * rows.length), xaxis: {tickangle: -50, type: "category", automargin: true},
     yaxis: {autorange: "reversed", type: "category", automargin: true}}, CONFIG);
}

function cases() {
  const body = document.querySelector("#cases tbody");
  for (const line of DATA.lines) {
    const row = body.insertRow(), first = line.first;
    const verdict = first.effect + (first.place ? " at " + first.place : "");
    for (const [text, kind] of [[line.name, "name"], [line.machine, "name"],
        [line.truth + (line.places.length ? " at " + line.places.join(", ") : ""), "name"], [line.ratio, ""], [line.verdict, "name"],
        [verdict, "name"], [first.probability === null ? "" : first.probability.toFixed(2), ""], [line.where || "", "name"]])
      row.insertCell().append(element("span", text)), row.lastChild.className = kind;
  }
  byId("tables").textContent = DATA.tables;
}

buttons(byId("split"), "split", [["all", "all"], ["by_ratio", "by survival ratio"], ["by_effect", "by effect"],
  ["by_place", "by place"], ["by_machine", "by machine"]], rates);
rates(); diagram(); confusion(); cases();
