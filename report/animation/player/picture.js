// The mechanism at a time: shapes, traces, hits and contact forces.

const ARROW = 0.22; // of the smaller side of the picture: the largest contact force
const SHORT = 7; // pixels of the shortest arrow that is drawn
const HATCH = 9; // pixels between two strokes of a wall
const COILS = 8;
const WIDE = 7; // pixels of a character of what is told, about
const LINE = 15; // pixels of a line of it
const MOST_HIGH = 460; // pixels of a picture
const FLASH = 0.09; // of the whole time, for which a hit flashes
const TOLD = 0.18; // of the whole time, for which it is told

// The room that some motions take together: the lowest and the highest of each coordinate.
function jointBounds(motions) {
  const [first, ...others] = motions.map((motion) => motion.bounds);
  const choose = (k) => (k % 2 ? Math.max : Math.min);
  return others.reduce((room, bounds) => room.map((e, k) => choose(k)(e, bounds[k])), first);
}

function makePicture(motion, bounds, clock) {
  const root = svg("svg", { class: "picture", role: "img" });
  const still = svg("g");
  const traces = svg("g");
  const moving = svg("g");
  const marks = svg("g");
  const forces = svg("g");
  const banner = svg("text", { class: "told halo", x: 8, y: 18 });
  root.append(still, traces, moving, marks, forces, banner);
  const shapes = motion.shapes.map((shape) => makeShape(shape));
  shapes.forEach(({ element }) => element && moving.append(element));
  const arrows = motion.arrows.map((arrow) => makeArrow(arrow));
  arrows.forEach(({ element }) => forces.append(element));
  const hits = motion.events.map((event, i) => makeHit(event, i));
  hits.forEach(({ element }) => marks.append(element));
  const view = { scale: 1, x: 0, y: 0, side: 1, width: 1, height: 1 };
  let now = 0;

  const to = (x, y) => [view.x + view.scale * x, view.y - view.scale * y];

  function layout(width) {
    const [left, right, bottom, top] = bounds();
    const scale = Math.min(width / (right - left), MOST_HIGH / (top - bottom));
    const room = Math.max(scale * (top - bottom), 120);
    const height = room + LINE; // a second line is told below a floor
    view.scale = scale;
    view.x = width / 2 - (scale * (left + right)) / 2;
    view.y = room / 2 + (scale * (top + bottom)) / 2;
    [view.width, view.height] = [width, height];
    view.side = Math.min(width, height);
    set(root, { viewBox: `0 0 ${width} ${height}`, height });
    set(root, { "data-scale": scale, "data-x": view.x, "data-y": view.y });
    still.replaceChildren(...ruler(motion.unit, scale, width, height));
    traces.replaceChildren(...tracesOf(motion, to));
    draw(now);
  }

  function draw(t) {
    now = t;
    const end = Math.min(t, motion.duration);
    const columns = columnsAt(motion, end);
    shapes.forEach((shape) => shape.draw(columns, to, view));
    arrows.forEach((arrow) => arrow.draw(motion, columns, end, to, view));
    hits.forEach((hit) => hit.draw(t, clock.duration, to, view));
    banner.textContent = toldAt(motion, t, clock.duration);
    set(root, { "aria-label": spoken(motion, end) });
  }

  whenSized(root, layout);
  return { element: root, draw, renew: () => view.width > 1 && layout(view.width) };
}

// What is told over the picture: the event that has just been, where its place is not known.
function toldAt(motion, t, duration) {
  const recent = ({ time, marks }) => !marks.length && t >= time && t < time + TOLD * duration;
  const event = motion.events.findLast(recent);
  return event ? [event.word, event.told].filter(Boolean).join(": ") : "";
}

function spoken(motion, t) {
  const mode = motion.lasting ? `, ${motion.modes[phaseAt(motion, t)]}` : "";
  return `${motion.name} at ${written(t, motion.duration)} s${mode}`;
}

// A length that can be compared with.
function ruler(unit, scale, width, height) {
  if (!unit) return [];
  const length = roundBelow(width / 5 / scale);
  const [x, y, end] = [10, height - 8, 10 + length * scale];
  const label = svg("text", { class: "quiet", x: end + 6, y: y + 1 });
  label.textContent = `${tick(length, length)} ${unit}`;
  return [svg("path", { class: "scale", d: `M${x} ${y - 5}V${y}H${end}V${y - 5}` }), label];
}

