// Animated 3-D picture of a machine: stages move as solids, sensors as they were measured.
// The page's script defines ``state`` (mode, amplitude, playing) and calls film() and start().
const PICTURE = DATA.picture, STAGES = PICTURE.stages.length;
const SHAPES = floats(PICTURE.shapes), CENTRES = floats(PICTURE.centres);
const PERIOD = 1800;  // of the animated motion [ms]

// Places of the measured sensors and, mode after mode, the vectors of their motion.
const SENSORS = PICTURE.sensors ? {...PICTURE.sensors, places: floats(PICTURE.sensors.places), vectors: floats(PICTURE.sensors.vectors)} : null;

// Points of a simulated surface and, mode after mode, the vectors of their motion.
const SURFACE = PICTURE.surface ? {points: floats(PICTURE.surface.points), triangles: integers(PICTURE.surface.triangles), vectors: floats(PICTURE.surface.vectors)} : null;

// ---- the machine: points that move with stages ---------------------------------------------

const MESHES = PICTURE.meshes.map(mesh => ({...mesh, vertices: floats(mesh.vertices),
  triangles: integers(mesh.triangles), edges: integers(mesh.edges)}));

// Return points with the index of their stage; NaN where a line breaks.
function points(places, stages) { return {places: Float64Array.from(places), stages: Int32Array.from(stages)}; }

function edgesOf(meshes) {
  const places = [], stages = [];
  for (const mesh of meshes)
    for (let k = 0; k < mesh.edges.length; k += 2) {
      for (const end of [mesh.edges[k], mesh.edges[k + 1]])
        places.push(mesh.vertices[3 * end], mesh.vertices[3 * end + 1], mesh.vertices[3 * end + 2]);
      places.push(NaN, NaN, NaN);
      stages.push(mesh.stage, mesh.stage, mesh.stage);
    }
  return points(places, stages);
}

function tendons() {
  const places = [], stages = [], names = [];
  for (const line of PICTURE.lines) {
    places.push(...floats(line.points), NaN, NaN, NaN);
    stages.push(...line.stages, -1);
    names.push(...line.stages.map(() => line.name), "");
  }
  return {...points(places, stages), names};
}

// Return the coordinates of a list of points, as plotly takes them.
const spread = list => ({x: list.map(p => p[0]), y: list.map(p => p[1]), z: list.map(p => p[2])});

function sites(kind) {
  const chosen = PICTURE.points.filter(p => p.kind === kind);
  return {...points(chosen.flatMap(p => p.place), chosen.map(p => p.stage)), names: chosen.map(p => p.name)};
}

function corners() {  // of the box around each stage: no point of the stage moves further
  const low = Array.from({length: STAGES}, () => [Infinity, Infinity, Infinity]), high = low.map(r => r.map(v => -v));
  const take = (stage, place) => { if (stage >= 0) place.forEach((v, k) => {
    low[stage][k] = Math.min(low[stage][k], v); high[stage][k] = Math.max(high[stage][k], v); }); };
  MESHES.forEach(m => { for (let k = 0; k < m.vertices.length; k += 3) take(m.stage, Array.from(m.vertices.slice(k, k + 3))); });
  PICTURE.points.forEach(p => take(p.stage, p.place));
  PICTURE.lines.forEach(line => { const p = floats(line.points); line.stages.forEach((stage, k) => take(stage, Array.from(p.slice(3 * k, 3 * k + 3)))); });
  const places = [], stages = [];
  low.forEach((l, stage) => { if (l[0] <= high[stage][0]) for (let c = 0; c < 8; c++) {
    for (let k = 0; k < 3; k++) places.push(c >> k & 1 ? high[stage][k] : l[k]);
    stages.push(stage); } });
  return points(places, stages);
}
const CORNERS = corners();

function extent() {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const take = list => list.forEach((v, i) => { const k = i % 3; low[k] = Math.min(low[k], v); high[k] = Math.max(high[k], v); });
  take(CORNERS.places);
  if (SENSORS) take(SENSORS.places);
  if (SURFACE) take(SURFACE.points);
  MESHES.filter(m => m.stage < 0).forEach(m => take(m.vertices));
  const size = Math.hypot(...low.map((v, k) => high[k] - v)) || 1;
  return {low, high, size};
}
const EXTENT = extent();

// Motion Re(shape exp(i phase)) of each stage; a point of it moves by v + theta x r.
function motionOf(mode, phase) {
  const out = new Float64Array(6 * STAGES), start = 12 * STAGES * mode, c = Math.cos(phase), s = Math.sin(phase);
  for (let k = 0; k < 6 * STAGES; k++) out[k] = SHAPES[start + 2 * k] * c - SHAPES[start + 2 * k + 1] * s;
  return out;
}

