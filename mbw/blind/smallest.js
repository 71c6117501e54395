// Places of a machine, the effects that a test shows there, and their smallest sizes.
const PLACES = DATA.places, PALE = "#c3c9d2";

function looks(place) {
  return MESHES.map(mesh => {
    const there = place.bodies.includes(mesh.stage < 0 ? null : PICTURE.stages[mesh.stage]);
    return {colour: there ? ORANGE : PALE, opacity: there ? 0.5 : 0.13};
  });
}

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

function cells(values) {
  const row = document.createElement("tr");
  values.forEach((value, k) => row.append(element("td", value, k < 3 || k === values.length - 1 ? {className: "name"} : {})));
  return row;
}

function showPlace(k) {
  state.place = k;
  const place = PLACES[k], at = byId("picture"), meshes = looks(place);
  byId("chosen").textContent = place.name;
  byId("effects").tBodies[0].replaceChildren(...place.rows.map(row => cells([row.effect, row.dof, row.parameter,
    row.value === null ? (row.is_found ? "found" : "not found") : row.value.toPrecision(3),
    row.of_usual === null ? "" : row.of_usual.toPrecision(2), row.confused.join(", ")])));
  if (!drawn) return;
  const dot = at.data.findIndex(trace => trace.name === "place"), corner = c => place.points.map(p => p[c]);
  if (MESHES.length) Plotly.restyle(at, {color: meshes.map(m => m.colour), opacity: meshes.map(m => m.opacity)}, MESHES.map((_, m) => m));
  if (dot >= 0) Plotly.restyle(at, {x: [corner(0)], y: [corner(1)], z: [corner(2)]}, [dot]);
}

looks(PLACES[0]).forEach((look, k) => Object.assign(MESHES[k], look));
PLACES[0].points.forEach(place => PICTURE.points.push({name: PLACES[0].name, stage: -1, place, kind: "place"}));
byId("confirmed").tBodies[0].replaceChildren(...DATA.confirmed.map(row => cells([row.effect, row.location, row.parameter,
  row.value.toPrecision(3), row.found_cases[0], row.found_cases[1], row.interval.map(end => (100 * end).toFixed(0) + " %").join(" to ")])));
bars();
start();
showPlace(0);
