// Places of a machine in the 3-D picture, of which one is marked.
const PLACES = DATA.places;

function looks(place) {
  return MESHES.map(mesh => {
    const there = place.bodies.includes(mesh.stage < 0 ? null : PICTURE.stages[mesh.stage]);
    return {colour: there ? ORANGE : PALE, opacity: there ? 0.5 : 0.13};
  });
}

function cells(values) {
  const row = document.createElement("tr");
  values.forEach((value, k) => row.append(element("td", value, k < 3 || k === values.length - 1 ? {className: "name"} : {})));
  return row;
}

// Mark a place in the picture: its bodies and points.
function mark(place) {
  const at = byId("picture"), meshes = looks(place);
  if (!drawn) return;
  const dot = at.data.findIndex(trace => trace.name === "place"), corner = c => place.points.map(p => p[c]);
  if (MESHES.length) Plotly.restyle(at, {color: meshes.map(m => m.colour), opacity: meshes.map(m => m.opacity)}, MESHES.map((_, m) => m));
  if (dot >= 0) Plotly.restyle(at, {x: [corner(0)], y: [corner(1)], z: [corner(2)]}, [dot]);
}

const SHOWN = PLACES.find(place => place.points.length) || {name: "", bodies: [], points: []};
looks(SHOWN).forEach((look, k) => Object.assign(MESHES[k], look));
SHOWN.points.forEach(place => PICTURE.points.push({name: SHOWN.name, stage: -1, place, kind: "place"}));
