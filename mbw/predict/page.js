// Animated modes of a machine, energy shares, Bode plot.
const MODES = DATA.modes;
const state = {mode: 0, amplitude: 5, playing: !matchMedia("(prefers-reduced-motion: reduce)").matches,
               energy: "strain", rows: "", curves: "", axis: "linear"};

// ---- the table of modes --------------------------------------------------------------------

const percent = share => share < 0.0005 ? "0 %" : (100 * share).toFixed(0) + " %";

function table() {
  const body = document.querySelector("#modes tbody");
  MODES.forEach((mode, k) => {
    const row = element("tr");
    row.append(element("td", String(k + 1)), element("td", mode.frequency.toFixed(mode.frequency < 10 ? 3 : 2)), element("td", damping(mode)));
    [mode.name || mode.spring, mode.body, mode.damper].forEach(largest => {  // a name, or name and share
      const cell = element("td", undefined, {className: "name"});
      if (typeof largest === "string") cell.append(element("em", largest));
      else if (largest) cell.append(element("small", percent(largest[1])), largest[0]);
      cell.title = typeof largest === "string" ? largest : largest ? percent(largest[1]) + " " + largest[0] : "";
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
  arrowKeys();
}

const damping = mode => Number.isNaN(Number(mode.damping)) ? mode.damping : Number(mode.damping).toFixed(2);

function choose(k) {
  const mode = MODES[k], amount = damping(mode);
  turn(k, mode.name ? mode.name : mode.frequency.toPrecision(5) + " Hz, " + (/\d/.test(amount) ? "damping " + amount + " %" : amount));
  mark();
}

// ---- the heat map --------------------------------------------------------------------------

const KINDS = [["strain", "strain energy"], ["kinetic", "kinetic energy"], ["dissipation", "dissipation"]];
const COLUMNS = DATA.energy.modes;

function heat() {
  const source = DATA.energy[state.energy], whole = state.rows === "whole";
  const names = whole ? source.whole : source.names, values = floats(whole ? source.sums : source.values);
  const n = COLUMNS.length, z = names.map((_, r) => Array.from(values.slice(r * n, (r + 1) * n), v => 100 * v));
  const low = z.reduce((m, row) => Math.min(m, ...row), 0), signed = low < -1, most = signed ? Math.max(100, -low) : 100;
  const shapes = [];
  if (!whole) source.owners.forEach((owner, r) => { if (r && kin(owner) !== kin(source.owners[r - 1])) shapes.push({type: "line", xref: "paper",
    x0: 0, x1: 1, y0: r - 0.5, y1: r - 0.5, line: {color: SOFT, width: 1}}); });
  const row = names.length > 80 ? 14 : 17;
  const layout = {height: Math.max(220, 110 + row * names.length), margin: {l: 20, r: 10, t: 8, b: 74}, font: FONT, paper_bgcolor: PAPER,
    plot_bgcolor: PAPER, shapes,
    xaxis: {tickvals: COLUMNS.map((_, k) => k), ticktext: COLUMNS.map(k => tick(MODES[k])), tickangle: -90, tickfont: {size: 10},
      title: {text: "modes, frequency / Hz", standoff: 10}, automargin: true, showgrid: false, zeroline: false, range: [-0.5, Math.max(n, 8) - 0.5]},
    yaxis: {tickvals: names.map((_, k) => k), ticktext: names, range: [names.length - 0.5, -0.5], automargin: true, showgrid: false,
      zeroline: false, tickfont: {size: row - 6}}};
  const trace = {type: "heatmap", z, xgap: 1, ygap: 1, zmin: signed ? -most : 0, zmax: most, zmid: signed ? 0 : undefined,
    colorscale: signed ? [[0, RED], [0.5, hue("hover")], [1, hue("deep")]] : [[0, hue("hover")], [0.1, BLUES[1][1]], [0.4, BLUES[2][1]], [1, hue("deep")]],
    colorbar: {ticksuffix: " %", thickness: 12, len: 200, lenmode: "pixels", y: 1, yanchor: "top", outlinewidth: 0},
    customdata: z.map((values, r) => values.map((_, k) => [names[r], COLUMNS[k] + 1, MODES[COLUMNS[k]].frequency.toPrecision(5)])),
    hovertemplate: "%{customdata[0]}, mode %{customdata[1]}, %{customdata[2]} Hz: %{z:.1f} %<extra></extra>"};
  Plotly.react("energy", [trace], layout, {...CONFIG, displayModeBar: false}).then(place => {
    if (!place.dataset.listens) { place.dataset.listens = "yes"; place.on("plotly_click", event => choose(COLUMNS[event.points[0].x])); }
    mark();
  });
  press(byId("kinds"));
}

const kin = owner => owner.startsWith("tendon:") ? "tendon:" : owner;  // all tendons form one group
const tick = mode => mode.name || (mode.frequency < 10 ? mode.frequency.toFixed(2) : mode.frequency.toFixed(1));

// ---- the Bode plot -------------------------------------------------------------------------

const BODE = DATA.bode, FREQ = floats(BODE.freq), FRFS = floats(BODE.values), MANY = 10;
const BEFORE = BODE.before ? floats(BODE.before) : null;  // of the machine alone, where something is put on it

const LOW = BODE.low && floats(BODE.low), HIGH = BODE.high && floats(BODE.high);  // 95 % intervals of a tuning
const ends = (values, k) => values.subarray(k * FREQ.length, (k + 1) * FREQ.length);

function bode() {
  const chosen = BODE.labels.map((label, k) => k).filter(k => state.curves === "all" || BODE.groups[k] === state.curves);
  const units = [...new Set(chosen.map(k => BODE.units[k]))], data = [], sizes = [];
  chosen.forEach((k, n) => {
    const values = polar(complexes(FRFS, k, FREQ.length)), hidden = n >= MANY;
    const name = BODE.labels[k] + (units.length > 1 ? " [" + BODE.units[k] + "]" : "");
    if (!hidden) sizes.push(values.size);
    const extra = {visible: hidden ? "legendonly" : true};
    if (HIGH) data.push(...bandTraces(FREQ, ends(LOW, k), ends(HIGH, k), name, HUES[n % HUES.length], extra));
    data.push(...bodeTraces(FREQ, values, name, {color: HUES[n % HUES.length], width: 1.4}, extra));
    if (!BEFORE) return;
    const alone = polar(complexes(BEFORE, k, FREQ.length));
    if (!hidden) sizes.push(alone.size);
    if (alone.size.some(size => size !== null)) data.push(...bodeTraces(FREQ, alone, name + ", before",
      {color: HUES[n % HUES.length], width: 1.4, dash: "dot"}, {visible: hidden ? "legendonly" : true, opacity: 0.75}));
  });
  const x = {gridcolor: GRID, zeroline: false, type: state.axis, ticks: "outside", anchor: "y2"};
  const layout = {...PLOT, height: 560, margin: {l: 76, r: 12, t: 34, b: 46},
    xaxis: {...x, title: {text: "Hz", standoff: 4}},
    ...bodeAxes(sizes, BODE.quantity + " / (" + (units.length > 1 ? "unit in the legend" : units[0]) + ")"),
    legend: {x: 1.01, y: 1, xanchor: "left", tracegroupgap: 0}, showlegend: true};
  Plotly.react("bode", data, layout, CONFIG).then(mark);
  press(byId("curves"));
}

// Return short lines at the natural frequencies above the phase: before in grey, after in black.
function ticks() {
  const last = FREQ[FREQ.length - 1], rows = [[BODE.frequencies, 0.328, GREY], [MODES.filter(m => /\d/.test(damping(m))).map(m => m.frequency), 0.303, INK]];
  return rows.flatMap(([frequencies, low, color]) => frequencies.filter(f => f >= FREQ[0] && f <= last).map(f =>
    ({type: "line", xref: "x", yref: "paper", x0: f, x1: f, y0: low, y1: low + 0.024, line: {color, width: 1.5}})));
}

// Mark the chosen mode: a column of the heat map, a line in the Bode plot.
function mark() {
  const energy = byId("energy"), column = COLUMNS.indexOf(state.mode), plot = byId("bode"), frequency = MODES[state.mode].frequency;
  if (energy.layout && energy.layout.shapes) {
    const shapes = energy.layout.shapes.filter(s => s.name !== "chosen");
    if (column >= 0) shapes.push({name: "chosen", type: "rect", yref: "paper", x0: column - 0.5, x1: column + 0.5, y0: 0, y1: 1,
      line: {color: ORANGE, width: 1.5}});
    Plotly.relayout(energy, {shapes});
  }
  const chosen = frequency > 0 && frequency <= FREQ[FREQ.length - 1] ? [{type: "line", xref: "x", x0: frequency, x1: frequency, yref: "paper",
    y0: 0, y1: 1, line: {color: ORANGE, width: 1, dash: "dot"}}] : [];
  if (plot.layout) Plotly.relayout(plot, {shapes: [...(BEFORE ? ticks() : []), ...chosen]});
}

function panels() {
  const kinds = byId("kinds"), choice = byId("curves"), groups = [...new Set(BODE.groups)];
  buttons(kinds, "energy", KINDS, heat);
  kinds.append(element("span", "", {className: "gap"}));
  state.rows = DATA.energy.strain.names.length > 60 ? "whole" : "each";
  buttons(kinds, "rows", [["each", "each direction"], ["whole", "stages"]], heat);
  if (COLUMNS.length < MODES.length) kinds.append(element("span", "the lowest " + COLUMNS.length + " of " + MODES.length + " modes", {className: "soft"}));
  const legend = "Solid: with what is put on the machine. Dotted: the machine alone. Between magnitude and phase: natural frequencies, before in grey, after in black. ";
  const shaded = "Shaded: 95 % interval of the magnitude, from the tuning. ";
  byId("bode-remark").textContent = (HIGH ? shaded : "") + (BEFORE ? legend : "") + BODE.remark;
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

// ---- the state space -------------------------------------------------------------------------

function stateSpace() {
  if (!DATA.check) return;
  const check = DATA.check, freq = floats(check.freq), values = floats(check.values);
  const [exact, states] = [0, 1].map(k => complexes(values, k, freq.length));
  const curves = [polar(exact), polar(states)], rest = Array.from(floats(check.difference), size => size > 0 ? size : null);
  const data = [...bodeTraces(freq, curves[0], "equation of motion", {color: HUES[0], width: 2.5}),
    ...bodeTraces(freq, curves[1], "state space", {color: HUES[1], width: 1.4, dash: "dash"}),
    {type: "scatter", mode: "lines", x: freq, y: rest, name: "difference", line: {color: GREY, width: 1.2},
      hovertemplate: "%{x:.5g} Hz: %{y:.4g}<extra>difference</extra>"}];
  const axes = bodeAxes([...curves.map(c => c.size), rest], check.quantity + " / (" + check.unit + ")");
  const layout = {...PLOT, height: 460, margin: {l: 76, r: 12, t: 34, b: 46}, title: {text: check.label, font: {size: 14}},
    xaxis: {gridcolor: GRID, zeroline: false, ticks: "outside", anchor: "y2", title: {text: "Hz", standoff: 4}}, ...axes,
    legend: {x: 1.01, y: 1, xanchor: "left", tracegroupgap: 0}, showlegend: true};
  Plotly.react("state-space", data, layout, CONFIG);
}

film();
table();
panels();
stateSpace();
chooseFirst();
start();
