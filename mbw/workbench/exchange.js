// Exchange with the server: one request at a time; of previews, the newest wins.

let revision = 0, told = 0, busy = false, preview = null, isRefused = false, show = () => {}, say = () => {}, restore = () => {};
const actions = [];

export async function load(path) {
  const answer = await fetch(path);
  const content = await answer.json();
  if (!answer.ok) throw new Error(content.error);
  return content;
}

// Begin: show(frame, isPreview) draws a frame, say(text, isError) tells the user, restore(frame) takes back what was typed.
export async function begin(onFrame, onMessage, onRefusal) {
  show = onFrame; say = onMessage; restore = onRefusal;
  await renew();
  const events = new EventSource("/events");
  let results = null, isGone = false;
  events.onmessage = event => {
    const [newest, brought] = event.data.split(" ");
    if (results !== null && brought !== results) location.reload();  // a job has brought curves or modes
    results = brought;
    told = Number(newest);
    if (told !== revision && !busy) renew();
  };
  events.onerror = () => { isGone = true; say("The workbench has ended or cannot be reached: run mbw open again, then reload this page.", true); };
  events.onopen = () => { if (isGone) say(""); isGone = false; };
}

export function act(action) {
  actions.push(action);
  preview = null;
  work();
}

export function tryOut(change) {  // {values} or {edit}
  preview = change;
  work();
}

export async function run(task, content = {}) {
  try {
    const answer = await post("/" + task, content);
    const told = await answer.json();
    say(answer.ok ? told.sentences.map(text => text.replace(/\.$/, "")).join(". ") + "." : told.error, !answer.ok);
  } catch { say("The workbench does not answer: run mbw open again, then reload this page.", true); }
}

async function work() {
  if (busy) return;
  busy = true;
  try {
    while (actions.length || preview) {
      if (actions.length) {
        const answer = await post("/act", {revision, action: actions.shift()});
        if (answer.ok) { await take(answer, false); if (isRefused) say(""); isRefused = false; }
        else await refuse(answer);
      } else {
        if (told > revision) await renew();  // another window acted meanwhile
        const change = preview;
        preview = null;
        const answer = await post("/preview", change);
        if (answer.ok) await take(answer, true);
        else await refuse(answer);
      }
    }
    if (told > revision) await renew();
  } catch { say("The workbench does not answer: run mbw open again, then reload this page.", true); }
  busy = false;
}

export function warn(text) {  // what was typed cannot be; the next action takes the sentence away
  say(text, true);
  isRefused = true;
}

async function refuse(answer) {
  say((await answer.json()).error, true);
  actions.length = 0;
  await renew();
  isRefused = true;
  restore();
}

async function renew() {
  const answer = await fetch("/frame");
  if (answer.ok) await take(answer, false);
  else say((await answer.json()).error, true);
}

export const post = (path, content) => fetch(path, {method: "POST", headers: {"Content-Type": "application/json"}, body: JSON.stringify(content)});

export async function decode(answer) {
  const buffer = await answer.arrayBuffer(), size = new DataView(buffer).getUint32(0, true);
  const frame = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
  const numbers = new Float32Array(buffer, 4 + size);
  for (const [name, [first, count]] of Object.entries(frame.arrays)) frame.arrays[name] = numbers.subarray(first, first + count);
  return frame;
}

async function take(answer, isPreview) {
  const frame = await decode(answer);
  if (!isPreview) {
    revision = Number(answer.headers.get("Revision"));
    frame.undo = Number(answer.headers.get("Undo-Steps"));
    frame.redo = Number(answer.headers.get("Redo-Steps"));
  }
  await show(frame, isPreview);
}
