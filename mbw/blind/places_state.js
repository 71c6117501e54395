// What a page of places shows: the chosen place, and a machine at rest.
const state = {place: 0, mode: 0, amplitude: 0, playing: false};