function displacement(motion, stage, x, y, z) {
  const b = 6 * stage, rx = x - CENTRES[3 * stage], ry = y - CENTRES[3 * stage + 1], rz = z - CENTRES[3 * stage + 2];
  return [motion[b] + motion[b + 4] * rz - motion[b + 5] * ry,
          motion[b + 1] + motion[b + 5] * rx - motion[b + 3] * rz,
          motion[b + 2] + motion[b + 3] * ry - motion[b + 4] * rx];
}

function sensorMotion(mode, phase, k) {
  const start = 6 * (SENSORS.names.length * mode + k), c = Math.cos(phase), s = Math.sin(phase);
  return [0, 1, 2].map(a => SENSORS.vectors[start + 2 * a] * c - SENSORS.vectors[start + 2 * a + 1] * s);
}

// Return the displaced sensors, or lines from the place at rest to each displaced sensor.
function tips(mode, phase, factor, lines) {
  const x = [], y = [], z = [];
  SENSORS.names.forEach((_, k) => {
    const place = SENSORS.places.slice(3 * k, 3 * k + 3), d = sensorMotion(mode, phase, k);
    if (lines) { x.push(place[0]); y.push(place[1]); z.push(place[2]); }
    x.push(place[0] + factor * d[0]); y.push(place[1] + factor * d[1]); z.push(place[2] + factor * d[2]);
    if (lines) { x.push(null); y.push(null); z.push(null); }
  });
  return {x, y, z};
}

// Return the deformed surface at a phase.
function bent(mode, phase, factor) {
  const x = [], y = [], z = [], {points, vectors} = SURFACE, start = points.length * mode, c = factor * Math.cos(phase);
  for (let k = 0; k < points.length; k += 3) {
    x.push(points[k] + c * vectors[start + k]); y.push(points[k + 1] + c * vectors[start + k + 1]); z.push(points[k + 2] + c * vectors[start + k + 2]);
  }
  return {x, y, z};
}

function reach(mode) {
  const start = SURFACE.points.length * mode, count = SURFACE.points.length / 3;
  return Array.from({length: count}, (_, k) => Math.hypot(...SURFACE.vectors.slice(start + 3 * k, start + 3 * k + 3)));
}

function largest(mode) {
  const re = motionOf(mode, 0), im = motionOf(mode, -Math.PI / 2);
  let most = 0;
  CORNERS.stages.forEach((stage, k) => {
    const place = CORNERS.places.slice(3 * k, 3 * k + 3);
    most = Math.max(most, Math.hypot(...displacement(re, stage, ...place), ...displacement(im, stage, ...place)));
  });
  if (SURFACE) most = reach(mode).reduce((a, b) => Math.max(a, b), most);
  if (SENSORS) SENSORS.names.forEach((_, k) => { most = Math.max(most, Math.hypot(...sensorMotion(mode, 0, k), ...sensorMotion(mode, -Math.PI / 2, k))); });
  return most || 1;
}

function moved(places, stageOf, motion, factor) {
  const count = places.length / 3, x = new Array(count), y = new Array(count), z = new Array(count);
  for (let k = 0; k < count; k++) {
    const px = places[3 * k], py = places[3 * k + 1], pz = places[3 * k + 2], stage = stageOf(k);
    if (Number.isNaN(px)) { x[k] = y[k] = z[k] = null; continue; }
    const d = stage < 0 || !motion ? [0, 0, 0] : displacement(motion, stage, px, py, pz);
    x[k] = px + factor * d[0]; y[k] = py + factor * d[1]; z[k] = pz + factor * d[2];
  }
  return {x, y, z};
}

// ---- the picture ---------------------------------------------------------------------------

const MOVING = [];  // for each moving trace its number, and its coordinates at(motion, factor)

