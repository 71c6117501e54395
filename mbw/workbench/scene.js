// The machine in 3-D: surfaces are sent once, and its modes move in the browser.

const PERIOD_MS = 1800, FIELD = 0.5;  // period of the shown motion; half the height of the picture over the distance
const GROUND = 2, MARGIN = 1.06;  // the ground is in the picture up to so many times the size of the machine
const SLOW_MS = 12, REST_MS = 150;  // a picture that takes longer (no graphics card) waits until sliders rest
const VERTEX = `#version 300 es
uniform mat4 camera; uniform vec3 shift, turn; in vec3 place; out vec3 world;
void main() { world = place + shift + cross(turn, place); gl_Position = camera * vec4(world, 1.0); gl_PointSize = 1.0; }`;
const FRAGMENT = `#version 300 es
precision highp float; uniform vec4 colour; uniform vec3 light; uniform bool lit; in vec3 world; out vec4 result;
void main() {
  float shade = lit ? 0.62 + 0.38 * abs(dot(normalize(cross(dFdx(world), dFdy(world))), light)) : 1.0;
  result = vec4(colour.rgb * shade, colour.a);
}`;

const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
const floats = text => new Float32Array(bytes(text)), integers = text => new Uint32Array(bytes(text));
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const add = (a, b, s = 1) => a.map((v, k) => v + s * b[k]), dot = (a, b) => a.reduce((sum, v, k) => sum + v * b[k], 0);
const unit = a => { const n = Math.hypot(...a) || 1; return a.map(v => v / n); };
const rgba = (hex, alpha = 1) => [1, 3, 5].map(k => parseInt(hex.slice(k, k + 2), 16) / 255).concat(alpha);

