// What is served, told anew each second.
"use strict";
async function lookDevices() {
  try {
    const answer = await fetch(location.href), told = new DOMParser().parseFromString(await answer.text(), "text/html");
    const now = document.getElementById("served"), come = told.getElementById("served");
    if (answer.ok && come && now.innerHTML !== come.innerHTML && !now.contains(document.activeElement)) now.replaceWith(come);
  } catch (error) { /* told above the page */ }
  setTimeout(lookDevices, 1000);
}
setTimeout(lookDevices, 1000);
