// The stop button and its key, F12. It speaks to each run's own listener, never to the web server, and needs nothing
// but what this page knew last: it works when the server is dead. Runs come from the JSON of #controls, then from the
// event `hil:controls`; a page without these calls hilStop.show(runs). A run is {run, state, stop_url, token, listener}.
"use strict";
window.hilStop = (() => {
  const ANSWER_MS = 950, AGAIN_MS = 1000, GIVE_UP_MS = 60000, LOOK_MS = 200, BEEP_S = 0.22;
  const CSS = `
    #stop { position: fixed; inset: auto 0 0 0; z-index: 2147483647; display: flex; gap: .9rem; align-items: stretch; padding: .5rem .8rem;
      min-height: 6rem; box-sizing: border-box; background: #fff; color: #171b20; border-top: 3px solid #b3261e; font: 15px/1.35 system-ui, sans-serif; }
    #stop button.press { flex: 0 0 13rem; font: 800 2.1rem/1 system-ui, sans-serif; letter-spacing: .06em; color: #fff; background: #c1121f;
      border: 3px solid #7d0a13; border-radius: .6rem; cursor: pointer; padding: .3rem; }
    #stop button.press:focus-visible { outline: 4px solid #0b5c8a; outline-offset: 2px; }
    #stop button.press:active { background: #7d0a13; }
    #stop button.press small { display: block; font: 600 .8rem/1.3 system-ui, sans-serif; letter-spacing: 0; margin-top: .2rem; }
    #stop .told { flex: 1; min-width: 0; max-height: 42vh; overflow-y: auto; }
    #stop ul { list-style: none; margin: 0; padding: 0; } #stop li, #stop p { margin: 0 0 .15rem; overflow-wrap: anywhere; }
    #stop .keys.lost { background: #fbf1dc; color: #5c3d00; border: 2px dashed #7a5200; padding: .1rem .5rem; font-weight: 700; cursor: pointer; }
    #stop .asked { font-weight: 700; } #stop .confirmed { color: #00563f; font-weight: 700; }
    #stop .unconfirmed { background: #b3261e; color: #fff; font-weight: 800; font-size: 1.25rem; padding: .2rem .6rem; border-radius: .3rem; }
    #stop button.mute { font: inherit; margin: .2rem 0; padding: .25rem .7rem; border: 2px solid #171b20; border-radius: .3rem; background: #fff; color: #171b20; cursor: pointer; }
    @media (prefers-color-scheme: dark) {
      #stop { background: #181c21; color: #e6e9ec; } #stop .confirmed { color: #5ecfa9; }
      #stop .keys.lost { background: #34280f; color: #f2cd86; } #stop button.press:focus-visible { outline-color: #6db7e2; } }
    @media (max-width: 34rem) { #stop { gap: .5rem; padding: .4rem; } #stop button.press { flex-basis: 7.2rem; font-size: 1.5rem; } #stop .told { font-size: 13px; }
      #stop .unconfirmed { font-size: 1rem; padding: .1rem .4rem; } }
    @media print { #stop { display: none; } }`;

  let words = {}, runs = [], asked = new Map(), pressedAt = 0, sound = null, beeping = 0;
  const parts = {};

  function say(text, values) {
    return Object.entries(values || {}).reduce((said, [name, value]) => said.replace("{" + name + "}", value), words[text] || text);
  }

  function seconds(value) {
    const text = value.toFixed(value < 10 ? 2 : 0);
    return (document.documentElement.lang === "de" ? text.replace(".", ",") : text) + " s";
  }

  function json(id, otherwise) {
    try { return JSON.parse(document.getElementById(id).textContent); } catch { return otherwise; }
  }

  function make(tag, className, ...inside) {
    const made = document.createElement(tag);
    if (className) made.className = className;
    made.append(...inside);
    return made;
  }

  // A listener on every address of its computer is reached where this page came from.
  function reached(url) {
    const at = new URL(url);
    if (["0.0.0.0", "[::]"].includes(at.hostname)) at.hostname = location.hostname;
    return at.href;
  }

  function underway() { return runs.filter(run => run.state !== "ended"); }

  // ---- what is shown ------------------------------------------------------------------------------------------

  function line(one) {
    const name = one.run.run + ": ";
    if (one.state === "asked") return make("li", "asked", name + say("stop requested …"));
    if (one.state === "over") return make("li", "", name + say("had ended before: {outcome}", {outcome: one.why}));
    if (one.state === "confirmed") {
      const outputs = Object.entries(one.answer.outputs || {}).map(([name, o]) => name + " " + o.at + " " + o.unit).join(", ");
      const text = say("stop confirmed, outputs read back safe after {time}", {time: seconds(one.took)});
      return make("li", "confirmed", name + text + (outputs ? " (" + outputs + ")" : ""));
    }
    return make("li", "unconfirmed", name + say("UNCONFIRMED: use the emergency stop") + (one.why ? " (" + one.why + ")" : ""));
  }

  function idle(run) {
    if (!run.stop_url) return make("li", "", run.run + ": " + say("cannot be stopped from here; end it where it was started, or use the emergency stop"));
    const own = run.listener === "run" ? " " + say("(no watchdog: the run itself listens)") : "";
    return make("li", "", say("ends {run}", {run: run.run}) + own);
  }

  function draw() {
    const open = underway().filter(run => !asked.has(run.run));
    const urgent = ["unconfirmed", "asked", "confirmed", "over"];
    const told = [...asked.values()].sort((one, other) => urgent.indexOf(one.state) - urgent.indexOf(other.state));
    const lines = [...told.map(line), ...open.map(idle)];
    parts.list.replaceChildren(...(lines.length ? lines : [make("li", "", say("no run is under way here"))]));
    parts.mute.hidden = !beeping;
  }

  function reachedByKeys() {
    return document.hasFocus() && document.activeElement?.tagName !== "IFRAME";
  }

  function look() {
    const has = reachedByKeys();
    parts.keys.className = has ? "keys" : "keys lost";
    const text = has ? say("F12 stops too") : say("F12 does not reach this page: click here");
    if (parts.keys.textContent !== text) parts.keys.textContent = text;
  }

  // ---- sound --------------------------------------------------------------------------------------------------

  function tuned() {  // within a gesture: a browser lets nothing sound before one
    try { sound = sound || new (window.AudioContext || window.webkitAudioContext)(); sound.resume(); } catch { sound = null; }
  }

  function beep() {
    if (!sound) return;
    for (const [at, hertz] of [[0, 880], [BEEP_S, 660]]) {
      const tone = sound.createOscillator(), volume = sound.createGain();
      tone.type = "square"; tone.frequency.value = hertz; volume.gain.value = 0.25;
      tone.connect(volume).connect(sound.destination);
      tone.start(sound.currentTime + at); tone.stop(sound.currentTime + at + 0.9 * BEEP_S);
    }
  }

  function alarm(on) {
    if (on && !beeping) { beep(); beeping = setInterval(beep, 3000 * BEEP_S); }
    if (!on && beeping) { clearInterval(beeping); beeping = 0; }
  }

  // ---- stop ---------------------------------------------------------------------------------------------------

  function settle(one, state, why, answer) {
    if (one.state === "confirmed") return;
    Object.assign(one, {state, why: why || "", answer: answer || {}, took: (performance.now() - one.since) / 1000});
    const open = [...asked.values()].some(other => other.state === "unconfirmed");
    alarm(open && !one.muted);
    draw();
  }

  async function ask(one) {
    if (!one.run.stop_url) return settle(one, "unconfirmed", say("no listener"));
    try {
      const body = new URLSearchParams({token: one.run.token});
      const answer = await fetch(reached(one.run.stop_url), {method: "POST", body, mode: "cors", credentials: "omit", cache: "no-store",
        signal: AbortSignal.timeout(2 * ANSWER_MS)});
      const told = await answer.json();
      if (told.state === "confirmed") return settle(one, "confirmed", "", told);
      settle(one, "unconfirmed", told.error || Object.entries(told.outputs || {}).map(([name, o]) => name + " " + say(o.state)).join(", "), told);
    } catch {
      const now = runs.find(run => run.run === one.run.run);
      if (now && now.state === "ended" && now.outcome === "completed") settle(one, "over", say("completed"));
      else settle(one, "unconfirmed", say("its listener does not answer"));
    }
    if (one.state === "unconfirmed" && performance.now() - one.since < GIVE_UP_MS) setTimeout(() => current(one) && ask(one), AGAIN_MS);
  }

  function current(one) { return asked.get(one.run.run) === one; }

  function press() {
    tuned();
    alarm(false);
    pressedAt = performance.now();
    asked = new Map(underway().map(run => [run.run, {run, state: "asked", since: pressedAt, muted: false}]));
    for (const one of asked.values()) {
      ask(one);
      setTimeout(() => { if (current(one) && one.state === "asked") settle(one, "unconfirmed", say("no answer within a second")); }, ANSWER_MS);
    }
    draw();
  }

  function onKey(event) {
    if (event.key !== "F12" && event.code !== "F12") return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (!event.repeat) press();
  }

  function mute() {
    for (const one of asked.values()) one.muted = true;
    alarm(false);
    draw();
  }

  function show(now) {
    if (Array.isArray(now)) { runs = now; draw(); }
  }

  function begin() {
    words = json("words", {});
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(CSS);
    document.adoptedStyleSheets = [...document.adoptedStyleSheets, sheet];
    const place = document.getElementById("stop") || document.body.appendChild(make("section"));
    place.id = "stop";
    parts.button = make("button", "press", say("STOP"), make("small", "", "F12"));
    parts.button.type = "button";
    parts.keys = make("p", "keys");
    parts.list = make("ul");
    const heard = make("div", "", parts.list);
    heard.setAttribute("role", "status");
    heard.setAttribute("aria-live", "assertive");
    parts.mute = make("button", "mute", say("Sound off"));
    parts.mute.type = "button";
    place.replaceChildren(parts.button, make("div", "told", heard, parts.mute, parts.keys));
    parts.button.addEventListener("click", press);
    parts.mute.addEventListener("click", mute);
    parts.keys.addEventListener("click", () => { window.focus(); parts.button.focus({preventScroll: true}); look(); });
    window.addEventListener("keydown", onKey, true);
    window.addEventListener("pointerdown", tuned, {once: true, capture: true});
    for (const event of ["focus", "blur", "visibilitychange", "focusin"]) window.addEventListener(event, look, true);
    document.addEventListener("hil:controls", event => show(event.detail));
    setInterval(look, LOOK_MS);
    show(json("controls", []));
    draw();
    look();
  }

  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", begin); else begin();
  return {show, press};
})();
