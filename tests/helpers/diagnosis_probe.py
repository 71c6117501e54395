"""What a browser does on the page of a diagnosis, and reports."""

PROBE = """<script>
const wait = ms => new Promise(done => setTimeout(done, ms));
(async () => {
  await wait(1500);
  const found = {first: state.channel, drawn, chosen: byId("chosen").textContent};
  found.curves = byId("frf").data.filter(t => t.showlegend !== false).map(t => t.name);
  const of = name => Array.from(byId("frf").data.find(t => t.name === name).y).slice(0, 20);
  found.measured = of("measured"); found.after = of("with the effect");
  found.bars = byId("gap").data[0].y;
  found.maps = byId("map").data.map(t => t.z.length);
  byId("map").emit("plotly_click", {points: [{customdata: ["", "", "", 7]}]});
  await wait(300);
  found.clicked = [state.channel, byId("out").value, Number(byId("test").value)];
  byId("worst").click(); found.worst = state.channel;
  byId("most").click(); found.most = state.channel;
  byId("test").value = "1"; byId("test").onchange(); found.switched = state.channel;
  const colours = () => drawn ? MESHES.map((_, m) => byId("picture").data[m].color) : [];
  found.before = colours();
  byId("where").emit("plotly_click", {points: [{pointNumber: 1}]});
  await wait(600);
  found.later = colours(); found.second = byId("chosen").textContent;
  found.wide = document.documentElement.scrollWidth <= document.documentElement.clientWidth;
  found.faults = FAULTS;
  document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
})();
</script>"""
