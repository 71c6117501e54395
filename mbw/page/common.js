// Shared by all pages: colours, settings of plotly, numbers packed as base64.
const hue = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
const BLUE = hue("tuned"), ORANGE = hue("drawn"), INK = hue("measured"), GREY = hue("noise"), GREEN = hue("diagnosed"), RED = hue("bad"), PALE = hue("pale"), PURPLE = hue("violet");
const PAPER = hue("paper"), GRID = hue("grid"), SOFT = hue("soft");
const HUES = [BLUE, ORANGE, "#2f8f4e", "#b0413e", "#7a5aa6", "#8a6d3b", "#c2569b", "#5d6673", "#9aa52c", "#22a0ae"];
const CONFIG = {displaylogo: false, responsive: true, modeBarButtonsToRemove: ["select2d", "lasso2d"]};
const FONT = {family: "system-ui, DejaVu Sans, sans-serif", size: 12, color: hue("ink")};
const PLOT = {font: FONT, paper_bgcolor: PAPER, plot_bgcolor: PAPER};
const BARE = {...CONFIG, displayModeBar: false};
const BLUES = [[0, hue("hover")], [0.15, PAPER === "#ffffff" ? "#dbe8f5" : "#23466b"], [0.5, PAPER === "#ffffff" ? "#7fb2e0" : "#3f86c8"], [1, hue("deep")]];
matchMedia("screen and (prefers-color-scheme: dark)").addEventListener("change", () => location.reload());

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

// Names for readers of the screen, and the keyboard in what scrolls, once the page is built.
addEventListener("load", () => {
  document.querySelectorAll("nav").forEach((bar, k) => { bar.setAttribute("aria-label", bar.getAttribute("aria-label") ?? `choices ${k + 1}`); });
  document.querySelectorAll("select, input").forEach(field => { if (!field.labels?.length && !field.title) field.setAttribute("aria-label", field.getAttribute("aria-label") ?? (field.placeholder || field.id || "choice")); });
  document.querySelectorAll("div, table").forEach(box => { if (/auto|scroll/.test(getComputedStyle(box).overflow) && box.tabIndex < 0) box.tabIndex = 0; });
});
