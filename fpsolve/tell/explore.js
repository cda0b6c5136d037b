"use strict";
const $ = id => document.getElementById(id);
const page = crypto.randomUUID();
const SVG = "http://www.w3.org/2000/svg";
const STEPS = 1000, REST = 300, LISTEN = 1000; // positions of a slider; milliseconds of rest, and between two looks at the server
let about, number = 0, knobs = [], wanted = 0, isMoving = false, isLost = false, rest, shown, before;

// asking

async function ask(name, more = {}) {
  const question = {page, number: ++number, values: Object.fromEntries(knobs.map(knob => [knob.key, knob.read()])), ...more};
  try {
    const response = await fetch("/" + name, {method: "POST", headers: {"Content-Type": "application/json"}, body: JSON.stringify(question)});
    return await response.json();
  } catch {
    isLost = true;
    $("state").textContent = "";
    $("refused").textContent = `fpsolve has ended, and this page does nothing any more; start it again: fpsolve explore ${about ? about.file : ""}`;
    document.body.classList.add("stale");
    return {stopped: true};
  }
}

const long = new Set(); // what has taken longer than a moment
// The answer of a kind is shown if nothing newer was asked; what takes longer than a moment says that it works.
async function work(name, show, more = {}) {
  const said = setTimeout(() => { $("state").textContent = "working …"; long.add(name); $("stop").disabled = false; }, 150);
  const answer = await ask(name, more);
  clearTimeout(said);
  if (isLost || answer.stopped) return;
  long.delete(name);
  $("stop").disabled = !long.size;
  $("refused").textContent = answer.refused || "";
  document.body.classList.toggle("stale", Boolean(answer.refused));
  const time = answer.seconds < 1 ? `${(1000 * answer.seconds).toFixed(0)} ms` : `${answer.seconds?.toFixed(1)} s`;
  $("state").textContent = answer.refused ? "" : `${name === "move" ? "moving, " : ""}${time}`;
  if (!answer.refused) show(answer);
}

async function listen() { // what a question waits for, and what there is of a map so far
  const {waits, map} = isLost ? {} : await ask("listen");
  if (isLost || $("stop").disabled) return;
  if (waits) $("state").textContent = `working … ${waits}`;
  if (map) see("map", map, asked.map);
}

function moved() {
  wanted += 1;
  $("state").textContent = "moving";
  clearTimeout(rest);
  if (about.moves) follow();
  else settle();
}

function settle() { rest = setTimeout(() => work("solve", showCurve), REST); }

async function follow() { // the last position wins: what lies between two answers is never asked for
  if (isMoving) return;
  isMoving = true;
  for (let seen; seen !== wanted && !isLost;) {
    seen = wanted;
    await work("move", showCurve);
  }
  isMoving = false;
  settle();
}

// the sliders

const valueAt = ([low, high], log, share) => log ? low * (high / low) ** share : low + (high - low) * share;
const shareOf = ([low, high], log, value) => log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);

function knobOf(spec) {
  const {ends, log} = spec, box = document.createElement("div"), id = `knob-${spec.key}`;
  const label = Object.assign(document.createElement("label"), {htmlFor: id});
  const key = Object.assign(document.createElement("span"), {className: "key", textContent: ` ${spec.key}`});
  const name = spec.words || spec.key, title = [spec.words, spec.symbol, spec.unit && `(${spec.unit})`].filter(Boolean).join(" ");
  label.append(title, key);
  const slider = Object.assign(document.createElement("input"), {type: "range", min: 0, max: STEPS, ariaLabel: `${name}, slider`});
  const field = Object.assign(document.createElement("input"), {type: "text", inputMode: "decimal", id, autocomplete: "off"});
  const back = Object.assign(document.createElement("button"), {type: "button", textContent: "↺", ariaLabel: `${name} as the case`, title: "as the case"});
  const place = () => { slider.value = STEPS * shareOf(ends, log, Number(field.value)); slider.ariaValueText = field.value; };
  const set = value => { field.value = value; place(); };
  slider.oninput = () => { field.value = Number(valueAt(ends, log, slider.value / STEPS).toPrecision(4)); slider.ariaValueText = field.value; moved(); };
  field.onchange = () => { place(); moved(); };
  back.onclick = () => { set(spec.value); moved(); };
  box.className = "knob";
  box.append(label, slider, field, back);
  set(spec.value);
  return {...spec, title: title || spec.key, box, set, read: () => field.value.trim() === "" || isNaN(field.value) ? field.value : Number(field.value)};
}