export function createScene(canvas, marks, onPick) {
  const gl = canvas.getContext("webgl2", {antialias: true, alpha: true, premultipliedAlpha: false});
  if (!gl) {
    marks.textContent = "No 3-D picture: this browser has no WebGL 2. All else on this page works without it.";
    marks.className = "absent";
    return {show() {}, setMachine() {}, setAmplitude() {}, setPlaying() {}, setFrames() {}};
  }
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(program, shader);
  }
  gl.bindAttribLocation(program, 0, "place");
  gl.linkProgram(program); gl.useProgram(program);
  const at = Object.fromEntries(["camera", "shift", "turn", "colour", "light", "lit"].map(name => [name, gl.getUniformLocation(program, name)]));

  const buffer = (kind, array) => { const b = gl.createBuffer(); gl.bindBuffer(kind, b); gl.bufferData(kind, array, gl.STATIC_DRAW); return b; };
  const loose = gl.createBuffer();  // lines whose ends move apart
  let data = {stages: [], points: [], marks: []}, centres = new Float32Array(0), meshes = [], lines = [], dots = [], places = [], middle = [0, 0, 0], size = 0;

  function setMachine(next) {
    for (const mesh of meshes) for (const name of ["vertices", "triangles", "edges"]) gl.deleteBuffer(mesh[name]);
    data = next;
    centres = floats(data.centres);
    meshes = data.meshes.map(mesh => ({
      stage: mesh.stage, colour: rgba(mesh.colour, mesh.opacity), places: floats(mesh.vertices), vertices: buffer(gl.ARRAY_BUFFER, floats(mesh.vertices)),
      triangles: buffer(gl.ELEMENT_ARRAY_BUFFER, integers(mesh.triangles)), nTriangles: integers(mesh.triangles).length,
      edges: buffer(gl.ELEMENT_ARRAY_BUFFER, integers(mesh.edges)), nEdges: integers(mesh.edges).length,
    })).sort((a, b) => b.colour[3] - a.colour[3]);
    lines = data.lines.map(line => ({...line, points: floats(line.points)}));
    // Sensors, hits, additions and names lie over the picture as elements of the page.
    dots.forEach(({dot}) => dot.remove());
    dots = [...data.points, ...data.marks].map(point => {
      const dot = document.createElement("i");
      dot.className = point.kind;
      if (point.kind === "edit" || point.kind === "cause") dot.title = dot.textContent = point.name;
      marks.prepend(dot);
      return {...point, dot};
    });
    shape = new Float32Array(12 * data.stages.length);
    isSlow = null;  // measured at the next picture, which has this machine in it
    if (size) return;  // the picture stays where the user has turned it
    const moving = boxOf(meshes.filter(m => m.stage >= 0)), whole = boxOf(meshes);
    ({places, middle, size} = moving.size && whole.size > GROUND * moving.size ? moving : whole);
    distance = 0;
  }

  function boxOf(list) {  // about surfaces, sensors and hits
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity], places = data.points.filter(p => p.stage >= 0).map(p => p.place);
    for (const m of list) for (let k = 0; k < m.places.length; k += 3) places.push(m.places.subarray(k, k + 3));
    for (const p of places) for (let k = 0; k < 3; k++) { low[k] = Math.min(low[k], p[k]); high[k] = Math.max(high[k], p[k]); }
    return {places, middle: low.map((v, k) => (v + high[k]) / 2), size: places.length ? Math.hypot(...low.map((v, k) => high[k] - v)) || 1 : 0};
  }

  let azimuth = -0.94, elevation = 0.48, distance = 0, shape = new Float32Array(0), factor = 0;
  let amplitude = 5, playing = false, frames = false, phase = 0, before = 0, asked = false, view = {reference: "", channel: ""}, ports = {}, isSlow = null, rest = 0;
  let css = {};

  // Motion of a body at the present phase: p moves by shift + turn x p.
  function motion(stage) {
    if (stage < 0) return {shift: [0, 0, 0], turn: [0, 0, 0]};
    const c = Math.cos(phase), s = Math.sin(phase), v = k => factor * (shape[12 * stage + 2 * k] * c - shape[12 * stage + 2 * k + 1] * s);
    const turn = [v(3), v(4), v(5)], centre = centres.subarray(3 * stage, 3 * stage + 3);
    return {shift: add([v(0), v(1), v(2)], cross(turn, Array.from(centre)), -1), turn};
  }
  const moved = (place, stage) => { const {shift, turn} = motion(stage); return add(add(place, shift), cross(turn, place)); };

  function scaleShape() {  // the largest motion of a body's corner or sensor is the chosen part of the size
    let largest = 0;
    const measure = (p, stage) => {
      if (stage < 0) return;
      const part = k => [0, 1, 2].map(a => shape[12 * stage + 2 * (k + a)]), imaginary = k => [0, 1, 2].map(a => shape[12 * stage + 2 * (k + a) + 1]);
      const arm = add(Array.from(p), Array.from(centres.subarray(3 * stage, 3 * stage + 3)), -1);
      for (const of of [part, imaginary]) largest = Math.max(largest, Math.hypot(...add(of(0), cross(of(3), arm))));
    };
    data.points.forEach(p => measure(p.place, p.stage));
    data.stages.forEach((_, k) => measure(centres.subarray(3 * k, 3 * k + 3), k));
    factor = largest ? amplitude / 100 * size / largest : 0;
  }

  function fittingDistance(right, up, back, aspect) {  // at which the whole machine is in the picture
    const half = FIELD * Math.max(1, 1 / aspect), needed = p => dot(p, back) + Math.max(Math.abs(dot(p, up)), Math.abs(dot(p, right)) / aspect) / half;
    return MARGIN * places.reduce((largest, p) => Math.max(largest, needed(middle.map((v, k) => p[k] - v))), 0.2 * size);
  }

  function camera() {
    const back = [Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation)];
    const right = unit(cross([0, 0, 1], back)), up = cross(back, right), aspect = canvas.width / canvas.height;
    if (!distance) distance = size ? fittingDistance(right, up, back, aspect) : 1;
    const eye = add(middle, back, distance), near = distance / 50, far = distance + 4 * size, f = 1 / (FIELD * Math.max(1, 1 / aspect));
    const a = (far + near) / (near - far), b = 2 * far * near / (near - far);
    const row = (axis, s) => [...axis.map(v => v * s), -s * dot(axis, eye)];
    const [x, y, z] = [row(right, f / aspect), row(up, f), row(back, 1)];
    return {matrix: new Float32Array([0, 1, 2, 3].flatMap(k => [x[k], y[k], a * z[k] + (k === 3 ? b : 0), -z[k]])), back, light: unit(add(add(back, up, 0.6), right, -0.5)), right, up};
  }

  function project(matrix, p) {
    const v = r => matrix[r] * p[0] + matrix[4 + r] * p[1] + matrix[8 + r] * p[2] + matrix[12 + r], w = v(3);
    return [(v(0) / w + 1) / 2 * canvas.clientWidth, (1 - v(1) / w) / 2 * canvas.clientHeight];
  }

  function strokes(list, colour) {
    if (!list.length) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, loose);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(list.flat()), gl.STREAM_DRAW);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.uniform3f(at.shift, 0, 0, 0); gl.uniform3f(at.turn, 0, 0, 0); gl.uniform1i(at.lit, 0); gl.uniform4fv(at.colour, colour);
    gl.drawArrays(gl.LINES, 0, list.length);
  }

  function draw() {
    const began = performance.now();
    asked = false;
    const look = camera();
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST); gl.enable(gl.BLEND); gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.POLYGON_OFFSET_FILL); gl.polygonOffset(1, 1); gl.enableVertexAttribArray(0);
    gl.uniformMatrix4fv(at.camera, false, look.matrix); gl.uniform3fv(at.light, look.light);
    for (const mesh of meshes) {
      const {shift, turn} = motion(mesh.stage);
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.vertices); gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      gl.uniform3fv(at.shift, shift); gl.uniform3fv(at.turn, turn);
      gl.uniform1i(at.lit, 1); gl.uniform4fv(at.colour, mesh.colour);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.triangles); gl.drawElements(gl.TRIANGLES, mesh.nTriangles, gl.UNSIGNED_INT, 0);
      gl.uniform1i(at.lit, 0); gl.uniform4f(at.colour, 0.06, 0.08, 0.12, 0.55);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.edges); gl.drawElements(gl.LINES, mesh.nEdges, gl.UNSIGNED_INT, 0);
    }
    strokes(lines.flatMap(line => line.stages.slice(1).flatMap((_, k) => [k, k + 1].map(e => moved(Array.from(line.points.slice(3 * e, 3 * e + 3)), line.stages[e])))), rgba(css.ink));
    if (frames) ["#d03a3a", "#2f8f4e", "#3a6fd0"].forEach((colour, k) => strokes([
      ...data.stages.flatMap((_, stage) => {
        const centre = Array.from(centres.subarray(3 * stage, 3 * stage + 3)), end = centre.slice();
        end[k] += 0.09 * size;
        return [moved(centre, stage), moved(end, stage)];
      }),
      ...data.points.filter(point => point.kind !== "site").flatMap(({place, stage, axes}) =>  // sensors and hits, along their own axes
        [moved(place, stage), moved(add(place, axes.slice(3 * k, 3 * k + 3), 0.035 * size), stage)]),
    ], rgba(colour)));
    mark(look);
    if (isSlow === null && meshes.length) {
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));  // waits for the picture
      isSlow = performance.now() - began > SLOW_MS;
    }
  }

  const letters = [..."xyz"].map(text => { const e = document.createElement("b"); e.textContent = text; marks.append(e); return e; });
  const reach = [0, 0], names = ["reference", "channel"].map(kind => { const e = document.createElement("span"); e.className = kind; marks.append(e); return e; });

  function mark(look) {
    const move = (element, [x, y]) => { element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`; };
    for (const point of dots) { point.at = project(look.matrix, moved(point.place, point.stage)); move(point.dot, point.at); }
    const scale = 26, corner = [34, canvas.clientHeight - 34];
    letters.forEach((letter, k) => move(letter, [corner[0] + scale * look.right[k], corner[1] - scale * look.up[k]]));
    names.forEach((name, k) => {
      const [text, sign] = [[ports[view.reference] ?? view.reference, -1], [view.channel, 1]][k], [place, direction] = [text.replace(/:[^:]*$/, ""), text.split(":").pop()];
      const hit = k === 0 && dots.find(d => d.name === place.replace(/^\D+/, "hit")), point = hit || dots.find(d => d.name === place);
      const body = data.stages.indexOf(place), centre = body >= 0 && moved(Array.from(centres.subarray(3 * body, 3 * body + 3)), body);
      const spot = point ? point.at : centre ? project(look.matrix, centre) : null;
      name.hidden = !spot;
      if (!spot) return;
      const label = (k ? "out " : "in ") + place + " " + direction;
      if (name.textContent !== label) { name.textContent = label; reach[k] = name.offsetWidth; }
      move(name, [Math.min(spot[0] + 8, canvas.clientWidth - reach[k]), spot[1] + sign * 14 - 9]);
    });
  }

  function step(now) {
    if (playing && !document.hidden && !(isSlow && (rest || now - before < 80))) { phase = (phase + 2 * Math.PI * Math.min(now - before, 100) / PERIOD_MS) % (2 * Math.PI); draw(); before = now; }
    if (playing) requestAnimationFrame(step);
  }
  const ask = () => { if (!asked && !playing) { asked = true; requestAnimationFrame(draw); } };
  const clampTilt = () => { elevation = Math.min(Math.max(elevation, -1.5), 1.5); ask(); };
  const zoomBy = s => { distance = Math.min(Math.max(distance * s, 0.2 * size), 6 * size); ask(); };

  let held = null;
  canvas.addEventListener("pointerdown", event => { held = {x: event.clientX, y: event.clientY, far: 0}; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointermove", event => {
    if (!held) return;
    const dx = event.clientX - held.x, dy = event.clientY - held.y;
    azimuth -= dx / 150; elevation += dy / 150;
    held = {x: event.clientX, y: event.clientY, far: held.far + Math.hypot(dx, dy)};
    clampTilt();
  });
  canvas.addEventListener("pointerup", event => {
    if (held && held.far < 4) {
      const box = canvas.getBoundingClientRect(), gap = d => Math.hypot(d.at[0] - event.clientX + box.left, d.at[1] - event.clientY + box.top);
      const near = dots.filter(d => d.kind !== "site").sort((a, b) => gap(a) - gap(b))[0];
      if (near && gap(near) < 12) onPick(near.name, event.shiftKey);
    }
    held = null;
  });
  canvas.addEventListener("wheel", event => { zoomBy(Math.exp(event.deltaY / 600)); event.preventDefault(); }, {passive: false});
  canvas.addEventListener("keydown", event => {
    const turn = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]}[event.key];
    if (turn) { azimuth += 0.1 * turn[0]; elevation += 0.1 * turn[1]; clampTilt(); }
    else if (event.key === "+") zoomBy(0.85);
    else if (event.key === "-") zoomBy(1 / 0.85);
    else return;
    event.preventDefault();
  });
  function readColours() { css = {ink: getComputedStyle(document.documentElement).getPropertyValue("--ink").trim()}; ask(); }
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColours);
  new ResizeObserver(() => { const r = devicePixelRatio || 1; canvas.width = Math.max(1, canvas.clientWidth * r); canvas.height = Math.max(1, canvas.clientHeight * r); ask(); }).observe(canvas);
  readColours();

  return {
    setMachine(next) { setMachine(next); ask(); },
    show(frame, portOf, isPreview) {
      if (frame.arrays.shape.length === 12 * data.stages.length) shape = frame.arrays.shape.slice(); view = frame.view; ports = portOf;
      for (const d of dots) d.dot.classList.toggle("chosen", d.name === view.channel.replace(/:[^:]*$/, ""));
      scaleShape();
      clearTimeout(rest); rest = 0;
      if (isSlow && isPreview) rest = setTimeout(() => { rest = 0; ask(); }, REST_MS);
      else ask();
    },
    setAmplitude(percent) { amplitude = percent; scaleShape(); ask(); },
    setPlaying(value) { playing = value; if (playing) { before = performance.now(); requestAnimationFrame(step); } else ask(); },
    setFrames(value) { frames = value; ask(); },
  };
}
