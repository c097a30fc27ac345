const $ = (id) => document.getElementById(id);
// What sheets are coloured by: unit, range and colours.
const SHADES = {
  distance: ["distance to the tool", "mm", [0, 25], "even"], surplus: ["surplus", "%", [0, 10], "even"],
  shear: ["shear", "°", [-45, 45], "split"], angle: ["fibre angle", "°", [-45, 45], "split"],
  warp: ["strain of the warp", "%", [-5, 5], "split"], weft: ["strain of the weft", "%", [-5, 5], "split"],
  progress: ["touched and draped", "", [0, 1], null], policy: ["the policy's next press", "%", [0, 100], "even"],
};
const MARK = { touched: 1, draped: 2, stencil: 4, allowed: 8, region: 16, clamped: 32, pulled: 64 };
const TINT = { cloth: [214, 206, 190], draped: [38, 92, 224], touched: [240, 150, 30], tool: [150, 150, 152], path: [250, 240, 80], allowed: [255, 220, 60], clamp: [220, 40, 200], stencil: [170, 60, 220], arm: [200, 160, 60], block: [120, 120, 124], fault: [225, 40, 40] };
const eye = new Eye(), canvas = $("canvas");
let stage = null, robot = null, moment = null, drawing = null, lost = "", hovered = null, shade = "distance", mode = "press", isDirty = true, link;
const told = { frames: 0, bytes: 0, heard: 0 };

// A message of the server's: its header and columns.
const TYPES = { u8: Uint8Array, i8: Int8Array, u16: Uint16Array, u32: Uint32Array, f32: Float32Array };
function decode(buffer) {
  const length = new DataView(buffer).getUint32(0, true), header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  for (const [name, type, count] of header.parts) {
    header[name] = new TYPES[type](buffer, at, count);
    at += Math.ceil(header[name].byteLength / 4) * 4;
  }
  return header;
}
function hear(buffer) {
  const said = decode(buffer);
  told.bytes = buffer.byteLength;
  if (said.kind === "stage") { setStage(said); return false; }
  if (said.kind === "robot") { setRobot(said); return false; }
  const unpacked = (is, place, value) => is && { range: is.range,
    position: Float32Array.from(place, (x, i) => is.low[i % 3] + is.size[i % 3] * x / 65535),
    value: Float32Array.from(value, (x) => is.range[0] + (is.range[1] - is.range[0]) * x / 65535) };
  moment = { ...said, ...unpacked(said.boxes[0], said.position, said.value), other: unpacked(said.boxes[1], said.beside_position, said.beside_value) };
  told.heard++;
  if (robot && !moment.robot) { robot = null; seeArm(); }
  // Another control has moved the cloth.
  if (driving !== null && !$("drive").classList.contains("on") && moment.at !== drive.to) driving = null;
  tell(); isDirty = true;
  return true;
}
function setStage(said) {
  stage = said;
  seeArm(); keepStage(); fillTask();
}
function keepStage() {
  if (!drawing || !stage) return;
  const tint = new Uint8Array(stage.tool.length).map((_, i) => TINT.tool[i % 3]);
  drawing.keepMesh("tool", stage.tool, stage.tool_triangles, tint);
  keepRobot();
  drawing.keep("warp", stage.warp, drawing.gl.ELEMENT_ARRAY_BUFFER); drawing.keep("weft", stage.weft, drawing.gl.ELEMENT_ARRAY_BUFFER);
}