// drawing

function node(parent, name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (text !== undefined) made.textContent = text;
  return parent.appendChild(made);
}

function ticks([low, high], log, count) {
  if (log && high / low > 3) {
    const found = [];
    for (let e = Math.floor(Math.log10(low)); e <= Math.log10(high); e++) for (const m of high / low > 300 ? [1] : [1, 2, 5]) found.push(m * 10 ** e);
    return found.filter(each => each >= low * (1 - 1e-9) && each <= high * (1 + 1e-9));
  }
  const rough = (high - low) / count, size = 10 ** Math.floor(Math.log10(rough)), step = [1, 2, 5, 10].find(m => m * size >= rough) * size;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

const brief = value => String(Number(value.toPrecision(6)));

// A frame with axes; gives what takes numbers to places in it.
function frame(svg, x, y) {
  svg.replaceChildren();
  const width = svg.clientWidth || 640, height = Math.max(260, Math.min(0.6 * width, 460));
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const box = {left: 78, right: width - 12, top: 12, bottom: height - 44};
  const X = value => box.left + (box.right - box.left) * shareOf(x.ends, x.log, value);
  const Y = value => box.bottom + (box.top - box.bottom) * shareOf(y.ends, y.log, value);
  for (const value of x.ticks || ticks(x.ends, x.log, width / 90)) {
    node(svg, "line", {class: value === 0 ? "zero" : "grid", x1: X(value), x2: X(value), y1: box.top, y2: box.bottom});
    node(svg, "text", {x: X(value), y: box.bottom + 17, "text-anchor": "middle"}, x.name ? x.name(value) : brief(value));
  }
  for (const value of ticks(y.ends, y.log, height / 60)) {
    node(svg, "line", {class: value === 0 ? "zero" : "grid", x1: box.left, x2: box.right, y1: Y(value), y2: Y(value)});
    node(svg, "text", {x: box.left - 6, y: Y(value) + 4, "text-anchor": "end"}, brief(value));
  }
  node(svg, "text", {x: (box.left + box.right) / 2, y: height - 6, "text-anchor": "middle"}, x.label);
  node(svg, "text", {transform: `translate(14 ${(box.top + box.bottom) / 2}) rotate(-90)`, "text-anchor": "middle"}, y.label);
  const clip = node(svg, "clipPath", {id: `clip-${svg.parentNode.id}`});
  node(clip, "rect", {x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top});
  const inside = node(svg, "g", {"clip-path": `url(#clip-${svg.parentNode.id})`});
  node(svg, "rect", {class: "frame", x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top});
  const at = (u, v) => [valueAt(x.ends, x.log, shareOf([box.left, box.right], false, u)), valueAt(y.ends, y.log, shareOf([box.bottom, box.top], false, v))];
  return {X, Y, inside, box, at};
}

const line = ({X, Y}, xs, ys) => xs.map((x, i) => `${i ? "L" : "M"}${X(x).toFixed(2)} ${Y(ys[i]).toFixed(2)}`).join("");

function smooth({X, Y}, xs, ys, slopes) { // cubic pieces with the slopes that are known
  let d = "";
  xs.forEach((x, i) => {
    const at = `${X(x).toFixed(2)} ${Y(ys[i]).toFixed(2)}`, h = i ? (x - xs[i - 1]) / 3 : 0;
    if (!i) d += `M${at}`;
    else if (slopes[i] === null || slopes[i - 1] === null) d += `L${at}`;
    else d += `C${X(x - 2 * h)} ${Y(ys[i - 1] + h * slopes[i - 1])} ${X(x - h)} ${Y(ys[i] - h * slopes[i])} ${at}`;
  });
  return d;
}

function drawCurve() {
  if (!shown || !isSeen("curve")) return;
  const curves = [before, shown].filter(Boolean).map(answer => answer.curve), [p, value, slope, error] = curves.at(-1);
  const all = curves.flatMap(each => each[1]).concat(0), room = 0.06 * (Math.max(...all) - Math.min(...all)) || 1;
  const ends = [Math.min(...p), Math.max(...p)], low = p.length > 1 ? ends : [Math.min(0, ends[0]), ends[1] + 1];
  const plot = frame($("curve").querySelector("svg"), {ends: low, label: "order of the moment p"},
    {ends: [Math.min(...all) - room, Math.max(...all) + room], label: `Λ(p) (${about.unit})`});
  if (before) node(plot.inside, "path", {class: "line before", d: smooth(plot, ...curves[0])});
  const down = p.toReversed(), lower = value.map((each, i) => each - error[i]).toReversed();
  node(plot.inside, "path", {class: "band one", d: `${line(plot, p, value.map((each, i) => each + error[i]))}${line(plot, down, lower).replace("M", "L")}Z`});
  node(plot.inside, "path", {class: "line one", d: smooth(plot, p, value, slope)});
  const dots = p.length < 9 ? p.map((each, i) => [each, value[i]]) : [];
  if (shown.root !== null) dots.push([shown.root, 0]);
  for (const [x, y] of dots) node(plot.inside, "circle", {class: "dot one", cx: plot.X(x), cy: plot.Y(y), r: 5});
}

function showCurve(answer) {
  shown = answer;
  if (!before && answer.root !== undefined && !wanted) before = answer;
  $("equations").replaceChildren(...answer.equations.map(text => Object.assign(document.createElement("p"), {className: "equation", textContent: text})));
  for (const name of ["verdict", "numbers", "table"]) $(name).innerHTML = answer[name]; // escaped by fpsolve
  redraw();
}

// the views beside the curve: what was drawn of another position is grey

const views = {}, asked = {}; // the answers by name, each with the position that it is of; the positions of questions
const position = () => JSON.stringify(knobs.map(knob => knob.read()));
const palette = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]]; // viridis, which the colour-blind see

