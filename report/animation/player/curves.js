// Panels of curves over time, with a cursor that shows the time and can be dragged.

const HIGH = 150;
const LEFT = 52;
const RIGHT = 10;
const TOP = 8;
const BOTTOM = 20;
const FAR = 1; // a bound further from the curves than this many times their range is not drawn
const FAR_FORCE = 5; // nor are limits of friction above this many times the largest force
const DASHES = ["", "7 3", "2 3", "9 3 2 3", "5 5", "12 4", "2 5"];

// The colour of a curve by its number, as in figures, and its stroke by its place in the panel.
function style(name, curve, i = 0) {
  return { class: `${name} s${curve.number % 7}`, "stroke-dasharray": DASHES[(i + Math.floor(i / 7)) % 7] };
}

// The least and the largest value of panels that are compared, with bounds that are near.
function rangeOf(panels) {
  const curves = panels.flatMap((panel) => panel.curves);
  const values = curves.flatMap((curve) => curve.values.filter((part) => part !== null).flat());
  let low = values.reduce((a, b) => Math.min(a, b), Infinity);
  let high = values.reduce((a, b) => Math.max(a, b), -Infinity);
  const span = high - low || Math.abs(high) || 1;
  const [least, most] = [low - FAR * span, high + FAR * span];
  const farthest = FAR_FORCE * Math.max(Math.abs(low), Math.abs(high));
  const limits = curves.flatMap((curve) => curve.limits.filter((part) => part !== null).flat());
  const bounds = curves.flatMap((curve) => [curve.low, curve.high]);
  const near = bounds.filter((bound) => bound !== null && bound >= least && bound <= most);
  near.push(...limits.filter((limit) => limit <= farthest).flatMap((limit) => [-limit, limit]));
  for (const bound of near) [low, high] = [Math.min(low, bound), Math.max(high, bound)];
  const room = 0.06 * (high - low) || Math.abs(high) * 0.1 || 1;
  return [low - room, high + room];
}

function makePanel(motion, panel, ranging, clock) {
  const root = svg("svg", { class: "panel", height: HIGH, role: "img" });
  const still = svg("g");
  const cursor = svg("line", { class: "cursor", y1: TOP, y2: HIGH - BOTTOM });
  const dots = panel.curves.map((curve) => svg("circle", { ...style("dot", curve), r: 4 }));
  root.append(still, cursor, ...dots);
  const values = panel.curves.map(() => html("output"));
  const axes = { width: 0, x: () => 0, y: () => 0 };
  const unit = panel.unit ? ` ${panel.unit}` : "";
  let [low, high] = ranging();
  let now = 0;

  function layout(width) {
    [low, high] = ranging();
    axes.width = width;
    axes.y = (v) => TOP + ((high - v) / (high - low)) * (HIGH - TOP - BOTTOM);
    axes.x = (t) => LEFT + (t / clock.duration) * (width - LEFT - RIGHT);
    set(root, { viewBox: `0 0 ${width} ${HIGH}` });
    still.replaceChildren(...grid(axes, [low, high], clock.duration), ...eventLines(motion, axes));
    panel.curves.forEach((curve, i) => still.append(strokes(panel, curve, i, axes)));
    draw(now);
  }

  function draw(t) {
    now = t;
    const end = Math.min(t, motion.duration);
    const x = axes.x(end);
    set(cursor, { x1: x, x2: x });
    panel.curves.forEach((curve, i) => {
      const value = valueAt(motion, panel, curve, end);
      dots[i].style.display = value === null ? "none" : "";
      if (value !== null) set(dots[i], { cx: x, cy: axes.y(value) });
      values[i].textContent = value === null ? "\u2013" : written(value, high - low) + unit;
    });
  }

  drags(root, (x) => {
    const box = root.getBoundingClientRect();
    const share = (x - box.left - LEFT) / (axes.width - LEFT - RIGHT);
    clock.pause();
    clock.seek(share * clock.duration);
  });
  whenSized(root, layout);
  const title = panel.title + (panel.unit ? ` [${panel.unit}]` : "");
  set(root, { "aria-label": `${title} of ${motion.name} over time; drag to set the time` });
  const body = html("details", { open: "" }, html("summary", {}, title), root, legend(panel, values));
  return { element: body, draw, renew: () => axes.width && layout(axes.width) };
}

