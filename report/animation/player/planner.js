// The page that plans: numbers are moved, and the solver that the page carries finds the motion again.

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

async function makePlanner(plan, motion) {
  const numbers = plan.numbers.map(({ value }) => value);
  const room = motion.bounds;
  const known = [...plan.coordinates, ...plan.coordinates.map((name) => `${name}_dot`), ...plan.inputs];
  const panels = motion.panels.filter(({ curves }) => curves.every(({ name }) => known.includes(name)));
  const inputs = motion.arrows.filter(({ kind }) => kind === "u");
  motion.arrows = inputs.map((arrow) => ({ ...arrow, panel: panels.indexOf(motion.panels[arrow.panel]) }));
  [motion.panels, motion.largest] = [panels, 0];
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
