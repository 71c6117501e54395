// Shared by all pages: colours, settings of plotly, numbers packed as base64.
const BLUE = "#1f6fb8", ORANGE = "#d9822b", INK = "#30343b", GREY = "#98a2b3", PURPLE = "#7b1fa2";
const HUES = ["#1f6fb8", "#d9822b", "#2f8f4e", "#b0413e", "#7a5aa6", "#8a6d3b", "#c2569b", "#5d6673", "#9aa52c", "#22a0ae"];
const CONFIG = {displaylogo: false, responsive: true, modeBarButtonsToRemove: ["select2d", "lasso2d"]};
const FONT = {family: "system-ui, DejaVu Sans, sans-serif", size: 12, color: "#1d2430"};
const PLOT = {font: FONT, paper_bgcolor: "white", plot_bgcolor: "white"};
const BARE = {...CONFIG, displayModeBar: false};
const GRID = "#eef1f5";
const BLUES = [[0, "#f7f9fb"], [0.15, "#dbe8f5"], [0.5, "#7fb2e0"], [1, "#134b82"]];

function bytes(text) {
  const raw = atob(text), array = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) array[i] = raw.charCodeAt(i);
  return array.buffer;
}

const floats = text => new Float32Array(bytes(text));
const integers = text => new Int32Array(bytes(text));
const shorts = text => new Int16Array(bytes(text));
const sizeOf = steps => steps === -32768 ? null : 10 ** (steps / 1500);  // inverse of pack_magnitudes and pack_polar

function element(tag, text, properties) {
  const node = Object.assign(document.createElement(tag), properties);
  if (text !== undefined) node.textContent = text;
  return node;
}

const byId = id => document.getElementById(id);
const escaped = text => text.replace(/&/g, "&amp;").replace(/</g, "&lt;");

// Add a button for each choice of state[key].
function buttons(place, key, choices, redraw) {
  for (const [value, label] of choices) {
    const button = element("button", label);
    button.dataset.key = key; button.dataset.value = value;
    button.onclick = () => { state[key] = value; redraw(); };
    place.append(button);
  }
}

function press(place) {
  place.querySelectorAll("button").forEach(b => b.setAttribute("aria-pressed", String(state[b.dataset.key] === b.dataset.value)));
}

function logAxis(list) {  // range of a logarithmic axis; single dips do not determine it
  const sizes = list.flat().filter(v => v !== null).sort((a, b) => a - b);
  const low = sizes[Math.floor(0.01 * sizes.length)] || 1e-3, top = sizes[sizes.length - 1] || 1;
  const range = [Math.log10(low) - 0.2, Math.log10(top) + 0.15], span = range[1] - range[0];
  return {range, dtick: span > 9 ? 2 : span > 1.3 ? 1 : "D1"};
}