// The session on the server. One moment is asked for at a time.
class Live {
  constructor() { this.connect(); }
  connect() {
    const url = new URL("socket", location.href);
    url.protocol = url.protocol.replace("http", "ws"); url.hash = "";
    const socket = this.socket = new WebSocket(url);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => { socket.send(JSON.stringify({ token: location.hash.slice(1) })); stage = robot = null; lost = ""; this.ask(0); };
    socket.onmessage = ({ data }) => { if (hear(data)) requestAnimationFrame(() => this.ask()); };
    socket.onclose = ({ code, reason }) => {
      lost = code === 1008 ? `closed: ${reason}` : "no connection";
      tell();
      if (reason !== "the token is another") setTimeout(() => this.connect(), 1000);
    };
  }
  ask(next = moment ? moment.number : 0) {
    if (this.socket.readyState !== 1) return;
    const [width, height] = size().map((x) => Math.min(Math.round(x), 1024));
    const look = drawing ? null : eye.look(width, height, range());
    this.socket.send(JSON.stringify({ next, stage: stage ? stage.stage : 0, robot: robot ? robot.robot : 0, shade, look }));
  }
  // What is asked of cloth that falls would come too late.
  send(name, more = {}) { if (this.socket.readyState === 1 && !(moment && moment.phase === "falling")) this.socket.send(JSON.stringify({ do: name, ...more })); }
}
// What a file holds: moments to go through, without a server.
class Still {
  constructor({ stage, robot, moments }) {
    const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
    this.moments = moments.map(bytes); this.at = 0; this.rate = 30; this.on = false;
    document.body.classList.add("still");
    hear(bytes(stage)); $("robot").hidden = !robot;
    if (robot) hear(bytes(robot));
    this.go(0);
    const tick = () => { if (this.on) { this.go(this.at + 1); this.on = this.at + 1 < this.moments.length; } setTimeout(tick, 1000 / this.rate); };
    tick();
  }
  go(to) { this.at = Math.min(Math.max(to, 0), this.moments.length - 1); hear(this.moments[this.at].slice(0)); }
  ask() { tell(); isDirty = true; }
  send(name, more = {}) {
    if (name === "speed") this.rate = more.rate;
    else if (name === "play") { if (more.on && this.at + 1 === this.moments.length) this.go(0); this.on = more.on; }
    else { this.on = false; this.go({ seek: more.to, undo: this.at - 1, redo: this.at + 1, step: this.at + 1, reset: 0 }[name] ?? this.at); }
  }
}

