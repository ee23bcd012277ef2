// The mechanism in space at a time: what the planar picture shows, turned by dragging.

const FOCUS = 3.2; // distance of the picture from the eye, in halves of its height
const [YAW, PITCH] = [0.6, 0.38]; // of the first view
const STEEPEST = 1.55;
const FILLED = 0.84; // of the picture, by the room
const ARROW_LONG = 0.18; // of a side of the room: the largest force
const SHORTEST_ARROW = 0.01; // of a side that is drawn
const [TURNED, TURNED_BY_KEY] = [0.008, 0.1]; // rad of a pixel, and of a key
const VIEW_KEYS = "drag or a, d, w, s turn; wheel or +, - go nearer and farther";
const FEW = 4; // bodies whose ways are drawn

// The middle of a room and the corners of it.
function cornersOf([x0, x1, y0, y1, z0, z1]) {
  const corners = [x0, x1].flatMap((x) => [y0, y1].flatMap((y) => [z0, z1].map((z) => [x, y, z])));
  return { middle: [(x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2], corners, side: Math.hypot(x1 - x0, y1 - y0, z1 - z0) || 1 };
}

// The camera of a view.
function cameraOf({ yaw, pitch, far, centre }, aspect) {
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  const back = [cp * sy, -cp * cy, sp];
  const right = [cy, sy, 0];
  return { eye: vector.add(centre, back, far), right, up: vector.cross(back, right), back, focus: FOCUS, aspect, far };
}

// The least distance from which a room is seen whole.
function distanceOf({ middle, corners }, view, aspect) {
  const { right, up, back } = cameraOf({ ...view, far: 1, centre: middle }, aspect);
  const needed = corners.map((corner) => {
    const d = vector.add(corner, middle, -1);
    const wide = Math.max(Math.abs(vector.dot(d, right)) / aspect, Math.abs(vector.dot(d, up)));
    return vector.dot(d, back) + (wide * FOCUS) / FILLED;
  });
  return Math.max(...needed);
}

// Colours of the page, which follow its theme, as three shares each.
function coloursOf(element) {
  const style = getComputedStyle(element);
  const read = (name) => [1, 3, 5].map((k) => parseInt(style.getPropertyValue(`--${name}`).trim().slice(k, k + 2), 16) / 255);
  const names = ["card", "line", "muted", "edge", "body", "mass", "hit", "normal", "friction"];
  const colours = Object.fromEntries(names.map((name) => [name, read(name)]));
  const mixed = (a, b, share) => a.map((e, k) => e + share * (b[k] - e));
  const solid = mixed(colours.edge, colours.body, 0.45);
  return { ...colours, solid, input: read("c4"), shadow: [0, 0, 0] };
}

function makeSpace(motion, bounds, clock) {
  const canvas = html("canvas", { role: "img", tabindex: 0, title: VIEW_KEYS });
  const over = svg("svg", { "aria-hidden": "true" });
  const follow = html("input", { type: "checkbox" });
  const again = html("button", { type: "button" }, "first view");
  const scale = html("span", { class: "quiet" });
  const views = html("div", { class: "views" }, html("label", {}, follow, " follow"), again, scale);
  const stage = html("div", { class: "stage" }, canvas, over);
  const root = html("div", { class: "picture space" }, stage, views);
  const painter = glPainter(canvas) ?? flatPainter(canvas);
  if (!painter) stage.replaceChildren(html("p", {}, "This browser draws nothing in space: it has no WebGL."));
  const hits = motion.events.map((event, i) => makeSpaceHit(event, i));
  const names = motion.arrows.map((arrow) => arrowName(motion, arrow));
  const ways = svg("path", { class: "trace" });
  const banner = svg("text", { class: "told halo", x: 8, y: 18 });
  over.append(ways, ...hits.map(({ element }) => element), ...names, banner);
  const view = { yaw: YAW, pitch: PITCH, zoom: 1, far: 1, centre: [0, 0, 0] };
  let [now, width, height] = [0, 1, 1];

  function layout(wide) {
    [width, height] = [wide, Math.min(Math.round(0.75 * wide), MOST_HIGH)];
    const ratio = window.devicePixelRatio || 1;
    set(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
    canvas.style.height = `${height}px`;
    set(over, { viewBox: `0 0 ${width} ${height}`, width, height });
    draw(now);
  }

  function draw(t) {
    now = t;
    if (!painter || width < 2) return;
    const end = Math.min(t, motion.duration);
    const room = cornersOf(bounds());
    const columns = columnsAt(motion, end);
    const values = motion.shapes.map(({ columns: own }) => own.map((k) => columns[k]));
    const first = distanceOf(room, { yaw: YAW, pitch: PITCH }, width / height);
    view.far = first * view.zoom;
    view.centre = follow.checked ? middleOf(motion, values) ?? room.middle : room.middle;
    const camera = cameraOf(view, width / height);
    const to = (p) => seenBy(camera, p, width, height);
    const ground = groundOf(motion, bounds(), room);
    const colours = coloursOf(root);
    const forces = motion.arrows.map((arrow) => forceOf(motion, arrow, values, end, room.side));
    const recent = hits.flatMap((hit) => hit.pushes(t, clock.duration, room.side));
    const arrows = [...forces, ...recent].filter(({ way }) => Math.hypot(...way) > SHORTEST_ARROW * room.side);
    const items = motion.shapes.flatMap((shape, i) => itemsOf(shape, values[i], room.side));
    const above = arrows.flatMap(({ at, way, colour, turns }) => arrowItems(at, way, room.side, colour, turns));
    const walls = motion.shapes.flatMap((shape, i) => (shape.kind === "plane" ? wallOf(values[i], bounds(), ground) : []));
    painter.paint({ camera, items, above, walls, ground, colours });
    set(ways, { d: waysOf(motion, to) });
    names.forEach((name, i) => placeName(name, forces[i], to, room.side));
    hits.forEach((hit) => hit.draw(t, clock.duration, to, { width, height }));
    banner.textContent = toldAt(motion, t, clock.duration);
    scale.textContent = `${motion.unit ? `grid ${tick(ground.step, ground.step)} ${motion.unit}, ` : ""}drag to turn`;
    set(canvas, { "aria-label": spoken(motion, end) });
    Object.assign(canvas.dataset, { yaw: view.yaw, pitch: view.pitch, zoom: view.zoom });
    root.sight = { camera, width, height };
    root.dispatchEvent(new Event("seen"));
  }

  const redraw = () => draw(now);
  moveView(canvas, view, redraw);
  follow.addEventListener("change", redraw);
  again.addEventListener("click", () => {
    Object.assign(view, { yaw: YAW, pitch: PITCH, zoom: 1 });
    redraw();
  });
  const themes = new MutationObserver(redraw);
  themes.observe(document.documentElement, { attributeFilter: ["data-theme"] });
  whenSized(root, layout);
  const close = () => {
    themes.disconnect();
    painter?.close();
  };
  return { element: root, draw, renew: redraw, close };
}

// Drag turns; the wheel, and two fingers, go nearer and farther; so do keys.
function moveView(canvas, view, redraw) {
  const turn = (right, down) => {
    view.yaw -= right;
    view.pitch = Math.min(Math.max(view.pitch + down, -STEEPEST), STEEPEST);
  };
  const held = new Map();
  const apart = () => {
    const [a, b] = [...held.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  const zoomed = (factor) => (view.zoom = Math.min(Math.max(view.zoom * factor, 0.1), 10));
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const last = held.get(event.pointerId);
    if (!last) return;
    const [before, next] = [held.size === 2 ? apart() : 0, [event.clientX, event.clientY]];
    held.set(event.pointerId, next);
    if (held.size === 1) {
      turn(TURNED * (next[0] - last[0]), TURNED * (next[1] - last[1]));
    } else if (before && apart()) {
      zoomed(before / apart());
    }
    redraw();
  });
  for (const end of ["lostpointercapture", "pointercancel"]) canvas.addEventListener(end, (event) => held.delete(event.pointerId));
  canvas.parentElement.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoomed(Math.exp(event.deltaY / 800));
    redraw();
  });
  canvas.addEventListener("keydown", ({ key }) => {
    const turns = { a: [-1, 0], d: [1, 0], w: [0, -1], s: [0, 1] };
    const zooms = { "+": 0.9, "-": 1 / 0.9 };
    if (key in turns) turn(...turns[key].map((e) => TURNED_BY_KEY * e));
    else if (key in zooms) zoomed(zooms[key]);
    else return;
    redraw();
  });
}

