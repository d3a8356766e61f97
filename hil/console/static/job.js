// A job: what it says, and where its product is.
"use strict";
const job = document.getElementById("job");
function showJob(told) {
  const at = document.getElementById("state"), link = document.getElementById("product");
  if (at.textContent !== say(told.state)) at.textContent = say(told.state);
  at.className = "word " + (told.state === "refused" ? "bad" : told.state === "done" ? "good" : "");
  document.getElementById("lines").textContent = told.lines.join("\n");
  link.hidden = !told.product;
  if (told.product && !link.href) { link.href = told.product; link.focus(); }
  return told.state !== "running" && told.state !== "waiting";
}
async function againJob() {
  let over = false;
  try { over = showJob(await ask("/jobs/" + encodeURIComponent(job.dataset.job) + "/state")); } catch (error) { /* told above the page */ }
  if (!over) setTimeout(againJob, 400);
}
showJob(JSON.parse(document.getElementById("first").textContent));
againJob();
