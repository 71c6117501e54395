// Parameters as sliders, with drawing, tolerance and interval on each track.

import {warn} from "./exchange.js";

const LOG_SPAN = Math.log(10), FREE_SPAN = 4;  // nats about the drawing; standard deviations where no bound is near
const STEPS = 1000;

export const create = (tag, properties, ...children) => { const e = Object.assign(document.createElement(tag), properties); e.append(...children); return e; };

export function fourDigits(value) {
  const text = value.toPrecision(4);
  return text.includes("e") || Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3) ? value.toExponential(3).replace("e+", "e") : text;
}

export const readNumber = text => text.trim() ? Number(text.replace(",", ".")) : NaN;

export const valueAt = (row, x) => row.log ? row.drawn * Math.exp(row.scale * x) : row.drawn + row.scale * x;
const placeOf = (row, value) => row.log ? Math.log(value / row.drawn) / row.scale : (value - row.drawn) / row.scale;

function change(row, x) {  // in the words of an engineer: a factor, or standard deviations
  if (Math.abs(x) < 5e-13) return "as drawn";
  return row.log && !row.tolerance ? "× " + Math.exp(row.scale * x).toPrecision(3) : (x > 0 ? "+" : "−") + Math.abs(x).toFixed(2) + " sd";
}

function bounds(row) {  // where a value may lie, in words
  const [low, high] = [row.low, row.high].map(x => x === null ? "" : fourDigits(valueAt(row, x)));
  return (low ? ` from ${low}` : row.log ? " above 0" : "") + (high ? `${low ? " to" : ", at most"} ${high}` : "") + " " + row.unit;
}

export function createSliders(place, rows, tuned, onInput, onCommit) {
  const list = [], groups = new Map();
  for (const row of rows) {
    if (!groups.has(row.location)) groups.set(row.location, []);
    groups.get(row.location).push(row);
  }
  const ranked = [...groups].sort((a, b) => a[1].every(r => r.tolerance) - b[1].every(r => r.tolerance));
  ranked.forEach(([location, members], number) => {
    const count = create("span", {className: "soft"});
    const group = create("details", {open: number < 2}, create("summary", {}, create("strong", {textContent: location.replace(/^\w+:/, "")}), " ", create("span", {className: "soft", textContent: location.split(":")[0]}), " ", count));
    const items = members.map(row => addRow(group, row, location));
    place.append(group);
    list.push(...items);
    groups.set(location, {group, items, count});
  });

  function addRow(group, row, location) {
    const plain = row.name.replace(location.replace(/^\w+:/, "") + "_", "").replace(location.replace(/^\w+:/, "") + ".", ""), id = "p" + list.length + "-" + group.childElementCount;
    const reach = row.log && !row.tolerance ? LOG_SPAN / row.scale : FREE_SPAN, near = v => v ?? Infinity;
    const spread = [tuned[row.name] ?? 0, ...(row.interval ?? [])];
    const low = Math.max(row.low ?? -Infinity, Math.min(-reach, ...spread)), high = Math.min(near(row.high), Math.max(reach, ...spread));
    const slider = create("input", {type: "range", id, min: low, max: high, step: (high - low) / STEPS, value: 0});
    const field = create("input", {type: "text", inputMode: "decimal", className: "value", autocomplete: "off"});
    field.setAttribute("aria-label", `${row.name} in ${row.unit}`);
    const reset = create("button", {type: "button", textContent: "↺", title: "as drawn", className: "reset"});
    reset.setAttribute("aria-label", `${row.name} as drawn`);
    const name = create("label", {textContent: plain.replace(/[._]/g, " "), title: row.name, htmlFor: id}), note = create("span", {className: "note soft"});
    const track = create("div", {className: "track"});
    const share = x => 100 * (Math.min(Math.max(x, low), high) - low) / (high - low);
    const span = (className, a, b) => { const e = create("i", {className}); e.style.left = share(a) + "%"; if (b !== undefined) e.style.width = share(b) - share(a) + "%"; track.append(e); };
    if (row.sd) span("band", -row.sd, row.sd);
    if (row.interval) span("interval", ...row.interval);
    span("drawn", 0);
    if (row.name in tuned) span("tuned", tuned[row.name]);
    track.append(slider);
    const line = create("div", {className: "row"}, name, track, field, create("span", {className: "unit soft", textContent: row.unit}), note, reset);
    group.append(line);
    const item = {row, line, slider, field, note, reset, x: 0, isHeld: false};
    slider.addEventListener("input", () => { item.isHeld = true; write(item, Number(slider.value), false); onInput(row.name, item.x); });
    for (const end of ["pointerup", "blur"]) slider.addEventListener(end, () => { item.isHeld = false; });  // no change where it began
    slider.addEventListener("change", () => { item.isHeld = false; onCommit({[row.name]: Number(slider.value)}); });
    field.addEventListener("change", () => {
      const x = placeOf(row, readNumber(field.value));
      if (x >= (row.low ?? -Infinity) && x <= (row.high ?? Infinity) && Number.isFinite(x)) { onCommit({[row.name]: Math.abs(x) < 1e-12 ? 0 : x}); return; }
      warn(`${row.name} cannot be "${field.value}": give a number${bounds(row)}`);
      write(item, item.x);
    });
    reset.addEventListener("click", () => onCommit({[row.name]: 0}));
    write(item, 0);
    return item;
  }

  function write(item, x, moves = true) {
    const {row} = item, value = fourDigits(valueAt(row, x)), words = change(row, x);
    item.x = x;
    if (moves) item.slider.value = x;
    if (document.activeElement !== item.field || moves) item.field.value = value;
    item.slider.setAttribute("aria-valuetext", `${value} ${row.unit}, ${words}`);
    item.note.textContent = words;
    item.line.classList.toggle("moved", x !== 0);
    item.reset.disabled = x === 0;
  }

  return {
    show(values) {
      for (const item of list) {
        const x = values[item.row.name] ?? 0;
        if (!item.isHeld && (x !== item.x || item.field.value !== fourDigits(valueAt(item.row, x)))) write(item, x);
      }
      for (const {items, count} of groups.values()) {
        const moved = items.filter(i => i.x !== 0).length;
        count.textContent = moved ? `${moved} of ${items.length} moved` : String(items.length);
      }
    },
    filter(text) {
      const words = text.toLowerCase().split(/\s+/).filter(Boolean);
      for (const {group, items} of groups.values()) {
        let shown = 0;
        for (const {row, line} of items) { line.hidden = !words.every(w => (row.name + " " + row.location).toLowerCase().includes(w)); shown += !line.hidden; }
        group.hidden = !shown;
        if (words.length && shown) group.open = true;
      }
    },
    names: rows.map(row => row.name),
  };
}
