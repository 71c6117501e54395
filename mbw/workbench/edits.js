// What if: masses, springs, struts, appendages and delays, each with sliders for its sizes.

import {warn} from "./exchange.js";
import {create, fourDigits, readNumber} from "./sliders.js";

const STEPS = 400, SPAN = 10;  // a slider reaches from a tenth of a size to ten times as much
const AXES = {x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1]};
const ROUND = value => Number(value.toPrecision(1));

// Kinds with their sizes: name, unit, the first value for a body's mass and the middle of the band [Hz], and the largest one.
const STIFFNESS = [["stiffness", "N/m", (mass, hertz) => ROUND(0.1 * mass * (2 * Math.PI * hertz) ** 2)], ["damping", "N s/m", (mass, hertz) => ROUND(0.004 * mass * 2 * Math.PI * hertz)]];
const KINDS = {
  mass: {label: "Mass", sizes: [["mass", "kg", mass => ROUND(0.05 * mass)]]},
  spring: {label: "Spring", sizes: STIFFNESS, ends: () => ({to: "world", axis: AXES.z})},
  strut: {label: "Strut", sizes: STIFFNESS, ends: bodies => ({to: bodies.length > 1 ? bodies[0] : "world", end: [0, 0, 0]})},
  appendage: {label: "Appendage", sizes: [["mass", "kg", mass => ROUND(0.05 * mass)], ["frequency", "Hz", (_, hertz) => Number(hertz.toPrecision(2))], ["damping", "", () => 0.03, 0.99]]},
  delay: {label: "Delay", sizes: [["delay", "s", () => 0.001]]},
};

export function createEdits(place, adders, session, onPut, onPreview, onRemove) {
  const bodies = Object.keys(session.masses), middle = Math.sqrt(Math.max(session.freq[0], session.freq.at(-1) / 100) * session.freq.at(-1));
  let shown = [];

  for (const [kind, {label, sizes, ends}] of Object.entries(KINDS)) {
    if (kind === "delay" && !session.loops.length) continue;
    const button = create("button", {type: "button", textContent: "+ " + label});
    button.onclick = () => {
      let number = 1;
      const taken = name => shown.some(edit => edit.name === name) || session.names.some(each => each === name || each.startsWith(name + "_"));
      while (taken(kind + number)) number++;
      const body = bodies.at(-1), first = Object.fromEntries(sizes.map(([name, , start]) => [name, start(session.masses[body], middle)]));
      const where = kind === "delay" ? {loop: session.loops[0]} : {body, point: [0, 0, 0]};
      onPut({kind, name: kind + number, ...where, ...ends?.(bodies), ...first});
    };
    adders.append(button);
  }

  function select(edit, key, names, label, put, write = name => name, read = value => value) {
    const list = create("select", {});
    list.append(...names.map(name => new Option(name === "world" ? "the ground" : name, name)));
    list.value = read(edit[key]);
    list.setAttribute("aria-label", `${edit.name}: ${label}`);
    list.onchange = () => put({...edit, [key]: write(list.value)});
    return list;
  }

  function addRow(edit) {
    const remove = create("button", {type: "button", textContent: "✕", className: "reset", title: "take off"});
    remove.setAttribute("aria-label", `take ${edit.name} off`);
    remove.onclick = () => onRemove(edit.name);
    const words = edit.kind === "delay" ? [" in ", select(edit, "loop", session.loops, "loop", onPut)]
      : [" at ", select(edit, "body", bodies, "body", onPut)];
    if (edit.to) {
      words.push(" from ", select(edit, "to", ["world", ...bodies.filter(name => name !== edit.body)], "other end", onPut));
      if (edit.axis) words.push(" along ", select(edit, "axis", Object.keys(AXES), "axis", onPut, name => AXES[name], axis => Object.keys(AXES).find(name => AXES[name].every((v, k) => v === axis[k])) ?? "z"));
    }
    const line = create("div", {className: "edit"}, create("div", {className: "words"}, create("strong", {textContent: edit.name}), ...words, remove));
    if (edit.point) addPoint(line, edit, "point", edit.end ? `m from the centre of mass of ${edit.body}` : "m from its centre of mass");
    if (edit.end) addPoint(line, edit, "end", edit.to === "world" ? "m from the world's origin" : `m from the centre of mass of ${edit.to}`);
    for (const size of KINDS[edit.kind].sizes) line.append(addSize(edit, ...size));
    return line;
  }

  function restore(field, value) {
    warn(`${field.getAttribute("aria-label")} cannot be "${field.value}": give a number`);
    field.value = fourDigits(value);
  }

  function addPoint(line, edit, key, origin) {
    const fields = edit[key].map((value, k) => {
      const field = create("input", {type: "text", inputMode: "decimal", value: fourDigits(value), autocomplete: "off"});
      field.setAttribute("aria-label", `${edit.name}, ${key}: ${"xyz"[k]} in ${origin}`);
      field.onchange = () => {
        const number = readNumber(field.value);
        if (Number.isFinite(number)) onPut({...edit, [key]: edit[key].map((v, n) => n === k ? number : v)});
        else restore(field, value);
      };
      return create("label", {}, "xyz"[k] + " ", field);
    });
    line.append(create("div", {className: "words soft"}, ...fields, origin));
  }

  function addSize(edit, name, unit, start, largest = Infinity) {
    const size = edit[name] || start(session.masses[edit.body] ?? 1, middle), id = `${edit.name}-${name}`;
    const slider = create("input", {type: "range", id, min: -STEPS, max: STEPS, step: 1, value: 0});
    const field = create("input", {type: "text", inputMode: "decimal", className: "value", value: fourDigits(edit[name]), autocomplete: "off"});
    field.setAttribute("aria-label", `${edit.name}: ${name}${unit ? " in " + unit : ""}`);
    const valueAt = step => Math.min(largest, size * SPAN ** (Number(step) / STEPS));
    slider.setAttribute("aria-valuetext", `${fourDigits(edit[name])} ${unit}`);
    slider.oninput = () => {
      const value = valueAt(slider.value);
      field.value = fourDigits(value);
      slider.setAttribute("aria-valuetext", `${field.value} ${unit}`);
      onPreview({...edit, [name]: value});
    };
    slider.onchange = () => onPut({...edit, [name]: Number(valueAt(slider.value).toPrecision(6))});
    field.onchange = () => {
      const value = readNumber(field.value);
      if (Number.isFinite(value)) onPut({...edit, [name]: value});
      else restore(field, edit[name]);
    };
    const track = create("div", {className: "track"}, slider);
    return create("div", {className: "row"}, create("label", {textContent: name, htmlFor: id}), track, field, create("span", {className: "unit soft", textContent: unit}));
  }

  return {
    show(edits) {
      const focused = document.activeElement?.id || document.activeElement?.getAttribute?.("aria-label"), within = place.contains(document.activeElement);
      shown = edits;
      place.replaceChildren(...edits.map(addRow));
      if (within && focused) [...place.querySelectorAll("input, select, button")].find(e => e.id === focused || e.getAttribute("aria-label") === focused)?.focus();
    },
  };
}