function traces() {
  const list = [];
  const add = (trace, places, stageOf, moves) => {
    if (moves) MOVING.push({number: list.length, at: (motion, factor) => moved(places, stageOf, motion, factor)});
    list.push({...moved(places, stageOf, null, 0), showlegend: false, hoverinfo: "skip", ...trace});
  };
  const lines = (set, trace, moves) => add({type: "scatter3d", mode: "lines", ...trace}, set.places, k => set.stages[k], moves);
  if (SURFACE) {
    const corner = k => Array.from({length: SURFACE.triangles.length / 3}, (_, t) => SURFACE.triangles[3 * t + k]);
    MOVING.push({number: list.length, at: (_, factor) => ({...bent(state.mode, phase, factor), intensity: reach(state.mode)})});
    list.push({...bent(0, 0, 0), type: "mesh3d", i: corner(0), j: corner(1), k: corner(2), intensity: reach(0), colorscale: [[0, "#e8eef5"], [1, "#3d78b4"]],
      showscale: false, flatshading: true, hoverinfo: "skip", lighting: {ambient: 0.7, diffuse: 0.5, specular: 0.05, roughness: 0.9, facenormalsepsilon: 0, vertexnormalsepsilon: 0}});
  }
  const sharp = edgesOf(MESHES.filter(m => m.stage >= 0));
  for (const mesh of MESHES) {
    const corner = k => Array.from({length: mesh.triangles.length / 3}, (_, t) => mesh.triangles[3 * t + k]);
    add({type: "mesh3d", i: corner(0), j: corner(1), k: corner(2), color: mesh.colour, opacity: mesh.opacity,
      flatshading: true, lighting: {ambient: 0.62, diffuse: 0.6, specular: 0.05, roughness: 0.9, facenormalsepsilon: 0, vertexnormalsepsilon: 0},
      lightposition: {x: 2000, y: -4000, z: 6000}, hoverinfo: mesh.stage < 0 ? "skip" : "name",
      name: mesh.stage < 0 ? "world" : PICTURE.stages[mesh.stage]}, mesh.vertices, () => mesh.stage, mesh.stage >= 0);
  }
  lines(sharp, {line: {color: "rgba(25,30,40,0.55)", width: 1.5}}, true);
  lines(sharp, {line: {color: "rgba(120,130,145,0.7)", width: 1}}, false);
  const legs = tendons();
  if (legs.stages.length) lines(legs, {line: {color: PICTURE.lines[0].colour, width: 6}, text: legs.names, hoverinfo: "text"}, true);
  for (const [kind, color, symbol, size] of [["site", GREY, "circle", 2], ["sensor", RED, "circle", 4], ["hammer", INK, "diamond", 5], ["place", PURPLE, "diamond", 11]]) {
    const set = sites(kind);
    if (set.names.length) add({type: "scatter3d", mode: "markers", name: kind, marker: {color, symbol, size, line: {width: 0}},
      text: set.names, hovertemplate: kind + " %{text}<extra></extra>", hoverinfo: undefined}, set.places, k => set.stages[k], true);
  }
  if (PICTURE.link) list.push({type: "scatter3d", mode: "lines", name: "link", ...spread(PICTURE.link), showlegend: false, hoverinfo: "skip",
    line: {color: PURPLE, width: 9}});
  if (SENSORS) for (const lines of [true, false]) {
    MOVING.push({number: list.length, at: (_, factor) => tips(state.mode, phase, factor, lines)});
    list.push({...tips(0, 0, 0, lines), type: "scatter3d", mode: lines ? "lines" : "markers", showlegend: false, line: {color: RED, width: 4},
      marker: {color: RED, size: 4, line: {width: 0}}, text: SENSORS.names, hoverinfo: lines ? "skip" : undefined,
      hovertemplate: lines ? undefined : "%{text}<extra></extra>"});
  }
  return list;
}

function scene() {
  const span = EXTENT.high.map((v, k) => v - EXTENT.low[k]), widest = Math.max(...span) || 1;
  const half = span.map(v => Math.max(0.56 * v + 0.04 * widest, 0.15 * widest));
  const axis = (k, name) => ({range: [0, 1].map(e => (EXTENT.low[k] + EXTENT.high[k]) / 2 + (e ? 1 : -1) * half[k]),
    title: {text: name + " / m", font: {size: 11}}, tickfont: {size: 10}, nticks: 5, showbackground: false,
    gridcolor: GRID, zerolinecolor: PALE, showspikes: false, autorange: false});
  const mean = Math.cbrt(half[0] * half[1] * half[2]), far = distance(half.map(v => v / 2 / mean));
  return {xaxis: axis(0, "x"), yaxis: axis(1, "y"), zaxis: axis(2, "z"), aspectmode: "manual", aspectratio: {x: half[0] / mean, y: half[1] / mean, z: half[2] / mean}, dragmode: "turntable",
    camera: {eye: {x: far * LOOK[0], y: far * LOOK[1], z: far * LOOK[2]}, center: {x: 0, y: 0, z: 0}, up: {x: 0, y: 0, z: 1}}};
}

