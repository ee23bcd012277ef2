// Handles: points of the drawing that can be dragged, and the numbers that they move.

const TRIED = 1e-5; // by which a place is moved to see what follows
const FOLLOWING = 4; // steps of Newton's method for what is dragged

const AREAS = ["wall", "plane"]; // shapes that stand still, and whose parameters can be dragged
const LINES = ["link", "spring", "rod", "coil"]; // shapes of several points
const UNHELD = ["contact", "touch", "force", "torque"]; // shapes that show what others have

// Points of the drawing that can be dragged: a place, and the numbers that it takes from there.  A
// point of a body moves the coordinates at an end that bodies with fewer of them do not depend on; one
// of a wall the parameters that walls alone depend on.  Of points with the same numbers that which they
// move most is taken.
function handlesOf(plan, motion, places) {
  const size = motion.bounds.length / 2; // of a place: 2, or 3 in space
  const points = motion.shapes.flatMap(({ kind, columns: own }) => {
    if (UNHELD.includes(kind)) return [];
    const wall = AREAS.includes(kind);
    const count = LINES.includes(kind) ? own.length / size : 1;
    const at = (k) => (kind === "wall" ? own : own.slice(size * k, size * (k + 1)));
    return Array.from({ length: count }, (_, k) => ({ wall, at: at(k) }));
  });
  const reach = (end, { at }, number) => {
    const [a, b] = [0, TRIED].map((more) => pointAt(at, places(end, number, more)));
    return Math.hypot(...a.map((e, k) => e - b[k])) / TRIED;
  };
  const moves = (...which) => reach(...which) > 1e-3;
  const handles = new Map();
  for (const end of ["start", "goal"]) {
    const of = (field) => plan.numbers.flatMap(({ name }, i) => (name.startsWith(`${field}.`) ? [i] : []));
    const states = plan.coordinates.map((name) => {
      return plan.turning.includes(name) ? -1 : plan.numbers.findIndex((n) => n.name === `${end}.${name}`);
    });
    const own = points.map((p) => states.filter((i) => i >= 0 && moves(end, p, i)));
    const bodies = points.filter(({ wall }) => !wall);
    points.forEach((p, k) => {
      const fewer = own.filter((other) => other.length < own[k].length && other.every((i) => own[k].includes(i)));
      const alone = own[k].filter((i) => !fewer.some((other) => other.includes(i)));
      const free = (i) => moves(end, p, i) && !bodies.some((body) => moves(end, body, i));
      const numbers = p.wall ? (end === "start" ? of("parameters").filter(free) : []) : alone.length ? alone : own[k];
      const most = Math.max(0, ...numbers.map((i) => reach(end, p, i)));
      const other = handles.get(String(numbers));
      if (numbers.length && !(other?.most >= 0.99 * most)) handles.set(String(numbers), { ...p, end, numbers, most });
    });
  }
  return [...handles.values()];
}

// The point of some columns: a place, or the middle of the two ends of a wall in the plane.
function pointAt(at, columns) {
  const own = at.map((k) => columns[k]);
  return own.length < 4 ? own : [(own[0] + own[2]) / 2, (own[1] + own[3]) / 2];
}

// What is seen of a picture: where points are in it, in pixels; two numbers of a point along its axes,
// ``flat``, and those that a pixel stands for in the plane through a point and parallel to the screen.
function sightOf(root) {
  if (root.sight) {
    const { camera, width, height } = root.sight;
    const flat = (p) => [vector.dot(p, camera.right), vector.dot(p, camera.up)];
    const to = (p) => seenBy(camera, p, width, height).slice(0, 2);
    const from = ([x, y], p) => {
      const [px, py, depth] = seenBy(camera, p, width, height);
      const pixel = (2 * depth) / (camera.focus * height);
      const [a, b] = flat(p);
      return [a + pixel * (x - px), b - pixel * (y - py)];
    };
    return { flat, to, from };
  }
  const [scale, x, y] = ["scale", "x", "y"].map((name) => Number(root.dataset[name]));
  const to = ([a, b]) => [x + scale * a, y - scale * b];
  const from = ([px, py]) => [(px - x) / scale, (y - py) / scale];
  return scale ? { flat: (p) => p, to, from } : null; // it has no size yet
}

// Move the numbers of a handle so that it is seen at a place, as near as it can.
function follow({ at, end, numbers: own }, { goal, flat }, numbers, places) {
  const seen = (...moved) => flat(pointAt(at, places(end, ...moved)));
  for (let k = 0; k < FOLLOWING; k += 1) {
    const [x, y] = seen();
    const slopes = own.map((i) => {
      const [a, b] = seen(i, TRIED);
      return [(a - x) / TRIED, (b - y) / TRIED];
    });
    const sum = (f) => slopes.reduce((total, slope) => total + f(slope), 0);
    const damping = 1e-9 + 1e-6 * sum(([a, b]) => a * a + b * b);
    const [xx, xy, yy] = [sum(([a]) => a * a) + damping, sum(([a, b]) => a * b), sum(([, b]) => b * b) + damping];
    const [dx, dy] = [goal[0] - x, goal[1] - y];
    const det = xx * yy - xy * xy;
    const [lx, ly] = [(yy * dx - xy * dy) / det, (xx * dy - xy * dx) / det];
    own.forEach((i, j) => (numbers[i] += slopes[j][0] * lx + slopes[j][1] * ly));
  }
}

// Rings on the picture at what can be dragged.
function makeHandles(handles, root, places, drag) {
  const sheet = root.querySelector(".stage > svg") ?? root;
  const rings = handles.map((handle) => {
    const ring = svg("circle", { class: `handle ${handle.end}`, r: 11, "aria-hidden": "true" });
    const move = (event) => {
      const [sight, box] = [sightOf(root), sheet.getBoundingClientRect()];
      const point = pointAt(handle.at, places(handle.end));
      const goal = sight.from([event.clientX - box.left, event.clientY - box.top], point);
      drag(handle, { goal, flat: sight.flat });
    };
    ring.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      ring.setPointerCapture(event.pointerId);
      ring.classList.add("held");
      drag(handle, null);
    });
    ring.addEventListener("pointermove", (event) => ring.hasPointerCapture(event.pointerId) && move(event));
    ring.addEventListener("lostpointercapture", () => {
      ring.classList.remove("held");
      drag(null, null);
    });
    return ring;
  });
  sheet.append(...rings);
  const place = () => {
    const sight = sightOf(root);
    handles.forEach(({ at, end }, i) => {
      const [cx, cy] = sight?.to(pointAt(at, places(end))) ?? [0, 0];
      set(rings[i], { cx, cy });
    });
  };
  root.addEventListener("seen", place);
  return place;
}
