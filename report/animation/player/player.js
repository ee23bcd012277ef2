// The page: reads the film, shows motions on one clock, and the controls.

const film = JSON.parse(byId("film").textContent);
const clock = makeClock(longest(film.motions));
const PLAY = "M3 1.5v13l11-6.5z";
const PAUSE = "M3 2h4v12H3zM9 2h4v12H9z";
const STEPS = 100; // of the whole time, by the arrows
const FINE = 10; // of a step, with the shift key
let shown = [];

function longest(motions) {
  return Math.max(...motions.map((motion) => motion.duration), 1e-9);
}

// A motion with its picture, its events and its curves.
function makeMotion(motion, all) {
  const alike = (other) => other.bounds.length === motion.bounds.length;
  const make = motion.bounds.length === 6 ? makeSpace : makePicture;
  const picture = make(motion, () => jointBounds(all.filter(alike)), clock);
  const comparable = (panel) => all.flatMap((other) => other.panels.filter((p) => p.title === panel.title && p.unit === panel.unit));
  const panels = motion.panels.map((panel) => makePanel(motion, panel, () => rangeOf(comparable(panel)), clock));
  const events = eventList(motion);
  const left = html("div", { class: "left" }, picture.element, events.element);
  const right = html("div", { class: "right" }, ...panels.map((panel) => panel.element));
  const told = html("p", { class: "quiet" }, summary(motion));
  const element = html("section", { class: "motion", "aria-label": motion.name });
  element.append(html("h2", {}, motion.name), told, html("div", { class: "body" }, left, right));
  const draw = (t) => [picture, events, ...panels].forEach((part) => part.draw(t));
  const renew = () => {
    told.textContent = summary(motion);
    [picture, events, ...panels].forEach((part) => part.renew());
  };
  return { element, picture: picture.element, draw, renew, close: picture.close ?? (() => {}) };
}

function summary(motion) {
  const words = [motion.status];
  if (motion.cost !== null) words.push(`cost ${short(motion.cost)}`);
  words.push(`${short(motion.duration)} s`);
  if (motion.largest) words.push(`longest arrow ${short(motion.largest)} N`);
  return words.filter(Boolean).join(", ");
}

// The events as buttons that go to them.
function eventList(motion) {
  const text = (event, i) => {
    const told = event.told ? `, ${event.told}` : "";
    return `${i + 1}  ${event.word} at ${short(event.time)} s${told}`;
  };
  const items = motion.events.map((event, i) => {
    const button = html("button", { type: "button" }, text(event, i));
    button.addEventListener("click", () => {
      clock.pause();
      clock.seek(event.time);
    });
    return html("li", {}, button);
  });
  const list = html("ul", { class: "events", "aria-label": "events" }, ...items);
  const draw = (t) => {
    const last = before([-1, ...motion.events.map((event) => event.time)], t) - 1;
    items.forEach((item, i) => set(item, { "aria-current": i === last }));
  };
  const renew = () => items.forEach((item, i) => (item.firstChild.textContent = text(motion.events[i], i)));
  return { element: list, draw, renew };
}

function show(motions) {
  const stage = byId("stage");
  shown.forEach((part) => part.close());
  shown = []; // the clock moves: what has been shown draws no more
  clock.stretch(longest(motions));
  shown = motions.map((motion) => makeMotion(motion, motions));
  stage.dataset.count = motions.length > 2 ? "many" : String(motions.length);
  stage.replaceChildren(...shown.map((part) => part.element));
  fit(motions);
}

// Draw the motions that are shown once more: their numbers have changed, their parts have not.
function renew(motions) {
  clock.duration = longest(motions);
  shown.forEach((part) => part.renew());
  fit(motions);
}

function fit(motions) {
  byId("slider").max = clock.duration;
  drawTicks(motions);
  clock.seek(clock.t);
}

// Marks at the events of all motions below the slider.
function drawTicks(motions) {
  const ticks = motions.flatMap((motion) => motion.events).map((event) => {
    const mark = html("i", { title: `${event.word} at ${short(event.time)} s` });
    mark.style.left = `${(100 * event.time) / clock.duration}%`;
    return mark;
  });
  byId("ticks").replaceChildren(...ticks);
}

