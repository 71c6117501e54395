// A machine moving in its modes, shares of energy, Bode plot.
const PICTURE = DATA.picture, MODES = DATA.modes, STAGES = PICTURE.stages.length;
const SHAPES = floats(PICTURE.shapes), CENTRES = floats(PICTURE.centres);
const PERIOD = 1800;  // ms of one swing
const state = {mode: 0, amplitude: 5, playing: !matchMedia("(prefers-reduced-motion: reduce)").matches,
               energy: "strain", rows: "", curves: "", axis: "linear"};
const byId = id => document.getElementById(id);

// ---- the machine: points that move with stages ---------------------------------------------

const MESHES = PICTURE.meshes.map(mesh => ({...mesh, vertices: floats(mesh.vertices),
  triangles: integers(mesh.triangles), edges: integers(mesh.edges)}));

// Points with the number of the stage of each, NaN where a line breaks.
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

function sites(kind) {
  const chosen = PICTURE.points.filter(p => p.kind === kind);
  return {...points(chosen.flatMap(p => p.place), chosen.map(p => p.stage)), names: chosen.map(p => p.name)};
}

function corners() {  // of the box around each stage: no point of it moves further
  const low = Array.from({length: STAGES}, () => [Infinity, Infinity, Infinity]), high = low.map(r => r.map(v => -v));
  const take = (stage, place) => { if (stage >= 0) place.forEach((v, k) => {
    low[stage][k] = Math.min(low[stage][k], v); high[stage][k] = Math.max(high[stage][k], v); }); };
  MESHES.forEach(m => { for (let k = 0; k < m.vertices.length; k += 3) take(m.stage, Array.from(m.vertices.slice(k, k + 3))); });
  PICTURE.points.forEach(p => take(p.stage, p.place));
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
  MESHES.filter(m => m.stage < 0).forEach(m => take(m.vertices));
  const size = Math.hypot(...low.map((v, k) => high[k] - v)) || 1;
  return {low, high, size};
}
const EXTENT = extent();

// v + theta x r of each stage's motion, Re(shape exp(i phase)).
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

function largest(mode) {
  const re = motionOf(mode, 0), im = motionOf(mode, -Math.PI / 2);
  let most = 0;
  CORNERS.stages.forEach((stage, k) => {
    const place = CORNERS.places.slice(3 * k, 3 * k + 3);
    most = Math.max(most, Math.hypot(...displacement(re, stage, ...place), ...displacement(im, stage, ...place)));
  });
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

const MOVING = [];  // places, stageOf and number of each trace that moves

function traces() {
  const list = [];
  const add = (trace, places, stageOf, moves) => {
    if (moves) MOVING.push({places, stageOf, number: list.length});
    list.push({...moved(places, stageOf, null, 0), showlegend: false, hoverinfo: "skip", ...trace});
  };
  const lines = (set, trace, moves) => add({type: "scatter3d", mode: "lines", ...trace}, set.places, k => set.stages[k], moves);
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
  for (const [kind, color, symbol, size] of [["site", "#8d95a3", "circle", 2], ["sensor", "#c8201d", "circle", 4], ["hammer", "#111827", "diamond", 5]]) {
    const set = sites(kind);
    if (set.names.length) add({type: "scatter3d", mode: "markers", marker: {color, symbol, size, line: {width: 0}},
      text: set.names, hovertemplate: kind + " %{text}<extra></extra>", hoverinfo: undefined}, set.places, k => set.stages[k], true);
  }
  return list;
}

function scene() {
  const span = EXTENT.high.map((v, k) => v - EXTENT.low[k]), widest = Math.max(...span) || 1;
  const half = span.map(v => Math.max(0.56 * v + 0.04 * widest, 0.15 * widest));
  const axis = (k, name) => ({range: [0, 1].map(e => (EXTENT.low[k] + EXTENT.high[k]) / 2 + (e ? 1 : -1) * half[k]),
    title: {text: name + " / m", font: {size: 11}}, tickfont: {size: 10}, nticks: 5, showbackground: false,
    gridcolor: "#eef1f5", zerolinecolor: "#d5dae2", showspikes: false, autorange: false});
  const mean = Math.cbrt(half[0] * half[1] * half[2]), far = distance(span.map(v => v / 4 / mean));
  return {xaxis: axis(0, "x"), yaxis: axis(1, "y"), zaxis: axis(2, "z"), aspectmode: "data", dragmode: "turntable",
    camera: {eye: {x: far * LOOK[0], y: far * LOOK[1], z: far * LOOK[2]}, center: {x: 0, y: 0, z: 0}, up: {x: 0, y: 0, z: 1}}};
}

// From where the corners of a box of these half lengths fill the picture, seen along LOOK.
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
  place.textContent = "No 3-D picture: this browser has no WebGL. Everything else on this page works without it.";
  byId("film").hidden = true;
}

