// The page of the workbench: each part draws the newest frame, all of one state.

import {act, begin, load, run, tryOut} from "./exchange.js";
import {createPlot, LABEL} from "./curves.js";
import {createScene} from "./scene.js";
import {createJobs} from "./jobs.js";
import {createEdits} from "./edits.js";
import {create, createSliders, fourDigits} from "./sliders.js";

const byId = id => document.getElementById(id);
let session = await load("/session");
document.title = session.name + " - workbench";
byId("title").textContent = session.name;

// ---- choice of input and output ---------------------------------------------------------------

const tests = Object.keys(session.measured);
function fill(select, sets) {
  select.replaceChildren(...sets.filter(([, names]) => names.length).map(([label, names]) => {
    const group = create("optgroup", {label});
    group.append(...names.map(name => new Option(name, name)));
    return group;
  }));
}
function fillChannels(reference) {
  const measured = session.measured[reference] ?? [], seen = new Set(measured);
  fill(byId("channel"), [["measured", measured], ["not measured", session.outputs.filter(name => !seen.has(name))]]);
}
byId("reference").onchange = event => act({do: "look", reference: event.target.value});
byId("channel").onchange = event => act({do: "look", channel: event.target.value});

function pick(point, isInput) {  // a point of the picture, along the axis that is looked at now
  const reference = byId("reference").value, channel = byId("channel").value;
  const ending = name => name.slice(name.lastIndexOf(":")).replace("-", "+");
  if (isInput) {
    const test = tests.find(name => session.ports[name].startsWith(point + ":"));
    act({do: "look", reference: test ?? point + ending(session.ports[reference] ?? reference)});
  } else {
    const wanted = point + ending(channel), options = [...(session.measured[reference] ?? []), ...session.outputs];
    act({do: "look", channel: options.includes(wanted) ? wanted : options.find(name => name.startsWith(point + ":")) ?? channel});
  }
}

// ---- parts of the page ------------------------------------------------------------------------

const reduced = matchMedia("(prefers-reduced-motion: reduce)").matches;
const plot = createPlot(byId("plot"), session.freq, session.curves, writeReadout);
const scene = createScene(byId("scene"), byId("marks"), pick);
const edits = createEdits(byId("edit-rows"), byId("adders"), session, edit => act({do: "put", edit}), edit => tryOut({edit}), name => act({do: "remove", name}));
let sliders;

// What depends on the machine's bodies and springs: at the beginning, and after something was added or taken off.
async function build() {
  scene.setMachine(await load("/scene"));
  byId("subtitle").textContent = `model ${session.model}, ${session.parameters.length} parameters`;
  byId("subtitle").title = session.path;
  fill(byId("reference"), [["measured", tests], ["not measured", session.inputs]]);
  byId("channel").replaceChildren();
  byId("groups").replaceChildren();
  sliders = createSliders(byId("groups"), session.parameters, session.tuned, (name, x) => tryOut({values: {[name]: x}}), values => act({do: "move", values}));
  sliders.filter(byId("filter").value);
}
await build();

function writeReadout(frequency, values, coherence) {
  const cells = session.curves.map(name => {
    const key = create("i", {className: "key " + name});
    const {size, angle} = values[name] ?? {};
    const has = Number.isFinite(size);
    return create("tr", {}, create("th", {scope: "row"}, key, LABEL[name]), create("td", {textContent: has ? fourDigits(size) : "none"}), create("td", {textContent: has ? angle.toFixed(1) + "°" : ""}));
  });
  const head = create("tr", {}, create("th", {scope: "col", textContent: frequency.toFixed(2) + " Hz"}), create("th", {scope: "col", textContent: "|H|"}), create("th", {scope: "col", textContent: "phase"}));
  byId("readout").replaceChildren(create("thead", {}, head), create("tbody", {}, ...cells));
  if (coherence !== undefined) byId("readout").tBodies[0].append(create("tr", {}, create("th", {scope: "row", textContent: "coherence"}), create("td", {textContent: coherence.toFixed(3)}), create("td")));
}

const percent = value => value === null || value === undefined ? "unknown" : (100 * value).toPrecision(3) + " %";
function writeFigures({gap, drawn_gap: drawn}) {
  if (gap.error === undefined) { byId("figures").hidden = true; return; }
  const rows = [["error of the FRFs", percent(gap.error), "drawn " + percent(drawn.error)]];
  if (gap.excess !== null) rows.push(["over the noise", "× " + gap.excess.toPrecision(3), "drawn × " + drawn.excess.toPrecision(3)]);
  byId("figures").replaceChildren(...rows.map(([name, value, note]) => create("div", {}, create("dt", {textContent: name}), create("dd", {}, create("strong", {textContent: value}), " ", create("span", {className: "soft", textContent: note})))));
}