function paint(rows) { // numbers, along x first, as a picture; null where there are none
  const canvas = Object.assign(document.createElement("canvas"), {width: rows.length, height: rows[0].length}), pen = canvas.getContext("2d");
  const all = rows.flat().filter(value => value !== null), low = Math.min(...all), high = Math.max(...all), pixels = pen.createImageData(canvas.width, canvas.height);
  rows.forEach((row, i) => row.forEach((value, j) => {
    const s = high > low ? 3.999999 * (value - low) / (high - low) : 0, k = Math.floor(s), at = 4 * ((canvas.height - 1 - j) * canvas.width + i);
    for (let c = 0; c < 3; c++) pixels.data[at + c] = palette[k][c] + (s - k) * (palette[k + 1][c] - palette[k][c]);
    pixels.data[at + 3] = value === null ? 0 : 255;
  }));
  pen.putImageData(pixels, 0, 0);
  return {href: canvas.toDataURL(), low, high};
}

const drawings = {
  map(answer) {
    const [u, v] = answer.axes.map(({key}) => knobs.find(knob => knob.key === key));
    const [x, y] = answer.axes.map(({start, stop, scale}, i) => ({ends: [start, stop], log: scale === "log", label: [u, v][i].title}));
    const svg = $("map").querySelector("svg"), plot = frame(svg, x, y), {left, right, top, bottom} = plot.box;
    if (answer.grid.length) { // of what is still searched: dark below 0, bright above
      const {href} = paint(answer.grid), half = 0.5 / (answer.grid.length - 1), w = right - left, h = bottom - top;
      node(plot.inside, "image", {class: "grid", href, x: left - half * w, y: top - half * h, width: (1 + 2 * half) * w, height: (1 + 2 * half) * h, preserveAspectRatio: "none"});
    }
    const kinds = ["one", "two"], lines = answer.lines.map((each, i) => each.branches.map(([u, v]) => node(plot.inside, "path", {class: `line ${kinds[i]}`, d: line(plot, u, v)})));
    const names = [[plot.X(u.read()), plot.Y(v.read()), 6]]; // and the mark of the sliders
    const say = (x, y, text, kind, turn = 0) => { // within the frame
      const made = node(plot.inside, "text", {class: `name ${kind}`, "text-anchor": "middle"}, text), half = made.getComputedTextLength() / 2 + 4;
      const at = turn ? x : Math.max(left + half, Math.min(right - half, x));
      made.setAttribute("transform", `translate(${at} ${y}) rotate(${turn})`);
      names.push([at, y, half]);
    };
    const wide = text => { const made = node(plot.inside, "text", {class: "name"}, text), width = made.getComputedTextLength(); made.remove(); return width; };
    const passed = lines.flat().flatMap(path => Array.from({length: 300}, (_, k) => path.getPointAtLength(path.getTotalLength() * k / 299)));
    const letters = []; // of regions whose name has no room where no line passes
    for (const {name, at} of answer.regions) {
      const [x, y] = [plot.X(at[0]), plot.Y(at[1])], rows = name.split(", "), w = Math.max(...rows.map(wide)) + 8, h = 15 * rows.length, shifts = [0, -0.25, 0.25, -0.45, 0.45];
      const free = shifts.flatMap(a => shifts.map(b => [Math.max(left + w / 2, Math.min(right - w / 2, x + a * w)), Math.max(top + h / 2, Math.min(bottom - h / 2, y + b * h))]))
        .filter(([u, v]) => !passed.some(each => Math.abs(each.x - u) < w / 2 && Math.abs(each.y - v) < h / 2));
      if (free.length) rows.forEach((row, k) => say(free[0][0], free[0][1] + 15 * (k - rows.length / 2) + 11, row, ""));
      else { letters.push(`${"abcdefgh"[letters.length]}: ${name}`); say(x, y + 4, letters.at(-1)[0], ""); }
    }
    $("map").querySelector(".letters").textContent = letters.join("; ");
    lines.forEach((paths, i) => { // along the straightest part of a line, away from other names
      if (!paths.length) return;
      const name = answer.lines[i].name, size = 8 * name.length, total = paths[0].getTotalLength(), at = s => paths[0].getPointAtLength(s);
      const places = Array.from({length: 40}, (_, k) => size + (total - 2 * size) * (k + 0.5) / 40).map(s => {
        const [a, b, c] = [at(s - size / 2), at(s), at(s + size / 2)], bend = Math.hypot(a.x - 2 * b.x + c.x, a.y - 2 * b.y + c.y);
        const near = Math.min(...names.map(([x, y, half]) => Math.hypot(Math.max(0, Math.abs(b.x - x) - half), b.y - y)), b.x - left, right - b.x, b.y - top, bottom - b.y);
        const turn = Math.atan((c.y - a.y) / (c.x - a.x)) * 180 / Math.PI;
        return {b, turn, cost: bend + 0.1 * Math.abs(turn) + Math.max(0, size - near)};
      });
      const {b, turn} = places.reduce((best, each) => each.cost < best.cost ? each : best), up = (turn - 90) * Math.PI / 180;
      say(b.x + 7 * Math.cos(up), b.y + 7 * Math.sin(up), name, kinds[i], turn || 0.01);
    });
    node(svg, "circle", {class: "dot two", cx: plot.X(u.read()), cy: plot.Y(v.read()), r: 6});
    svg.onclick = event => {
      const place = svg.getBoundingClientRect(), at = plot.at(event.clientX - place.left, event.clientY - place.top);
      if (at.some((value, i) => value < [x, y][i].ends[0] || value > [x, y][i].ends[1])) return;
      [u, v].forEach((knob, i) => knob.set(Number(at[i].toPrecision(4))));
      moved();
    };
  },
  field(answer) {
    $("field").querySelector(".panels").replaceChildren(...answer.panels.map((each, i) => {
      const box = document.createElement("div"), svg = document.createElementNS(SVG, "svg"), title = document.createElement("h3");
      box.id = `panel-${i}`;
      svg.setAttribute("role", "img");
      svg.setAttribute("aria-label", `${each.title}; numbers are in the table`);
      box.append(title, svg);
      requestAnimationFrame(() => {
        const [x, y] = each.ends.map((ends, k) => ({ends, label: each.names[k]})), {href, low, high} = paint(each.values);
        const turn = Math.abs(x.ends[1] - 2 * Math.PI) < 1e-9;
        if (turn) Object.assign(x, {ticks: [0, 1, 2, 3, 4].map(k => k * Math.PI / 2), name: value => ["0", "π/2", "π", "3π/2", "2π"][Math.round(2 * value / Math.PI)]});
        const plot = frame(svg, x, y), {left, right, top, bottom} = plot.box;
        node(plot.inside, "image", {href, x: left, y: top, width: right - left, height: bottom - top, preserveAspectRatio: "none"});
        title.textContent = `${each.title}, from ${low.toPrecision(3)} (dark) to ${high.toPrecision(3)} (bright)`;
      });
      return box;
    }));
  },
  paths(answer) {
    const all = answer.logs.flat(), end = answer.time.at(-1), {exponent} = answer, more = exponent === null ? [] : [exponent * end];
    const plot = frame($("paths").querySelector("svg"), {ends: [0, end], label: about.time}, {ends: [Math.min(...all, ...more), Math.max(...all, ...more)], label: "ln‖x‖"});
    for (const each of answer.logs) node(plot.inside, "path", {class: "line path", d: line(plot, answer.time, each)});
    if (exponent !== null) node(plot.inside, "path", {class: "line two", d: line(plot, [0, end], [0, exponent * end])});
    const ends = [Math.min(...answer.motion, 0), Math.max(...answer.motion)];
    const near = frame($("motion").firstChild, {ends: [0, answer.short.at(-1)], label: about.time}, {ends, label: answer.name});
    node(near.inside, "path", {class: "line one", d: line(near, answer.short, answer.motion)});
  },
};

