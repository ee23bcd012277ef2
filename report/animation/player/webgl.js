// What draws items in space on a canvas: WebGL where there is one, or else a drawing in the plane.

const SUN = vector.unit([0.35, -0.25, 1]);
const NEAR_SHARE = 0.02; // of the distance of the camera: nothing nearer is drawn
const WALL_SEEN = 0.22; // of its colour: what is behind a wall is seen
const LOOKS = { solid: 0, shadow: 1, ground: 2, wall: 3 };

const VERTEX = `#version 300 es
precision highp float;
in vec3 p, n; in float e;
uniform mat4 M, V; uniform vec3 size; uniform float lift, ground; uniform vec3 sun; uniform int look;
out vec3 N, P, Q;
void main() {
  vec4 w = M * vec4(p * size + vec3(0.0, 0.0, e * lift), 1.0);
  N = mat3(M) * (n / max(size, vec3(1e-9)));
  if (look == 1) w.xyz -= sun * ((w.z - ground) / sun.z);
  P = w.xyz; Q = p;
  gl_Position = V * w;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
in vec3 N, P, Q;
uniform vec3 colour, other, eye, sun, middle; uniform float step_, reach; uniform int look; uniform bool split;
out vec4 c;
void main() {
  if (look == 1) { c = vec4(colour, 0.3); return; }
  if (look == 2) {
    vec2 g = abs(fract(P.xy / step_ - 0.5) - 0.5) / fwidth(P.xy / step_);
    float line = 1.0 - min(1.4 * min(g.x, g.y), 1.0);
    float far = length(P.xy - middle.xy) / reach;
    c = vec4(colour, line * exp(-far * far));
    return;
  }
  if (look == 3) { c = vec4(colour, ${WALL_SEEN}); return; }
  vec3 n = normalize(N), v = normalize(eye - P);
  vec3 own = split && Q.x * Q.y * Q.z > 0.0 ? other : colour;
  float light = max(dot(n, sun), 0.0), shine = pow(max(dot(n, normalize(v + sun)), 0.0), 40.0);
  c = vec4(own * (0.55 + 0.5 * light) + 0.12 * shine, 1.0);
}`;

// A painter by WebGL, or null where it is not there.
function glPainter(canvas) {
  const gl = canvas.getContext("webgl2", { alpha: false, antialias: true, stencil: true, preserveDrawingBuffer: true });
  if (!gl) return null;
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return null;
  gl.useProgram(program);
  const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
  const names = Array.from({ length: count }, (_, k) => gl.getActiveUniform(program, k).name);
  const at = Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(program, name)]));
  const loaded = Object.fromEntries(Object.entries(MESHES).map(([name, data]) => {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    for (const [field, size, offset] of [["p", 3, 0], ["n", 3, 12], ["e", 1, 24]]) {
      const place = gl.getAttribLocation(program, field);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, 28, offset);
    }
    return [name, { array, count: data.length / 7 }];
  }));

  const put = ({ mesh, frame: [x, y, z, o], size, lift = 0, colour, other }, look, colours) => {
    gl.bindVertexArray(loaded[mesh].array);
    gl.uniformMatrix4fv(at.M, false, [...x, 0, ...y, 0, ...z, 0, ...o, 1]);
    gl.uniform3fv(at.size, size);
    gl.uniform1f(at.lift, lift);
    gl.uniform3fv(at.colour, colours[look === "shadow" ? "shadow" : colour]);
    gl.uniform3fv(at.other, colours[other ?? colour]);
    gl.uniform1i(at.split, other ? 1 : 0);
    gl.uniform1i(at.look, LOOKS[look]);
    gl.drawArrays(gl.TRIANGLES, 0, loaded[mesh].count);
  };

  // Draw items, their shadows on the ground, the ground and walls as a camera sees them, and what is
  // above, through all of these.
  const paint = ({ camera, items, above, walls, ground, colours }) => {
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(...colours.card, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.uniformMatrix4fv(at.V, false, matrixOf(camera));
    gl.uniform3fv(at.eye, camera.eye);
    gl.uniform3fv(at.sun, SUN);
    gl.uniform3fv(at.middle, ground.middle);
    for (const [name, value] of [["ground", ground.height], ["step_", ground.step], ["reach", ground.reach]]) gl.uniform1f(at[name], value);
    items.forEach((item) => put(item, "solid", colours));
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    put({ ...ground.item, colour: "line" }, "ground", colours);
    if (camera.eye[2] > ground.height) {
      gl.enable(gl.STENCIL_TEST); // each place is dark once
      gl.stencilFunc(gl.EQUAL, 0, 255);
      gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
      items.forEach((item) => put(item, "shadow", colours));
      gl.disable(gl.STENCIL_TEST);
    }
    walls.forEach((wall) => put(wall, "wall", colours));
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    above.forEach((item) => put(item, "solid", colours));
  };
  // A page may have few canvases with WebGL at once.
  return { paint, close: () => gl.getExtension("WEBGL_lose_context")?.loseContext() };
}

