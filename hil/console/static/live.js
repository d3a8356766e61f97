// A run as it is driven: pictures come as server-sent events, its state is asked for besides.
"use strict";
const live = document.getElementById("live"), base = "/live/" + encodeURIComponent(live.dataset.run);
const LANE = 76, KEPT = 3000;
let channels = [], fine = null, coarse = null, window_s = 60, seq = -1, last_s = null, bode = [], source = null, told = null, dirty = false, last_values = [];

function put(id, text) { const at = document.getElementById(id); if (at.textContent !== text) at.textContent = text; }

function lanes() {
  document.getElementById("lanes").replaceChildren(...channels.map((one, k) => {
    const unit = one.unit === "1" ? "" : one.unit;
    const what = make("span", "what", one.name);
    what.title = one.name;
    return make("div", "lane missing b" + k % 8, what, make("span", "now", make("b", "", "–"), " ", make("small", "", unit)));
  }));
}

function width(k) {  // a thousandth of what the chart spans
  const span = fine && last_s !== null ? spanOf(series(k, fine), last_s - 10, last_s) : null;
  return span ? (span[1] - span[0]) / 100 : 0;
}

// One number for one output: after the end where it stands, not where the last sample of the run found it.
function values(now) {
  const stands = told && told.state === "ended" && told.ending ? told.ending.stands : {};
  document.querySelectorAll(".lane").forEach((lane, k) => {
    const at = stands[channels[k].name], shown = typeof at === "number" ? at : now[k];
    const missing = shown === null || shown === undefined;
    lane.classList.toggle("missing", missing);
    lane.querySelector("b").textContent = missing ? say("no measurement") : told_to(shown, width(k));
  });
}

function series(k, from) { return {t: from.t, low: from.low[k], high: from.high[k]}; }

// The new stretches begin with the one that was last, whole now.
function add(kept, come, most) {
  if (!come.t.length) return;
  let keep = kept.t.length;
  while (keep && kept.t[keep - 1] >= come.t[0] - 1e-9) keep--;
  const drop = Math.max(0, keep + come.t.length - most);
  kept.t = kept.t.slice(drop, keep).concat(come.t);
  for (const side of ["low", "high"]) kept[side] = kept[side].map((row, k) => row.slice(drop, keep).concat(come[side][k]));
}

// The whole run: stretches put together to the width that it has by now.
function merge(kept, come) {
  const width = kept.width_s;
  come.t.forEach((t, i) => {
    const start = Math.floor(t / width + 1e-6) * width, at = kept.t.length - 1;
    if (at >= 0 && start <= kept.t[at] + 1e-9) {
      kept.low.forEach((row, k) => { if (come.low[k][i] !== null) row[at] = row[at] === null ? come.low[k][i] : Math.min(row[at], come.low[k][i]); });
      kept.high.forEach((row, k) => { if (come.high[k][i] !== null) row[at] = row[at] === null ? come.high[k][i] : Math.max(row[at], come.high[k][i]); });
    } else {
      kept.t.push(start);
      kept.low.forEach((row, k) => row.push(come.low[k][i]));
      kept.high.forEach((row, k) => row.push(come.high[k][i]));
    }
  });
  if (kept.t.length > 2 * KEPT) { const old = {t: kept.t, low: kept.low, high: kept.high}; kept.width_s *= 2; kept.t = []; kept.low = old.low.map(() => []); kept.high = old.high.map(() => []); merge(kept, old); }
}

function draw() {
  dirty = false;
  if (!fine || last_s === null) return;
  const shown_s = window_s || Math.max(1, last_s), from = window_s ? Math.max(0, last_s - window_s) : 0, kept = window_s ? fine : coarse;
  drawStrip(document.getElementById("strip"), channels.map((_one, k) => series(k, kept)), LANE, from, from + shown_s, kept.width_s);
  if (bode.length) drawBode();
}

function drawBode() {
  document.getElementById("bode-panel").hidden = false;
  const groups = new Map();
  for (const point of bode) {
    const key = shown(point.bias, 4) + " ± " + shown(point.amplitude, 4);
    if (!groups.has(key)) groups.set(key, []);
    groups.get(key).push(point);
  }
  const rows = [...groups].map(([name, points]) => {
    points.sort((a, b) => a.frequency_hz - b.frequency_hz);
    let before = null;
    const phase = points.map(p => { let v = p.phase_deg; if (before !== null) v += 360 * Math.round((before - v) / 360); before = v; return v; });
    return {name, x: points.map(p => p.frequency_hz), gain: points.map(p => p.gain_db), phase};
  });
  drawPoints(document.getElementById("gain"), rows.map(r => ({name: r.name, x: r.x, y: r.gain})), "dB");
  drawPoints(document.getElementById("phase"), rows.map(r => ({name: r.name, x: r.x, y: r.phase})), "°");
}

let came = performance.now();
function old() {  // what no sample confirms any more looks like it
  const is = !told || told.state !== "running" || performance.now() - came > 1000;
  document.getElementById("lanes").classList.toggle("old", is);
  const note = document.getElementById("rows"), text = last_s === null ? "" : shown(last_s, 6) + " s" + (is ? " · " + say("last recorded") : "");
  if (note.textContent !== text) note.textContent = text;
}
setInterval(old, 200);

function soon() { if (!dirty) { dirty = true; requestAnimationFrame(draw); } }

