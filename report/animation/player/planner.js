// The page that plans: numbers are moved, and the solver that the page carries finds the motion again.

const TRIED = 1e-5; // by which a place is moved to see what follows
const FOLLOWING = 4; // steps of Newton's method for what is dragged
const AROUND = 0.05; // around a motion that leaves the room of the picture, in shares of it

// The solver, as the page carries it.
async function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const plain = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return WebAssembly.compile(await new Response(plain).arrayBuffer());
}

// A solver beside the page.  Of the numbers that come while it works, it takes the last.
function makeSolver(module, { worker: text }, answered, failed) {
  const worker = new Worker(URL.createObjectURL(new Blob([text], { type: "text/javascript" })));
  let [busy, next] = [true, null];
  const send = () => {
    worker.postMessage(next);
    [busy, next] = [true, null];
  };
  worker.onerror = failed;
  worker.onmessage = ({ data }) => {
    busy = false;
    if (next) send();
    if (data) answered(data);
  };
  worker.postMessage(module);
  return (numbers) => {
    next = Float64Array.from(numbers);
    if (!busy) send();
  };
}

// The drawing of the model, by its own code: columns at rows of positions and times.
async function makeDrawing(module, { columns }) {
  const { exports } = await WebAssembly.instantiate(module, { page: { seconds: () => 0 } });
  exports._initialize?.();
  const put = (at, numbers) => new Float64Array(exports.memory.buffer, at, numbers.length).set(numbers);
  return (positions, times, parameters) => {
    put(exports.positions(), positions.flat());
    put(exports.moments(), times);
    put(exports.parameters(), parameters);
    const flat = new Float64Array(exports.memory.buffer, exports.draw(times.length), times.length * columns);
    return times.map((_, k) => Array.from(flat.subarray(k * columns, (k + 1) * columns)));
  };
}

// Slopes of rows over their places: those of the parabola through three of them.
function slopesOf(s, rows) {
  if (s.length < 3) return rows.map(() => rows[1].map((end, j) => (end - rows[0][j]) / (s[1] - s[0])));
  return rows.map((_, k) => {
    const a = Math.min(Math.max(k - 1, 0), s.length - 3);
    const [p, q, r] = [s[a], s[a + 1], s[a + 2]];
    const share = [
      (2 * s[k] - q - r) / ((p - q) * (p - r)),
      (2 * s[k] - p - r) / ((q - p) * (q - r)),
      (2 * s[k] - p - q) / ((r - p) * (r - q)),
    ];
    return rows[a].map((_, j) => share[0] * rows[a][j] + share[1] * rows[a + 1][j] + share[2] * rows[a + 2][j]);
  });
}

// Cubics between rows, with their slopes, in so many parts: places and rows.
function finely(s, rows, slopes, parts) {
  const [places, fine] = [[], []];
  for (let k = 0; k + 1 < s.length; k += 1) {
    const width = s[k + 1] - s[k];
    for (let i = 0; i < parts; i += 1) {
      const c = i / parts;
      places.push(s[k] + c * width);
      fine.push(rows[k].map((begin, j) => {
        const along = (1 - c) * slopes[k][j] - c * slopes[k + 1][j];
        return begin + c * c * (3 - 2 * c) * (rows[k + 1][j] - begin) + width * c * (1 - c) * along;
      }));
    }
  }
  return [[...places, s[s.length - 1]], [...fine, rows[rows.length - 1]]];
}

const column = (rows, j) => rows.map((row) => row[j]);

// The phases of an answer: times and rows of places, velocities, inputs, and places that are near.
function phasesOf(plan, { unknowns, times }) {
  const read = (rows) => rows.map((row) => row.map((k) => unknowns[k]));
  return plan.phases.map(({ shares, places, parts, inputs }, i) => {
    const begin = times[plan.nodes[i]];
    const length = times[plan.nodes[i + 1]] - begin;
    const at = (s) => s.map((share) => begin + share * length);
    const q = read(places);
    const slopes = slopesOf(shares, q);
    const [near, fine] = finely(shares, q, slopes, parts);
    const v = slopes.map((row) => row.map((slope) => slope / length));
    return { begin, t: at(shares), v, near: at(near), fine, moments: at(inputs.shares), u: read(inputs.rows) };
  });
}

// Curves of an answer by their names: times and values in each phase.
function curvesOf(plan, phases) {
  const curves = new Map();
  const add = (name, times, rows, j) => {
    curves.set(name, { times: phases.map((p) => p[times]), values: phases.map((p) => column(p[rows], j)) });
  };
  plan.coordinates.forEach((name, j) => {
    add(name, "near", "fine", j);
    add(`${name}_dot`, "t", "v", j);
  });
  plan.inputs.forEach((name, j) => add(name, "moments", "u", j));
  return curves;
}

