// Two drawings on a canvas: stretches of samples over time (least to largest), and points over a logarithmic axis.
"use strict";

function colour(name) { return getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim(); }

function fitted(canvas) {
  const scale = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "11px system-ui, sans-serif";
  return [pen, width, height];
}

function ticks(low, high, most) {
  const step = 10 ** Math.floor(Math.log10((high - low) / most || 1));
  const size = [1, 2, 5, 10].map(f => f * step).find(s => (high - low) / s <= most) || step * 10;
  const found = [];
  for (let i = Math.ceil(low / size - 1e-9); i * size <= high + 1e-9 * size; i++) found.push(i * size);
  return found;
}

// Series: {t, low, high}; places: x of the window's ends in px, y of the lane's ends in px.
function drawStretches(pen, series, ink, from, to, box, span, width_s) {
  const [left, right, top, bottom] = box, [least, most] = span;
  const x = t => left + (t - from) / (to - from) * (right - left);
  const y = v => bottom - (v - least) / (most - least) * (bottom - top);
  let i = 0, n = series.t.length;
  for (let a = 0, b = n; a < b;) { const m = (a + b) >> 1; if (series.t[m] < from) a = i = m + 1; else b = m; }
  i = Math.max(0, i - 1);
  pen.save();
  pen.beginPath(); pen.rect(left, top - 1, right - left, bottom - top + 2); pen.clip();
  pen.strokeStyle = ink; pen.lineWidth = 1.2; pen.lineJoin = "round";
  pen.beginPath();
  let open = false;
  for (; i < n && series.t[i] <= to; i++) {
    if (series.low[i] === null) { open = false; continue; }
    if (open && series.t[i] - series.t[i - 1] > Math.max(0.5, 6 * width_s)) open = false;  // a hole is not bridged
    const px = x(series.t[i]), a = y(series.low[i]), b = y(series.high[i]);
    if (open) pen.lineTo(px, a); else pen.moveTo(px, a);
    pen.lineTo(px, b);
    open = true;
  }
  pen.stroke();
  pen.restore();
}

function spanOf(series, from, to) {
  let least = Infinity, most = -Infinity;
  for (let i = series.t.length - 1; i >= 0 && series.t[i] >= from; i--) {
    if (series.t[i] > to || series.low[i] === null) continue;
    least = Math.min(least, series.low[i]); most = Math.max(most, series.high[i]);
  }
  if (least > most) return null;
  const room = (most - least) * 0.08 || Math.abs(most) * 0.05 || 1;
  return [least - room, most + room];
}

// Channels in lanes over one time axis.
function drawStrip(canvas, channels, laneHeight, from, to, width_s) {
  const foot = 20;
  canvas.style.height = channels.length * laneHeight + foot + "px";
  const [pen, width] = fitted(canvas);
  const left = 46, right = width - 8, soft = colour("soft"), line = colour("line");
  const marks = ticks(from, to, Math.max(2, Math.floor((right - left) / 90)));
  pen.lineWidth = 1;
  channels.forEach((series, k) => {
    const top = k * laneHeight + 6, bottom = (k + 1) * laneHeight - 6;
    pen.strokeStyle = line;
    for (const t of marks) {
      const px = Math.round(left + (t - from) / (to - from) * (right - left)) + 0.5;
      pen.beginPath(); pen.moveTo(px, k * laneHeight); pen.lineTo(px, (k + 1) * laneHeight); pen.stroke();
    }
    pen.beginPath(); pen.moveTo(0, (k + 1) * laneHeight - 0.5); pen.lineTo(width, (k + 1) * laneHeight - 0.5); pen.stroke();
    const span = spanOf(series, from, to);
    if (!span) return;
    pen.fillStyle = soft; pen.textAlign = "right"; pen.textBaseline = "middle";
    for (const v of ticks(span[0], span[1], 3)) {
      const y = bottom - (v - span[0]) / (span[1] - span[0]) * (bottom - top);
      pen.fillText(shown(v, 4), left - 5, y);
    }
    drawStretches(pen, series, colour("c" + k % 8), from, to, [left, right, top, bottom], span, width_s);
  });
  pen.fillStyle = soft; pen.textBaseline = "top"; pen.textAlign = "center";
  for (const t of marks) pen.fillText(shown(t, 6) + " s", Math.min(right - 14, Math.max(left + 10, left + (t - from) / (to - from) * (right - left))), channels.length * laneHeight + 4);
}