function start() {
  if (!hasWebGl()) { absent(); return; }
  const layout = {scene: scene(), margin: {l: 0, r: 0, t: 0, b: 0}, font: FONT, paper_bgcolor: "white", uirevision: "keep"};
  Plotly.newPlot("picture", traces(), layout, {...CONFIG, modeBarButtonsToRemove: ["tableRotation", "resetCameraLastSave3d"]})
    .then(() => { drawn = true; watch(); show(); requestAnimationFrame(step); }, absent);
}

function watch() {  // a picture that is being turned stands still, or plotly would turn it back
  const place = byId("picture");
  place.addEventListener("pointerdown", () => { held = true; }, true);
  addEventListener("pointerup", () => setTimeout(() => { held = false; }, 100), true);
  addEventListener("pointercancel", () => { held = false; }, true);
  let wheel = 0;
  place.addEventListener("wheel", () => { held = true; clearTimeout(wheel); wheel = setTimeout(() => { held = false; }, 300); }, true);
}

function show() {
  if (!drawn || busy) return Promise.resolve();
  const motion = motionOf(state.mode, phase), factor = state.amplitude / 100 * EXTENT.size / largest(state.mode);
  const sets = MOVING.map(set => moved(set.places, set.stageOf, motion, factor));
  busy = true;
  return Plotly.restyle("picture", {x: sets.map(s => s.x), y: sets.map(s => s.y), z: sets.map(s => s.z)}, MOVING.map(s => s.number))
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
  if (PICTURE.points.some(p => p.kind === "sensor")) key.append(dot("#c8201d"), "sensor ");
  if (PICTURE.points.some(p => p.kind === "hammer")) key.append(element("span", "◆ "), "hammer");
  byId("film").append(play, label2, note, key);
  if (PICTURE.boxed.length)
    byId("film").append(element("div", "Small boxes stand for stages without geoms: " +
      (PICTURE.boxed.length > 6 ? PICTURE.boxed.length + " of them" : PICTURE.boxed.join(", ")) + ".", {className: "soft"}));
}

// ---- the table of modes --------------------------------------------------------------------

const percent = share => share < 0.0005 ? "0 %" : (100 * share).toFixed(0) + " %";