// What stands in the place of a motion that there is not.
function verdictOf(node) {
  const evidence = node.evidence.map((text) => html("li", {}, text));
  const told = html("p", {}, film.verdicts[node.verdict][1]);
  const list = html("ul", { class: "evidence" }, ...evidence);
  const element = html("section", { class: "motion", id: "verdict", "aria-live": "polite" });
  const proved = node.proved ? [html("p", {}, `${PROVED} ${node.proved}`)] : [];
  element.append(html("h2", {}, badge(node.verdict), node.name), told, ...proved, list);
  return element;
}

function showTree(nodes) {
  const compare = html("input", { type: "checkbox", id: "compare" });
  const best = nodes.find((node) => node.verdict === "optimal" && node.motion !== null);
  let chosen = null;
  const choose = (node) => {
    chosen = node;
    const beside = compare.checked && best && best !== node ? [best] : [];
    const motions = [...beside, node].filter(({ motion }) => motion !== null);
    show(motions.map(({ motion }) => film.motions[motion]));
    byId("stage").prepend(verdictOf(node));
    byId("stage").dataset.count = "1";
    if (beside.length && motions.length > 1) byId("stage").dataset.count = "pair";
  };
  const tree = makeTree(nodes, choose);
  const section = byId("tree");
  section.hidden = false;
  section.append(html("h2", {}, "sequences"), key(nodes));
  if (film.statement) section.append(html("p", { id: "statement" }, film.statement));
  if (best) section.append(html("label", { class: "quiet" }, compare, " beside the best one"));
  section.append(tree.element);
  compare.addEventListener("change", () => choose(chosen));
  document.querySelector("main").classList.add("search");
  tree.pick(best ?? nodes[0]);
}

function icon(d) {
  return svg("svg", { viewBox: "0 0 16 16", "aria-hidden": "true" }, svg("path", { d }));
}

function makeControls() {
  const [play, slider, speed, loop, time] = ["play", "slider", "speed", "loop", "time"].map(byId);
  SPEEDS.forEach((s) => speed.append(html("option", { value: s }, `${s}\u00d7`)));
  speed.value = String(clock.speed);
  speed.addEventListener("change", () => (clock.speed = Number(speed.value)));
  loop.addEventListener("change", () => (clock.loop = loop.checked));
  play.addEventListener("click", toggle);
  byId("back").addEventListener("click", () => step(-1));
  byId("forth").addEventListener("click", () => step(1));
  slider.addEventListener("input", () => {
    const t = Number(slider.value); // pausing sets it to the time of the clock
    clock.pause();
    clock.seek(t);
  });
  let was = null;
  clock.listen(({ t, duration, playing }) => {
    const text = `${written(t, duration, 3)} s`;
    slider.value = t;
    set(slider, { "aria-valuetext": text });
    time.textContent = `${text} of ${written(duration, duration, 3)} s`;
    shown.forEach((part) => part.draw(t));
    if (was === playing) return;
    was = playing;
    play.replaceChildren(icon(playing ? PAUSE : PLAY));
    set(play, { "aria-label": playing ? "pause" : "play", title: playing ? "pause (space)" : "play (space)" });
  });
}

function toggle() {
  if (clock.playing) clock.pause();
  else clock.play();
}

function step(count) {
  clock.pause();
  clock.seek(clock.t + (count * clock.duration) / STEPS);
}

// Space plays and pauses, arrows step, Home and End go to the ends.
function makeKeys() {
  const acts = {
    " ": toggle,
    ArrowLeft: (shift) => step(shift ? -1 / FINE : -1),
    ArrowRight: (shift) => step(shift ? 1 / FINE : 1),
    Home: () => clock.seek(0),
    End: () => clock.seek(clock.duration),
  };
  document.addEventListener("keydown", (event) => {
    const own = event.target.closest("select, summary, button, input:not(#slider)");
    const taken = own && (event.key === " " || own.matches("select, input[type=range]"));
    if (!(event.key in acts) || taken || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    acts[event.key](event.shiftKey);
  });
}

function makeTheme() {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const button = byId("theme");
  let chosen = null;
  const apply = () => {
    const theme = chosen ?? (dark.matches ? "dark" : "light");
    document.documentElement.dataset.theme = theme;
    button.textContent = theme === "dark" ? "light" : "dark";
    set(button, { "aria-label": `${button.textContent} colours` });
  };
  button.addEventListener("click", () => {
    chosen = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    apply();
  });
  dark.addEventListener("change", apply);
  apply();
}

makeTheme();
makeControls();
makeKeys();
if (film.tree.length) showTree(film.tree);
else show(film.motions);
if (!matchMedia("(prefers-reduced-motion: reduce)").matches) clock.play();
