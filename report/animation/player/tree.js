// The sequences of a search as a tree of buttons.

const PROVED = "\u220e"; // the end of a proof

function badge(verdict) {
  const element = html("span", { class: "verdict", "aria-hidden": "true" }, film.verdicts[verdict][0]);
  element.style.background = `var(--${verdict})`;
  return element;
}

// The tree of nodes; ``choose`` is called with the node that is clicked.
function makeTree(nodes, choose) {
  const buttons = nodes.map((node) => nodeButton(node, () => pick(node)));
  const lists = new Map();
  const root = html("ul", { role: "tree", "aria-label": "sequences" });
  nodes.forEach((node, i) => {
    const below = html("ul", { role: "group" });
    const item = html("li", { role: "none" }, buttons[i]);
    lists.set(JSON.stringify(node.sequence), { item, below });
    const parent = lists.get(JSON.stringify(node.sequence.slice(0, -1)));
    if (!node.sequence.length || !parent) root.append(item);
    else {
      if (!parent.below.isConnected && !parent.below.parentNode) parent.item.append(parent.below);
      parent.below.append(item);
    }
  });

  function pick(node) {
    buttons.forEach((button, i) => {
      const chosen = nodes[i] === node;
      set(button, { "aria-current": chosen, "aria-selected": chosen, tabindex: chosen ? 0 : -1 });
    });
    choose(node);
  }

  root.addEventListener("keydown", (event) => walk(event, root));
  return { element: html("div", { class: "branches" }, root), pick };
}

function nodeButton(node, act) {
  const [, meaning] = film.verdicts[node.verdict];
  const last = node.sequence[node.sequence.length - 1] ?? node.name;
  const cost = node.cost === null ? "" : ` ${short(node.cost)}`;
  const button = html("button", { type: "button", role: "treeitem", "aria-level": node.sequence.length + 1 });
  const proved = node.proved && `, ${node.proved}`;
  button.append(badge(node.verdict), last + cost + (proved && ` ${PROVED}`));
  set(button, { "aria-label": `${node.name}, ${meaning}${cost ? `, cost${cost}` : ""}${proved}` });
  set(button, { title: `${node.name}: ${meaning}${proved}` });
  button.addEventListener("click", act);
  return button;
}

// Up and down go from one node to the next, left and right to the parent and to the first child.
function walk(event, root) {
  const all = [...root.querySelectorAll("button")];
  const at = all.indexOf(document.activeElement);
  const item = all[at]?.parentElement;
  const goals = {
    ArrowDown: () => all[at + 1],
    ArrowUp: () => all[at - 1],
    ArrowLeft: () => item.parentElement.closest("li")?.querySelector("button"),
    ArrowRight: () => item.querySelector(":scope > ul button"),
    Home: () => all[0],
    End: () => all[all.length - 1],
  };
  if (at < 0 || !(event.key in goals)) return;
  event.preventDefault();
  event.stopPropagation();
  goals[event.key]()?.focus();
}

// What the verdicts are called, with how many there are of each.
function key(nodes) {
  const found = Object.keys(film.verdicts).filter((verdict) => nodes.some((node) => node.verdict === verdict));
  const entries = found.map((verdict) => {
    const count = nodes.filter((node) => node.verdict === verdict).length;
    return html("li", {}, badge(verdict), `${verdict} (${count})`);
  });
  const proved = nodes.filter((node) => node.proved).length;
  if (proved) entries.push(html("li", {}, `${PROVED} proved (${proved})`));
  return html("ul", { class: "key" }, ...entries);
}
