// What is served, told anew each second.
"use strict";
let servedText = "";
async function lookDevices() {
  try {
    const answer = await fetch("/devices/served"), text = await answer.text(), now = document.getElementById("served");
    if (answer.ok && text !== servedText && !now.contains(document.activeElement)) {
      servedText = text;
      const told = document.createElement("template");  // rows of our own server, escaped there; scripts do not run from here
      told.innerHTML = "<table><tbody>" + text + "</tbody></table>";
      now.replaceChildren(...told.content.querySelector("tbody").children);
    }
  } catch (error) { /* told above the page */ }
  setTimeout(lookDevices, 1000);
}
setTimeout(lookDevices, 500);
