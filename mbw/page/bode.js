// Bode plots, shared by all pages with FRFs: magnitude above phase along one frequency axis.

// Return the values of one channel as pairs of real and imaginary part.
function complexes(values, channel, count) {
  const start = 2 * count * channel;
  return Array.from({length: count}, (_, k) => [values[start + 2 * k], values[start + 2 * k + 1]]);
}

// Return magnitudes, and angles in degrees with a gap where they wrap; null without a value.
function polar(values) {
  const size = values.map(v => { const s = Math.hypot(...v); return s > 0 && Number.isFinite(s) ? s : null; });
  return {size, angle: unwrapped(values.map((v, k) => size[k] === null ? null : Math.atan2(v[1], v[0]) * 180 / Math.PI))};
}

// Return magnitudes and angles of one channel that pack_polar packed.
function unpackedPolar(values, channel, count) {
  const start = 2 * count * channel, size = Array.from({length: count}, (_, k) => sizeOf(values[start + 2 * k]));
  return {size, angle: unwrapped(size.map((v, k) => v === null ? null : values[start + 2 * k + 1] / 100))};
}

function unwrapped(angle) {
  for (let k = 1; k < angle.length; k++) if (angle[k] !== null && Math.abs(angle[k] - angle[k - 1]) > 180) angle[k - 1] = null;
  return angle;
}

// Return the traces of an FRF: its magnitude, and its phase on the second axis.
function bodeTraces(x, {size, angle}, name, line, extra = {}) {
  const common = {type: "scatter", mode: "lines", x, name, legendgroup: name, line, ...extra}, tail = "<extra>" + escaped(name) + "</extra>";
  return [{...common, y: size, hovertemplate: "%{x:.5g} Hz: %{y:.4g}" + tail},
          {...common, y: angle, yaxis: "y2", showlegend: false, hovertemplate: "%{x:.5g} Hz: %{y:.1f}°" + tail}];
}

// Return the outlines of an interval of the magnitude, shaded in between; a logarithmic axis has no zero.
function bandTraces(x, low, high, name, color, extra = {}) {
  const common = {type: "scatter", mode: "lines", x, legendgroup: name, showlegend: false, hoverinfo: "skip", line: {color, width: 0}, ...extra};
  return [{...common, y: Array.from(low, (v, k) => high[k] > 0 ? Math.max(v, 1e-4 * high[k]) : null)},
          {...common, y: Array.from(high, v => v > 0 ? v : null), fill: "tonexty", fillcolor: color + "33"}];
}

function bodeAxes(sizes, title, [top, middle] = [0.36, [0, 0.3]]) {
  return {yaxis: {type: "log", domain: [top, 1], gridcolor: GRID, exponentformat: "power", ...logAxis(sizes), title: {text: title}},
    yaxis2: {domain: middle, range: [-190, 190], tickvals: [-180, -90, 0, 90, 180], gridcolor: GRID, zeroline: false, title: {text: "phase / °"}}};
}
