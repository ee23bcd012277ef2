// Meshes of unit size, and the shapes of a scene in space as items that a painter draws: a mesh, where
// its frame is, its sizes along the axes of that, a colour.

const AROUND_AXIS = 40; // corners around what is round
const [ROD_THICK, BOB_SIZE, THIN_BOX, COIL_WIDE] = [0.012, 0.03, 0.002, 0.025]; // in sides of the room
const HEAD_LONG = 0.035; // of an arrow, in sides of the room

const vector = {
  add: (a, b, k = 1) => a.map((e, i) => e + k * b[i]),
  dot: (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
  unit: (a) => {
    const length = Math.hypot(...a) || 1;
    return a.map((e) => e / length);
  },
};

// Corners, normals and lifts of the triangles between rings of points (radius, height, their normal, lift).
function lathe(profile) {
  const at = ([r, z, nr, nz, lift], k) => {
    const angle = (2 * Math.PI * k) / AROUND_AXIS;
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return [r * c, r * s, z, nr * c, nr * s, nz, lift];
  };
  const out = [];
  for (let i = 0; i + 1 < profile.length; i += 1) {
    for (let k = 0; k < AROUND_AXIS; k += 1) {
      const [a, b] = [at(profile[i], k), at(profile[i + 1], k)];
      const [c, d] = [at(profile[i + 1], k + 1), at(profile[i], k + 1)];
      out.push(...a, ...b, ...c, ...a, ...c, ...d);
    }
  }
  return new Float32Array(out);
}

function cube() {
  const out = [];
  for (let axis = 0; axis < 3; axis += 1) {
    for (const side of [1, -1]) {
      const corner = (u, v) => {
        const [p, n] = [[0, 0, 0], [0, 0, 0]];
        [p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3], n[axis]] = [side, u * side, v, side];
        return [...p, ...n, 0];
      };
      for (const [u, v] of [[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]]) out.push(...corner(u, v));
    }
  }
  return new Float32Array(out);
}

function ball(lift) {
  const rings = [];
  for (let k = 0; k <= 12; k += 1) rings.push([(Math.PI * k) / 24, lift]);
  for (let k = lift ? 0 : 1; k <= 12; k += 1) rings.push([Math.PI / 2 + (Math.PI * k) / 24, -lift]);
  return rings.map(([angle, own]) => [Math.sin(angle), Math.cos(angle), Math.sin(angle), Math.cos(angle), own]);
}

const MESHES = {
  cube: cube(),
  ball: lathe(ball(0)),
  capsule: lathe(ball(1)),
  pipe: lathe([[0, 1, 0, 1, 0], [1, 1, 0, 1, 0], [1, 1, 1, 0, 0], [1, -1, 1, 0, 0], [1, -1, 0, -1, 0], [0, -1, 0, -1, 0]]),
  cone: lathe([[0, 1, 1, 0.4, 0], [1, -1, 1, 0.4, 0], [1, -1, 0, -1, 0], [0, -1, 0, -1, 0]]),
};

// A frame at a place, by columns; of axes that interpolation has bent.
function frameOf(at, first, second) {
  const x = vector.unit(first);
  const z = vector.unit(vector.cross(x, second));
  return [x, vector.cross(z, x), z, at];
}

// A frame whose third axis is along a way.
function upright(at, way) {
  const z = vector.unit(Math.hypot(...way) > 0 ? way : [0, 0, 1]);
  const x = vector.unit(vector.cross(Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], z));
  return [x, vector.cross(z, x), z, at];
}

function pipe(a, b, radius, colour) {
  const way = vector.add(b, a, -1);
  return { mesh: "pipe", frame: upright(vector.add(a, way, 0.5), way), size: [radius, radius, Math.hypot(...way) / 2], colour };
}

// The items of a shape with some values, in a room of a side.
function itemsOf({ kind }, values, side) {
  const makers = { rod, coil, bob, block, sphere, capsule, cylinder };
  return kind in makers ? makers[kind](values, side) : [];
}

function pointsIn(values) {
  return Array.from({ length: values.length / 3 }, (_, k) => values.slice(3 * k, 3 * k + 3));
}

function rod(values, side, radius = ROD_THICK * side) {
  const points = pointsIn(values);
  const pipes = points.slice(1).map((b, k) => pipe(points[k], b, radius, "edge"));
  return [...pipes, ...points.map((p) => ({ mesh: "ball", frame: upright(p, [0, 0, 1]), size: [radius, radius, radius], colour: "edge" }))];
}

function coil(values, side) {
  const [a, b] = pointsIn(values);
  const way = vector.add(b, a, -1);
  const [x, y] = upright(a, way);
  const points = Array.from({ length: 12 * COILS + 1 }, (_, k) => {
    const s = k / (12 * COILS);
    const [turn, wide] = [2 * Math.PI * COILS * s, COIL_WIDE * side * Math.min(1, 10 * Math.min(s, 1 - s))];
    return a.map((e, i) => e + s * way[i] + wide * (Math.cos(turn) * x[i] + Math.sin(turn) * y[i]));
  });
  return rod(points.flat(), side, (ROD_THICK * side) / 3);
}

function bob(values, side) {
  const radius = BOB_SIZE * side;
  return [{ mesh: "ball", frame: upright(values, [0, 0, 1]), size: [radius, radius, radius], colour: "mass" }];
}

function solid(mesh, values, size, more = {}) {
  const frame = frameOf(values.slice(0, 3), values.slice(3, 6), values.slice(6, 9));
  return [{ mesh, frame, size, colour: "solid", ...more }];
}

function block(values, side) {
  return solid("cube", values, values.slice(9).map((e) => Math.max(e / 2, THIN_BOX * side)));
}

function sphere(values) {
  return solid("ball", values, [values[9], values[9], values[9]], { other: "body" });
}

function capsule(values) {
  return solid("capsule", values, [values[9], values[9], values[9]], { lift: values[10] / 2 });
}

function cylinder(values) {
  return solid("pipe", values, [values[9], values[9], values[10] / 2], { other: "body" });
}

// An arrow from a place along a way; that of a torque has two heads.
function arrowItems(at, way, side, colour, turns) {
  const [length, direction] = [Math.hypot(...way), vector.unit(way)];
  const head = Math.min(HEAD_LONG * side, length);
  const wide = 0.4 * head;
  const cone = (end) => {
    const middle = vector.add(at, direction, end - head / 2);
    return { mesh: "cone", frame: upright(middle, direction), size: [wide, wide, head / 2], colour };
  };
  const shaft = pipe(at, vector.add(at, direction, length - head / 2), 0.3 * wide, colour);
  return [shaft, cone(length), ...(turns ? [cone(length - 0.8 * head)] : [])];
}