const STILL = ["plane", "touch", "force", "torque"];

// The middle of all that moves.
function middleOf(motion, values) {
  const places = motion.shapes.flatMap(({ kind, columns: own }, i) => {
    const moves = own.some((k) => motion.parts.some(({ columns }) => typeof columns[k] !== "number"));
    return STILL.includes(kind) || !moves ? [] : [values[i].slice(0, 3)];
  });
  if (!places.length) return null;
  return [0, 1, 2].map((k) => places.reduce((sum, place) => sum + place[k], 0) / places.length);
}

// The ground: its height, the distance of its lines, and a square on it.
function groundOf(motion, [x0, x1, y0, y1], { middle, side }) {
  const [height, step] = [motion.ground, roundBelow(side / 6)];
  const reach = 0.8 * side;
  const frame = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [middle[0], middle[1], height]];
  const item = { mesh: "cube", frame, size: [2.5 * reach, 2.5 * reach, 1e-6 * side] };
  const [low, high] = [[x0 - side / 4, y0 - side / 4], [x1 + side / 4, y1 + side / 4]];
  const lines = [0, 1].flatMap((k) => multiples(step, low[k], high[k]).map((s) => {
    const ends = [[0, 0, height], [0, 0, height]];
    [ends[0][k], ends[1][k], ends[0][1 - k], ends[1][1 - k]] = [s, s, low[1 - k], high[1 - k]];
    return ends;
  }));
  return { height, step, reach, middle, item, lines };
}