function table() {
  const body = document.querySelector("#modes tbody");
  MODES.forEach((mode, k) => {
    const row = element("tr");
    row.append(element("td", String(k + 1)), element("td", mode.frequency.toFixed(mode.frequency < 10 ? 3 : 2)), element("td", damping(mode)));
    [mode.name || mode.spring, mode.body, mode.damper].forEach(lead => {
      const cell = element("td", undefined, {className: "name"});
      if (typeof lead === "string") cell.append(element("em", lead));
      else if (lead) cell.append(element("small", percent(lead[1])), lead[0]);
      cell.title = typeof lead === "string" ? lead : lead ? percent(lead[1]) + " " + lead[0] : "";
      row.append(cell);
    });
    row.onclick = () => choose(k);
    body.append(row);
  });
  const filter = byId("filter");
  filter.oninput = () => {
    const text = filter.value.trim().toLowerCase();
    let count = 0;
    for (const row of body.rows) { row.hidden = !row.textContent.toLowerCase().includes(text); count += !row.hidden; }
    byId("found").textContent = text ? count + " of " + MODES.length : MODES.length + " modes and poles";
  };
  filter.oninput();
  addEventListener("keydown", event => {
    const way = {ArrowDown: 1, ArrowUp: -1}[event.key];
    if (!way || /INPUT|SELECT/.test(document.activeElement.tagName) || !visible()) return;
    let k = state.mode + way;
    while (body.rows[k] && body.rows[k].hidden) k += way;
    if (body.rows[k]) { choose(k); event.preventDefault(); }
  });
}

const damping = mode => Number.isNaN(Number(mode.damping)) ? mode.damping : Number(mode.damping).toFixed(2);

function choose(k) {
  const rows = document.querySelector("#modes tbody").rows;
  rows[state.mode].removeAttribute("aria-selected");
  state.mode = k;
  rows[k].setAttribute("aria-selected", "true");
  const box = byId("modes"), top = rows[k].offsetTop;
  if (top < box.scrollTop + 30 || top > box.scrollTop + box.clientHeight - 30) box.scrollTop = top - box.clientHeight / 2;
  const mode = MODES[k], amount = damping(mode);
  const text = mode.name ? mode.name : mode.frequency.toPrecision(5) + " Hz, " + (/\d/.test(amount) ? "damping " + amount + " %" : amount);
  byId("chosen").replaceChildren("Mode " + (k + 1) + ": " + text);
  if (!state.playing) phase = 0;
  show();
  mark();
}

// ---- the heat map --------------------------------------------------------------------------

const KINDS = [["strain", "strain energy"], ["kinetic", "kinetic energy"], ["dissipation", "dissipation"]];
const COLUMNS = DATA.energy.modes;

function buttons(place, key, choices, redraw) {
  for (const [value, label] of choices) {
    const made = element("button", label);
    made.dataset.key = key; made.dataset.value = value;
    made.onclick = () => { state[key] = value; redraw(); };
    place.append(made);
  }
}

function press(place) {
  place.querySelectorAll("button").forEach(b => b.setAttribute("aria-pressed", String(state[b.dataset.key] === b.dataset.value)));
}

function heat() {
  const source = DATA.energy[state.energy], whole = state.rows === "whole";
  const names = whole ? source.whole : source.names, values = floats(whole ? source.sums : source.values);
  const n = COLUMNS.length, z = names.map((_, r) => Array.from(values.slice(r * n, (r + 1) * n), v => 100 * v));
  const low = z.reduce((m, row) => Math.min(m, ...row), 0), signed = low < -1, most = signed ? Math.max(100, -low) : 100;
  const shapes = [];
  if (!whole) source.owners.forEach((owner, r) => { if (r && kin(owner) !== kin(source.owners[r - 1])) shapes.push({type: "line", xref: "paper",
    x0: 0, x1: 1, y0: r - 0.5, y1: r - 0.5, line: {color: "#667085", width: 1}}); });
  const row = names.length > 80 ? 14 : 17;
  const layout = {height: Math.max(220, 110 + row * names.length), margin: {l: 20, r: 10, t: 8, b: 74}, font: FONT, paper_bgcolor: "white",
    plot_bgcolor: "white", shapes,
    xaxis: {tickvals: COLUMNS.map((_, k) => k), ticktext: COLUMNS.map(k => tick(MODES[k])), tickangle: -90, tickfont: {size: 10},
      title: {text: "modes, frequency / Hz", standoff: 10}, automargin: true, showgrid: false, zeroline: false, range: [-0.5, Math.max(n, 8) - 0.5]},
    yaxis: {tickvals: names.map((_, k) => k), ticktext: names, range: [names.length - 0.5, -0.5], automargin: true, showgrid: false,
      zeroline: false, tickfont: {size: row - 6}}};
  const trace = {type: "heatmap", z, xgap: 1, ygap: 1, zmin: signed ? -most : 0, zmax: most, zmid: signed ? 0 : undefined,
    colorscale: signed ? [[0, "#b42318"], [0.5, "#f7f9fb"], [1, "#134b82"]] : [[0, "#f7f9fb"], [0.1, "#dbe8f5"], [0.4, "#7fb2e0"], [1, "#134b82"]],
    colorbar: {ticksuffix: " %", thickness: 12, len: 200, lenmode: "pixels", y: 1, yanchor: "top", outlinewidth: 0},
    customdata: z.map((values, r) => values.map((_, k) => [names[r], COLUMNS[k] + 1, MODES[COLUMNS[k]].frequency.toPrecision(5)])),
    hovertemplate: "%{customdata[0]}, mode %{customdata[1]}, %{customdata[2]} Hz: %{z:.1f} %<extra></extra>"};
  Plotly.react("energy", [trace], layout, {...CONFIG, displayModeBar: false}).then(place => {
    if (!place.dataset.listens) { place.dataset.listens = "yes"; place.on("plotly_click", event => choose(COLUMNS[event.points[0].x])); }
    mark();
  });
  press(byId("kinds"));
}