// The matrix of a camera, by columns.
function matrixOf({ eye, right, up, back, focus, aspect, far }) {
  const [n, f] = [NEAR_SHARE * far, 40 * far];
  const [a, b] = [(f + n) / (n - f), (2 * f * n) / (n - f)];
  const row = (u, k) => [...u.map((e) => k * e), -k * vector.dot(u, eye)];
  const depth = row(back, 1);
  const rows = [row(right, focus / aspect), row(up, focus), depth.map((e, i) => a * e + (i === 3 ? b : 0)), depth.map((e) => -e)];
  return [0, 1, 2, 3].flatMap((k) => rows.map((r) => r[k]));
}

// A painter in the plane: triangles from the farthest to the nearest.
function flatPainter(canvas) {
  const context = canvas.getContext("2d");
  if (!context) return null;
  const css = (colour, light) => `rgb(${colour.map((e) => Math.round(255 * Math.min(1, e * light))).join(" ")})`;
  const paint = ({ camera, items, above, walls, ground, colours }) => {
    const to = (p) => seenBy(camera, p, canvas.width, canvas.height);
    context.fillStyle = css(colours.card, 1);
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.strokeStyle = css(colours.line, 1);
    for (const [a, b] of ground.lines) {
      context.beginPath();
      context.moveTo(...to(a));
      context.lineTo(...to(b));
      context.stroke();
    }
    const sorted = (parts) => parts.flatMap((item) => facesOf(item, camera)).sort((a, b) => b.depth - a.depth);
    for (const { corners, light, colour, seen } of [...sorted(walls), ...sorted(items), ...sorted(above)]) {
      context.globalAlpha = seen;
      context.fillStyle = context.strokeStyle = css(colours[colour], light);
      context.beginPath();
      corners.forEach((p) => context.lineTo(...to(p)));
      context.closePath();
      context.fill();
      if (seen === 1) context.stroke(); // so that nothing is seen between faces
    }
    context.globalAlpha = 1;
  };
  return { paint, close() {} };
}

// Triangles of an item that face a camera.
function facesOf({ mesh, frame: [x, y, z, o], size, lift = 0, colour, other, seen = 1 }, { eye, back }) {
  const data = MESHES[mesh];
  const faces = [];
  for (let k = 0; k < data.length; k += 21) {
    const own = [0, 7, 14].map((i) => Array.from(data.subarray(k + i, k + i + 7)));
    const corners = own.map(([a, b, c, , , , e]) => {
      const [u, v, w] = [a * size[0], b * size[1], c * size[2] + e * lift];
      return o.map((q, i) => q + u * x[i] + v * y[i] + w * z[i]);
    });
    const normal = vector.unit(vector.cross(vector.add(corners[1], corners[0], -1), vector.add(corners[2], corners[0], -1)));
    const middle = corners[0].map((_, i) => (corners[0][i] + corners[1][i] + corners[2][i]) / 3);
    if (vector.dot(normal, vector.add(eye, middle, -1)) <= 0) continue;
    const sides = [0, 1, 2].map((i) => own[0][i] + own[1][i] + own[2][i]);
    const split = other && sides[0] * sides[1] * sides[2] > 1e-9;
    const light = 0.55 + 0.5 * Math.max(vector.dot(normal, SUN), 0);
    faces.push({ corners, light, colour: split ? other : colour, seen, depth: -vector.dot(back, vector.add(middle, eye, -1)) });
  }
  return faces;
}

// Where a point is on a picture, and how far from the eye.
function seenBy({ eye, right, up, back, focus }, p, width, height) {
  const d = vector.add(p, eye, -1);
  const depth = -vector.dot(d, back);
  const scale = ((focus / Math.max(depth, 1e-9)) * height) / 2;
  return [width / 2 + scale * vector.dot(d, right), height / 2 - scale * vector.dot(d, up), depth];
}
