// Elements of the page.  Names of a model are texts everywhere, never markup.

const SVG = "http://www.w3.org/2000/svg";

function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

function svg(name, attributes = {}, ...children) {
  const element = set(document.createElementNS(SVG, name), attributes);
  element.append(...children);
  return element;
}

function html(name, attributes = {}, ...children) {
  const element = set(document.createElement(name), attributes);
  element.append(...children);
  return element;
}

function byId(id) {
  return document.getElementById(id);
}

// A name as mathematics.
function symbol({ head, tail }) {
  return tail ? [head, html("sub", {}, tail)] : [head];
}

// Call with the width of an element, now and whenever it changes.
function whenSized(element, layout) {
  let last = 0;
  new ResizeObserver(() => {
    const width = Math.round(element.clientWidth);
    if (width > 0 && width !== last) layout((last = width));
  }).observe(element);
}

// A path through points, each of two numbers.
function path(points) {
  return points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`).join("");
}