// Distance of the camera at which the corners of a box of these half lengths fill the picture.
const LOOK = [0.52, -0.72, 0.46];  // from the front, right, above
function distance(half) {
  const place = byId("picture"), level = Math.hypot(LOOK[0], LOOK[1]), long = Math.hypot(...LOOK);
  const right = [-LOOK[1] / level, LOOK[0] / level, 0];
  const up = [-LOOK[0] * LOOK[2] / level / long, -LOOK[1] * LOOK[2] / level / long, level / long];
  const tall = 0.86 * Math.tan(Math.PI / 8), wide = tall * place.clientWidth / place.clientHeight;
  let far = 0;
  for (let c = 0; c < 8; c++) {
    const corner = half.map((h, k) => c >> k & 1 ? h : -h), along = axis => corner.reduce((sum, v, k) => sum + v * axis[k], 0);
    far = Math.max(far, along(LOOK) / long + Math.max(Math.abs(along(right)) / wide, Math.abs(along(up)) / tall));
  }
  return far / long;
}

let drawn = false, busy = false, held = false, phase = 0, before = null;

function hasWebGl() {
  try {
    const canvas = document.createElement("canvas");
    return Boolean(canvas.getContext("webgl2") || canvas.getContext("webgl"));
  } catch { return false; }
}

function absent() {
  const place = byId("picture");
  if (drawn) Plotly.purge(place);
  drawn = false;
  place.className = "absent";
  place.textContent = "No 3-D picture: this browser has no WebGL. The rest of this page works without it.";
  byId("film").hidden = true;
}

function start() {
  if (!hasWebGl()) { absent(); return; }
  const layout = {scene: scene(), margin: {l: 0, r: 0, t: 0, b: 0}, font: FONT, paper_bgcolor: PAPER, uirevision: "keep"};
  return Plotly.newPlot("picture", traces(), layout, {...CONFIG, modeBarButtonsToRemove: ["tableRotation", "resetCameraLastSave3d"]})
    .then(() => { drawn = true; watch(); show(); requestAnimationFrame(step); }, absent);
}

function watch() {  // the animation stops while the user turns the picture; plotly would reset it
  const place = byId("picture");
  place.addEventListener("pointerdown", () => { held = true; }, true);
  addEventListener("pointerup", () => setTimeout(() => { held = false; }, 100), true);
  addEventListener("pointercancel", () => { held = false; }, true);
  let wheel = 0;
  place.addEventListener("wheel", () => { held = true; clearTimeout(wheel); wheel = setTimeout(() => { held = false; }, 300); }, true);
}

function show() {
  if (!drawn || busy || !(SHAPES.length || SURFACE)) return Promise.resolve();
  const motion = motionOf(state.mode, phase), factor = state.amplitude / 100 * EXTENT.size / largest(state.mode);
  const sets = MOVING.map(set => set.at(motion, factor));
  busy = true;
  const change = {x: sets.map(s => s.x), y: sets.map(s => s.y), z: sets.map(s => s.z)};
  if (SURFACE) change.intensity = sets.map(s => s.intensity ?? null);
  return Plotly.restyle("picture", change, MOVING.map(s => s.number))
    .catch(absent).finally(() => { busy = false; });
}

function visible() {
  const box = byId("picture").getBoundingClientRect();
  return !document.hidden && box.bottom > 0 && box.top < innerHeight;
}

function step(now) {
  if (state.playing && !held && !busy && drawn && visible()) {
    phase = (phase + 2 * Math.PI * Math.min(now - (before ?? now), 100) / PERIOD) % (2 * Math.PI);
    show();
  }
  before = now;
  if (drawn) requestAnimationFrame(step);
}

function film() {
  const play = element("button");
  const label = () => { play.textContent = state.playing ? "❚❚ pause" : "▶ play"; play.setAttribute("aria-pressed", String(state.playing)); };
  play.onclick = () => { state.playing = !state.playing; label(); };
  label();
  const slider = element("input", undefined, {type: "range", min: 0, max: 15, step: 0.5, value: state.amplitude, id: "amplitude"});
  slider.oninput = () => { state.amplitude = Number(slider.value); show(); };
  const label2 = element("label", "amplitude ", {className: "soft"});
  label2.append(slider);
  const note = element("span", "", {className: "gap"});
  const key = element("span", undefined, {className: "soft"});
  const dot = color => element("span", "● ", {style: "color:" + color});
  if (SENSORS) key.append(dot(RED), "measured at the sensor ");
  if (PICTURE.points.some(p => p.kind === "sensor")) key.append(dot(RED), "sensor ");
  if (PICTURE.points.some(p => p.kind === "hammer")) key.append(element("span", "◆ "), "hammer");
  byId("film").append(play, label2, note, key);
  if (PICTURE.boxed.length)
    byId("film").append(element("div", "Small boxes represent stages without geoms: " +
      (PICTURE.boxed.length > 6 ? PICTURE.boxed.length + " of them" : PICTURE.boxed.join(", ")) + ".", {className: "soft"}));
}
