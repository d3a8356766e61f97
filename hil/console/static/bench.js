// The board of a bench, told anew twice a second.
"use strict";
const board = document.getElementById("board");
const STATES = {good: "good", bad: "bad", stale: "stale", missing: "missing"};

function cell(tag, className, text, small) {
  const made = make(tag, className, text);
  if (small) made.append(make("small", "", small));
  return made;
}

function row(line) {
  const made = make("tr", line.tone), name = cell("th", "", line.name, line.source);
  const limit = line.limit;
  name.scope = "row";
  made.append(
    name, cell("td", "num", told_to(line.value, line.noise)), cell("td", "", line.unit),
    cell("td", "r wide", line.noise === null ? "–" : shown(line.noise, 2)),
    cell("td", "r nowrap wide", line.age_s === null ? "–" : decimal(line.age_s.toFixed(1)) + " s"),
    cell("td", "nowrap wide", limit || "–"),
    make("td", "", make("span", "tag " + STATES[line.tone], say(line.state)), limit ? make("small", "narrow", limit) : null),
  );
  return made;
}

function lock(one, tripped) {
  const bad = tripped || one.state === "broken", made = make("tr", ""), name = cell("th", "", one.name);
  name.scope = "row";
  const tone = bad ? "bad" : one.state === "kept" ? "good" : "missing";
  made.append(name, cell("td", "", one.asks), cell("td", "", say(one.action)),
    make("td", "", make("span", "tag " + tone, say(tripped ? "tripped" : one.state))));
  return made;
}

function link(one) {
  const made = make("tr", ""), name = cell("th", "", one.name, one.driver);
  name.scope = "row";
  made.append(name, cell("td", "", one.where || "–"), cell("td", "nowrap", one.latency || "–"),
    make("td", "", make("span", "tag " + one.tone, say(one.state)), one.why ? make("small", "", one.why) : null));
  return made;
}

function trip(name, why) {
  const button = make("button", "quiet", say("Reset") + " " + name);
  button.type = "button";
  button.addEventListener("click", async () => {
    if (!await agreed(say("Really reset the trip of {name}?", {name}))) return;
    button.disabled = true;
    try { await post("/bench/" + encodeURIComponent(board.dataset.bench) + "/reset", {interlock: name}); await lookBench(); }
    catch (error) { refuse(error.message); button.disabled = false; }
  });
  return make("p", "notice bad trip", make("span", "", make("strong", "", say("tripped") + ": " + name), " – " + why), button);
}

let trips = "";
function show(told) {
  document.getElementById("lines").replaceChildren(...told.lines.map(row));
  document.getElementById("locks").replaceChildren(...told.interlocks.map(one => lock(one, one.name in told.trips)));
  document.getElementById("links").replaceChildren(...told.links.map(link));
  if (trips !== JSON.stringify(told.trips)) {
    trips = JSON.stringify(told.trips);
    document.getElementById("trips").replaceChildren(...Object.entries(told.trips).map(([name, why]) => trip(name, why)));
  }
  const reader = document.getElementById("reader"), text = told.run || told.fault || (told.watched ? "hil watch" : say("not being read"));
  if (reader.textContent !== text) reader.textContent = text;
  document.getElementById("watch").hidden = Boolean(told.run);
  const button = document.getElementById("watch-button"), on = told.watched;
  button.textContent = on ? button.dataset.off : button.dataset.on;
  document.querySelector("#watch input").value = on ? "0" : "1";
}

async function lookBench() { show(await ask("/bench/" + encodeURIComponent(board.dataset.bench) + "/state")); }

function grey() {  // nothing is heard: what stands here is old, and looks like it
  for (const one of document.querySelectorAll("#lines tr")) one.className = "stale";
  for (const one of document.querySelectorAll("#lines .tag, #locks .tag, #links .tag")) { one.className = "tag stale"; one.textContent = say("stale"); }
}

async function againBench() {
  try { await lookBench(); } catch (error) { grey(); }
  setTimeout(againBench, 500);
}

if (board) {
  show(JSON.parse(document.getElementById("first").textContent));
  document.addEventListener("hil:connection", event => { if (!event.detail) grey(); });
  setTimeout(againBench, 500);
}
