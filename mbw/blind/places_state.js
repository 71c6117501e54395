// What a page of places shows: the chosen place, and a machine at rest.
// Return a size with three digits, and a factor near 1 with two of its difference from 1.
function sizeText(value) {
  const off = Math.abs(value - 1);
  return off > 0 && off < 0.1 ? value.toFixed(Math.min(12, 1 - Math.floor(Math.log10(off)))) : value.toPrecision(3);
}

const state = {place: 0, mode: 0, amplitude: 0, playing: false};