// One output over time with its limits.
function drawPlanned(canvas, output) {
  const [pen, width, height] = fitted(canvas), left = 52, right = width - 10, top = 10, bottom = height - 22;
  const from = output.t[0], to = output.t[output.t.length - 1] + 1e-9, limits = output.limits;
  let span = spanOf(output, from, to) || [0, 1];
  if (limits) { const room = 0.06 * (limits[1] - limits[0]); span = [Math.min(span[0], limits[0] - room), Math.max(span[1], limits[1] + room)]; }
  const y = v => bottom - (v - span[0]) / (span[1] - span[0]) * (bottom - top);
  pen.strokeStyle = colour("line"); pen.fillStyle = colour("soft"); pen.textAlign = "right"; pen.textBaseline = "middle";
  for (const v of ticks(span[0], span[1], 5)) {
    pen.beginPath(); pen.moveTo(left, y(v)); pen.lineTo(right, y(v)); pen.stroke();
    pen.fillText(shown(v, 4), left - 5, y(v));
  }
  pen.textAlign = "center"; pen.textBaseline = "top";
  for (const t of ticks(from, to, Math.max(2, Math.floor((right - left) / 90)))) pen.fillText(shown(t, 5) + " s", Math.min(right - 14, left + (t - from) / (to - from) * (right - left)), bottom + 6);
  if (limits) {
    pen.strokeStyle = colour("bad"); pen.setLineDash([6, 4]); pen.lineWidth = 1.5;
    for (const v of limits) { pen.beginPath(); pen.moveTo(left, y(v)); pen.lineTo(right, y(v)); pen.stroke(); }
    pen.setLineDash([]);
  }
  drawStretches(pen, output, colour("c0"), from, to, [left, right, top, bottom], span, 1e9);
}

// Points over a logarithmic frequency; series: {name, x, y}.
function drawPoints(canvas, series, unit) {
  const [pen, width, height] = fitted(canvas), left = 52, right = width - 12, top = 26, bottom = height - 24;
  const xs = series.flatMap(s => s.x), ys = series.flatMap(s => s.y);
  if (!xs.length) return;
  const from = Math.log10(Math.min(...xs)) - 0.05, to = Math.log10(Math.max(...xs)) + 0.05;
  const room = (Math.max(...ys) - Math.min(...ys)) * 0.08 || 1, span = [Math.min(...ys) - room, Math.max(...ys) + room];
  const px = v => left + (Math.log10(v) - from) / (to - from) * (right - left);
  const py = v => bottom - (v - span[0]) / (span[1] - span[0]) * (bottom - top);
  pen.strokeStyle = colour("line"); pen.fillStyle = colour("soft"); pen.textAlign = "right"; pen.textBaseline = "middle";
  for (const v of ticks(span[0], span[1], 6)) {
    pen.beginPath(); pen.moveTo(left, py(v)); pen.lineTo(right, py(v)); pen.stroke();
    pen.fillText(shown(v, 4), left - 5, py(v));
  }
  pen.textAlign = "center"; pen.textBaseline = "top";
  for (let e = Math.floor(from); e <= Math.ceil(to); e++) for (let m = 1; m < 10; m++) {
    const v = m * 10 ** e, at = Math.log10(v);
    if (at < from || at > to) continue;
    pen.beginPath(); pen.moveTo(px(v), top); pen.lineTo(px(v), bottom); pen.stroke();
    if (m === 1 || m === 2 || m === 5) pen.fillText(shown(v, 3), px(v), bottom + 5);
  }
  pen.textAlign = "right"; pen.fillText("Hz", right, bottom + 5);
  pen.textAlign = "left"; pen.textBaseline = "top";
  let along = left;
  series.forEach((one, k) => {
    const ink = colour("c" + k % 8);
    pen.strokeStyle = pen.fillStyle = ink; pen.lineWidth = 1.4;
    pen.setLineDash([[], [6, 3], [2, 2], [8, 3, 2, 3]][k % 4]);
    pen.beginPath(); one.x.forEach((v, i) => i ? pen.lineTo(px(v), py(one.y[i])) : pen.moveTo(px(v), py(one.y[i]))); pen.stroke();
    pen.setLineDash([]);
    one.x.forEach((v, i) => { pen.beginPath(); pen.arc(px(v), py(one.y[i]), 2.6, 0, 7); pen.fill(); });
    pen.fillText(one.name, along, 6);
    along += pen.measureText(one.name).width + 16;
  });
  pen.fillStyle = colour("soft"); pen.textAlign = "right"; pen.fillText(unit, right, 6);
}
