// Beside a page that plans: its solver, which gets numbers and returns motions.

let solver = null;

function textAt(at) {
  const bytes = new Uint8Array(solver.memory.buffer, at);
  return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
}

onmessage = async ({ data }) => {
  if (!solver) {
    const page = { seconds: () => performance.now() / 1000 };
    solver = (await WebAssembly.instantiate(data, { page })).exports;
    solver._initialize?.();
    postMessage(null);
    return;
  }
  const array = (at, size) => new Float64Array(solver.memory.buffer, at, size);
  const begin = performance.now();
  array(solver.numbers(), data.length).set(data);
  const status = solver.solve();
  postMessage({
    solved: status === 0,
    ms: performance.now() - begin,
    told: textAt(solver.sentence(status)),
    wrong: solver.wrong(),
    cost: solver.cost(),
    iterations: solver.iterations(),
    unknowns: array(solver.unknowns(), solver.size()).slice(),
    times: array(solver.times(), solver.nodes()).slice(),
  });
};
