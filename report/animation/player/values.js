// Values of a motion at a time, and how they are written.

// The last position in a sorted list whose entry is not above t; 0 where all are.
function before(times, t) {
  let low = 0;
  let high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t) low = middle;
    else high = middle - 1;
  }
  return low;
}

// Position and share of the interval of a time in a sorted list.
function spot(times, t) {
  const k = Math.min(before(times, t), times.length - 2);
  if (k < 0) return { k: 0, share: 0 };
  const width = times[k + 1] - times[k];
  return { k, share: width > 0 ? Math.min(Math.max((t - times[k]) / width, 0), 1) : 1 };
}

function mixed(values, { k, share }) {
  if (typeof values === "number") return values;
  return share ? values[k] + share * (values[k + 1] - values[k]) : values[k];
}

// The phase that a time lies in; at an event the one after it.
function phaseAt(motion, t) {
  return before(motion.starts, t);
}

// The columns of the scene of a motion at a time.
function columnsAt(motion, t) {
  const part = motion.parts[phaseAt(motion, t)];
  const where = spot(part.times, t);
  return part.columns.map((column) => mixed(column, where));
}

// The value of a curve of a panel at a time, or null where it has none.
function valueAt(motion, panel, curve, t) {
  const phase = phaseAt(motion, t);
  const values = curve.values[phase];
  return values === null ? null : mixed(values, spot(panel.times[phase], t));
}

const MINUS = "\u2212";

// A number with as many decimals as a range of values asks for.
function written(value, range, digits = 4) {
  const size = range > 0 ? Math.ceil(Math.log10(range)) : 1;
  const decimals = Math.min(Math.max(digits - size, 0), 12);
  if (size > 7 || size < -6) return value.toExponential(3).replaceAll("-", MINUS);
  const text = value.toFixed(decimals);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", MINUS);
}

// Round numbers between two values, about so many, and two at least.
function rounds(low, high, count) {
  const span = high - low;
  if (!(span > 0)) return [low];
  const raw = span / Math.max(count, 1);
  const power = 10 ** Math.floor(Math.log10(raw));
  const steps = [1, 2, 5, 10].map((k) => k * power);
  const first = steps.findIndex((step) => step >= raw * 0.999);
  const found = multiples(steps[first], low, high);
  return found.length > 1 || first === 0 ? found : multiples(steps[first - 1], low, high);
}

// What of the multiples of a step lies between two values.
function multiples(step, low, high) {
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * (high - low); k += 1) found.push(k * step);
  return found;
}

// The largest round number that is not above a value.
function roundBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].map((k) => k * power).find((s) => s <= value * 1.001);
}

// A round number as it stands on an axis.
function tick(value, step) {
  const size = Math.max(Math.abs(value), Math.abs(step));
  if (size >= 1e6 || Math.abs(step) < 1e-5) return value.toExponential(1).replaceAll("-", MINUS);
  const decimals = Math.max(0, -Math.floor(Math.log10(Math.abs(step) || 1) + 1e-9));
  return (Math.abs(value) < 1e-9 * Math.abs(step) ? 0 : value).toFixed(decimals).replace("-", MINUS);
}

// Four digits of a number, for texts.
function short(value) {
  return String(Number(value.toPrecision(4))).replaceAll("-", MINUS);
}
