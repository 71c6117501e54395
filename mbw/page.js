// What all pages share: colours, plotly's settings, numbers packed as text.
const BLUE = "#1f6fb8", ORANGE = "#d9822b", INK = "#30343b", GREY = "#98a2b3";
const CONFIG = {displaylogo: false, responsive: true, modeBarButtonsToRemove: ["select2d", "lasso2d"]};
const FONT = {family: "system-ui, DejaVu Sans, sans-serif", size: 12, color: "#1d2430"};

function floats(text) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return new Float32Array(bytes.buffer);
}

function integers(text) {
  return new Int32Array(floats(text).buffer);
}

function element(tag, text, properties) {
  const made = Object.assign(document.createElement(tag), properties);
  if (text !== undefined) made.textContent = text;
  return made;
}
