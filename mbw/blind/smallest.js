// Places of a machine, the effects that a test shows there, and their smallest sizes.
function bars() {
  const names = PLACES.map(p => p.name);
  const bar = (name, values, colour) => ({type: "bar", orientation: "h", name, y: names, x: values, marker: {color: colour}});
  Plotly.react("where", [
    bar("found", PLACES.map(p => p.rows.length - p.missed), BLUE), bar("not found", PLACES.map(p => p.missed), ORANGE)],
    {...PLOT, barmode: "stack", height: 90 + 20 * Math.max(names.length, 4), margin: {l: 10, r: 20, t: 30, b: 30},
      xaxis: {title: {text: "effects"}, gridcolor: GRID}, yaxis: {autorange: "reversed", automargin: true, ticksuffix: "  "}}, BARE).then(plot => {
      if (plot.dataset.listens) return;
      plot.dataset.listens = "yes";
      plot.on("plotly_click", event => showPlace(event.points[0].pointNumber));
    });
}

function showPlace(k) {
  state.place = k;
  const place = PLACES[k];
  byId("chosen").textContent = place.name;
  byId("effects").tBodies[0].replaceChildren(...place.rows.map(row => cells([row.effect, row.dof, row.parameter,
    row.value === null ? (row.is_found ? "found" : "not found") : sizeText(row.value),
    row.of_usual === null ? "" : row.of_usual.toPrecision(2), row.confused.join(", ")])));
  mark(place);
}

byId("confirmed").tBodies[0].replaceChildren(...DATA.confirmed.map(row => cells([row.effect, row.location, row.parameter,
  sizeText(row.value), row.found_cases[0], row.found_cases[1], row.interval.map(end => (100 * end).toFixed(0) + " %").join(" to ")])));
byId("drawn").hidden = !DATA.confirmed.length;
bars();
showPlace(0);
Promise.resolve(start()).then(() => mark(PLACES[state.place]));