// What is told of the impulses of a contact.
function impulsesTold(name, [normal, friction], named) {
  const whose = named ? ` of ${name}` : "";
  const parts = [["impulse", normal], ["friction", friction]].filter(([, size]) => size);
  return parts.map(([what, size]) => `${what} ${short(size)}${whose}`).join(", ");
}

// Put what happens at the events into them; rows are those of the drawing where each phase ends.
function tellEvents(motion, plan, ends, { unknowns, times }) {
  const impulses = plan.events.map(({ contacts }) =>
    new Map(contacts.map(([name, ...at]) => [name, at.map((k) => (k < 0 ? 0 : unknowns[k]))])),
  );
  const largest = Math.max(...impulses.flatMap((own) => [...own.values()].flat().map(Math.abs)), 0) || 1;
  motion.events.forEach((event, i) => {
    const named = plan.events[i].named;
    event.time = times[plan.nodes[i + 1]];
    event.told = [...impulses[i]].map(([name, own]) => impulsesTold(name, own, named)).filter(Boolean).join(", ");
    for (const mark of event.marks) {
      const [normal, friction] = impulses[i].get(mark.contact) ?? [0, 0];
      const shape = motion.shapes.find(({ kind, name }) => kind === "contact" && name === mark.contact);
      mark.at = shape.columns.map((k) => ends[i][k]);
      const [nx, ny] = mark.at.slice(2);
      mark.impulse = [normal * nx + friction * ny, normal * ny - friction * nx].map((p) => p / largest);
      const own = event.word.split(" ").filter((word) => word.replace(/^[+-]+/, "").split(":")[0] === mark.contact);
      const words = own.length ? own : [mark.contact];
      mark.told = [...words, impulsesTold(mark.contact, [normal, friction], false)].filter(Boolean).join(" ");
    }
  });
}

// The room of a motion, at least that which the page begins with.
function widened([left, right, bottom, top], motion) {
  const room = [left, right, bottom, top];
  const [dx, dy] = [AROUND * (right - left), AROUND * (top - bottom)];
  for (const { kind, columns: own } of motion.shapes) {
    if (kind === "wall" || kind === "contact") continue;
    const points = kind === "link" || kind === "spring" ? own.length / 2 : 1;
    for (const { columns } of motion.parts) {
      for (let k = 0; k < 2 * points; k += 2) {
        for (const x of columns[own[k]]) [room[0], room[1]] = [Math.min(room[0], x - dx), Math.max(room[1], x + dx)];
        for (const y of columns[own[k + 1]]) [room[2], room[3]] = [Math.min(room[2], y - dy), Math.max(room[3], y + dy)];
      }
    }
  }
  return room;
}

// Put an answer into the motion that is shown.
function tellMotion(motion, plan, answer, draw, numbers) {
  const phases = phasesOf(plan, answer);
  const rows = draw(phases.flatMap((p) => p.fine), phases.flatMap((p) => p.near), parametersOf(plan, numbers, answer));
  let first = 0;
  const scenes = phases.map((p) => rows.slice(first, (first += p.near.length)));
  const curves = curvesOf(plan, phases);
  motion.cost = answer.cost;
  motion.duration = answer.times[answer.times.length - 1];
  motion.starts = phases.map((p) => p.begin);
  motion.parts = phases.map((p, i) => ({ times: p.near, columns: rows[0].map((_, k) => column(scenes[i], k)) }));
  tellEvents(motion, plan, scenes.map((scene) => scene[scene.length - 1]), answer);
  for (const panel of motion.panels) {
    panel.times = curves.get(panel.curves[0].name).times;
    for (const curve of panel.curves) curve.values = curves.get(curve.name).values;
  }
  plan.numbers.forEach(({ name }, i) => {
    const [field, what, side] = name.split(".");
    const own = motion.panels.flatMap((panel) => panel.curves).find((curve) => curve.name === what);
    if (field === "bounds" && own) own[side] = numbers[i];
  });
}

function parametersOf(plan, numbers, { unknowns }) {
  return plan.parameters.map(({ value, number, unknown }) => {
    if (unknown >= 0) return unknowns[unknown];
    return number >= 0 ? numbers[number] : value;
  });
}