let rowCount = -1;
function writeModes(frame) {
  const body = byId("mode-rows"), withTest = session.has_measured_modes;
  if (rowCount !== frame.modes.length) {
    rowCount = frame.modes.length;
    body.replaceChildren(...frame.modes.map((_, k) => {
      const button = create("button", {type: "button", textContent: k + 1});
      button.onclick = () => act({do: "look", mode: k + 1 === chosenMode ? 0 : k + 1});
      const row = create("tr", {}, create("td", {}, button), ...Array.from({length: withTest ? 6 : 3}, () => create("td")));
      row.onclick = event => { if (event.target !== button) button.click(); };
      return row;
    }));
  }
  frame.modes.forEach((mode, k) => {
    const shift = mode.drawn ? mode.frequency / mode.drawn - 1 : null;
    const texts = [mode.name || mode.frequency.toFixed(2), shift === null ? "" : (shift < 0 ? "−" : "+") + Math.abs(100 * shift).toFixed(1) + " %",
      mode.damping === null ? (mode.name ? "" : "> 100") : (100 * mode.damping).toFixed(2), mode.mac?.toFixed(3) ?? "", mode.measured?.toFixed(2) ?? "", mode.measured ? (100 * mode.measured_damping).toFixed(2) : ""];
    const row = body.rows[k], isChosen = k + 1 === frame.view.mode;
    for (let c = 1; c < row.cells.length; c++) if (row.cells[c].textContent !== texts[c - 1]) row.cells[c].textContent = texts[c - 1];
    if (isChosen && !row.classList.contains("chosen")) {  // scrolls the table alone, not the page
      const box = body.closest(".scroll"), gap = row.getBoundingClientRect().bottom - box.getBoundingClientRect().bottom;
      if (gap > 0) box.scrollTop += gap + 8;
    }
    row.classList.toggle("chosen", isChosen);
    row.cells[0].firstChild.setAttribute("aria-pressed", String(isChosen));
    row.cells[0].firstChild.setAttribute("aria-label", `mode ${k + 1}, ${texts[0]} Hz`);
  });
}

let chosenMode = 0, newest = null, jobs = null;
async function show(frame, isPreview) {
  if (!isPreview && frame.structure !== session.structure) {
    session = await load("/session");
    await build();
    newest = null;
  }
  if (!isPreview && newest?.structure !== frame.structure) edits.show(frame.edits);
  newest = frame; chosenMode = frame.view.mode;
  if (byId("reference").value !== frame.view.reference || !byId("channel").options.length) {
    byId("reference").value = frame.view.reference;
    fillChannels(frame.view.reference);
  }
  byId("channel").value = frame.view.channel;
  plot.show(frame, isPreview);
  scene.show(frame, session.ports, isPreview);
  writeFigures(frame); writeModes(frame);
  if (!isPreview) {
    sliders.show(frame.x);
    showCauses(frame.x);
    byId("undo").disabled = !frame.undo; byId("redo").disabled = !frame.redo;
    byId("as-drawn").disabled = !Object.keys(frame.x).length;
    writeStudy(frame.key);
    jobs?.look();
    history.replaceState(null, "", "#" + new URLSearchParams(frame.view));  // what is looked at, for a bookmark
  }
  dispatchEvent(new CustomEvent("painted", {detail: {key: frame.key, isPreview}}));
}

// Margins and errors take longer than a frame: they follow when the state rests, each with its age.
const MARGINS = [["crossover", "crossover", "Hz", 1], ["phase", "phase margin", "°", 1], ["gain", "gain margin", "×", 1], ["delay", "delay margin", "ms", 1e3], ["modulus", "modulus margin", "", 1]];
async function writeStudy(key) {
  if (!session.has_study) return;
  byId("plant-age").textContent = "computing …";
  let study;
  try { study = await load("/study"); } catch (error) { byId("plant-age").textContent = error.message; byId("plant-rows").replaceChildren(); return; }
  if (key !== newest.key) return;  // that of a later state is on its way
  byId("plant-age").textContent = study.sentences.join(". ");
  const number = (value, unit) => value === null || value === undefined ? "none" : value.toPrecision(4) + (unit ? " " + unit : "");
  const line = (name, drawn, current) => create("tr", {}, create("th", {scope: "row", textContent: name}), create("td", {textContent: drawn}), create("td", {className: "now", textContent: current}));
  const rows = study.loops.flatMap(({name, drawn, current}) => {
    const isStable = row => row && row.unstable === undefined, words = row => row ? `unstable at ${number(row.unstable, "Hz")}` : "unknown";
    if (!isStable(current)) return [line(name, isStable(drawn) ? "stable" : words(drawn), words(current))];
    return MARGINS.map(([field, label, unit, scale]) => line(`${name}: ${label}`, isStable(drawn) ? number(drawn[field] && drawn[field] * scale, unit) : words(drawn), number(current[field] && current[field] * scale, unit)));
  });
  rows.push(...study.errors.map(({name, drawn, current}) => line(`error ${name}, rms`, drawn ? number(drawn.rms, drawn.unit) : "unknown", current ? number(current.rms, current.unit) : "unknown")));
  const head = create("tr", {}, create("th", {scope: "col"}), create("th", {scope: "col", textContent: "as drawn"}), create("th", {scope: "col", textContent: "current"}));
  byId("plant-rows").replaceChildren(create("thead", {}, head), create("tbody", {}, ...rows));
  dispatchEvent(new CustomEvent("studied", {detail: {key}}));
}