// What is seen.
const size = () => [$("stage").clientWidth / (moment && moment.other ? 2 : 1), $("stage").clientHeight];
function range() {
  const own = SHADES[shade][2];
  if (!moment || !moment.value || !($("fit").checked || shade === "policy")) return own;
  const most = Math.max(Math.abs(moment.range[0]), Math.abs(moment.range[1]), 1e-6);
  return own[0] < 0 ? [-most, most] : [0, most];
}
function tints(of) {
  const [low, high] = range(), map = SHADES[shade][3], out = new Uint8Array(3 * moment.marks.length);
  for (let v = 0; v < moment.marks.length; v++) {
    const mark = moment.marks[v];
    let c = map ? color(map, (of.value[v] - low) / (high - low)) : mark & MARK.draped ? TINT.draped : mark & MARK.touched ? TINT.touched : TINT.cloth;
    if (!(mark & MARK.region)) c = c.map((x) => 0.55 * x + 0.45 * 128);
    out.set(c, 3 * v);
  }
  return out;
}
const place = (v) => [moment.position[3 * v], moment.position[3 * v + 1], moment.position[3 * v + 2]];
// The square of the roller over a vertex, with the tool's normal.
function stencil(v) {
  const n = unit([0, 1, 2].map((k) => moment.normal[3 * v + k])), x = add([1, 0, 0], n, -n[0]);
  const along = unit(Math.hypot(...x) > 0.1 ? x : add([0, 1, 0], n, -n[1])), over = cross(n, along), half = stage.stencil_mm / 2000;
  const corner = (a, b) => add(add(add(place(v), along, a * half), over, b * half), n, 1e-3);
  return [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
}
function draw() {
  requestAnimationFrame(draw);
  if (!isDirty || !moment || !stage || moment.stage !== stage.stage) return;
  isDirty = false; told.frames++;
  if (!drawing) { showPicture(); return; }
  const ratio = window.devicePixelRatio || 1, [width, height] = size(), gl = drawing.gl;
  const wide = Math.round(width * (moment.other ? 2 : 1) * ratio), high = Math.round(height * ratio);
  // Even to the same size it would be made anew.
  if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
  const seen = eye.onto(width, height), look = (tint, size = 1) => ({ tint, near: 2e-3, size: size * ratio });
  drawing.clear(rgb(getComputedStyle(document.documentElement).getPropertyValue("--back").trim().slice(1)));
  for (const of of [moment.other, moment]) {
    if (!of) continue;
    drawing.begin(seen, of === moment.other ? width * ratio : 0, width * ratio);
    drawing.draw("tool", "tool.triangles", "TRIANGLES");
    drawing.keepMesh("sheet", of.position, stage.triangles, tints(of));
    drawing.draw("sheet", "sheet.triangles", "TRIANGLES", { near: 1e-3 });
    if ($("yarns").checked) { drawing.draw("sheet", "warp", "LINES", look([60, 60, 70])); drawing.draw("sheet", "weft", "LINES", look([110, 60, 60])); }
  }
  const all = (mark) => [...moment.marks.keys()].filter((v) => moment.marks[v] & mark).map(place);
  if ($("allowed").checked) drawing.mark(all(MARK.allowed), "POINTS", { ...look(TINT.allowed, 4), near: 1.2e-2 });
  drawing.mark(all(MARK.clamped | MARK.pulled), "POINTS", { ...look(TINT.clamp, 8), near: 1.2e-2 });
  if ($("path").checked) for (const stroke of moment.strokes) drawing.mark(stroke.map(place), stroke.length > 1 ? "LINE_STRIP" : "POINTS", { ...look(TINT.path, 5), near: 4e-3 });
  drawArm(look);
  const next = shade === "policy" && moment.has_policy && moment.range[1] > 0 ? moment.value.reduce((best, p, v, all) => p > all[best] ? v : best, 0) : -1;
  for (const [v, tint] of [[next, TINT.touched], [mode === "press" && hovered ? hovered.vertex : -1, TINT.stencil]]) if (v >= 0) drawing.mark(stencil(v), "LINE_LOOP", { ...look(tint), near: 6e-3 });
}
// The arm where it presses what is seen, or where it is driven; what it does not press in red.
function drawArm(look) {
  if (!robot || !$("arm").checked) return;
  const parts = robot.counts.length, at = 12 * parts * armAt();
  let first = 0;
  robot.counts.forEach((count, k) => {
    drawing.place(robot.poses.subarray(at + 12 * k, at + 12 * k + 12));
    drawing.draw("arm", null, "TRIANGLES", { first, count });
    first += count;
  });
  drawing.place(null);
  const faults = isStale() ? [] : [...robot.vertices].filter((v, k) => robot.faults[k]);
  drawing.mark(faults.map(place), "POINTS", { ...look(TINT.fault, 9), near: 1.4e-2 });
}
let url = "";
function showPicture() {
  if (!moment.picture) return;
  URL.revokeObjectURL(url);
  $("picture").src = url = URL.createObjectURL(new Blob([moment.picture], { type: "image/png" }));
}
const fixed = (x, digits) => { const text = x === null ? "–" : x.toFixed(digits); return Number(text) === 0 ? (0).toFixed(digits) : text; };
const number = (x, digits = 3) => x === null || x === undefined ? "–" : Number(x).toPrecision(digits);
// Words to the user are shown for a while.
const WHILE = 10000;
const came = new Map();
function news(notices) {
  const now = performance.now(), isFirst = told.heard < 2;
  for (const [k] of notices) if (!came.has(k)) { came.set(k, isFirst ? -WHILE : now); setTimeout(tell, WHILE); }
  return notices.filter(([k]) => now - came.get(k) < WHILE).slice(-3).map(([, text]) => text);
}
function tell() {
  const words = [lost];
  if (!moment && !lost) words.push("the tool is being set up");
  if (!drawing) words.push(`${noDrawing}: the server draws the pictures.`);
  if (moment) {
    const m = moment, n = m.numbers, falls = m.at < m.fall;
    if (m.phase === "falling") words.push(`the blank falls, ${Math.round(100 * m.share)} %`);
    if (m.pulled) words.push("pulled by hand: this is not of the task");
    words.push(...m.oddities, ...news(m.notices));
    const rows = falls ? [] : [["distance", `${fixed(n.distance_m, 3)} m`], ["surplus", `${fixed(n.surplus_mm, 2)} mm`], ["score", `${fixed(n.score === null ? null : 100 * n.score, 1)} %`], ["undraped", n.undraped], ["presses", `${n.presses} in ${n.strokes} strokes`], ["robot's time", `${fixed(n.robot_s, 1)} s`]];
    if (m.beside && !falls) [fixed(m.beside[0], 3), fixed(m.beside[1], 2), fixed(m.beside[2] && 100 * m.beside[2], 1)].forEach((text, k) => { rows[k][1] += ` (beside: ${text})`; });
    $("numbers").replaceChildren(...rows.map((row) => { const tr = document.createElement("tr"); row.forEach((text) => { tr.insertCell().textContent = text; }); return tr; }));
    $("rivals").textContent = m.rivals.map((rival) => `${rival.name} ${number(100 * rival.score)} %`).join(", ");
    if (document.activeElement !== $("time") || !dragging) [$("time").max, $("time").value] = [m.count - 1, m.at];
    $("moment").textContent = falls ? `fall ${m.at + 1} of ${m.fall}` : `press ${m.at - m.fall} of ${m.count - m.fall - 1}` + (m.waiting ? `, ${m.waiting} waiting` : "") + (m.over ? ", all touched" : "");
    for (const [id, on] of [["play", m.playing], ["pause", m.paused], ["follow", m.following], ["beside", m.beside]]) $(id).classList.toggle("on", !!on);
    $("accuracy").value = m.accuracy; $("follow").hidden = !m.has_policy;
    for (const option of $("shade").options) option.hidden = option.value === "policy" && !m.has_policy;
    drawCurves(m.curves || []); tellRobot();
  }
  $("words").textContent = words.filter((text) => text).join("\n");
  const [low, high] = range(), [, unit, , map] = SHADES[shade], bar = $("bar").getContext("2d");
  [$("low").textContent, $("high").textContent, $("unit").textContent] = map ? [number(low, 2), number(high, 2), unit] : ["blue draped, orange touched", "", ""];
  $("bar").hidden = !map;
  if (map) for (let x = 0; x < 256; x++) { bar.fillStyle = `rgb(${color(map, x / 255).map(Math.round)})`; bar.fillRect(x, 0, 1, 1); }
  tellUnder();
}
function tellUnder() {
  const v = hovered && hovered.vertex, [name, unit, , map] = SHADES[shade];
  const mm = (x) => number(1e3 * x, 4);
  $("under").textContent = hovered && moment && v < moment.marks.length ? `vertex ${v} at ${place(v).map((x, k) => mm(x + stage.origin[k])).join(", ")} mm` + (map ? `: ${name} ${number(moment.value[v])} ${unit}` : "") : "";
}
// Scores of trainings over their steps.
function drawCurves(runs) {
  $("trainings").hidden = !runs.length;
  const c = $("curves").getContext("2d"), { width, height } = $("curves"), tint = ["#6ea8fe", "#f0961e", "#5ec962", "#dc28c8", "#fde725"];
  c.clearRect(0, 0, width, height);
  const steps = Math.max(1, ...runs.flatMap((run) => run.best.map(([step]) => step)));
  runs.forEach((run, k) => {
    for (const [name, dash] of [["best", []], ["mean", [3, 3]]]) {
      c.strokeStyle = tint[k % 5]; c.setLineDash(dash); c.beginPath();
      run[name].forEach(([step, score]) => c.lineTo(step / steps * width, height * (1 - Math.max(score, 0))));
      c.stroke();
    }
  });
  const last = (list) => list.length ? `${number(100 * list[list.length - 1][1])} %` : "–";
  $("runs").textContent = runs.map((run) => `${run.name}: best ${last(run.best)}, mean (dashed) ${last(run.mean)}`).join("; ");
}

// Pointer, keys, buttons.
const fingers = new Map();
let held = null, dragging = false;
const at = (event) => { const box = $("stage").getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
const under = ([x, y]) => stage && moment && moment.stage === stage.stage ? pick(eye.onto(...size()), moment.position, stage.triangles, x, y) : null;
const changed = () => { isDirty = true; if (!drawing) link.ask(0); };
function turn(dx, dy) { eye.turn -= 0.4 * dx; eye.lift = Math.min(Math.max(eye.lift + 0.4 * dy, -89), 90); changed(); }
function shift(dx, dy) { const { axes, scale } = eye.onto(...size()); eye.moved = add(add(eye.moved, axes[0], -dx / scale), axes[1], dy / scale); changed(); }
const zoom = (by) => { eye.zoom = Math.min(Math.max(eye.zoom * by, 0.2), 50); changed(); };
const distance = (a, b) => 1e3 * Math.hypot(stage.rest[2 * a] - stage.rest[2 * b], stage.rest[2 * a + 1] - stage.rest[2 * b + 1]);
function press(found) {
  // A stroke is of presses that overlap by about half.
  if (held.last !== undefined && distance(held.last, found.vertex) < 0.5 * stage.stencil_mm) return;
  held.last = found.vertex;
  link.send("press", { vertices: [found.vertex] });
}
function pull([x, y]) {
  const { axes, scale } = eye.onto(...size()), to = add(add(held.from, axes[0], (x - held.x) / scale), axes[1], (held.y - y) / scale);
  link.send("pull", { vertex: held.vertex, to });
}
for (const seen of [canvas, $("picture")]) {
  seen.addEventListener("pointerdown", (event) => {
    const [x, y] = at(event), found = under([x, y]);
    try { seen.setPointerCapture(event.pointerId); } catch {}
    fingers.set(event.pointerId, [x, y]); canvas.focus();
    const looks = fingers.size > 1 || event.button !== 0 || event.shiftKey || mode === "look" || DATA || !found && mode !== "region" && mode !== "robot";
    if (held && held.kind === "pull") link.send("release");
    held = { kind: looks ? "look" : mode, x, y, shift: event.shiftKey };
    if (held.kind === "press") press(found);
    if (held.kind === "pull") { held.vertex = found.vertex; held.from = place(found.vertex); }
    if (held.kind === "robot") held.base = basePlace();
    if (held.kind === "region") held.first = found && found.vertex;
  });
  seen.addEventListener("pointermove", (event) => {
    const now = at(event), before = fingers.get(event.pointerId);
    if (!before) { hovered = under(now); tellUnder(); isDirty = true; return; }
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      zoom(Math.hypot(now[0] - other[0], now[1] - other[1]) / Math.max(Math.hypot(before[0] - other[0], before[1] - other[1]), 1));
      turn(dx / 2, dy / 2);
    } else if (held.kind === "look") (held.shift ? shift : turn)(dx, dy);
    else if (held.kind === "pull") pull(now);
    else if (held.kind === "robot") moveRobot(now, false);
    else if (held.kind === "region") Object.assign($("region").style, { left: `${Math.min(now[0], held.x)}px`, top: `${Math.min(now[1], held.y)}px`, width: `${Math.abs(now[0] - held.x)}px`, height: `${Math.abs(now[1] - held.y)}px` });
    else { hovered = under(now); if (hovered) press(hovered); tellUnder(); isDirty = true; }
    if (held.kind === "region") $("region").hidden = false;
    fingers.set(event.pointerId, now);
  });
  for (const end of ["pointerup", "pointercancel"]) seen.addEventListener(end, (event) => {
    if (held && held.kind === "pull") link.send("release");
    if (held && held.kind === "robot") { if (end === "pointerup") moveRobot(at(event), true); held = null; seeArm(); }
    if (held && held.kind === "region" && end === "pointerup") chooseRegion(at(event));
    $("region").hidden = true;
    fingers.delete(event.pointerId);
    if (!fingers.size) held = null;
  });
  seen.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(-0.0015 * event.deltaY)); }, { passive: false });
  seen.addEventListener("contextmenu", (event) => event.preventDefault());
}
canvas.addEventListener("pointerleave", () => { hovered = null; tellUnder(); isDirty = true; });
// The region that holds all of the sheet that is seen between two corners.
function chooseRegion([x, y]) {
  const seen = eye.onto(...size()), inside = (a, b, c) => Math.min(a, b) <= c && c <= Math.max(a, b);
  const all = [...moment.marks.keys()].filter((v) => { const [px, py] = project(seen, ...place(v)); return inside(x, held.x, px) && inside(y, held.y, py); });
  if (!all.length) return;
  // To a tenth beyond the vertices, so that they are in it.
  const least = (k) => Math.floor(1e4 * all.reduce((low, v) => Math.min(low, stage.rest[2 * v + k]), Infinity)) / 10;
  const most = (k) => Math.ceil(1e4 * all.reduce((high, v) => Math.max(high, stage.rest[2 * v + k]), -Infinity)) / 10;
  link.send("task", { change: { region_mm: [least(0), least(1), most(0), most(1)] } });
}
const KEYS = {
  z: () => link.send("undo"), y: () => link.send("redo"), r: () => link.send("reset"), ".": () => link.send("step"),
  b: () => link.send("path"), k: () => link.send("beside"), s: () => link.send("save_presses"), p: () => $("play").click(), f: () => $("follow").click(), " ": () => $("pause").click(),
  1: () => view("free"), 2: () => view("top"), 3: () => view("side"), "+": () => zoom(1.1), "-": () => zoom(1 / 1.1),
  ArrowLeft: () => turn(-12, 0), ArrowRight: () => turn(12, 0), ArrowUp: () => turn(0, -12), ArrowDown: () => turn(0, 12),
};
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || /INPUT|SELECT|TEXTAREA/.test(event.target.tagName) && event.target.type !== "checkbox" && event.target.type !== "radio") return;
  if (KEYS[event.key]) { event.preventDefault(); KEYS[event.key](); }
});
const view = (name) => { eye.view(name); changed(); };
for (const button of document.querySelectorAll("[data-view]")) button.onclick = () => view(button.dataset.view);
for (const name of ["undo", "redo", "reset", "step"]) $(name).onclick = () => link.send(name);
for (const [id, key] of [["play", "playing"], ["pause", "paused"], ["follow", "following"]]) $(id).onclick = () => link.send(id, { on: DATA ? !link.on : !moment[key] });
for (const [id, order] of [["save", "save_presses"], ["task", "save_task"], ["best", "path"], ["beside", "beside"]]) $(id).onclick = () => link.send(order);
$("time").oninput = () => { dragging = true; link.send("seek", { to: Number($("time").value) }); };
$("time").onchange = () => { dragging = false; };
$("speed").oninput = () => link.send("speed", { rate: 10 ** $("speed").value });
$("accuracy").onchange = () => link.send("accuracy", { name: $("accuracy").value });
for (const [name, [title]] of Object.entries(SHADES)) if (!DATA || name === "distance" || name === "progress") $("shade").add(new Option(title, name));
$("shade").onchange = () => { shade = $("shade").value; link.ask(0); };
for (const id of ["fit", "yarns", "allowed", "path"]) $(id).onchange = () => { tell(); changed(); };
$("light").onchange = () => { document.documentElement.classList.toggle("light", $("light").checked); isDirty = true; };
for (const radio of document.getElementsByName("mode")) radio.onchange = () => { mode = radio.value; };
addEventListener("resize", changed);