// Sliders of the numbers, in their groups; ``moved`` is called when one has been.
function makeNumbers(plan, numbers, moved) {
  const groups = new Map(plan.groups.map((group) => [group, html("fieldset", {}, html("legend", {}, group))]));
  const rows = plan.numbers.map(({ group, words, label, unit, low, high }, i) => {
    const slider = html("input", { type: "range", name: plan.numbers[i].name, min: low, max: high, step: "any" });
    slider.value = numbers[i];
    const value = html("output");
    const name = html("span", { class: "names" }, words, ...(label ? symbol(label) : []), unit ? ` [${unit}]` : "");
    set(slider, { "aria-label": `${group} ${name.textContent}` });
    slider.addEventListener("input", () => {
      numbers[i] = Number(slider.value);
      write();
      moved();
    });
    const write = () => {
      value.textContent = written(numbers[i], high - low);
      if (Number(slider.value) === numbers[i]) return;
      set(slider, { min: Math.min(slider.min, numbers[i]), max: Math.max(slider.max, numbers[i]) });
      slider.value = numbers[i];
    };
    groups.get(group).append(html("label", {}, name, slider, value));
    return write;
  });
  const again = html("button", { type: "button", id: "again" }, "reset");
  again.addEventListener("click", () => {
    plan.numbers.forEach(({ value }, i) => (numbers[i] = value));
    write();
    moved();
  });
  const write = () => rows.forEach((row) => row());
  write();
  const filled = [...groups.values()].filter((group) => group.querySelector("input"));
  return { element: html("form", { class: "numbers", "aria-label": "numbers" }, ...filled), again, write };
}

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

async function makePlanner(plan, motion) {
  const numbers = plan.numbers.map(({ value }) => value);
  const room = motion.bounds;
  const known = [...plan.coordinates, ...plan.coordinates.map((name) => `${name}_dot`), ...plan.inputs];
  motion.panels = motion.panels.filter(({ curves }) => curves.every(({ name }) => known.includes(name)));
  [motion.arrows, motion.largest] = [[], 0];
  show([motion]);
  const told = html("p", { id: "planned", role: "status" }, "the solver begins");
  let [last, sent, held, playing] = [null, 0, null, false];
  let place = () => {};

  const ask = () => {
    sent = performance.now();
    solve(numbers);
  };
  const sliders = makeNumbers(plan, numbers, ask);
  const head = html("div", { class: "planned" }, told, sliders.again);
  const attach = () => byId("stage").querySelector(".left").append(head, sliders.element);
  attach();

  // The columns of the drawing where the motion begins or ends, with one number moved.
  const places = (end, moved = -1, more = 0) => {
    const changed = numbers.map((value, i) => (i === moved ? value + more : value));
    const at = end === "start" ? 0 : last.ends.length - 1;
    const q = plan.coordinates.map((name, j) => {
      const i = plan.numbers.findIndex((number) => number.name === `${end}.${name}`);
      return i < 0 ? last.ends[at][j] : changed[i];
    });
    return draw([q], [end === "start" ? 0 : motion.duration], parametersOf(plan, changed, last))[0];
  };

  // While a handle is held, the motion stands at its end, and the room stays as it is.
  const drag = (handle, goal) => {
    if (handle === null) {
      held = null;
      motion.bounds = widened(room, motion);
      renew([motion]);
      place();
      if (playing) clock.play();
    } else if (held === null) {
      [held, playing] = [handle, clock.playing];
      clock.pause();
      clock.seek(handle.end === "start" ? 0 : clock.duration);
    } else if (goal) {
      follow(handle, goal, numbers, places);
      sliders.write();
      place();
      ask();
    }
  };

  const answered = (answer) => {
    const none = !answer.solved;
    told.classList.toggle("none", none);
    byId("stage").classList.toggle("none", none);
    if (none) {
      const whose = answer.wrong < 0 ? "" : `${plan.numbers[answer.wrong].name}: expected `;
      told.textContent = `no motion: ${whose}${answer.told}`;
    } else {
      const first = last === null;
      const { phases } = plan;
      const rows = [phases[0].places[0], phases[phases.length - 1].places.at(-1)];
      last = { ...answer, ends: rows.map((row) => row.map((k) => answer.unknowns[k])) };
      if (first) for (const shape of motion.shapes) shape.columns = plan.shapes[motion.shapes.indexOf(shape)];
      tellMotion(motion, plan, answer, draw, numbers);
      if (!held) motion.bounds = widened(room, motion);
      told.textContent = `planned in ${answer.ms.toFixed(1)} ms, ${answer.iterations} iterations`;
      if (first) begin();
      else renew([motion]);
      if (held) clock.seek(held.end === "start" ? 0 : clock.duration);
    }
    place();
    Object.assign(told.dataset, { count: Number(told.dataset.count ?? 0) + 1, ms: answer.ms });
    told.dataset.latency = performance.now() - sent;
  };

  const begin = () => {
    show([motion]);
    attach();
    const root = byId("stage").querySelector(".picture");
    place = makeHandles(handlesOf(plan, motion, places), root, places, drag);
    whenSized(root, () => place());
  };

  const failed = () => (told.textContent = "no motion: this browser does not run the solver of the page");
  let [draw, solve] = [null, () => {}];
  try {
    const module = await unpacked(plan.solver);
    draw = await makeDrawing(module, plan);
    solve = makeSolver(module, plan, answered, failed);
    ask();
  } catch {
    failed();
  }
}

makePlanner(film.plan, film.motions[0]);
