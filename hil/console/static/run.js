// The form of a run: checked while it is typed, rehearsed, started.
"use strict";
const form = document.getElementById("form"), said = document.getElementById("said");

function tell(text, bad) { said.textContent = text; said.className = bad ? "bad" : ""; }

function fields() { return new FormData(form); }

function wrong(name, why) {
  const setting = document.querySelector(`[data-setting="${CSS.escape(name)}"]`);
  if (!setting) return false;
  setting.classList.toggle("wrong", Boolean(why));
  setting.querySelector(".why").textContent = why || "";
  setting.querySelector("input, select, textarea").setAttribute("aria-invalid", why ? "true" : "false");
  return true;
}

async function check() {
  const told = await post("/run/check", fields()).catch(error => { tell(error.message, true); return null; });
  if (!told) return false;
  for (const setting of document.querySelectorAll("[data-setting]")) wrong(setting.dataset.setting, told.faults[setting.dataset.setting]);
  return !Object.keys(told.faults).length;
}

function refused(text, name) {
  if (name) wrong(name, text);
  tell(say("Refused") + ": " + text, true);
}

document.getElementById("serial").addEventListener("keydown", event => {  // a scanner types and presses Enter
  if (event.key !== "Enter") return;
  event.preventDefault();
  document.getElementById("operator").focus();
});

for (const name of ["procedure", "bench", "preset"]) document.getElementById(name)?.addEventListener("change", () => {
  const kept = new URLSearchParams();
  const own = name === "procedure" ? /^(set\.|limits$)/ : /^set\./;  // settings, and limits of what that one measures
  for (const [key, value] of fields()) if (value && !own.test(key)) kept.set(key, value);
  location.search = kept;
});

let waiting = 0;
form.addEventListener("input", event => {
  if (!event.target.closest("[data-setting]")) return;
  clearTimeout(waiting);
  waiting = setTimeout(check, 300);
});

function showPlanned(told) {
  const panel = document.getElementById("planned");
  panel.hidden = false;
  document.getElementById("planned-text").textContent = decimal(told.text);
  const charts = told.outputs.map(output => {
    const canvas = document.createElement("canvas"), unit = output.unit === "1" ? "" : ` [${output.unit}]`;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", output.name + unit + (output.limits ? `, ${output.limits[0]} … ${output.limits[1]}` : ""));
    return [make("figure", "", make("figcaption", "", output.name + unit), canvas), canvas, output];
  });
  document.getElementById("planned-charts").replaceChildren(...charts.map(one => one[0]));
  const draw = () => charts.forEach(([, canvas, output]) => drawPlanned(canvas, output));
  draw();
  addEventListener("resize", draw);
}

async function rehearsed(name, query) {
  for (;;) {
    const told = await ask("/run/rehearsal/" + name + "?" + query);
    if (told.state === "refused") return refused(told.text, told.setting);
    if (told.state === "rehearsed") { tell(say("rehearsed") + ": " + say("within all limits")); return showPlanned(told); }
    tell(told.text || say("Rehearsing …"));
    await new Promise(done => setTimeout(done, 300));
  }
}

async function act(button, work) {
  button.disabled = true;
  try { if (await check()) await work(); } catch (error) { refused(error.message); } finally { button.disabled = false; }
}

document.getElementById("rehearse").addEventListener("click", event => act(event.target, async () => {
  tell(say("Rehearsing …"));
  const query = new URLSearchParams({procedure: form.elements.procedure.value, bench: form.elements.bench.value});
  const begun = await post("/run/rehearse", fields());
  await rehearsed(begun.rehearsal, query);
}));

form.addEventListener("submit", event => {
  event.preventDefault();
  hilStop.expect(act(document.getElementById("start"), async () => {
    tell(say("Starting …"));
    const begun = await post("/run/start", fields());
    location.href = "/live/" + encodeURIComponent(begun.run);
  }));
});