// Causes of the verdict: a box switches each on and off where the model can have it.
byId("verdict").hidden = !session.verdict;
byId("headline").textContent = session.verdict?.headline ?? "";
const boxes = (session.verdict?.causes ?? []).map((cause, k) => {
  const names = Object.keys(cause.moves), box = create("input", {type: "checkbox", disabled: !names.length});
  box.onchange = () => act({do: "move", values: Object.fromEntries(names.map(name => [name, box.checked ? cause.moves[name] : 0]))});
  const label = create("label", {}, box, create("b", {className: "number", textContent: k + 1}), ` ${(100 * cause.probability).toFixed(0)} % ${cause.name}`);
  byId("cause-rows").append(create("div", {className: "edit"}, label, create("p", {className: "soft", textContent: [cause.sizes, cause.means].filter(Boolean).join(". ")}),
    ...(names.length ? [] : [create("p", {className: "soft", textContent: "not among those of the fit, or no term of the equation of motion: it cannot be switched here"})])));
  return {box, names};
});
function showCauses(x) {
  for (const {box, names} of boxes) box.checked = names.length > 0 && names.every(name => x[name]);
}

function say(text, isError = false) {
  byId("status").textContent = text;
  byId("status").className = isError ? "warn" : text ? "note" : "";
}

// ---- controls -----------------------------------------------------------------------------------

byId("undo").onclick = () => act({do: "undo"});
byId("redo").onclick = () => act({do: "redo"});
byId("as-drawn").onclick = () => act({do: "move", values: Object.fromEntries(Object.keys(newest.x).map(name => [name, 0]))});
byId("as-tuned").onclick = () => act({do: "move", values: session.tuned});
byId("as-tuned").hidden = !Object.keys(session.tuned).length;
byId("as-diagnosed").onclick = () => act({do: "move", values: session.diagnosed});
byId("as-diagnosed").hidden = !Object.keys(session.diagnosed).length;
byId("save").onclick = () => { say("Saving and reading back …"); run("save"); };
byId("export").onclick = () => { say("Writing the page …"); run("export"); };
byId("export").hidden = !session.has_page;
byId("logarithmic").checked = session.logarithmic;
plot.setLogarithmic(session.logarithmic);
byId("logarithmic").onchange = event => plot.setLogarithmic(event.target.checked);
byId("frames").onchange = event => scene.setFrames(event.target.checked);
byId("amplitude").oninput = event => scene.setAmplitude(Number(event.target.value));
byId("filter").oninput = event => sliders.filter(event.target.value);
const play = value => { byId("play").setAttribute("aria-pressed", String(value)); byId("play").textContent = value ? "Pause" : "Play"; scene.setPlaying(value); };
byId("play").onclick = () => play(byId("play").getAttribute("aria-pressed") !== "true");
addEventListener("keydown", event => {
  if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z" || event.target.matches("input[type=text], input[type=search]")) return;
  act({do: event.shiftKey ? "redo" : "undo"});
  event.preventDefault();
});
document.querySelectorAll(".of-test").forEach(e => { e.hidden = !session.has_measured_modes; });
document.querySelectorAll(".of-tuning").forEach(e => { e.hidden = !Object.keys(session.tuned).length; });
byId("plant").hidden = !session.has_study;
byId("remarks").hidden = !session.remarks.length;
byId("remarks").querySelector("ul").append(...session.remarks.map(textContent => create("li", {textContent})));

const asked = Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
await begin(show, say, () => edits.show(newest.edits));
jobs = createJobs(byId("job-rows"), byId("verbs"), session, () => newest.machine);
if (asked.reference && (asked.reference !== newest.view.reference || asked.channel !== newest.view.channel || Number(asked.mode) !== newest.view.mode))
  act({do: "look", reference: asked.reference, channel: asked.channel, mode: Number(asked.mode)});
play(!reduced);
document.documentElement.dataset.ready = "true";