const QUIET = new Set(["plan"]), LOUD = /trip|stop|lost|not measured|refused|deleted/;
function events(list) {
  const at = document.getElementById("events");
  for (const one of list) {
    if (QUIET.has(one.event)) continue;
    const text = one.details.text || Object.entries(one.details).filter(([, v]) => v !== null).map(([k, v]) => k + " " + (typeof v === "object" ? JSON.stringify(v) : v)).join(", ");
    at.prepend(make("li", LOUD.test(one.event) ? "bad" : "", make("span", "t", one.time_s === null ? "" : shown(one.time_s, 6) + " s"), make("b", "", say(one.event)), " " + text));
  }
  while (at.children.length > 200) at.lastChild.remove();
}

function picture(come) {
  seq = come.seq;
  last_s = come.time_s;
  values(last_values = come.values);
  if (come.events) events(come.events);
  if (come.bode && come.bode.length) bode.push(...come.bode);
  came = performance.now();
  soon();
}

function follow() {
  if (source) source.close();
  source = new EventSource(base + "/stream");
  source.addEventListener("snapshot", event => {
    const come = JSON.parse(event.data);
    channels = come.channels; fine = come.fine; coarse = come.coarse; bode = [];
    document.getElementById("events").replaceChildren();
    lanes();
    picture(come);
    if (told && told.state !== "running") came = -Infinity;
  });
  source.addEventListener("picture", event => {
    const come = JSON.parse(event.data);
    if (come.seq <= seq || !fine) return;
    merge(coarse, come.fine);
    add(fine, come.fine, KEPT);
    picture(come);
  });
  source.addEventListener("over", () => { source.close(); source = null; });
  source.addEventListener("gone", () => { source.close(); source = null; });
}

const WORD = {starting: "", running: "good", evaluating: "", ended: "", lost: "bad", refused: "bad"};
function state(come) {
  const ends = come.state === "ended" && (!told || told.state !== "ended");
  told = come;
  if (ends) values(last_values);
  const at = document.getElementById("state");
  if (at.textContent !== say(come.state)) at.textContent = say(come.state);
  at.className = "word " + (WORD[come.state] || "");
  document.getElementById("simulated").hidden = !come.simulated;
  put("about", [come.procedure, come.bench, come.serial, come.operator].filter(Boolean).join(" · "));
  put("progress", come.state === "running" || come.state === "starting" || come.state === "evaluating" ? come.text : "");
  put("left", come.state === "running" ? come.left : "");
  const bar = document.getElementById("share");
  bar.hidden = come.state !== "running" || come.share === null || come.share === undefined;
  if (!bar.hidden) bar.value = come.share;
  document.getElementById("hold").hidden = come.state !== "running" || !come.stop_url;
  if (come.state === "running" || come.state === "ended" || come.state === "lost" || come.state === "evaluating") if (!source && !fine) follow();
  verdict(come);
}

function verdict(come) {
  const box = document.getElementById("verdict"), names = box.dataset;
  const planned = come.outcome === "completed" || come.outcome === "written";
  let word = "", tone = "", details = "";
  if (come.state === "lost") [word, tone, details] = [names.lost, "bad", say("The process of this run is gone. Look at the valve, then at its outputs.")];
  else if (come.state === "refused") [word, tone, details] = [names.refused, "bad", come.outcome];
  else if (come.state === "ended" && !planned) [word, tone, details] = [(come.ending && come.ending.word) || names.stopped, "bad", (come.ending && come.ending.sentence) || come.outcome];
  else if (come.state === "ended" && come.judged) {
    [word, tone] = {pass: [names.pass, "good"], fail: [names.fail, "bad"], "cannot tell": [names.open, "open"]}[come.verdict] || [names.none, ""];
    details = come.missed.join("\n");
  } else if (come.state === "ended" && come.exit_status) [word, tone, details] = [names.stopped, "bad", come.text];
  box.hidden = !word;
  box.className = "verdict " + tone + (word.length > 12 ? " long" : "");
  put("verdict-word", word);
  put("verdict-details", details);
  const links = document.getElementById("verdict-links");
  if (come.judged && !links.children.length) {
    const results = make("a", "", links.dataset.results);
    results.href = "/results/" + encodeURIComponent(come.run);
    links.append(results);
    if (come.next_unit) {
      const next = make("a", "", links.dataset.next);
      next.href = come.next_unit;
      next.accessKey = "n";
      links.append(next);
    }
  }
}

async function lookRun() {
  try { state(await ask(base + "/state")); } catch (error) { /* the page says that the console is silent */ }
  const over = told && (told.state === "lost" || told.state === "refused" || (told.state === "ended" && (told.judged || told.outcome !== "completed")));
  setTimeout(lookRun, over ? 2000 : 300);
}

document.getElementById("hold").addEventListener("click", async event => {
  const button = event.target, on = button.getAttribute("aria-pressed") === "true", at = document.getElementById("hold-said");
  try {
    const answer = await post(base + "/hold", {hold: on ? "0" : "1"});
    button.setAttribute("aria-pressed", on ? "false" : "true");
    button.textContent = on ? button.dataset.hold : button.dataset.on;
    at.textContent = on ? "" : answer.state === "holding" ? say("holding") : say("A hold was asked for; it begins between two parts.");
  } catch (error) { at.textContent = error.message; }
});

for (const button of document.querySelectorAll("[data-window]")) button.addEventListener("click", () => {
  window_s = Number(button.dataset.window);
  for (const one of document.querySelectorAll("[data-window]")) one.setAttribute("aria-pressed", one === button ? "true" : "false");
  soon();
});
addEventListener("resize", soon);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", soon);
document.addEventListener("hil:connection", event => { if (event.detail && fine && told && told.state === "running") follow(); else if (!event.detail) { values([]); put("state", say("not known")); } });
state(JSON.parse(document.getElementById("first").textContent));
lookRun();
