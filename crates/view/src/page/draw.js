// Colours from the least value to the greatest: perceptually even, and two-sided about the middle.
const MAPS = {
  even: ["440154", "472d7b", "3b528b", "2c728e", "21918c", "28ae80", "5ec962", "addc30", "fde725"],
  split: ["2166ac", "67a9cf", "d1e5f0", "f7f7f7", "fddbc7", "ef8a62", "b2182b"],
};
const rgb = (hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16));
for (const name in MAPS) MAPS[name] = MAPS[name].map(rgb);
function color(map, share) {
  const last = MAPS[map].length - 1, at = Math.min(Math.max(share || 0, 0), 1) * last, k = Math.min(Math.floor(at), last - 1);
  return [0, 1, 2].map((c) => MAPS[map][k][c] + (at - k) * (MAPS[map][k + 1][c] - MAPS[map][k][c]));
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const add = (a, b, by = 1) => [0, 1, 2].map((k) => a[k] + by * b[k]);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const length = Math.hypot(...a) || 1; return a.map((x) => x / length); };

// An eye that looks at a box from afar: turned about the vertical, lifted over the horizon [degrees].
class Eye {
  constructor() { this.low = [-1, -1, -1]; this.high = [1, 1, 1]; this.beyond = 0; this.view("free"); }
  view(name) {
    [this.turn, this.lift] = { free: [-35, 35], top: [0, 90], side: [0, 0] }[name];
    this.zoom = 1; this.moved = [0, 0, 0];
  }
  axes() {
    const [t, l] = [this.turn, this.lift].map((a) => a * Math.PI / 180);
    const right = [Math.cos(t), Math.sin(t), 0], away = [-Math.sin(t), Math.cos(t), 0];
    const up = [away[0] * Math.sin(l), away[1] * Math.sin(l), Math.cos(l)];
    return [right, up, cross(right, up)];
  }
  // What a picture of so many pixels shows.
  onto(width, height) {
    const axes = this.axes(), size = add(this.high, this.low, -1);
    const extent = axes.map((a) => Math.abs(a[0] * size[0]) + Math.abs(a[1] * size[1]) + Math.abs(a[2] * size[2]));
    const scale = 0.92 * this.zoom * Math.min(width / extent[0], height / extent[1]);
    const middle = add(add(this.low, this.high).map((x) => x / 2), this.moved);
    // A robot stands beyond the box that is looked at.
    const near = Math.hypot(...size) * 2, depth = near + this.beyond;
    return { axes, scale, middle, width, height, depth, closer: near / depth };
  }
  // The same for the server, which fits a box into the picture.
  look(width, height, range) {
    const [, up, back] = this.axes(), { middle } = this.onto(width, height);
    const half = add(this.high, this.low, -1).map((x) => x / 2 / this.zoom);
    return { direction: back.map((x) => -x), up, low: add(middle, half, -1), high: add(middle, half), size: [width, height], range };
  }
}
// Pixels from the left and from the top, and height towards the eye.
function project(seen, x, y, z) {
  const p = [x - seen.middle[0], y - seen.middle[1], z - seen.middle[2]], [right, up, back] = seen.axes;
  return [seen.width / 2 + seen.scale * dot(p, right), seen.height / 2 - seen.scale * dot(p, up), dot(p, back)];
}
// The vertex under a pixel, and the place there.
function pick(seen, position, triangles, x, y) {
  let best = null;
  const count = position.length / 3, at = new Float32Array(3 * count);
  for (let v = 0; v < count; v++) at.set(project(seen, position[3 * v], position[3 * v + 1], position[3 * v + 2]), 3 * v);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const [x1, y1, x2, y2] = [at[3 * b] - at[3 * a], at[3 * b + 1] - at[3 * a + 1], at[3 * c] - at[3 * a], at[3 * c + 1] - at[3 * a + 1]];
    const area = x1 * y2 - x2 * y1, px = x - at[3 * a], py = y - at[3 * a + 1];
    const u = (px * y2 - x2 * py) / area, w = (x1 * py - px * y1) / area;
    if (!(u >= 0 && w >= 0 && u + w <= 1)) continue;
    const height = at[3 * a + 2] * (1 - u - w) + at[3 * b + 2] * u + at[3 * c + 2] * w;
    if (best && best.height >= height) continue;
    const share = [1 - u - w, u, w], k = share.indexOf(Math.max(...share));
    best = { vertex: [a, b, c][k], height };
  }
  return best;
}
function normals(position, triangles) {
  const out = new Float32Array(position.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
    const x1 = position[b] - position[a], y1 = position[b + 1] - position[a + 1], z1 = position[b + 2] - position[a + 2];
    const x2 = position[c] - position[a], y2 = position[c + 1] - position[a + 1], z2 = position[c + 2] - position[a + 2];
    const n = [y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2];
    for (const v of [a, b, c]) for (let k = 0; k < 3; k++) out[v + k] += n[k];
  }
  return out;
}

