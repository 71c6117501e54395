// The page of a live test: every part shows the newest state that the server tells.

import {createPlot} from "./curves.js";
import {decode, load, post} from "./exchange.js";
import {create, fourDigits} from "./sliders.js";

const QUANTILE_95 = 1.96, GONE = "The test has ended or cannot be reached: run mbw live again, and open the address that it prints.";
const byId = id => document.getElementById(id);
const cell = (text, className = "") => create("td", {textContent: text, className});
const percent = value => value === null ? "" : "± " + (100 * value).toPrecision(2) + " %";
let state = null, received = 0, frame = null, channel = "", busy = false, isStale = false;

function say(text, isError = false) {
  byId("status").textContent = text;
  byId("status").className = isError ? "warn" : text ? "note" : "";
}

async function renew() {  // one request at a time; the newest state wins
  isStale = true;
  if (busy) return;
  busy = true;
  try {
    while (isStale) {
      isStale = false;
      state = await load("/live");
      received = performance.now();
      show();
      await showResponse();
    }
    document.documentElement.dataset.ready = "true";
  } catch (error) { console.error(error); say(GONE, true); }
  busy = false;
}

// Fill a table again; the button that has the focus keeps it.
function refill(body, rows) {
  const label = body.contains(document.activeElement) ? document.activeElement.getAttribute("aria-label") : null;
  body.replaceChildren(...rows);
  if (label) [...body.querySelectorAll("button")].find(e => e.getAttribute("aria-label") === label)?.focus();
}

function judgement({accepted, reason, decision}) {
  if (accepted) return reason ? "taken back: " + reason : "accepted";
  return decision === false ? "withdrawn" + (reason ? ": " + reason : "") : "not accepted: " + reason;
}

function show() {
  const {hits, places} = state, accepted = hits.filter(hit => hit.accepted), last = hits[hits.length - 1], size = hit => Math.abs(hit.peak).toPrecision(3);
  byId("title").textContent = state.name;
  byId("subtitle").textContent = "hammer test"; byId("subtitle").title = state.folder;
  const figures = [["accepted hits", `${accepted.length}`, `of ${hits.length}`], ["points with enough hits", `${places.filter(place => !place.needed).length}`, `of ${places.length}`]];
  byId("figures").replaceChildren(...figures.map(([name, value, note]) => create("div", {}, create("dt", {textContent: name}), create("dd", {}, create("strong", {textContent: value}), " ", create("span", {className: "soft", textContent: note})))));
  byId("sign").textContent = state.stop ? "STOP" : "NEXT";
  byId("sign").className = state.stop ? "stop" : "";
  byId("advice").textContent = state.stop ? "Enough hits" : `${state.next}, ${state.missing} more`;
  byId("why").textContent = state.reason;
  document.title = `${state.stop ? "STOP" : state.next} - ${state.name}`;
  byId("last").replaceChildren(...(last ? [
    create("b", {className: "badge" + (last.accepted ? "" : " refused"), textContent: last.accepted ? "✓" : "✗", ariaHidden: "true"}),
    create("div", {}, create("strong", {textContent: judgement(last)}), create("p", {className: "soft", textContent: `last hit: ${last.hit}, ${size(last)} N at ${last.place}`})),
  ] : [create("p", {className: "soft", textContent: "no hit yet"})]));
  refill(byId("place-rows"), places.map((place, k) => {
    const button = create("button", {type: "button", textContent: place.place, ariaLabel: "show " + place.place, ariaPressed: String(k === shownPlace())});
    button.onclick = () => { byId("place").value = k; choose(); };
    return create("tr", {className: place.place === state.next ? "next" : ""}, create("th", {scope: "row"}, button), cell(`${place.accepted} of ${place.accepted + place.needed}`), cell(place.refused || ""), cell(place.coherence?.toFixed(3) ?? ""), cell(percent(place.interval)));
  }));
  refill(byId("hit-rows"), hits.toReversed().map(hit => {
    const word = hit.accepted ? "Withdraw" : "Take back", button = create("button", {type: "button", textContent: word, ariaLabel: `${word} ${hit.hit}`});
    button.onclick = () => decide(hit);
    return create("tr", {className: hit.accepted ? "" : "refused"}, create("th", {scope: "row", textContent: hit.hit}), cell(hit.place), cell(size(hit)), cell((hit.accepted ? "✓ " : "✗ ") + judgement(hit), "reason"), create("td", {}, button));
  }));
  for (const [id, word, key, hit] of [["back", "Take back", "b", hits.findLast(hit => !hit.accepted)], ["withdraw", "Withdraw", "w", accepted[accepted.length - 1]]]) {
    byId(id).disabled = !hit;
    byId(id).textContent = (hit ? `${word} ${hit.hit}` : word) + ` (${key})`;
    byId(id).onclick = () => decide(hit);
  }
  byId("cause-rows").replaceChildren(...(state.causes ?? []).map(({site, gain}) => create("tr", {}, create("th", {scope: "row", textContent: site}), cell(gain.toPrecision(3)))));
  byId("cause-table").hidden = !state.causes?.length;
  byId("no-causes").textContent = state.causes === null ? "They follow when a point has enough hits." : state.causes.length ? "" : "The tuned model needs none so far.";
  showAge();
  const options = [new Option("the last hit's point", ""), ...places.map((place, k) => new Option(place.place, k))], chosen = byId("place").value;
  if (byId("place").options.length !== options.length) { byId("place").replaceChildren(...options); byId("place").value = chosen; }
  say(state.sentences[state.sentences.length - 1] ?? "");
  byId("remarks").querySelector("ul").replaceChildren(...[...state.remarks, ...state.sentences.filter(text => !state.remarks.includes(text)).toReversed()].map(textContent => create("li", {textContent})));
}