// The robot.
const BASE = ["bx", "by", "bz"];
const basePlace = () => {
  const is = (id, was) => $(id).value === "" ? was : Number($(id).value), place = robot && robot.place;
  return place && { at_mm: BASE.map((id, k) => is(id, place.at_mm[k])), turn_deg: is("bt", place.turn_deg), step_deg: is("bs", place.step_deg) };
};
let driving = null, isWanted = false;
const askRobot = (place, plan) => { isWanted = plan; link.send("robot", { place, plan }); };
function setRobot(said) {
  robot = said;
  const isDragged = held && held.kind === "robot";
  // What was reached on the way to where it is being planned says nothing of where it was left.
  if (!isDragged && !(isWanted && said.program_s === null)) fillBase(robot.place);
  if (said.program_s !== null) isWanted = false;
  [$("driven").max, $("driven").value] = [robot.at.length - 1, 0]; driving = null; $("drive").classList.remove("on");
  // A drag is measured in what is seen.
  if (!isDragged) seeArm();
  isDirty = true; keepRobot(); tellRobot();
}
function fillBase(place) {
  const values = { ...Object.fromEntries(BASE.map((id, k) => [id, Math.round(10 * place.at_mm[k]) / 10])), bt: place.turn_deg, bs: place.step_deg };
  for (const id in values) if (document.activeElement !== $(id)) $(id).value = values[id];
}
function keepRobot() {
  if (!drawing || !robot) return;
  const count = robot.corners.length / 3, moving = 3 * robot.counts.slice(0, 8).reduce((a, b) => a + b, 0);
  drawing.keepMesh("arm", robot.corners, new Uint32Array(count).map((_, k) => k), new Uint8Array(3 * count).map((_, k) => (k < moving ? TINT.arm : TINT.block)[k % 3]));
}
// All of the arm is looked at while it is shown.
function seeArm() {
  if (!stage) return;
  [eye.low, eye.high] = stage.bounds; eye.beyond = 0;
  const parts = robot && robot.counts.length, every = robot && Math.ceil(robot.at.length / 12);
  for (let at = 0; robot && drawing && $("arm").checked && at < robot.at.length; at += every) {
    let first = 0;
    robot.counts.forEach((count, k) => {
      const pose = robot.poses.subarray(12 * (parts * at + k), 12 * (parts * at + k) + 12);
      for (let c = first; k < 8 && c < first + count; c++) {
        const x = robot.corners.subarray(3 * c, 3 * c + 3), at = [0, 1, 2].map((r) => pose[4 * r] * x[0] + pose[4 * r + 1] * x[1] + pose[4 * r + 2] * x[2] + pose[4 * r + 3]);
        eye.low = eye.low.map((low, r) => Math.min(low, at[r])); eye.high = eye.high.map((high, r) => Math.max(high, at[r]));
      }
      first += count;
    });
    eye.beyond = 4;
  }
  isDirty = true;
}
// Whether it was asked for other presses than those that are seen.
const isStale = () => moment.strokes.flat().some((v, k) => v !== robot.vertices[k]) || moment.count - moment.fall - 1 !== robot.vertices.length;
function armAt() {
  if (driving !== null) return Number($("driven").value);
  if (isStale() || moment.at < moment.fall) return 0;
  const found = robot.pressed.findIndex((pressed) => pressed >= moment.at - moment.fall);
  return found < 0 ? robot.at.length - 1 : found;
}
function tellRobot() {
  const words = [];
  if (moment && moment.plans) words.push("it is being planned");
  else if (!robot) words.push("no robot yet: plan");
  if (robot && moment) {
    const reached = robot.faults.filter((fault) => !fault).length;
    words.push(`${robot.name} ${robot.program_s === null ? "reaches" : "presses"} ${reached} of ${robot.faults.length} points` + (robot.program_s === null ? "" : ` in ${fixed(robot.program_s, 1)} s`));
    if (isStale()) words.push("these are other presses: plan anew");
    $("faults").replaceChildren(...robot.faults.flatMap((fault, k) => {
      if (!fault || robot.program_s === null) return [];
      const row = document.createElement("li"); row.value = k + 1; row.textContent = fault; return [row];
    }));
    if (driving === null) $("driven").value = armAt();
    $("clock").textContent = robot.program_s === null ? "" : `${fixed(robot.at[armAt()], 1)} s`;
  }
  $("reach").textContent = words.join("; ");
}
function drive(to) {
  $("driven").value = to; isDirty = true;
  const pressed = moment.fall + robot.pressed[to], now = performance.now();
  // Asked again if it was lost.
  if (!isStale() && pressed !== moment.at && (pressed !== drive.to || now - drive.at > 500)) { drive.at = now; link.send("seek", { to: pressed }); }
  drive.to = pressed;
  tellRobot();
}
$("driven").oninput = () => {
  if (!robot || !moment) return;
  const to = Number($("driven").value);
  driving = performance.now() - 1e3 * robot.at[to];
  drive(to);
};
$("drive").onclick = () => {
  if (!robot || robot.program_s === null) return;
  const isOn = $("drive").classList.toggle("on"), from = Number($("driven").value), last = robot.at.length - 1;
  driving = isOn ? performance.now() - 1e3 * robot.at[from === last ? 0 : from] : null;
  const step = () => {
    if (!robot || !$("drive").classList.contains("on")) { $("drive").classList.remove("on"); return; }
    const now = (performance.now() - driving) / 1e3, to = robot.at.findIndex((at) => at >= now);
    drive(to < 0 ? last : to);
    if (to < 0) { driving = null; $("drive").classList.remove("on"); } else requestAnimationFrame(step);
  };
  step();
};
// By a drag over the floor: as it is seen, but no faster than a low look has it.
function moveRobot([x, y], isEnd) {
  const { axes, scale } = eye.onto(...size()), right = (x - held.x) / scale, away = (held.y - y) / scale / Math.max(Math.abs(axes[2][2]), 0.3), t = eye.turn * Math.PI / 180;
  if (!held.base) return;
  const by = [right * Math.cos(t) - away * Math.sin(t), right * Math.sin(t) + away * Math.cos(t), 0];
  const to = { ...held.base, at_mm: add(held.base.at_mm, by, 1e3) };
  fillBase(to);
  if (isEnd || performance.now() - (moveRobot.at || 0) > 80) { moveRobot.at = performance.now(); askRobot(to, isEnd); }
}
for (const id of [...BASE, "bt", "bs"]) $(id).onchange = () => askRobot(basePlace(), true);
$("plan").onclick = () => askRobot(basePlace(), true);
$("arm").onchange = seeArm;