// A wall as far as the room reaches; the ground is none.
function wallOf(values, bounds, ground) {
  const [at, normal] = [values.slice(0, 3), values.slice(3, 6)];
  if (normal[2] > 0.999 && Math.abs(at[2] - ground.height) < 1e-6 * ground.reach) return [];
  const [x, y, z] = upright(at, normal);
  const spans = [x, y].map((axis) => {
    const along = cornersOf(bounds).corners.map((corner) => vector.dot(vector.add(corner, at, -1), axis));
    return [Math.min(...along), Math.max(...along)];
  });
  const middle = spans.map(([low, high]) => (low + high) / 2);
  const o = vector.add(vector.add(at, x, middle[0]), y, middle[1]);
  const size = [...spans.map(([low, high]) => (high - low) / 2 + 0.02 * ground.reach), 0.002 * ground.reach];
  return [{ mesh: "cube", frame: [x, y, z, vector.add(o, z, -size[2])], size, colour: "muted", seen: WALL_SEEN }];
}

// A force, or an input, as it is drawn: from a place along a way.
function forceOf(motion, { panel, curve, shape, kind, largest }, values, t, side) {
  const [at, normal, along] = pointsIn(values[shape]);
  const size = valueAt(motion, motion.panels[panel], motion.panels[panel].curves[curve], t) ?? 0;
  const direction = kind === "T" ? along : normal;
  const way = direction.map((e) => (e * size * ARROW_LONG * side) / (largest || 1));
  const colour = { N: "normal", T: "friction" }[kind] ?? "input";
  return { at, way, colour, turns: motion.shapes[shape].kind === "torque" };
}

function arrowName(motion, { panel, curve, kind }) {
  const { head, tail } = motion.panels[panel].curves[curve].label;
  const element = svg("text", { class: `force halo ${kind}`, "text-anchor": "middle" });
  if (kind === "u" && tail) element.append(head, svg("tspan", { dy: 3, "font-size": "9px" }, tail));
  else element.append(kind === "u" ? head : kind);
  return element;
}

function placeName(element, { at, way }, to, side) {
  const length = Math.hypot(...way);
  element.style.display = length > SHORTEST_ARROW * side ? "" : "none";
  const [x, y] = to(vector.add(at, way, 1 + (0.03 * side) / (length || 1)));
  set(element, { x, y: y + 4 });
}

// The ways of masses, and of the middles of bodies where these are few.
function waysOf(motion, to) {
  const bodies = motion.shapes.filter(({ kind }) => ["block", "sphere", "capsule", "cylinder"].includes(kind));
  const drawn = motion.shapes.filter((shape) => shape.kind === "bob" || (bodies.length <= FEW && bodies.includes(shape)));
  return drawn.flatMap(({ columns: own }) => motion.parts.map(({ times, columns }) => {
    if (own.slice(0, 3).every((k) => typeof columns[k] === "number")) return "";
    return path(times.map((_, k) => to(own.slice(0, 3).map((c) => mixed(columns[c], { k, share: 0 })))));
  })).join("");
}

// A hit: a ring that flashes, its impulse, and its number, which is told for a while.
function makeSpaceHit(event, i) {
  const spots = event.marks.map((mark) => {
    const parts = { ring: svg("circle", { class: "flash" }), cross: svg("path", { class: "mark" }), label: svg("text", { class: "told halo" }) };
    return { mark, ...parts };
  });
  const element = svg("g", {}, ...spots.flatMap(({ ring, cross, label }) => [ring, cross, label]));
  const since = (t, duration) => (t - event.time) / duration;
  const pushes = (t, duration, side) => {
    const told = since(t, duration) >= 0 && since(t, duration) < TOLD;
    const pushed = ({ at, impulse }) => ({ at: at.slice(0, 3), way: impulse.map((p) => p * ARROW_LONG * side), colour: "hit", turns: false });
    return told ? event.marks.map(pushed) : [];
  };
  const draw = (t, duration, to, view) => {
    const passed = since(t, duration);
    element.style.display = passed < 0 ? "none" : "";
    spots.forEach(({ mark, ring, cross, label }, k) => {
      const [x, y] = to(mark.at.slice(0, 3));
      const fading = Math.min(Math.max(passed / FLASH, 0), 1);
      set(ring, { cx: x, cy: y, r: 8 + 16 * fading, opacity: 1 - fading });
      set(cross, { d: `M${x - 4} ${y - 4}l8 8m0 -8l-8 8` });
      const told = passed < TOLD;
      label.textContent = told ? `${i + 1} ${mark.told}` : String(i + 1);
      set(label, beside(x, y, [0, told ? 1 : -1], k * told, WIDE * label.textContent.length, view));
    });
  };
  return { element, draw, pushes };
}