function showAge() {
  if (state?.age_s == null) return;
  const age = state.age_s + (performance.now() - received) / 1000, excess = state.excess === null ? "" : `, error × ${state.excess.toPrecision(3)} of the noise`;
  byId("age").textContent = `${state.found_hits} hits, ${age < 120 ? age.toFixed(0) + " s" : (age / 60).toFixed(0) + " min"} old${excess}`;
}

// ---- frequency response -----------------------------------------------------------------------

function shownPlace() {  // number of the chosen point, or that of the last hit
  const chosen = byId("place").value, last = state.hits[state.hits.length - 1];
  return chosen ? Number(chosen) : Math.max(state.places.findIndex(place => place.place === last?.place), 0);
}

async function showResponse() {
  const answer = await fetch("/frf?" + new URLSearchParams({place: shownPlace(), channel}));
  if (!answer.ok) throw new Error((await answer.json()).error);
  frame = await decode(answer);
  byId("channel").replaceChildren(...frame.channels.map(name => new Option(name, name)));
  byId("channel").value = frame.view.channel;
  byId("channel").disabled = !frame.channels.length;
  plot.show(frame, false);
}

function writeReadout(frequency, values, coherence, line) {
  const {deviation} = frame.arrays;
  if (!deviation) { byId("readout").replaceChildren(create("tbody", {}, create("tr", {}, cell("no accepted hit at this point yet")))); return; }
  const row = (key, name, ...texts) => create("tr", {}, create("th", {scope: "row"}, ...(key ? [create("i", {className: "key " + key})] : []), name), ...texts.map(cell), ...(texts.length < 2 ? [cell("")] : []));
  const curve = (key, name) => row(key, name, fourDigits(values[key].size), values[key].angle.toFixed(1) + "°");
  const title = text => create("th", {scope: "col", textContent: text}), head = create("tr", {}, ...[frequency.toFixed(2) + " Hz", "|H| / (" + frame.unit + ")", "phase"].map(title));
  const rows = [curve("measured", "measured"), row("", "95 %", "± " + fourDigits(QUANTILE_95 * deviation[line] / Math.SQRT2))];
  if (values.current) rows.push(curve("current", "model"));
  if (coherence !== undefined) rows.push(row("", "coherence", coherence.toFixed(3)));
  byId("readout").replaceChildren(create("thead", {}, head), create("tbody", {}, ...rows));
}

// ---- controls ---------------------------------------------------------------------------------

async function decide(hit) {
  try {
    const answer = await post("/decide", {hit: hit.hit, accepted: !hit.accepted});
    if (!answer.ok) say((await answer.json()).error, true);
  } catch { say(GONE, true); }
}

const choose = () => { if (state) { show(); showResponse(); } };
const plot = createPlot(byId("plot"), [0, 1], ["measured", "current"], writeReadout);
byId("place").onchange = choose;
byId("channel").onchange = event => { channel = event.target.value; choose(); };
byId("logarithmic").onchange = event => plot.setLogarithmic(event.target.checked);
addEventListener("keydown", event => {
  const button = {b: byId("back"), w: byId("withdraw")}[event.key];
  if (button && !event.ctrlKey && !event.metaKey && !event.altKey && !event.repeat && !event.target.matches("select")) button.click();
});
setInterval(showAge, 1000);
const events = new EventSource("/events");
events.onmessage = renew;
events.onerror = () => say(GONE, true);
