// A value over time with its uncertainty and its limits.
"use strict";
const trendPoints = document.getElementById("points");
function drawTrend() {
  const points = JSON.parse(trendPoints.textContent), canvas = document.getElementById("trend");
  const [pen, width, height] = fitted(canvas), left = 60, right = width - 14, top = 12, bottom = height - 24;
  const times = points.map(p => Date.parse(p.at)), from = Math.min(...times), to = Math.max(...times);
  const ends = points.flatMap(p => [p.value - (p.expanded || 0), p.value + (p.expanded || 0), p.low, p.high]).filter(Number.isFinite);
  const room = (Math.max(...ends) - Math.min(...ends)) * 0.08 || Math.abs(ends[0]) * 0.05 || 1;
  const least = Math.min(...ends) - room, most = Math.max(...ends) + room, spread = to - from || 1, edge = 0.04 * (right - left);
  const x = t => left + edge + (to > from ? (t - from) / spread : 0.5) * (right - left - 2 * edge);
  const y = v => bottom - (v - least) / (most - least) * (bottom - top);
  pen.strokeStyle = colour("line"); pen.fillStyle = colour("soft"); pen.textAlign = "right"; pen.textBaseline = "middle";
  for (const v of ticks(least, most, 6)) {
    pen.beginPath(); pen.moveTo(left, y(v)); pen.lineTo(right, y(v)); pen.stroke();
    pen.fillText(shown(v, 5), left - 5, y(v));
  }
  pen.textAlign = "center"; pen.textBaseline = "top";
  const two = n => String(n).padStart(2, "0");
  const dated = t => { const d = new Date(t), day = d.getFullYear() + "-" + two(d.getMonth() + 1) + "-" + two(d.getDate()); return spread < 2 * 864e5 ? day + " " + two(d.getHours()) + ":" + two(d.getMinutes()) : day; };
  let free = -Infinity;
  for (const t of times) if (x(t) - free > 110) { pen.fillText(dated(t), x(t), bottom + 6); free = x(t); }
  pen.setLineDash([6, 4]); pen.strokeStyle = colour("bad"); pen.lineWidth = 1.5;
  for (const side of ["low", "high"]) {
    pen.beginPath();
    let open = false;
    points.forEach((p, i) => {
      if (!Number.isFinite(p[side])) { open = false; return; }
      if (!open) pen.moveTo(i ? x(times[i]) : left, y(p[side]));
      pen.lineTo(i === points.length - 1 ? right : x(times[i]), y(p[side]));
      open = true;
    });
    pen.stroke();
  }
  pen.setLineDash([]); pen.strokeStyle = pen.fillStyle = colour("c0");
  points.forEach((p, i) => {
    if (p.expanded) {
      pen.beginPath(); pen.moveTo(x(times[i]), y(p.value - p.expanded)); pen.lineTo(x(times[i]), y(p.value + p.expanded)); pen.stroke();
      for (const end of [p.value - p.expanded, p.value + p.expanded]) { pen.beginPath(); pen.moveTo(x(times[i]) - 4, y(end)); pen.lineTo(x(times[i]) + 4, y(end)); pen.stroke(); }
    }
    pen.beginPath(); pen.arc(x(times[i]), y(p.value), 3.5, 0, 7); pen.fill();
  });
}
if (trendPoints) { drawTrend(); addEventListener("resize", drawTrend); }