const kin = owner => owner.startsWith("tendon:") ? "tendon:" : owner;  // each tendon owns itself
const tick = mode => mode.name || (mode.frequency < 10 ? mode.frequency.toFixed(2) : mode.frequency.toFixed(1));

// ---- the Bode plot -------------------------------------------------------------------------

const BODE = DATA.bode, FREQ = floats(BODE.freq), FRFS = floats(BODE.values), MANY = 10;
const HUES = ["#1f6fb8", "#d9822b", "#2f8f4e", "#b0413e", "#7a5aa6", "#8a6d3b", "#c2569b", "#5d6673", "#9aa52c", "#22a0ae"];

function parts(curve) {
  const n = FREQ.length, magnitude = new Array(n), angle = new Array(n);
  for (let k = 0; k < n; k++) {
    const re = FRFS[2 * (curve * n + k)], im = FRFS[2 * (curve * n + k) + 1], size = Math.hypot(re, im);
    magnitude[k] = size > 0 && Number.isFinite(size) ? size : null;
    angle[k] = magnitude[k] === null ? null : Math.atan2(im, re) * 180 / Math.PI;
    if (k && angle[k] !== null && Math.abs(angle[k] - angle[k - 1]) > 180) angle[k - 1] = null;
  }
  return {magnitude, angle};
}

function decades(list) {  // so that single dips do not rule
  const sizes = list.flat().filter(v => v !== null).sort((a, b) => a - b);
  const low = sizes[Math.floor(0.01 * sizes.length)] || 1e-3, top = sizes[sizes.length - 1] || 1;
  const range = [Math.log10(low) - 0.2, Math.log10(top) + 0.15], span = range[1] - range[0];
  return {range, dtick: span > 9 ? 2 : span > 1.3 ? 1 : "D1"};
}