// Names of the curves with their strokes, and the values at the cursor.
function legend(panel, values) {
  const entries = panel.curves.map((curve, i) => {
    const stroke = svg("path", { ...style("curve", curve, i), d: "M0 4H28" });
    const swatch = svg("svg", { viewBox: "0 0 28 8", "aria-hidden": "true" }, stroke);
    const name = html("span", { "aria-label": curve.name }, ...symbol(curve.label));
    return html("li", {}, swatch, name, " = ", values[i]);
  });
  return html("ul", { class: "legend" }, ...entries);
}

function grid(axes, [low, high], duration) {
  const drawn = [];
  const steps = rounds(low, high, 4);
  for (const value of steps) {
    const y = axes.y(value);
    const step = steps.length > 1 ? steps[1] - steps[0] : value;
    const kind = Math.abs(value) < 1e-9 * (high - low) ? "zero" : "grid";
    const label = svg("text", { class: "quiet", x: LEFT - 6, y: y + 4, "text-anchor": "end" });
    label.textContent = tick(value, step);
    drawn.push(svg("line", { class: kind, x1: LEFT, x2: axes.width - RIGHT, y1: y, y2: y }), label);
  }
  const times = rounds(0, duration, Math.max(axes.width / 110, 2));
  for (const t of times) {
    const label = svg("text", { class: "quiet", x: axes.x(t), y: HIGH - 5, "text-anchor": "middle" });
    label.textContent = tick(t, times[1]) + (t === 0 ? " s" : "");
    drawn.push(label);
  }
  const width = axes.width - LEFT - RIGHT;
  drawn.push(svg("rect", { class: "frame", x: LEFT, y: TOP, width, height: HIGH - TOP - BOTTOM }));
  return drawn;
}

function eventLines(motion, axes) {
  return motion.events.map(({ time }) => {
    const x = axes.x(time);
    return svg("line", { class: "when", x1: x, x2: x, y1: TOP, y2: HIGH - BOTTOM });
  });
}

// The strokes of a curve, cut off at the frame: its phases, dotted jumps between them, bounds and limits.
function strokes(panel, curve, i, axes) {
  const drawn = [];
  const line = (name, d, place) => drawn.push(svg("path", { ...style(name, curve, place), d }));
  const seen = (v) => v !== null && axes.y(v) >= TOP && axes.y(v) <= HIGH - BOTTOM;
  for (const bound of [curve.low, curve.high]) {
    if (seen(bound)) line("limit", path([[LEFT, axes.y(bound)], [axes.width - RIGHT, axes.y(bound)]]));
  }
  curve.limits.forEach((limits, phase) => {
    for (const sign of limits === null || !limits.some((v) => seen(v)) ? [] : [1, -1]) {
      line("limit", path(limits.map((v, k) => [axes.x(panel.times[phase][k]), axes.y(sign * v)])));
    }
  });
  let end = null;
  curve.values.forEach((values, phase) => {
    if (values === null) {
      end = null;
      return;
    }
    const points = values.map((v, k) => [axes.x(panel.times[phase][k]), axes.y(v)]);
    if (end !== null) line("jump", path([end, points[0]]));
    line("curve", path(points), i);
    end = points[points.length - 1];
  });
  const room = { x: LEFT, y: TOP, width: axes.width - LEFT - RIGHT, height: HIGH - TOP - BOTTOM };
  return svg("svg", { ...room, viewBox: Object.values(room).join(" ") }, ...drawn);
}

// Call with the place of the pointer while it is pressed on an element.
function drags(element, move) {
  element.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    element.setPointerCapture(event.pointerId);
    move(event.clientX);
  });
  element.addEventListener("pointermove", (event) => {
    if (element.hasPointerCapture(event.pointerId)) move(event.clientX);
  });
}
