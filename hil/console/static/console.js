// What every page does: words in the reader's language, runs under way, and whether the console still answers.
"use strict";
const WORDS = JSON.parse(document.getElementById("words").textContent);
const EVERY_MS = 400, SILENT_MS = 900;

function say(text, values) {
  return Object.entries(values || {}).reduce((said, [name, value]) => said.replace("{" + name + "}", value), WORDS[text] || text);
}

function decimal(text) { return document.documentElement.lang === "de" ? text.replace(".", ",") : text; }

function shown(value, digits = 5) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  let text = Math.abs(value) >= 1e7 || (value !== 0 && Math.abs(value) < 1e-4) ? value.toExponential(digits - 1) : String(Number(value.toPrecision(digits)));
  return decimal(text.replace("-", "\u2212"));
}

// A reading to the place that its noise, or the span that is shown, still tells.
function told_to(value, width) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (!(width > 0)) return shown(value);
  const places = Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(width))));
  const text = value.toFixed(places);
  return decimal((Number(text) === 0 ? text.replace("-", "") : text).replace("-", "\u2212"));
}

// An element with a class, text and children; text is never taken for markup.
function make(tag, className, ...inside) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  made.append(...inside.filter(one => one !== null && one !== undefined));
  return made;
}

// Asks on the page itself: a dialog of the browser would keep F12 and the stop button waiting.
function agreed(text) {
  return new Promise(settle => {
    const yes = make("button", "", say("Yes")), no = make("button", "quiet", say("No"));
    const asked = make("div", "notice bad trip", make("span", "", text), yes, no);
    asked.setAttribute("role", "alertdialog");
    asked.setAttribute("aria-label", text);
    for (const button of [yes, no]) {
      button.type = "button";
      button.addEventListener("click", () => { asked.remove(); settle(button === yes); });
    }
    document.getElementById("refused").after(asked);
    asked.scrollIntoView({block: "center"});
    no.focus();
  });
}

function refuse(text) {
  const told = document.getElementById("refused");
  told.textContent = say("Refused") + ": " + text;
  told.hidden = false;
  told.scrollIntoView({block: "center"});
}

// Sends a form. Another may operate: then the seat is taken over if its user says so, and the form is sent again.
async function send(path, body) {
  for (let again = true; ; again = false) {
    const answer = await fetch(path, {method: "POST", body, headers: {Accept: "application/json"}});
    if (answer.ok) return answer;
    const why = (await answer.json().catch(() => ({}))).error || answer.status + " " + answer.statusText;
    if (answer.status !== 409 || !again || !await agreed(why + ". " + say("Take over as the operator?"))) throw new Error(why);
    await fetch("/seat", {method: "POST", body: new URLSearchParams({take: "1"})});
  }
}

async function post(path, fields) { return (await send(path, new URLSearchParams(fields))).json(); }

// Plain forms are sent here, so that what is refused is told on the page that stands.
addEventListener("submit", async event => {
  const form = event.target, by = event.submitter, method = by?.formMethod || form.method;
  if (event.defaultPrevented || method !== "post" || "plain" in form.dataset) return;
  event.preventDefault();
  const told = document.getElementById("refused"), fields = new FormData(form);
  told.hidden = true;
  if (by) by.disabled = true;
  try {
    const body = form.enctype === "multipart/form-data" ? fields : new URLSearchParams(fields);
    location.href = (await send(by?.hasAttribute("formaction") ? by.formAction : form.action, body)).url;
  } catch (error) { refuse(error.message); } finally { if (by) by.disabled = false; }
});

async function ask(path) {
  const answer = await fetch(path, {headers: {Accept: "application/json"}, signal: AbortSignal.timeout(2 * SILENT_MS)});
  if (!answer.ok) throw new Error((await answer.json().catch(() => ({}))).error || answer.statusText);
  return answer.json();
}

let heard = performance.now(), offline = false;
function connected(is) {
  if (is) heard = performance.now();
  const silent = performance.now() - heard > SILENT_MS;
  if (silent === offline) return;
  offline = silent;
  document.body.classList.toggle("offline", silent);
  const told = document.getElementById("offline");
  told.hidden = !silent;
  told.textContent = silent ? say("No connection to the console. What this page shows is old.") : "";
  document.dispatchEvent(new CustomEvent("hil:connection", {detail: !silent}));
}

function showUnderway(runs) {
  const told = document.getElementById("underway");
  const names = runs.map(run => run.run + " · " + say(run.state));
  if (told.dataset.said === names.join()) return;
  told.dataset.said = names.join();
  told.replaceChildren(...runs.map(run => {
    const link = make("a", "", run.run);
    link.href = "/live/" + encodeURIComponent(run.run);
    return make("span", "tag " + (run.state === "lost" ? "bad" : run.state === "running" ? "good" : ""), link, " " + say(run.state));
  }));
}

async function look() {
  try {
    const told = await ask("/controls");
    connected(true);
    showUnderway(told.runs);
    document.dispatchEvent(new CustomEvent("hil:controls", {detail: told}));
  } catch (error) { connected(false); }
  setTimeout(look, EVERY_MS);
}

document.addEventListener("hil:release", () => post("/stop/release", {}).catch(error => refuse(error.message)));
for (const select of document.querySelectorAll("select[data-go]")) select.addEventListener("change", () => select.form.submit());
for (const link of document.querySelectorAll(".langs a")) {  // keeps what else the address says
  const address = new URL(location.href);
  address.searchParams.set("lang", link.hreflang);
  link.href = address.search;
}
const FIRST_CONTROLS = JSON.parse(document.getElementById("controls").textContent);
showUnderway(FIRST_CONTROLS.runs);
setInterval(() => connected(false), 200);
look();

// One key for what is done a hundred times a day: a link with an access key follows it alone, where nothing is typed.
document.addEventListener("keydown", event => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input, select, textarea, [contenteditable]")) return;
  const link = /^[a-z]$/.test(event.key) && document.querySelector(`a[accesskey="${event.key}"]`);
  if (link) link.click();
});
