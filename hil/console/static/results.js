// What can be done with the runs that are chosen.
"use strict";
const boxes = [...document.querySelectorAll("#chosen input[name=run]")];
function chosen() {
  const count = boxes.filter(box => box.checked).length;
  document.getElementById("compare").disabled = count !== 2;
  document.getElementById("passport").disabled = count < 1;
}
for (const box of boxes) box.addEventListener("change", chosen);
chosen();