function bode() {
  const chosen = BODE.labels.map((label, k) => k).filter(k => state.curves === "all" || BODE.groups[k] === state.curves);
  const units = [...new Set(chosen.map(k => BODE.units[k]))], data = [], sizes = [];
  chosen.forEach((k, n) => {
    const {magnitude, angle} = parts(k), color = HUES[n % HUES.length], hidden = n >= MANY;
    const name = BODE.labels[k] + (units.length > 1 ? " [" + BODE.units[k] + "]" : "");
    const common = {x: FREQ, mode: "lines", name, legendgroup: name, line: {color, width: 1.4}, visible: hidden ? "legendonly" : true};
    if (!hidden) sizes.push(magnitude);
    data.push({...common, y: magnitude, hovertemplate: "%{x:.5g} Hz, %{y:.4g}<extra>" + escaped(name) + "</extra>"});
    data.push({...common, y: angle, yaxis: "y2", showlegend: false, hovertemplate: "%{x:.5g} Hz, %{y:.1f}°<extra>" + escaped(name) + "</extra>"});
  });
  const x = {gridcolor: "#eef1f5", zeroline: false, type: state.axis, ticks: "outside", anchor: "y2"};
  const layout = {height: 560, margin: {l: 76, r: 12, t: 34, b: 46}, font: FONT, paper_bgcolor: "white", plot_bgcolor: "white",
    xaxis: {...x, title: {text: "Hz", standoff: 4}},
    yaxis: {type: "log", domain: [0.36, 1], gridcolor: "#eef1f5", exponentformat: "power", ...decades(sizes),
      title: {text: BODE.quantity + " / (" + (units.length > 1 ? "unit in the legend" : units[0]) + ")"}},
    yaxis2: {domain: [0, 0.3], range: [-190, 190], tickvals: [-180, -90, 0, 90, 180], gridcolor: "#eef1f5", zeroline: false, title: {text: "phase / °"}},
    legend: {x: 1.01, y: 1, xanchor: "left", tracegroupgap: 0}, showlegend: true};
  Plotly.react("bode", data, layout, CONFIG).then(mark);
  press(byId("curves"));
}

const escaped = text => text.replace(/&/g, "&amp;").replace(/</g, "&lt;");

// The chosen mode: a column of the heat map, a line in the Bode plot.
function mark() {
  const energy = byId("energy"), column = COLUMNS.indexOf(state.mode), plot = byId("bode"), frequency = MODES[state.mode].frequency;
  if (energy.layout && energy.layout.shapes) {
    const shapes = energy.layout.shapes.filter(s => s.name !== "chosen");
    if (column >= 0) shapes.push({name: "chosen", type: "rect", yref: "paper", x0: column - 0.5, x1: column + 0.5, y0: 0, y1: 1,
      line: {color: ORANGE, width: 1.5}});
    Plotly.relayout(energy, {shapes});
  }
  if (plot.layout) Plotly.relayout(plot, {shapes: frequency > 0 && frequency <= FREQ[FREQ.length - 1] ? [{type: "line", xref: "x",
    x0: frequency, x1: frequency, yref: "paper", y0: 0, y1: 1, line: {color: ORANGE, width: 1, dash: "dot"}}] : []});
}

function panels() {
  const kinds = byId("kinds"), choice = byId("curves"), groups = [...new Set(BODE.groups)];
  buttons(kinds, "energy", KINDS, heat);
  kinds.append(element("span", "", {className: "gap"}));
  state.rows = DATA.energy.strain.names.length > 60 ? "whole" : "each";
  buttons(kinds, "rows", [["each", "each direction"], ["whole", "stages"]], heat);
  if (COLUMNS.length < MODES.length) kinds.append(element("span", "the lowest " + COLUMNS.length + " of " + MODES.length + " modes", {className: "soft"}));
  byId("bode-remark").textContent = BODE.remark;
  heat();
  if (!BODE.labels.length) return;
  state.curves = BODE.labels.length <= MANY ? "all" : groups[0];
  if (groups.length > 1) {
    const select = element("select");
    if (BODE.labels.length <= MANY) select.add(new Option("all", "all"));
    groups.forEach(group => select.add(new Option(group, group)));
    select.onchange = () => { state.curves = select.value; bode(); };
    choice.append(select);
  }
  choice.append(element("span", "", {className: "gap"}));
  buttons(choice, "axis", [["linear", "linear"], ["log", "log"]], bode);
  bode();
}

film();
table();
panels();
const first = Number(location.hash.slice(1));
choose(first >= 1 && first <= MODES.length ? first - 1 : 0);
start();
