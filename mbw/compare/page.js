// Tests beside each other: modes with shifts or scatter, FRFs overlaid with the noise of each.
const MODES = DATA.modes, NAMES = DATA.names, CELLS = DATA.cells, LINES = floats(DATA.freq).length;
const FREQ = Array.from(floats(DATA.freq)), FRF = shorts(DATA.frf), NOISE = shorts(DATA.noise), IS_FLEET = DATA.kind === "fleet";
const state = {cell: 0, mode: 0, playing: false};
const colour = test => HUES[test % HUES.length];
const number = (value, text) => value === null || value === undefined ? "-" : text(value);
const sigmas = value => value < 1000 ? value.toPrecision(3) : value.toFixed(0);
const percent = size => value => (100 * value / size).toPrecision(2) + " %";

function fill(id, columns, rows, click) {
  const table = document.querySelector("#" + id + " table"), head = element("tr");
  head.append(...columns.map(([title, hint]) => element("th", title, {title: hint ?? "", className: title ? "" : "name"})));
  table.tHead.append(head);
  rows.forEach((cells, k) => {
    const row = element("tr");
    row.append(...cells.map(([text, kind]) => element("td", text, {className: kind ?? ""})));
    if (click) row.onclick = () => click(k);
    table.tBodies[0].append(row);
  });
}

// ---- modes ---------------------------------------------------------------------------------

function pairTable() {
  const columns = [["mode"], [NAMES[0] + " / Hz"], [NAMES[1] + " / Hz"], ["shift / %", "second less first, relative"], ["±", "one standard deviation, by the noise of both tests"],
    ["sigma", "shift over its standard deviation"], [NAMES[0] + " ζ / %"], [NAMES[1] + " ζ / %"], ["±", "one standard deviation of the difference"], ["sigma", "difference over its standard deviation"],
    ["MAC", "modal assurance criterion at the shared channels"]];
  fill("modes", columns, MODES.map((mode, k) => {
    const shift = mode.frequency_shift, loss = mode.damping_shift, size = mode.frequency[0] / 100;
    const mark = row => row && row.changed ? "changed" : "";
    return [[String(k + 1)], ...mode.frequency.map(v => [number(v, digits)]), [number(shift, s => (s.value / size).toFixed(3)), mark(shift)], [number(shift, s => deviation(s.sd / size))],
      [number(shift && shift.significance, sigmas)], ...mode.damping.map((v, test) => [number(v, d => (100 * d).toFixed(3)), test ? mark(loss) : ""]), [number(loss, s => deviation(100 * s.sd))],
      [number(loss && loss.significance, sigmas)], [shift ? mode.mac[1].toFixed(2) : "-"]];
  }));
  byId("modes-note").textContent = "Red: changed beyond noise" + (DATA.kind === "visits" ? " and what differs between two visits of itself." : ".") + " ±: one standard deviation of the difference; sigma: the difference in standard deviations. A mode with one frequency has no partner.";
}

function fleetTable() {
  const parts = [["frequency", "frequency / Hz", digits], ["damping", "ζ / %", v => (100 * v).toFixed(3)]];
  const columns = [["mode"], ["tests"], ...parts.flatMap(([, title]) => [[title, "mean"], ["spread", "standard deviation between machines"], ["within", "standard deviation within a test"]]), ["stands out"]];
  fill("modes", columns, MODES.map((mode, k) => {
    const cells = parts.flatMap(([name, , text]) => {
      const row = mode[name + "_scatter"], size = Math.abs(row.mean);
      return [[text(row.mean)], [number(row.spread, percent(size))], [number(row.within, percent(size))]];
    });
    const names = [...new Set(parts.flatMap(([name]) => mode[name + "_scatter"].stands_out))];
    return [[String(k + 1)], [mode.frequency.filter(v => v !== null).length + " of " + NAMES.length], ...cells, [names.join(", ") || "-", names.length ? "changed" : ""]];
  }));
  byId("modes-note").textContent = "Spread: standard deviation between the tests; within: that of a single test by its noise. Dots: each test, relative to the mean of the mode.";
}

