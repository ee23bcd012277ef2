// One clock for everything that moves: a time from 0 to the end, which plays or stands.

const SPEEDS = [0.1, 0.2, 0.5, 1, 2];
const SHORTEST = 3; // seconds that a motion takes on the screen at least, if a speed allows it
const HOLD = 0.4; // seconds that its end stands before it begins again

function makeClock(duration) {
  const listeners = [];
  const clock = { t: 0, duration, playing: false, loop: true, speed: firstSpeed(duration) };
  let last = null;
  let held = 0;
  let request = 0;

  const tell = () => listeners.forEach((listener) => listener(clock));

  function frame(now) {
    const passed = last === null ? 0 : Math.min((now - last) / 1000, 0.25);
    last = now;
    if (clock.t >= clock.duration) {
      held += passed;
      if (!clock.loop) return clock.pause();
      if (held >= HOLD) [clock.t, held] = [0, 0];
    } else {
      clock.t = Math.min(clock.t + passed * clock.speed, clock.duration);
    }
    request = requestAnimationFrame(frame);
    tell();
  }

  clock.listen = (listener) => listeners.push(listener);
  clock.play = () => {
    if (clock.playing) return;
    if (clock.t >= clock.duration) clock.t = 0;
    [clock.playing, last, held] = [true, null, 0];
    request = requestAnimationFrame(frame);
    tell();
  };
  clock.pause = () => {
    cancelAnimationFrame(request);
    clock.playing = false;
    tell();
  };
  clock.seek = (t) => {
    clock.t = Math.min(Math.max(t, 0), clock.duration);
    held = 0;
    tell();
  };
  clock.stretch = (end) => {
    clock.duration = end;
    clock.seek(Math.min(clock.t, end));
  };
  return clock;
}

// The fastest speed, up to that of the motion itself, at which a motion can be followed.
function firstSpeed(duration) {
  const slow = SPEEDS.filter((speed) => speed <= 1 && duration / speed >= SHORTEST);
  return slow.length ? Math.max(...slow) : SPEEDS[0];
}
