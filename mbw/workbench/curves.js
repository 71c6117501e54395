// FRF of the page: magnitude with the band of the measurement, phase and coherence, and a cursor.

const STYLE = {  // dash and width: no meaning by colour alone
  measured: {dash: [], width: 1.6}, drawn: {dash: [6, 4], width: 1.4}, tuned: {dash: [11, 3], width: 1.6},
  diagnosed: {dash: [9, 3, 2, 3], width: 1.6}, current: {dash: [], width: 2.4},
};
export const LABEL = {measured: "measured", drawn: "as drawn", tuned: "tuned", diagnosed: "diagnosed", current: "current"};
const QUANTILE_95 = 1.96, LEFT = 58, RIGHT = 16;

export function createPlot(canvas, freq, names, onCursor) {
  const context = canvas.getContext("2d"), base = document.createElement("canvas");
  let frame = null, polar = {}, range = null, zoom = null, logarithmic = false, cursor = Math.floor(freq.length / 2), drag = null, viewed = "";
  const colour = {};
  let all = [freq[0], freq[freq.length - 1]];

  function readColours() {
    const style = getComputedStyle(document.documentElement);
    for (const name of [...names, "ink", "soft", "line", "panel", "accent"]) colour[name] = style.getPropertyValue("--" + name).trim();
  }

  const span = () => zoom ?? all;
  const scale = f => logarithmic ? Math.log(Math.max(f, 1e-9)) : f;
  const toX = f => { const [a, b] = span().map(scale); return LEFT + (scale(f) - a) / (b - a) * (width() - LEFT - RIGHT); };
  const toF = x => { const [a, b] = span().map(scale), s = a + (x - LEFT) / (width() - LEFT - RIGHT) * (b - a); return logarithmic ? Math.exp(s) : s; };
  const width = () => canvas.clientWidth, height = () => canvas.clientHeight;
  const parts = () => {  // top and bottom of magnitude, phase and coherence
    const has = frame?.arrays.coherence ? 1 : 0, free = height() - 58 - 18 * has, m = 20 + free * (has ? 0.6 : 0.72), p = m + 18 + free * (has ? 0.26 : 0.28);
    return {magnitude: [20, m], phase: [m + 18, p], coherence: has ? [p + 18, height() - 20] : null};
  };

  function toPolar(values) {
    const n = values.length / 2, size = new Float32Array(n), angle = new Float32Array(n);
    for (let k = 0; k < n; k++) {
      size[k] = Math.log10(Math.hypot(values[2 * k], values[2 * k + 1]) || NaN);
      angle[k] = Math.atan2(values[2 * k + 1], values[2 * k]) * 180 / Math.PI;
    }
    return {size, angle};
  }

  // Draw a curve with at most two points a pixel, the lowest and the highest: no peak is lost.
  function trace(g, values, toY, breaks = Infinity) {
    g.beginPath();
    let column = NaN, low = 0, high = 0, last = NaN, pen = false, lowAt = 0, highAt = 0;
    const flush = x => { for (const y of lowAt < highAt ? [low, high] : [high, low]) { pen ? g.lineTo(x, y) : g.moveTo(x, y); pen = true; } };
    for (let k = 0; k < values.length; k++) {
      const x = toX(freq[k]), y = toY(values[k]);
      if (Number.isNaN(y)) continue;
      if (Math.abs(values[k] - last) > breaks) { if (!Number.isNaN(column)) flush(column); pen = false; column = NaN; }
      last = values[k];
      if (Math.abs(x - column) < 0.5) {
        if (y < low) { low = y; lowAt = k; }
        if (y > high) { high = y; highAt = k; }
        continue;
      }
      if (!Number.isNaN(column)) flush(column);
      column = x; low = high = y; lowAt = highAt = k;
    }
    if (!Number.isNaN(column)) flush(column);
    g.stroke();
  }

  function curve(g, name) {
    const {magnitude, phase} = parts(), line = STYLE[name];
    g.strokeStyle = colour[name]; g.lineWidth = line.width; g.setLineDash(line.dash);
    for (const [values, toY, breaks, [top, bottom]] of [[polar[name].size, toLevel, Infinity, magnitude], [polar[name].angle, toAngle, 180, phase]]) {
      g.save(); g.beginPath(); g.rect(LEFT, top, width() - LEFT - RIGHT, bottom - top); g.clip();
      trace(g, values, toY, breaks);
      g.restore();
    }
  }

  const toLevel = v => { const [top, bottom] = parts().magnitude; return bottom - (v - range[0]) / (range[1] - range[0]) * (bottom - top); };
  const toAngle = v => { const [top, bottom] = parts().phase; return bottom - (v + 190) / 380 * (bottom - top); };

  function fitRange(isNewView) {
    const sizes = Object.keys(polar).flatMap(name => Array.from(polar[name].size)).filter(Number.isFinite).sort((a, b) => a - b);
    if (!sizes.length) { range = [-1, 1]; return; }
    const fit = [sizes[Math.floor(0.01 * sizes.length)] - 0.2, sizes[sizes.length - 1] + 0.15];
    range = isNewView || !range ? fit : [Math.min(range[0], fit[0]), Math.max(range[1], fit[1])];
  }

  function ticks() {
    const [a, b] = span(), list = [];
    if (logarithmic) {
      for (let d = Math.floor(Math.log10(a)); d <= Math.log10(b); d++) for (const m of [1, 2, 5]) if (m * 10 ** d >= a && m * 10 ** d <= b) list.push(m * 10 ** d);
      return list;
    }
    const raw = (b - a) / 7, unit = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].find(m => m * unit >= raw) * unit;
    for (let f = Math.ceil(a / step) * step; f <= b; f += step) list.push(f);
    return list;
  }

  function drawBase() {  // all that does not change while a slider moves
    const ratio = devicePixelRatio || 1, g = base.getContext("2d"), {magnitude, phase, coherence} = parts();
    base.width = canvas.width; base.height = canvas.height;
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width(), height());
    g.font = "12px system-ui, 'DejaVu Sans', sans-serif"; g.fillStyle = colour.soft; g.strokeStyle = colour.line; g.lineWidth = 1;
    const bottom = (coherence ?? phase)[1];
    g.textAlign = "center";
    for (const f of ticks()) {
      const x = Math.round(toX(f)) + 0.5;
      for (const box of [magnitude, phase, coherence].filter(Boolean)) { g.beginPath(); g.moveTo(x, box[0]); g.lineTo(x, box[1]); g.stroke(); }
      g.fillText(String(Number(f.toPrecision(6))), x, bottom + 15);
    }
    g.textAlign = "right"; g.fillText("f / Hz", LEFT - 12, bottom + 15);
    const rule = (y, text) => { g.beginPath(); g.moveTo(LEFT, y); g.lineTo(width() - RIGHT, y); g.stroke(); g.fillText(text, LEFT - 6, y + 4); };
    const step = Math.max(1, Math.round((range[1] - range[0]) / 6));
    for (let d = Math.ceil(range[0]); d <= range[1]; d += step) rule(Math.round(toLevel(d)) + 0.5, "10" + superscript(d));
    for (const angle of [-180, 0, 180]) rule(Math.round(toAngle(angle)) + 0.5, angle + "°");
    if (coherence) for (const v of [0, 1]) rule(Math.round(coherence[1] - v * (coherence[1] - coherence[0])) + 0.5, String(v));
    g.textAlign = "left";
    tag(g, `|H| / (${frame.unit})`, magnitude); tag(g, "phase", phase);
    if (frame.arrays.deviation) band(g);
    if (coherence) {
      g.strokeStyle = colour.soft; g.lineWidth = 1.2; g.setLineDash([]);
      trace(g, frame.arrays.coherence, v => coherence[1] - v * (coherence[1] - coherence[0]));
      tag(g, "coherence", coherence);
    }
    for (const name of names) if (name !== "current" && polar[name]) curve(g, name);
  }

  function tag(g, text, [top]) { g.fillStyle = colour.soft; g.fillText(text, LEFT, top - 5); }

  function band(g) {  // 95 % of the measured magnitude: half of the variance acts along it
    const {deviation} = frame.arrays, {size} = polar.measured, [top, bottom] = parts().magnitude;
    const end = (k, sign) => toLevel(Math.log10(Math.max(10 ** size[k] + sign * QUANTILE_95 * deviation[k] / Math.SQRT2, 1e-4 * 10 ** size[k])));
    g.save(); g.beginPath(); g.rect(LEFT, top, width() - LEFT - RIGHT, bottom - top); g.clip();
    g.beginPath();
    const shown = [...size.keys()].filter(k => Number.isFinite(size[k]));
    for (const k of shown) g.lineTo(toX(freq[k]), end(k, 1));
    for (const k of shown.reverse()) g.lineTo(toX(freq[k]), end(k, -1));
    g.fillStyle = colour.measured; g.globalAlpha = 0.22; g.fill(); g.restore();
  }

  function draw() {
    if (!frame) return;
    const ratio = devicePixelRatio || 1, {magnitude, phase, coherence} = parts();
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(base, 0, 0);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.setLineDash([]);
    frame.modes.forEach((mode, k) => {  // triangles at the modes of the current model
      const x = toX(mode.frequency);
      if (x < LEFT || x > width() - RIGHT) return;
      const chosen = k + 1 === frame.view.mode;
      context.fillStyle = chosen ? colour.current : colour.soft;
      context.beginPath(); context.moveTo(x - 4, magnitude[0] - 1); context.lineTo(x + 4, magnitude[0] - 1); context.lineTo(x, magnitude[0] + (chosen ? 9 : 6)); context.fill();
    });
    if (polar.current) curve(context, "current");
    const x = Math.round(toX(freq[cursor])) + 0.5;
    context.setLineDash([2, 3]); context.strokeStyle = colour.ink; context.lineWidth = 1;
    if (x >= LEFT && x <= width() - RIGHT) { context.beginPath(); context.moveTo(x, magnitude[0]); context.lineTo(x, (coherence ?? phase)[1]); context.stroke(); }
    if (drag) { context.fillStyle = colour.current; context.globalAlpha = 0.15; context.fillRect(Math.min(drag.from, drag.to), 0, Math.abs(drag.to - drag.from), height()); context.globalAlpha = 1; }
    onCursor(freq[cursor], Object.fromEntries(Object.entries(polar).map(([name, {size, angle}]) => [name, {size: 10 ** size[cursor], angle: angle[cursor]}])), frame.arrays.coherence?.[cursor], cursor);
  }

  function redraw() {
    const ratio = devicePixelRatio || 1;
    canvas.width = Math.round(width() * ratio); canvas.height = Math.round(height() * ratio);
    if (!frame || !canvas.width) return;
    drawBase(); draw();
  }

  function nearest(x) {
    const f = toF(x);
    let low = 0, high = freq.length - 1;
    while (high - low > 1) { const middle = (low + high) >> 1; if (freq[middle] < f) low = middle; else high = middle; }
    return f - freq[low] < freq[high] - f ? low : high;
  }

  function zoomBy(factor) {
    const [a, b] = span(), f = Math.min(Math.max(freq[cursor], a), b), half = [f - a, b - f].map(d => d * factor);
    zoom = factor > 1 && half[0] + half[1] >= all[1] - all[0] ? null : [Math.max(all[0], f - half[0]), Math.min(all[1], f + half[1])];
    redraw();
  }

  const place = event => event.clientX - canvas.getBoundingClientRect().left;
  canvas.addEventListener("pointerdown", event => { drag = {from: place(event), to: place(event)}; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointermove", event => { cursor = nearest(place(event)); if (drag) drag.to = place(event); draw(); });
  canvas.addEventListener("pointerup", () => {
    const ends = drag && Math.abs(drag.to - drag.from) > 8 ? [drag.from, drag.to].sort((a, b) => a - b).map(toF) : null;
    drag = null;
    if (ends) zoom = [Math.max(all[0], ends[0]), Math.min(all[1], ends[1])];
    redraw();
  });
  canvas.addEventListener("dblclick", () => { zoom = null; redraw(); });
  canvas.addEventListener("keydown", event => {
    const steps = {ArrowLeft: -1, ArrowRight: 1, PageDown: -20, PageUp: 20, Home: -freq.length, End: freq.length}[event.key];
    if (steps) { cursor = Math.min(Math.max(cursor + steps * (event.shiftKey ? 10 : 1), 0), freq.length - 1); draw(); }
    else if (event.key === "+") zoomBy(0.5);
    else if (event.key === "-") zoomBy(2);
    else if (event.key === "Escape") { zoom = null; redraw(); }
    else return;
    event.preventDefault();
  });
  new ResizeObserver(redraw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { readColours(); redraw(); });
  readColours();

  return {
    show(next, isPreview) {
      frame = next;
      const view = [next.view.reference, next.view.channel, next.version].join("\n"), isNew = view !== viewed;
      viewed = view;
      if (next.arrays.freq) {  // lines of its own
        freq = next.arrays.freq;
        const ends = [freq[0], freq[freq.length - 1]];
        if (String(ends) !== String(all)) { all = ends; zoom = null; cursor = Math.floor(freq.length / 2); }
        cursor = Math.min(cursor, freq.length - 1);
      }
      if (isNew) polar = {};
      for (const name of names) if (next.arrays[name] && (isNew || name === "current")) polar[name] = toPolar(next.arrays[name]);
      if (!isPreview) fitRange(isNew);
      isPreview ? draw() : redraw();
    },
    setLogarithmic(value) { logarithmic = value; redraw(); },
    has: name => Boolean(polar[name]),
  };
}

function superscript(number) { return String(number).replace("-", "⁻").replace(/\d/g, d => "⁰¹²³⁴⁵⁶⁷⁸⁹"[d]); }
