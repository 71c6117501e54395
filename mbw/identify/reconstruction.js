// All channels of one body in a grid: measured, and reconstructed from the body's six motions (seed, fig. 2.2).
Object.assign(state, {body: "", solidInp: 0, curve: "magnitude"});
const GRID_ROW = 132, NARROW = 760;  // height of a row of the grid, width of the page below which it has one column [px]
const CHECKED = Array.from(new Set(DATA.bodies)).map(body => ({body, check: DATA.solid.find(row => row.body === body) || null}));

// Verdict of the check in a few words, and whether it is good (null: no check is possible).
function verdictOf({check}) {
  if (!check || !check.spare) return ["no redundant channel: not checked", null];
  const faults = check.faults.length > 1 ? ", " + check.faults.length + " faults" : check.faults.map(([effect, place]) => ", " + place + ": " + effect).join("");
  if (check.solid_to === null) return ["not a solid" + faults, false];
  const isWhole = check.solid_to >= FREQ[LINES - 1] * (1 - 1e-9);
  return ["solid up to " + Number(check.solid_to.toPrecision(4)) + " Hz" + (isWhole ? "" : " only") + faults, isWhole && !faults];
}

// The body shown first: the one that is a solid over the smallest band, of equal ones the first.
function worstBody() {
  const limit = ({check}) => !check || !check.spare ? Infinity : check.faults.length ? -1 : check.solid_to === null ? 0 : check.solid_to;
  return CHECKED.reduce((worst, row) => limit(row) < limit(worst) ? row : worst).body;
}

// Rows of at most three channels: those of one sensor stand beside each other.
function channelGrid(body) {
  const points = new Map();
  OUTPUTS.forEach((name, out) => {
    if (DATA.bodies[out] !== body) return;
    const point = name.replace(/:[^:]*$/, "") + (turns(name) ? " turning" : "");
    points.set(point, [...(points.get(point) || []), out]);
  });
  const width = byId("solid-grid").clientWidth < NARROW ? 1 : 3;
  return [...points.values()].flatMap(outs => Array.from({length: Math.ceil(outs.length / width)}, (_, k) => outs.slice(k * width, (k + 1) * width)));
}

function channelTraces(out, number, isFirst) {
  const cell = out * INPUTS.length + state.solidInp, axis = number ? String(number + 1) : "", place = {xaxis: "x" + axis, yaxis: "y" + axis}, traces = [];
  if (!IS_MEASURED[cell]) return traces;
  const part = state.curve === "magnitude" ? "size" : "angle", unit = part === "size" ? ":.4g" : ":.1f";
  const curve = (values, name, line) => ({type: "scatter", mode: "lines", x: FREQ, y: polar(stored(values, cell))[part], name, line, legendgroup: name, showlegend: isFirst, ...place,
    hovertemplate: "%{x:.5g} Hz: %{y" + unit + "}" + (part === "size" ? "" : "°") + "<extra>" + escaped(OUTPUTS[out]) + " " + name + "</extra>"});
  traces.push(curve(MEASURED, "measured", {color: INK, width: 2}));
  if (HAS_SOLID[cell]) traces.push(curve(AS_SOLID, "reconstructed from six motions", {color: ORANGE, width: 1.3}));
  return traces;
}

function cellTitle(out) {
  const cell = out * INPUTS.length + state.solidInp;
  if (!IS_MEASURED[cell]) return OUTPUTS[out] + ": not measured";
  return OUTPUTS[out] + (HAS_SOLID[cell] ? "   difference " + (100 * solidDifference(cell)).toPrecision(2) + " %" : "");
}

