// Handles: points of the drawing that can be dragged, and the numbers that they move.

const TRIED = 1e-5; // by which a place is moved to see what follows
const FOLLOWING = 4; // steps of Newton's method for what is dragged

// Points of the drawing that can be dragged: a place, and the numbers that it takes from there.  A
// point of a body moves the coordinates at an end that bodies with fewer of them do not depend on; one
// of a wall the parameters that walls alone depend on.  Of points with the same numbers that which they
// move most is taken.
function handlesOf(plan, motion, places) {
  const points = motion.shapes.flatMap(({ kind, columns: own }) => {
    if (kind === "contact") return [];
    const wall = kind === "wall";
    const pairs = kind === "link" || kind === "spring" ? own.length / 2 : 1;
    return Array.from({ length: pairs }, (_, k) => ({ wall, at: wall ? own : own.slice(2 * k, 2 * k + 2) }));
  });
  const reach = (end, { at }, number) => {
    const [a, b] = [0, TRIED].map((more) => pointAt(at, places(end, number, more)));
    return Math.hypot(a[0] - b[0], a[1] - b[1]) / TRIED;
  };
  const moves = (...which) => reach(...which) > 1e-3;
  const handles = new Map();
  for (const end of ["start", "goal"]) {
    const of = (field) => plan.numbers.flatMap(({ name }, i) => (name.startsWith(`${field}.`) ? [i] : []));
    const states = plan.coordinates.map((name) => plan.numbers.findIndex((n) => n.name === `${end}.${name}`));
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

// The point of some columns: x and y, or the middle of two points.
function pointAt(at, columns) {
  const own = at.map((k) => columns[k]);
  return own.length === 2 ? own : [(own[0] + own[2]) / 2, (own[1] + own[3]) / 2];
}

// Move the numbers of a handle so that it goes to a place, as near as it can.
function follow({ at, end, numbers: own }, goal, numbers, places) {
  for (let k = 0; k < FOLLOWING; k += 1) {
    const [x, y] = pointAt(at, places(end));
    const slopes = own.map((i) => {
      const [a, b] = pointAt(at, places(end, i, TRIED));
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
  const view = () => ["scale", "x", "y"].map((name) => Number(root.dataset[name]));
  const rings = handles.map((handle) => {
    const ring = svg("circle", { class: `handle ${handle.end}`, r: 11, "aria-hidden": "true" });
    const move = (event) => {
      const [scale, x, y] = view();
      const box = root.getBoundingClientRect();
      drag(handle, [(event.clientX - box.left - x) / scale, (y - (event.clientY - box.top)) / scale]);
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
  root.append(...rings);
  return () => {
    const [scale, x, y] = view();
    if (!scale) return; // it has no size yet
    handles.forEach(({ at, end }, i) => {
      const [a, b] = pointAt(at, places(end));
      set(rings[i], { cx: x + scale * a, cy: y - scale * b });
    });
  };
}
