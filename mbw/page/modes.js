// Table of modes beside the picture; a click or the arrow keys choose a row.
// The page's script defines ``state``, ``MODES`` and choose(k), which calls turn().

const digits = value => value < 10 ? value.toFixed(3) : value.toFixed(2);
const deviation = value => value === 0 ? "0" : value < 1e-4 ? value.toExponential(0) : value.toPrecision(2);

const rowsOf = () => document.querySelector("#modes tbody").rows;

// Show mode k: mark its row, write its title above the picture, show its motion.
function turn(k, title) {
  const rows = rowsOf();
  rows[state.mode].removeAttribute("aria-selected");
  state.mode = k;
  rows[k].setAttribute("aria-selected", "true");
  const box = byId("modes"), top = rows[k].offsetTop;
  if (top < box.scrollTop + 30 || top > box.scrollTop + box.clientHeight - 30) box.scrollTop = top - box.clientHeight / 2;
  byId("chosen").replaceChildren("Mode " + (k + 1) + ": " + title);
  if (!state.playing) phase = 0;
  show();
}

function arrowKeys() {
  addEventListener("keydown", event => {
    const way = {ArrowDown: 1, ArrowUp: -1}[event.key], rows = rowsOf();
    if (!way || /INPUT|SELECT/.test(document.activeElement.tagName) || !visible()) return;
    let k = state.mode + way;
    while (rows[k] && rows[k].hidden) k += way;
    if (rows[k]) { choose(k); event.preventDefault(); }
  });
}

// Choose the mode that the address names, such as #3, when the page opens.
function chooseFirst() {
  const first = Number(location.hash.slice(1));
  choose(first >= 1 && first <= MODES.length ? first - 1 : 0);
}