const VERTEX = `#version 300 es
in vec3 position, normal, tint; uniform mat4 view; uniform vec4 flat_tint; uniform float near, size; out vec3 n, c;
void main() { gl_Position = view * vec4(position, 1.0); gl_Position.z -= near; gl_PointSize = size; n = mat3(view) * normal; c = mix(tint, flat_tint.rgb, flat_tint.a); }`;
const FRAGMENT = `#version 300 es
precision mediump float; in vec3 n, c; uniform float lit; out vec4 color;
void main() {
  float length2 = dot(n, n);
  vec3 m = length2 > 0.0 ? n * inversesqrt(length2) : vec3(0, 0, -1);
  float light = 0.35 + 0.65 * abs(dot(m, normalize(vec3(0.35, 0.5, -0.8))));
  color = vec4(c * mix(1.0, light, lit), 1.0);
}`;

// Draws meshes, lines and points by WebGL 2.
class Drawing {
  constructor(canvas) {
    // Where a processor stands in for the card, smooth edges take half of its time.
    const asked = document.createElement("canvas").getContext("webgl2"), named = asked && asked.getExtension("WEBGL_debug_renderer_info");
    const antialias = !/swiftshader|llvmpipe|software/i.test(asked ? asked.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : asked.RENDERER) : "");
    if (asked) asked.getExtension("WEBGL_lose_context")?.loseContext();
    const gl = this.gl = canvas.getContext("webgl2", { antialias, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    const program = this.program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source); gl.compileShader(shader); gl.attachShader(program, shader);
    }
    ["position", "normal", "tint"].forEach((name, k) => gl.bindAttribLocation(program, k, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(program));
    this.at = Object.fromEntries(["view", "flat_tint", "near", "size", "lit"].map((name) => [name, gl.getUniformLocation(program, name)]));
    this.buffers = {};
    gl.useProgram(program); gl.enable(gl.DEPTH_TEST); gl.enable(gl.POLYGON_OFFSET_FILL); gl.polygonOffset(1, 1);
  }
  // Numbers on the card, by a name.
  keep(name, numbers, target = this.gl.ARRAY_BUFFER) {
    const { gl, buffers } = this, is = buffers[name] = buffers[name] || { buffer: gl.createBuffer() };
    gl.bindBuffer(target, is.buffer); gl.bufferData(target, numbers, gl.DYNAMIC_DRAW); is.count = numbers.length;
  }
  keepMesh(name, position, triangles, tint) {
    this.keep(name + ".position", position); this.keep(name + ".normal", normals(position, triangles)); this.keep(name + ".tint", tint);
    this.keep(name + ".triangles", triangles, this.gl.ELEMENT_ARRAY_BUFFER);
  }
  clear(back) { this.gl.clearColor(...back.map((x) => x / 255), 1); this.gl.clear(this.gl.COLOR_BUFFER_BIT | this.gl.DEPTH_BUFFER_BIT); }
  // What follows is seen so, so far from the left.
  begin(seen, left, wide) {
    const { gl } = this, { axes, scale, middle, width, height, depth } = seen;
    gl.viewport(left, 0, wide, gl.drawingBufferHeight);
    const by = [2 * scale / width, 2 * scale / height, -1 / depth], view = new Float32Array(16);
    for (let r = 0; r < 3; r++) { for (let c = 0; c < 3; c++) view[4 * c + r] = by[r] * axes[r][c]; view[12 + r] = -by[r] * dot(axes[r], middle); }
    view[15] = 1;
    this.closer = seen.closer; this.view = view;
    this.place(null);
  }
  // What follows is where a pose, row by row, takes it; where it is, without one.
  place(pose) {
    const at = new Float32Array(this.view);
    if (pose) for (let r = 0; r < 4; r++) for (let c = 0; c < 4; c++) {
      at[4 * c + r] = c === 3 ? this.view[12 + r] : 0;
      for (let k = 0; k < 3; k++) at[4 * c + r] += this.view[4 * k + r] * pose[4 * k + c];
    }
    this.gl.uniformMatrix4fv(this.at.view, false, at);
  }
  // Draws kept positions, as listed by kept numbers; in one colour, or in their own and lit.
  draw(name, indices, kind, { tint = null, near = 0, size = 1, first = 0, count = null } = {}) {
    const { gl, buffers, at } = this;
    ["position", "normal", "tint"].forEach((part, k) => {
      const kept = buffers[`${name}.${part}`];
      if (!kept) { gl.disableVertexAttribArray(k); return; }
      gl.bindBuffer(gl.ARRAY_BUFFER, kept.buffer); gl.enableVertexAttribArray(k);
      gl.vertexAttribPointer(k, 3, part === "tint" ? gl.UNSIGNED_BYTE : gl.FLOAT, part === "tint", 0, 0);
    });
    gl.uniform4fv(at.flat_tint, tint ? [...tint.map((x) => x / 255), 1] : [0, 0, 0, 0]);
    gl.uniform1f(at.lit, tint ? 0 : 1); gl.uniform1f(at.near, near * this.closer); gl.uniform1f(at.size, size);
    if (indices) { gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[indices].buffer); gl.drawElements(gl[kind], buffers[indices].count, gl.UNSIGNED_INT, 0); }
    else gl.drawArrays(gl[kind], first, count ?? buffers[name + ".position"].count / 3);
  }
  // Lines or points through places [m], at once.
  mark(places, kind, look) { if (places.length) { this.keep("mark.position", new Float32Array(places.flat())); this.draw("mark", null, kind, look); } }
}