// The ways of masses and of the middles of discs and boxes.
function tracesOf(motion, to) {
  const drawn = [];
  for (const { kind, columns: [a, b] } of motion.shapes) {
    if (kind !== "point" && kind !== "disc" && kind !== "box") continue;
    const ways = motion.parts.map(({ times, columns }) =>
      times.map((_, k) => to(mixed(columns[a], { k, share: 0 }), mixed(columns[b], { k, share: 0 }))),
    );
    drawn.push(svg("path", { class: "trace", d: ways.map(path).join("") }));
  }
  return drawn;
}

// An element for a shape, with its name if it has one, and how the columns of its scene place it.
function makeShape({ kind, name, columns: own }) {
  const makers = { link, point, disc, box, spring, wall };
  if (!(kind in makers)) return { element: null, draw() {} };
  const { element: drawn, place } = makers[kind]();
  const label = svg("text", { class: "quiet halo" });
  label.textContent = name;
  const draw = (columns, to, view) => {
    const values = own.map((k) => columns[k]);
    place(values, to, view);
    const [x, y] = to(values[0], values[1]);
    set(label, { x, y: y - 8 });
  };
  return { element: name ? svg("g", {}, drawn, label) : drawn, draw };
}

function link() {
  const element = svg("path", { class: "link" });
  const place = (c, to) => {
    const points = [];
    for (let k = 0; k < c.length; k += 2) points.push(to(c[k], c[k + 1]));
    set(element, { d: path(points) });
  };
  return { element, place };
}

function point() {
  const element = svg("circle", { class: "point", r: 7 });
  const place = ([x, y], to) => {
    const [cx, cy] = to(x, y);
    set(element, { cx, cy });
  };
  return { element, place };
}

function disc() {
  const round = svg("circle", { class: "disc" });
  const radius = svg("path", { class: "radius" });
  const place = ([x, y, r, angle], to, view) => {
    const [cx, cy] = to(x, y);
    set(round, { cx, cy, r: r * view.scale });
    set(radius, { d: path([[cx, cy], to(x + r * Math.cos(angle), y + r * Math.sin(angle))]) });
  };
  return { element: svg("g", {}, round, radius), place };
}

function box() {
  const element = svg("path", { class: "box" });
  const place = ([x, y, width, height, angle], to) => {
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const corner = (a, b) => to(x + (c * a * width - s * b * height) / 2, y + (s * a * width + c * b * height) / 2);
    set(element, { d: `${path([corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)])}Z` });
  };
  return { element, place };
}

function spring() {
  const element = svg("path", { class: "spring" });
  const place = ([x0, y0, x1, y1], to) => {
    const [a, b] = [to(x0, y0), to(x1, y1)];
    const along = [b[0] - a[0], b[1] - a[1]];
    const length = Math.hypot(...along) || 1;
    const across = [(-along[1] / length) * 6, (along[0] / length) * 6];
    const at = (share, side) => [0, 1].map((k) => a[k] + along[k] * share + across[k] * side);
    const points = [a, at(0.12, 0)];
    for (let k = 0; k < COILS; k += 1) points.push(at(0.12 + (0.76 * (k + 0.5)) / COILS, k % 2 ? 1 : -1));
    set(element, { d: path([...points, at(0.88, 0), b]) });
  };
  return { element, place };
}

// A wall with strokes on its solid side, to the right of its way from a to b.
function wall() {
  const line = svg("path", { class: "wall" });
  const strokes = svg("path", { class: "hatch" });
  const place = ([x0, y0, x1, y1], to) => {
    const [a, b] = [to(x0, y0), to(x1, y1)];
    const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
    const [ex, ey] = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
    const count = Math.min(Math.floor(length / HATCH), 400);
    let d = "";
    for (let k = 0; k < count; k += 1) {
      const s = ((k + 0.8) * length) / count;
      const [x, y] = [a[0] + s * ex, a[1] + s * ey];
      d += path([[x, y], [x - 7 * ey - 6 * ex, y + 7 * ex - 6 * ey]]);
    }
    set(line, { d: path([a, b]) });
    set(strokes, { d });
  };
  return { element: svg("g", {}, strokes, line), place };
}

