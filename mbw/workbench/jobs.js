// Jobs: verbs of the command line on what the page shows, one after the other.

import {load, run} from "./exchange.js";
import {create} from "./sliders.js";

const POLL_MS = 1000, IDLE_MS = 10000, LINES = 14;  // idle: another window may have begun one
const WORDS = {tune: "Tune", diagnose: "Diagnose", identify: "Identify", predict: "Predict", blind: "Blind", compare: "Compare"};
const SHOWN = ["tune", "diagnose", "identify"];  // as curves or modes of this page
const ALONE = ["predict", "blind"];  // of a model without measurements
const MARK = {waiting: "…", running: "▶", done: "✓", failed: "✕", cancelled: "–", interrupted: "‖"};

export function createJobs(place, adders, session, machine) {
  let timer = 0, shown = "";
  const ask = content => run("jobs", content).then(look);
  for (const verb of tested(session) ? Object.keys(WORDS) : ALONE) {
    const button = create("button", {type: "button", textContent: WORDS[verb], title: `mbw ${verb} with the current model`});
    button.onclick = () => verb === "compare" ? compare() : ask({do: "add", verb});
    adders.append(button);
  }

  function compare() {
    const field = create("input", {type: "text", autocomplete: "off"}), go = create("button", {type: "submit", textContent: "Compare"});
    const back = create("button", {type: "button", textContent: "Back"});
    const form = create("form", {className: "words", id: "compare-form"}, create("label", {}, "with the campaign ", field), go, back);
    document.getElementById("compare-form")?.remove();
    form.onsubmit = event => { event.preventDefault(); form.remove(); ask({do: "add", verb: "compare", partner: field.value}); };
    form.onkeydown = event => { if (event.key === "Escape") form.remove(); };
    back.onclick = () => form.remove();
    place.before(form);
    field.focus();
  }

  function addRow(job) {
    const button = (text, action, label) => {
      const each = create("button", {type: "button", textContent: text});
      each.setAttribute("aria-label", `${label} job ${job.number}`);
      each.onclick = () => ask({do: action, number: job.number});
      return each;
    };
    const words = [create("strong", {textContent: `${MARK[job.status]} ${job.number} ${job.verb}`}), create("span", {className: "soft", textContent: job.status + (job.code ? `, exit code ${job.code}` : "")})];
    if (job.key !== machine()) words.push(create("span", {className: "soft", textContent: "of another state"}));
    if (job.is_shown && SHOWN.includes(job.verb)) words.push(create("span", {className: "soft", textContent: "shown"}));
    const tools = create("span", {className: "tools"});
    if (job.status === "waiting" || job.status === "running") tools.append(button("Cancel", "cancel", "cancel"));
    if (["cancelled", "interrupted", "failed"].includes(job.status)) tools.append(button("Resume", "resume", "resume"));
    if (job.status === "done" && SHOWN.includes(job.verb)) tools.append(button("Show", "show", "show the result of"));
    if (job.has_page) tools.append(create("a", {href: `/result/${job.number}`, target: "_blank", rel: "noopener", textContent: "page"}));
    const log = create("details", {open: job.status === "running" || job.status === "failed"}, create("summary", {className: "soft", textContent: "log", title: `result in ${job.folder}`}),
      create("pre", {tabIndex: 0, textContent: job.log.split(/\r?\n/).map(line => line.split("\r").pop()).filter(Boolean).slice(-LINES).join("\n")}));
    return create("div", {className: "edit"}, create("div", {className: "words"}, ...words, tools), ...job.remarks.map(textContent => create("p", {textContent})), log);
  }

  async function look() {
    clearTimeout(timer);
    let jobs = [];
    try { ({jobs} = await load("/jobs")); } catch { return; }  // the page says elsewhere that the server is gone
    const text = JSON.stringify([jobs, machine()]);
    if (text !== shown) {
      const focused = place.contains(document.activeElement) ? document.activeElement.getAttribute("aria-label") : null;
      place.replaceChildren(...jobs.map(addRow));
      shown = text;
      if (focused) [...place.querySelectorAll("button")].find(e => e.getAttribute("aria-label") === focused)?.focus();
    }
    const isActive = jobs.some(job => ["waiting", "running"].includes(job.status) || (job.status === "cancelled" && job.code === null));
    timer = setTimeout(look, isActive ? POLL_MS : IDLE_MS);
  }
  look();
  return {look};
}

const tested = session => Object.keys(session.measured).length > 0;