// The task.
const FIELDS = { cx: (p) => p.centre_mm[0], cy: (p) => p.centre_mm[1], height: (p) => p.height_mm, tilt: (p) => p.tilt_deg, axis: (p) => p.tilt_axis_deg || 0 };
function fillTask() {
  for (const id in FIELDS) $(id).value = FIELDS[id](stage.placement);
  $("clamps").replaceChildren(); stage.clamps.forEach(addClamp);
  for (const id of ["tool", "material"]) $(id).length = 0;
}
function addClamp(clamp) {
  const row = document.createElement("p"), given = [...clamp.at_mm, clamp.radius_mm || 0, ...(clamp.move_mm || [0, 0, 0])];
  row.append("clamp at x, y, radius, moved by x, y, z [mm] ");
  for (const value of given) { const input = document.createElement("input"); Object.assign(input, { type: "number", value }); row.append(input); }
  const button = document.createElement("button");
  button.textContent = "remove"; button.onclick = () => row.remove();
  row.append(button); $("clamps").append(row);
}
$("clamp").onclick = () => addClamp({ at_mm: hovered ? [0, 1].map((k) => Math.round(1e3 * stage.rest[2 * hovered.vertex + k])) : [0, 0] });
$("whole").onclick = () => link.send("task", { change: {} });
$("fall").onclick = () => {
  const clamps = [...$("clamps").children].map((row) => { const n = [...row.querySelectorAll("input")].map((input) => Number(input.value)); return { at_mm: n.slice(0, 2), radius_mm: n[2], move_mm: n.slice(3, 6) }; });
  const placement = { ...stage.placement, centre_mm: [Number($("cx").value), Number($("cy").value)], height_mm: Number($("height").value), tilt_deg: Number($("tilt").value), tilt_axis_deg: Number($("axis").value) };
  link.send("task", { change: { region_mm: stage.region_mm, placement, clamps, tool: $("tool").value || null, material: $("material").value || null } });
};
$("tool").onfocus = $("material").onfocus = () => { for (const id of ["tool", "material"]) if (!$(id).length) { $(id).add(new Option("as it is", "")); for (const name of moment[id + "s"]) $(id).add(new Option(name)); } };