// An arrow from a place on the picture along a way on it.
function arrow([x, y], [wx, wy]) {
  const length = Math.hypot(wx, wy) || 1;
  const [ex, ey] = [wx / length, wy / length];
  const barb = (side) => [x + wx - 8 * ex - side * 4.5 * ey, y + wy - 8 * ey + side * 4.5 * ex];
  return path([[x, y], [x + wx, y + wy]]) + path([barb(1), [x + wx, y + wy], barb(-1)]);
}

// A contact force: N along the normal, T along the normal turned clockwise by 90 degrees.
function makeArrow({ panel, curve, shape, kind, largest }) {
  const line = svg("path", { class: `force ${kind}` });
  const label = svg("text", { class: `force halo ${kind}`, "text-anchor": "middle" });
  const element = svg("g", {}, line, label);
  label.textContent = kind;
  const draw = (motion, columns, t, to, view) => {
    const force = valueAt(motion, motion.panels[panel], motion.panels[panel].curves[curve], t);
    const length = (force / (largest || 1)) * ARROW * view.side;
    element.style.display = Math.abs(length) < SHORT ? "none" : "";
    const [x, y, nx, ny] = motion.shapes[shape].columns.map((k) => columns[k]);
    const [dx, dy] = kind === "N" ? [nx, -ny] : [ny, nx];
    const [ax, ay] = to(x, y);
    const [tx, ty, named] = [ax + length * dx, ay + length * dy, Math.sign(length) * 11];
    set(line, { d: arrow([ax, ay], [length * dx, length * dy]) });
    const [px, py] = [tx + named * dx, ty + named * dy];
    const seen = px > 0 && px < view.width && py > 4 && py < view.height;
    set(label, seen ? { x: px, y: py + 4 } : { x: tx - 11 * dy, y: ty + 11 * dx + 4 });
  };
  return { element, draw };
}

// A hit: it flashes at its places, its impulse is drawn and told there for a while, and a cross with
// its number stays, which stands on the side away from the surface.
function makeHit(event, i) {
  const spots = event.marks.map((mark) => ({
    mark,
    ring: svg("circle", { class: "flash" }),
    cross: svg("path", { class: "mark" }),
    push: svg("path", { class: "push" }),
    label: svg("text", { class: "told halo" }),
  }));
  const element = svg("g", {}, ...spots.flatMap(({ ring, cross, push, label }) => [ring, cross, push, label]));
  const draw = (t, duration, to, view) => {
    const since = (t - event.time) / duration;
    element.style.display = since < 0 ? "none" : "";
    const told = since < TOLD;
    spots.forEach(({ mark, ring, cross, push, label }, k) => {
      const [x, y] = to(mark.at[0], mark.at[1]);
      const [px, py] = mark.impulse.map((share) => share * ARROW * view.side);
      const fading = Math.min(Math.max(since / FLASH, 0), 1);
      set(ring, { cx: x, cy: y, r: 10 + 16 * fading, opacity: 1 - fading });
      set(cross, { d: `M${x - 5} ${y - 5}l10 10m0 -10l-10 10` });
      set(push, { d: told && Math.hypot(px, py) >= SHORT ? arrow([x, y], [px, -py]) : "" });
      label.textContent = told ? `${i + 1} ${mark.told}` : String(i + 1);
      const [nx, ny] = mark.at.slice(2).map((part) => (told ? part : -part));
      set(label, beside(x, y, [nx, ny], k * told, WIDE * label.textContent.length, view));
    });
  };
  return { element, draw };
}

// Where a text of a width stands beside a contact, on the side that the surface is on, within the picture.
function beside(x, y, [nx, ny], line, width, view) {
  const shift = Math.abs(nx) > 0.5 ? (-Math.sign(nx) * width) / 2 : 0;
  const room = (value, low, high) => Math.max(Math.min(value, high), low);
  const half = Math.min(width, view.width - 8) / 2;
  const wanted = x - 16 * nx + shift;
  const middle = room(wanted, half + 4, view.width - half - 4);
  const pushed = Math.abs(middle - wanted) > 8 && shift ? 2 * LINE : 0; // back over the mechanism
  const base = y + 22 * ny + 4 + pushed + Math.sign(ny || 1) * LINE * line;
  return { x: middle, y: room(base, LINE, view.height - 4), "text-anchor": "middle" };
}