function reconstruction() {
  const row = CHECKED.find(({body}) => body === state.body), grid = channelGrid(state.body), width = Math.max(...grid.map(outs => outs.length));
  const head = 58, foot = 46, height = head + foot + GRID_ROW * grid.length, data = [], layout = {}, annotations = [];
  const isMagnitude = state.curve === "magnitude", shown = [[], []];  // translations, rotations
  const left = k => k / width + (k ? 0.022 : 0), right = k => (k + 1) / width - (k < width - 1 ? 0.022 : 0);
  let number = 0;
  grid.forEach((outs, r) => outs.forEach((out, c) => {
    const traces = channelTraces(out, number, !data.length), axis = number ? String(number + 1) : "", isLast = !grid.slice(r + 1).some(next => next.length > c);
    const top = 1 - r / grid.length - 0.16 / grid.length, bottom = 1 - (r + 1) / grid.length + 0.03 / grid.length;
    data.push(...traces);
    if (isMagnitude) shown[Number(turns(OUTPUTS[out]))].push(...traces.map(trace => trace.y));
    layout["xaxis" + axis] = {domain: [left(c), right(c)], anchor: "y" + axis, matches: number ? "x" : undefined, gridcolor: GRID, zeroline: false, showticklabels: isLast, ticks: isLast ? "outside" : "",
      title: isLast ? {text: "frequency / Hz", standoff: 4} : undefined, range: [FREQ[0], FREQ[LINES - 1]]};
    layout["yaxis" + axis] = {domain: [bottom, top], anchor: "x" + axis, gridcolor: GRID, zeroline: false, showticklabels: c === 0 || turns(OUTPUTS[out]) !== turns(OUTPUTS[outs[0]]), tickfont: {size: 10}, of: Number(turns(OUTPUTS[out]))};
    annotations.push({xref: "x" + axis + " domain", yref: "y" + axis + " domain", x: 0, y: 1, xanchor: "left", yanchor: "bottom", showarrow: false, font: {size: 11}, text: escaped(cellTitle(out))});
    number++;
  }));
  for (const [name, axis] of Object.entries(layout)) if (name.startsWith("yaxis")) {
    Object.assign(axis, isMagnitude ? {type: "log", exponentformat: "power", ...logAxis(shown[axis.of])} : {range: [-190, 190], tickvals: [-180, 0, 180]});
    delete axis.of;
  }
  const [words, isGood] = verdictOf(row), unit = DATA.quantity + " / (" + UNITS.motion[grid[0][0]] + "/" + UNITS.force[state.solidInp] + ")";
  annotations.push({xref: "paper", yref: "paper", x: 0, y: 1, yshift: 24, xanchor: "left", yanchor: "bottom", showarrow: false, text: escaped(row.body + ": " + words),
    font: {size: 12, color: isGood === null ? FONT.color : "#ffffff"}, bgcolor: isGood === null ? GRID : isGood ? "#2f7d4a" : "#b42318", borderpad: 4});
  annotations.push({xref: "paper", yref: "paper", x: 0, xshift: -58, y: 0.5, textangle: -90, xanchor: "center", showarrow: false, text: escaped(isMagnitude ? unit : "phase / °")});
  Plotly.react("solid-grid", data, {...PLOT, ...layout, height, margin: {l: 76, r: 12, t: head, b: foot}, annotations, hovermode: "x",
    legend: {orientation: "h", x: 1, y: 1, yref: "paper", xanchor: "right", yanchor: "bottom", uirevision: "kept"}}, width > 1 ? CONFIG : BARE);
  byId("solid-words").textContent = row.check ? row.check.words : "";
  byId("solid-inp").value = state.solidInp;
  press(byId("solid-nav"));
}

function reconstructions() {
  const nav = byId("solid-nav"), force = element("select", undefined, {id: "solid-inp"});
  if (!IS_MEASURED.some(value => value)) return;
  state.body = worstBody();
  buttons(nav, "body", CHECKED.map(row => [row.body, row.body]), reconstruction);
  CHECKED.forEach((row, k) => { const isGood = verdictOf(row)[1]; nav.children[k].prepend(element("i", "", {className: "dot " + (isGood === null ? "plain" : isGood ? "good" : "trouble"), title: verdictOf(row)[0]})); });
  INPUTS.forEach((name, k) => force.add(new Option(name, k)));
  force.onchange = () => { state.solidInp = Number(force.value); reconstruction(); };
  nav.append(" per force at ", force);
  buttons(nav, "curve", [["magnitude", "magnitude"], ["phase", "phase"]], reconstruction);
  reconstruction();
  let before = channelGrid(state.body).length;
  addEventListener("resize", () => { const now = channelGrid(state.body).length; if (now !== before) { before = now; reconstruction(); } });
}
