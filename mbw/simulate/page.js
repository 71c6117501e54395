// Page of mbw simulate: inputs above motion, along one axis of time.
const state = {view: "0"};
const points = view => [...new Set(view.outputs.map(o => o.label.split(":").slice(0, -1).join(":") || o.label))];
const LAYOUT = {...PLOT, height: 320, margin: {l: 80, r: 20, t: 10, b: 45}, showlegend: true, legend: {orientation: "h", y: 1.12}};

function traces(view, channels) {
  const time = Array.from(floats(view.time));
  return channels.map((channel, k) => ({
    type: "scatter", mode: "lines", x: time, y: Array.from(floats(channel.values)), name: channel.label,
    line: {color: HUES[k % HUES.length], width: 1.3},
    hovertemplate: "%{x:.5g} s: %{y:.4g} " + escaped(channel.unit) + "<extra>" + escaped(channel.label) + "</extra>"}));
}

function axes(channels) {
  const units = [...new Set(channels.map(channel => channel.unit))].join(", ");
  return {xaxis: {title: {text: "time / s"}, gridcolor: GRID, zeroline: false},
    yaxis: {title: {text: units}, gridcolor: GRID, zerolinecolor: GREY, exponentformat: "power"}};
}

function draw(place, view, channels) {
  Plotly.react(place, traces(view, channels), {...LAYOUT, ...axes(channels)}, CONFIG);
}

function redraw() {
  const view = DATA.views[Number(state.view)], list = points(view), select = byId("point");
  const kept = list.includes(select.value) ? select.value : view.start && list.includes(view.start) ? view.start : list[0];
  select.replaceChildren(...list.map(name => element("option", name, {value: name, selected: name === kept})));
  byId("inputs").hidden = !view.inputs.length;
  byId("motion").hidden = !view.outputs.length;
  draw("input", view, view.inputs);
  draw("output", view, view.outputs.filter(o => o.label === kept || o.label.startsWith(kept + ":")));
  press(byId("views"));
}

// A closed loop: what it follows, its error, and its control between the limits.
function drawLoop() {
  const view = DATA.views[Number(state.view)], loop = view.loops[byId("loop").selectedIndex];
  draw("followed", view, loop.followed);
  draw("error", view, loop.error);
  const layout = {...LAYOUT, ...axes(loop.control)};
  layout.yaxis.title.text = loop.input;
  if (loop.limit !== null) {
    layout.shapes = [1, -1].map(sign => ({type: "line", xref: "paper", x0: 0, x1: 1, y0: sign * loop.limit, y1: sign * loop.limit,
      line: {color: GREY, dash: "dash", width: 1.5}, label: {text: "limit", textposition: "end"}}));
  }
  Plotly.react("control", traces(view, loop.control), layout, CONFIG);
}

// Zooming along time in one plot does the same in the other.
function link(from, to) {
  byId(from).on("plotly_relayout", event => {
    const range = event["xaxis.autorange"] ? {"xaxis.autorange": true} : event["xaxis.range[0]"] === undefined ? null
      : {"xaxis.range": [event["xaxis.range[0]"], event["xaxis.range[1]"]]};
    const now = byId(to).layout.xaxis.range, wanted = range && range["xaxis.range"];
    if (range && !(wanted && now && now[0] === wanted[0] && now[1] === wanted[1]) && !(event["xaxis.autorange"] && byId(to).layout.xaxis.autorange)) Plotly.relayout(to, range);
  });
}

if (DATA.views.length > 1) buttons(byId("views"), "view", DATA.views.map((view, k) => [String(k), view.label]), redraw);
byId("point").onchange = redraw;
redraw();
const shown = ["input", "output"];
const loops = DATA.views[0].loops;
if (loops.length) {
  byId("loops").hidden = false;
  byId("loop").replaceChildren(...loops.map(loop => element("option", loop.name, {value: loop.name})));
  byId("loop").onchange = drawLoop;
  drawLoop();
  shown.push("followed", "error", "control");
}
shown.forEach(from => shown.filter(to => to !== from).forEach(to => link(from, to)));