function shifts() {
  const traces = NAMES.map((name, test) => ({type: "scatter", mode: "markers", name, x: MODES.map((_, k) => k + 1),
    y: MODES.map(mode => mode.frequency[test] === null ? null : 100 * (mode.frequency[test] / mode.frequency_scatter.mean - 1)),
    error_y: {type: "data", array: MODES.map(mode => mode.frequency[test] === null ? 0 : 200 * mode.frequency_sd[test] / mode.frequency_scatter.mean), thickness: 1},
    marker: {color: colour(test), size: 8}, hovertemplate: "mode %{x}: %{y:+.3g} %<extra>" + escaped(name) + "</extra>"}));
  Plotly.newPlot("shifts", traces, {...PLOT, height: 320, margin: {l: 70, r: 16, t: 26, b: 44}, xaxis: {title: {text: "mode"}, dtick: 1, gridcolor: GRID, zeroline: false},
    yaxis: {title: {text: "frequency from its mean / %"}, gridcolor: GRID}, legend: {orientation: "h", y: 1.02, yanchor: "bottom"}}, CONFIG);
}

// ---- FRFs ----------------------------------------------------------------------------------

function frf() {
  const data = [], sizes = [];
  NAMES.forEach((name, test) => {
    const place = state.cell * NAMES.length + test, curve = unpackedPolar(FRF, place, LINES);
    const noise = Array.from({length: LINES}, (_, k) => sizeOf(NOISE[place * LINES + k]));
    sizes.push(curve.size, noise);
    data.push({type: "scatter", mode: "lines", x: FREQ, y: noise, name: name + ", noise", legendgroup: name, showlegend: false, opacity: 0.5, line: {color: colour(test), width: 0.8},
      hovertemplate: "%{x:.5g} Hz: %{y:.3g}<extra>" + escaped(name) + ", noise</extra>"}, ...bodeTraces(FREQ, curve, name, {color: colour(test), width: 1.5}));
  });
  Plotly.react("frf", data, {...PLOT, height: 540, margin: {l: 76, r: 12, t: 40, b: 44}, shapes: marks(),
    xaxis: {title: {text: "frequency / Hz", standoff: 4}, gridcolor: GRID, zeroline: false, ticks: "outside", anchor: "y2"}, ...bodeAxes(sizes, DATA.quantity + " / (" + DATA.units[state.cell] + ")"),
    legend: {orientation: "h", x: 0, y: 1.01, xanchor: "left", yanchor: "bottom"}}, CONFIG);
  byId("which").value = state.cell;
  document.querySelectorAll("#channels tbody tr").forEach((row, k) => row.setAttribute("aria-selected", String(k === state.cell)));
}

// Natural frequencies of each test, dotted.
function marks() {
  return MODES.flatMap(mode => mode.frequency.map((f, test) => f === null ? null : {type: "line", xref: "x", yref: "paper", x0: f, x1: f, y0: 0.36, y1: 1,
    line: {color: colour(test), width: 0.6, dash: "dot"}})).filter(shape => shape);
}

function chooser() {
  const select = element("select", undefined, {id: "which"});
  CELLS.forEach(([out, source], k) => select.add(new Option(out + " per " + source, k)));
  select.onchange = () => { state.cell = Number(select.value); frf(); };
  byId("cell").append("FRF ", select);
}

(IS_FLEET ? fleetTable : pairTable)();
if (IS_FLEET) shifts(); else byId("shifts").hidden = true;
byId("frfs").hidden = !CELLS.length;
byId("channels-section").hidden = IS_FLEET || !CELLS.length;
if (!IS_FLEET) fill("channels", [["", ""], ["difference / noise"], ["difference / FRF"]], DATA.differences.map(([over, relative], k) =>
  [[CELLS[k].join(" per "), "name"], [over.toPrecision(3)], [(100 * relative).toPrecision(3) + " %"]]), k => { state.cell = k; frf(); });
chooser();
if (CELLS.length) frf();
