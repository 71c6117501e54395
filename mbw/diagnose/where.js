// Location: probabilities of places and free forces as bars, the chosen place on the machine.
const PLACES = DATA.places, MILD = "#f3cfa3";

// Return colour and opacity of each mesh; the bodies of the shown place stand out.
function looks(place) {
  return MESHES.map(mesh => {
    const name = mesh.stage < 0 ? null : PICTURE.stages[mesh.stage], there = place.bodies.includes(name);
    const own = place.name.startsWith("body") || place.name.startsWith("pair");
    return {colour: there ? (own ? ORANGE : MILD) : PALE, opacity: there ? (own ? 0.55 : 0.4) : 0.13};
  });
}

function bars() {
  const names = PLACES.map(p => p.name), forced = PLACES.some(p => p.gain), most = Math.max(...PLACES.map(p => p.gain || 0));
  const bar = (key, axis, text) => ({type: "bar", orientation: "h", y: names, x: PLACES.map(p => p[key]), xaxis: axis, width: 0.7, showlegend: false,
    marker: {color: PLACES.map((_, k) => k === state.place ? ORANGE : BLUE)}, text: PLACES.map(text), textposition: "outside", cliponaxis: false,
    textangle: 0, hoverinfo: "skip"});
  const data = [bar("share", "x", p => p.share ? (100 * p.share).toFixed(p.share < 0.1 ? 1 : 0) + " %" : "")];
  if (forced) data.push(bar("gain", "x2", p => p.gain ? p.towards : ""));
  const title = text => ({text, font: {size: 13}, standoff: 6});
  Plotly.react("where", data, {...PLOT, height: 70 + 26 * Math.max(names.length, 4), margin: {l: 10, r: 60, t: 30, b: 8},
    xaxis: {domain: forced ? [0, 0.4] : [0, 0.8], range: [0, 1.25 * Math.max(...PLACES.map(p => p.share || 0), 0.1)], side: "top", tickformat: ".0%", nticks: 4, gridcolor: GRID, zeroline: false,
      title: title("probability of the place")},
    ...(forced ? {xaxis2: {domain: [0.55, 1], range: [0, 1.15 * most], side: "top", nticks: 4, gridcolor: GRID, zeroline: false, exponentformat: "SI",
      title: title("gain with a free force / nats")}} : {}),
    yaxis: {autorange: "reversed", automargin: true, ticksuffix: "  ", showgrid: false, zeroline: false}}, BARE).then(place => {
      if (place.dataset.listens) return;
      place.dataset.listens = "yes";
      place.on("plotly_click", event => showPlace(event.points[0].pointNumber));
    });
}

function showPlace(k) {
  state.place = k;
  const place = PLACES[k], meshes = looks(place), at = byId("picture");
  byId("chosen").replaceChildren(place.name, element("span", (place.towards ? " " + place.towards : "") + (place.note ? ": " + place.note : "")));
  bars();
  if (!drawn) return;
  const link = at.data.findIndex(trace => trace.name === "link"), ends = spread(place.line);
  const dot = at.data.findIndex(trace => trace.name === "place"), corner = c => place.points.map(p => p[c]);
  if (MESHES.length) Plotly.restyle(at, {color: meshes.map(m => m.colour), opacity: meshes.map(m => m.opacity)}, MESHES.map((_, m) => m));
  if (link >= 0) Plotly.restyle(at, {x: [ends.x], y: [ends.y], z: [ends.z]}, [link]);
  if (dot >= 0) Plotly.restyle(at, {x: [corner(0)], y: [corner(1)], z: [corner(2)]}, [dot]);
}

// Colour the first place before the first drawing: plotly takes the colours from the meshes.
looks(PLACES[0]).forEach((look, k) => Object.assign(MESHES[k], look));
PICTURE.link = PLACES[0].line;
PLACES[0].points.forEach((place, k) => PICTURE.points.push({name: PLACES[0].name, stage: -1, place, kind: "place"}));
byId("film").append(element("span", "◆ ", {style: "color:" + PURPLE}), element("span", "the place, a link as a line ", {className: "soft"}),
  element("span", "● ", {style: "color:var(--bad)"}), element("span", "sensor ", {className: "soft"}), element("span", "◆ "), element("span", "hammer", {className: "soft"}));
start();
showPlace(0);
