// Further tests of a machine, ranked by what they show, and the points where they act.
function bars() {
  const names = PLACES.map(p => p.name), shrink = PLACES.map(p => p.gain.shrink);
  Plotly.react("where", [{type: "bar", orientation: "h", y: names, x: shrink,
    marker: {color: PLACES.map((_, k) => k === state.place ? ORANGE : BLUE)}}],
    {...PLOT, height: 90 + 20 * Math.max(names.length, 4), margin: {l: 10, r: 20, t: 30, b: 40},
      xaxis: {title: {text: "smallest sizes, over those as it is"}, gridcolor: GRID, rangemode: "tozero"},
      yaxis: {autorange: "reversed", automargin: true, ticksuffix: "  "}}, BARE).then(plot => {
      if (plot.dataset.listens) return;
      plot.dataset.listens = "yes";
      plot.on("plotly_click", event => showPlace(event.points[0].pointNumber));
    });
}

function gainRow({gain}, k) {
  const old = gain.most, now = gain.most_after, has = old !== null && now !== null;
  const size = row => row.value === null ? "not found" : sizeText(row.value);
  const values = [gain.name, gain.findable, gain.findable_before, gain.compared, gain.shrink.toPrecision(2),
    has ? `${now.effect} at ${now.location}` : "", has ? now.parameter : "", has ? size(now) : "", has ? size(old) : ""];
  const row = document.createElement("tr");
  values.forEach((value, n) => row.append(element("td", value, [0, 5, 6, 8].includes(n) ? {className: "name"} : {})));
  row.addEventListener("click", () => showPlace(k));
  return row;
}

function showPlace(k) {
  state.place = k;
  byId("chosen").textContent = PLACES[k].name;
  bars();
  mark(PLACES[k]);
}

const percent = ends => ends.map(end => (100 * end).toFixed(0) + " %").join(" to ");
byId("gains").tBodies[0].replaceChildren(...PLACES.map(gainRow));
byId("confirmed").tBodies[0].replaceChildren(...DATA.confirmed.map(row => {
  const line = document.createElement("tr");
  [row.name, row.effect, row.location, row.parameter, sizeText(row.value), row.found_before.join(" of "), percent(row.interval_before),
    row.found_after.join(" of "), percent(row.interval_after)].forEach((value, n) => line.append(element("td", value, n < 4 || n === 6 || n === 8 ? {className: "name"} : {})));
  return line;
}));
byId("drawn").hidden = !DATA.confirmed.length;
showPlace(0);
Promise.resolve(start()).then(() => mark(PLACES[state.place]));