// Pictures and films.
function download(blob, name) { const a = document.createElement("a"); a.href = URL.createObjectURL(blob); a.download = name; a.click(); setTimeout(() => URL.revokeObjectURL(a.href), 1e4); }
$("shot").onclick = () => !moment || !drawing && !moment.picture ? null : drawing ? canvas.toBlob((blob) => download(blob, "drape.png")) : download(new Blob([moment.picture], { type: "image/png" }), "drape.png");
let film = null;
$("film").onclick = () => {
  if (film) { film.stop(); film = null; } else {
    const parts = []; film = new MediaRecorder(canvas.captureStream(30));
    film.ondataavailable = ({ data }) => parts.push(data); film.onstop = () => download(new Blob(parts, { type: parts[0].type }), "drape.webm"); film.start();
  }
  $("film").classList.toggle("on", film !== null);
};

let noDrawing = "";
function open() {
  try { drawing = new Drawing(canvas); keepStage(); } catch (error) { drawing = null; noDrawing = error.message; }
  $("picture").hidden = !!drawing; canvas.style.visibility = drawing ? "visible" : "hidden";
}
canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); drawing = null; noDrawing = "the graphics card has dropped this page"; $("picture").hidden = false; canvas.style.visibility = "hidden"; link.ask(0); });
canvas.addEventListener("webglcontextrestored", () => { open(); tell(); isDirty = true; });
if (matchMedia("(prefers-color-scheme: light)").matches) $("light").click();
open();
tell();
link = DATA ? new Still(DATA) : new Live();
draw();
