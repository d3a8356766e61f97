// The stop button and its key, F12. It speaks to each run's own listener and needs nothing but what this page knew last:
// it works when the server is dead. Beside that it tells the server, which stops what is starting, and what this page does
// not reach. What is known comes from the JSON of #controls, then from the event `hil:controls`: {runs, pressed}, a run
// being {run, state, stop_urls, token, who, listener, by}; whether the server answers from the event `hil:connection`.
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
    #stop .asked, #stop .unknown { font-weight: 700; } #stop .confirmed { color: #00563f; font-weight: 700; }
    #stop .unconfirmed { background: #b3261e; color: #fff; font-weight: 800; font-size: 1.25rem; padding: .2rem .6rem; border-radius: .3rem; }
    #stop button.mute { font: inherit; margin: .2rem 0; padding: .25rem .7rem; border: 2px solid #171b20; border-radius: .3rem; background: #fff; color: #171b20; cursor: pointer; }
    @media (prefers-color-scheme: dark) {
      #stop { background: #181c21; color: #e6e9ec; } #stop .confirmed { color: #5ecfa9; }
      #stop .keys.lost { background: #34280f; color: #f2cd86; } #stop button.press:focus-visible { outline-color: #6db7e2; } }
    @media (max-width: 34rem) { #stop { gap: .5rem; padding: .4rem; } #stop button.press { flex-basis: 7.2rem; font-size: 1.5rem; } #stop .told { font-size: 13px; }
      #stop .unconfirmed { font-size: 1rem; padding: .1rem .4rem; } }
    @media print { #stop { display: none; } }`;

  let words = {}, runs = [], pressed = null, offline = false, begun = 0, asked = new Map(), press_ = null, sound = null, beeping = 0,
    isDrawn = false, pressedEarly = false;
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

  // Where this page reaches a run itself: over TLS at the host that it came from, else on this computer. A listener on
  // every address of its computer is reached where this page came from.
  function reached(run) {
    for (const url of run.stop_urls || []) {
      const at = new URL(url);
      if (["0.0.0.0", "[::]"].includes(at.hostname)) at.hostname = location.hostname;
      if (at.protocol === location.protocol && (at.protocol === "http:" || at.hostname === location.hostname)) return at.href;
    }
    return "";
  }

  function underway() { return runs.filter(run => run.state !== "ended"); }

  // ---- what is shown ------------------------------------------------------------------------------------------

  function line(one) {
    const name = one.run.run + ": ";
    if (one.state === "asked") return make("li", "asked", name + say("stop requested …"));
    if (one.state === "over") return make("li", "", name + (one.why ? say("had ended before: {outcome}", {outcome: one.why}) : say("stopped before it drove")));
    if (one.state === "waits") return make("li", "asked", name + say("safe, read back; confirmed in {time}", {time: seconds(one.left)}));
    if (one.state === "confirmed") {
      const outputs = Object.entries(one.answer.outputs || {}).map(([name, o]) => name + " " + o.at + " " + o.unit).join(", ");
      const text = say("stop confirmed, outputs read back safe after {time}", {time: seconds(one.took)});
      return make("li", "confirmed", name + text + (outputs ? " (" + outputs + ")" : ""));
    }
    return make("li", "unconfirmed", name + say("UNCONFIRMED: use the emergency stop") + (one.why ? " (" + one.why + ")" : ""));
  }

  function idle(run) {
    if (run.state === "starting") return make("li", "", say("ends {run} before it drives", {run: run.run}));
    if (!reached(run)) {
      const how = offline || !(run.stop_url || run.by) ? "cannot be stopped from here; end it where it was started, or use the emergency stop" : "is stopped through the console, while that answers";
      return make("li", "", run.run + ": " + say(how));
    }
    const own = run.listener === "run" ? " " + say("(no watchdog: the run itself listens)") : "";
    return make("li", "", say("ends {run}", {run: run.run}) + own);
  }

  function blocked() {
    const at = new Date(pressed.at_utc).toLocaleTimeString(document.documentElement.lang, {hourCycle: "h23"});  // as everywhere else on the page
    const by = [at, pressed.account].filter(Boolean).join(", ");
    if (pressed.runs.length) return make("li", "asked", say("Stop is pressed ({by}): {run} ends before it drives.", {by, run: pressed.runs.join(", ")}));
    const button = make("button", "mute", say("Release"));
    button.type = "button";
    button.addEventListener("click", () => document.dispatchEvent(new CustomEvent("hil:release")));
    return make("li", "asked", say("Stop is pressed ({by}): no run can start.", {by}) + " ", button);
  }

  function nothing() {
    if (offline && underway().length) return make("li", "unknown", say("What else is under way is not known: use the emergency stop."));
    if (offline) return make("li", "unknown", say("Not known whether a run is under way: use the emergency stop."));
    return make("li", "", say(begun ? "a run is starting" : "no run is under way here"));
  }

  function draw() {
    const open = underway().filter(run => !asked.has(run.run));
    const urgent = ["unconfirmed", "asked", "waits", "confirmed", "over"];
    const told = [...asked.values()].sort((one, other) => urgent.indexOf(one.state) - urgent.indexOf(other.state));
    const lines = [...told.map(line), ...open.map(idle), ...(pressed && !offline ? [blocked()] : [])];
    if (!lines.length || (offline && !told.some(one => one.state === "unconfirmed"))) lines.push(nothing());
    const drawn = lines.map(one => one.className + one.textContent).join("\n");
    if (drawn !== parts.list.dataset.drawn) parts.list.replaceChildren(...lines);  // what is said again is not announced again
    parts.list.dataset.drawn = drawn;
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
    if (one.state === "confirmed" || one.state === "over") return;
    Object.assign(one, {state, why: why || "", answer: answer || {}, took: (performance.now() - one.since) / 1000});
    sounds();
    draw();
  }

  function sounds() { alarm([...asked.values()].some(one => one.state === "unconfirmed" && !one.muted)); }

  async function posted(url, body, more) {
    const answer = await fetch(url, {method: "POST", body, cache: "no-store", keepalive: true, signal: AbortSignal.timeout(2 * ANSWER_MS), ...more});
    if (!answer.ok) throw new Error(String(answer.status));
    return answer.json();
  }

  function heard(one, told) {
    const open = Object.values(told.outputs || {}).filter(o => o.state !== "safe");
    one.left = Math.max(0, ...open.map(o => o.confirmed_in_s || 0));
    if (told.state === "confirmed") settle(one, "confirmed", "", told);
    else if (open.length && open.every(o => o.read_back && o.confirmed_in_s)) settle(one, "waits", "", told);  // only time is missing
    else settle(one, "unconfirmed", told.error || Object.entries(told.outputs || {}).map(([name, o]) => name + " " + say(o.state)).join(", "), told);
  }

  // A run's own listener, until it has confirmed.
  async function ask(one) {
    const url = reached(one.run);
    if (!url) return one.run.by || one.run.stop_url ? undefined : settle(one, "unconfirmed", say("no listener"));
    try {
      heard(one, await posted(url, new URLSearchParams({token: one.run.token, ...one.run.who}), {mode: "cors", credentials: "omit"}));
    } catch { if (!ended(one)) settle(one, "unconfirmed", say("its listener does not answer")); }
    if (["unconfirmed", "waits"].includes(one.state) && performance.now() - one.since < GIVE_UP_MS) setTimeout(() => asked.get(one.run.run) === one && ask(one), AGAIN_MS);
  }

  // The server, until it has answered: it ends what is starting, and keeps runs from starting.
  async function tell(press) {
    try {
      const told = await posted("/stop", new URLSearchParams(press.runs.map(name => ["run", name])));
      if (press !== press_) return;
      press.answered = true;
      asked.delete("");
      for (const [name, answer] of Object.entries(told.answers)) {
        if (!asked.has(name)) asked.set(name, {run: {run: name}, state: "asked", since: press.at, muted: false});
        if (answer.state === "confirmed" || !reached(asked.get(name).run)) heard(asked.get(name), answer);
      }
      show({runs, pressed: told.pressed});
    } catch {
      const again = performance.now() - press.at < GIVE_UP_MS && ![...asked.values()].some(one => one.state === "confirmed");
      if (press === press_ && again) setTimeout(() => press === press_ && tell(press), AGAIN_MS);
    }
  }

  // Nothing confirmed in time. What is starting is as good as stopped once the server knows of the press.
  function late(press) {
    if (press !== press_) return;
    if (!asked.size && !press.answered) asked.set("", {run: {run: say("console")}, state: "asked", since: press.at, muted: false});
    for (const one of asked.values()) {
      const why = reached(one.run) ? "no answer within a second" : "the console does not answer";
      if (one.state === "asked" && !(press.answered && one.run.by)) settle(one, "unconfirmed", say(why));
    }
  }

  // A run that was asked may be known better now: it listens, has ended, or another one is under way.
  function ended(one) {
    const now = runs.find(run => run.run === one.run.run);
    if (!now && press_.answered && !one.run.stop_url) { settle(one, "over"); return true; }
    if (!now || now.state !== "ended" || !(now.is_safe || now.outcome === "completed" || !now.stop_url && now.by)) return false;
    settle(one, "over", now.outcome === "completed" ? say("completed") : now.stop_url ? now.outcome : "");
    return true;
  }

  function follow() {
    for (const [name, one] of asked) {
      const now = runs.find(run => run.run === name);
      if (now && reached(now) && !reached(one.run) && now.state !== "ended") { one.run = now; ask(one); }
      else if (["asked", "unconfirmed", "waits"].includes(one.state)) ended(one);
      const next = runs.find(run => run.state !== "ended" && run.run !== name && !asked.has(run.run));
      if (next && ["confirmed", "over"].includes(one.state)) asked.delete(name);  // the word of a run goes with it
      else if (next && one.state === "unconfirmed" && one.run.bench && next.bench === one.run.bench && !underway().some(run => run.run === name)) asked.delete(name);
    }
    sounds();
  }

  function press() {
    tuned();
    alarm(false);
    press_ = {at: performance.now(), answered: false, runs: underway().map(run => run.run)};
    asked = new Map(underway().map(run => [run.run, {run, state: "asked", since: press_.at, muted: false}]));
    for (const one of asked.values()) ask(one);
    tell(press_);
    setTimeout(late, ANSWER_MS, press_);
    draw();
  }

  function onKey(event) {
    if (event.key !== "F12" && event.code !== "F12") return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (event.repeat) return;
    if (isDrawn) press(); else pressedEarly = true;
  }

  function mute() {
    for (const one of asked.values()) one.muted = true;
    alarm(false);
    draw();
  }

  function show(now) {
    ({runs, pressed} = now);
    follow();
    draw();
  }

  // Somebody starts a run: it is under way from the click, until the console says how it stands.
  async function expect(work) {
    begun += 1;
    draw();
    try { return await work; } finally { begun -= 1; draw(); }
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
    window.addEventListener("pointerdown", tuned, {once: true, capture: true});
    for (const event of ["focus", "blur", "visibilitychange", "focusin"]) window.addEventListener(event, look, true);
    document.addEventListener("hil:controls", event => show(event.detail));
    document.addEventListener("hil:connection", event => { offline = !event.detail; draw(); });
    setInterval(look, LOOK_MS);
    isDrawn = true;
    show(json("controls", {runs: [], pressed: null}));
    look();
    if (pressedEarly) press();
  }

  window.addEventListener("keydown", onKey, true);  // at once: a page that is still being read would lose the key
  if (document.readyState === "loading") document.addEventListener("readystatechange", begin, {once: true}); else begin();
  return {show, press, expect};
})();
