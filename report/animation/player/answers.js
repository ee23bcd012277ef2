// Answers of the solver, put into the motion that is shown.

const AROUND = 0.05; // around a motion that leaves the room of the picture, in shares of it

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
      const contacts = motion.shapes.filter(({ kind }) => kind === "contact" || kind === "touch");
      mark.at = contacts.find(({ name }) => name === mark.contact).columns.map((k) => ends[i][k]);
      mark.impulse = impulseAt(mark.at, normal, friction).map((p) => p / largest);
      const own = event.word.split(" ").filter((word) => word.replace(/^[+-]+/, "").split(":")[0] === mark.contact);
      const words = own.length ? own : [mark.contact];
      mark.told = [...words, impulsesTold(mark.contact, [normal, friction], false)].filter(Boolean).join(" ");
    }
  });
}

// An impulse in the plane, with friction along the normal turned clockwise, or in space.
function impulseAt(at, normal, friction) {
  if (at.length === 6) return at.slice(3).map((e) => normal * e);
  const [nx, ny] = at.slice(2);
  return [normal * nx + friction * ny, normal * ny - friction * nx];
}

// The room of a motion, at least that which the page begins with.
function widened(first, motion) {
  const room = [...first];
  const size = room.length / 2; // of a place
  for (const { kind, columns: own } of motion.shapes) {
    if (["wall", "contact", "plane", "touch"].includes(kind)) continue;
    const count = ["link", "spring", "rod", "coil"].includes(kind) ? own.length : size;
    for (const { columns } of motion.parts) {
      for (let k = 0; k < count; k += 1) {
        const low = 2 * (k % size);
        const beyond = AROUND * (first[low + 1] - first[low]);
        for (const x of columns[own[k]]) {
          [room[low], room[low + 1]] = [Math.min(room[low], x - beyond), Math.max(room[low + 1], x + beyond)];
        }
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