function drawViews() {
  for (const name in views) {
    const {answer, of} = views[name], moving = name === "map" ? answer.axes.map(axis => axis.key) : [];
    const others = text => JSON.parse(text).filter((_, i) => !moving.includes(knobs[i].key)).join();
    $(name).classList.toggle("stale", others(of) !== others(position()));
    if (isSeen(name)) drawings[name](answer);
  }
}

function makeViews() {
  const [first, second] = document.querySelectorAll("#map .axis"), axes = knobs.filter(knob => knob.axis);
  for (const select of [first, second]) select.append(...axes.map(knob => new Option([knob.words, knob.key].filter(Boolean).join(", "), knob.key)));
  const usual = [axes[0].key, (axes.find(knob => knob.key.startsWith("noise.")) || axes.at(-1)).key], own = about.axes.filter(key => axes.some(knob => knob.key === key));
  [first.value, second.value] = own.length === 2 ? own : usual;
  const axis = select => { const {key, ends: [start, stop], log} = axes.find(knob => knob.key === select.value); return {key, start, stop, scale: log ? "log" : "linear"}; };
  const questions = {map: () => ({axes: [axis(first), axis(second)]}), field: () => ({p: Number($("field").querySelector(".order").value)}), paths: () => ({})};
  for (const name in questions) $(name).querySelector(".go").onclick = () => {
    const of = asked[name] = position();
    work(name, answer => see(name, answer, of), questions[name]());
  };
}

function see(name, answer, of) {
  views[name] = {answer, of};
  $(name).querySelector(".told").innerHTML = answer.told; // escaped by fpsolve
  drawViews();
}

// views, downloads

const isSeen = name => $(name).clientWidth > 0; // the style shows the panel after the button that is chosen

function redraw() {
  drawCurve();
  drawViews();
}

function download({name, text}) {
  const link = Object.assign(document.createElement("a"), {href: URL.createObjectURL(new Blob([text])), download: name});
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

async function copy({text}) {
  Object.assign($("code"), {hidden: false, value: text});
  $("code").select();
  await navigator.clipboard.writeText(text).then(() => { $("state").textContent = "copied"; }, () => {}); // where that is not allowed, it is there to be copied
}

async function start() {
  about = await ask("start");
  if (isLost) return;
  $("title").textContent = document.title = about.title || "fpsolve explore";
  knobs = about.knobs.map(knobOf);
  $("knobs").append(...knobs.map(knob => knob.box));
  for (const id of ["save", "report"]) $(id).hidden = !about.file;
  makeViews();
  $("views").onchange = redraw;
  $("reset").onclick = () => { for (const knob of knobs) knob.set(knob.value); moved(); };
  $("stop").onclick = () => { ask("stop"); long.clear(); $("state").textContent = "stopped"; $("stop").disabled = true; };
  $("save").onclick = () => work("save", download);
  $("report").onclick = () => work("report", download);
  $("python").onclick = () => work("python", copy);
  addEventListener("resize", redraw);
  addEventListener("pagehide", () => navigator.sendBeacon("/stop", new Blob([JSON.stringify({page, number: ++number})], {type: "application/json"})));
  addEventListener("pageshow", event => { if (event.persisted) settle(); }); // shown again by the browser's button for going back
  setInterval(listen, LISTEN);
  await work("solve", showCurve);
}

start();
