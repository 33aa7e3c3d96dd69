"use strict";
// The page: what is drawn, what is dragged, what is read off. The numbers are those of engine.js.

// A picture of states by the names of the coordinates: `parts` gives lines and bobs in units of length, `take` the coordinates that put a
// bob at a point; none of it where nothing but curves over time is known.
function pictureOf(data) {
  const n = data.columns.length / 2, names = data.columns.slice(0, n);
  const constant = (symbol) => ((data.exact && data.exact.parameters) || []).find((p) => p.symbol === symbol);
  const angles = names.every((name, i) => data.periodic[i] && /^(theta|phi|angle|q)\d*$/.test(name));
  if (angles && data.time_like === null) {
    const rods = (values) => names.map((_, i) => {
      const found = constant(`l${i + 1}`) || constant("l");
      return found ? values[found.symbol] : 1;
    });
    const joints = (q, values) => {
      let [x, y] = [0, 0];
      return [[0, 0]].concat(rods(values).map((l, i) => [(x += l * Math.sin(q[i])), (y -= l * Math.cos(q[i]))]));
    };
    return {
      reach: (values) => 1.1 * rods(values).reduce((a, b) => a + b, 0),
      joints,
      lines: true,
      take: (q, k, [x, y], values) => {
        const [px, py] = joints(q, values)[k - 1];
        return q.map((old, i) => (i === k - 1 ? near(Math.atan2(x - px, py - y), old) : old));
      },
    };
  }
  const place = (name) => names.indexOf(name);
  const [r, turn] = [place("r"), Math.max(place("theta"), place("phi"), place("angle"))];
  if (place("theta") >= 0 && place("phi") >= 0 && r < 0 && n === 2) {
    const [a, b] = [place("theta"), place("phi")], tilt = 0.5;
    return {
      reach: () => 1.15,
      globe: true,
      joints: (q) => {
        const [s, c] = [Math.sin(q[a]), Math.cos(q[a])], [x, y] = [s * Math.cos(q[b]), s * Math.sin(q[b])];
        return [[0, 0], [y, c * Math.cos(tilt) - x * Math.sin(tilt)]];
      },
      take: (q, k, [x, y]) => {
        const z = Math.sqrt(Math.max(0, 1 - x * x - y * y));
        const up = y * Math.cos(tilt) + z * Math.sin(tilt), ahead = z * Math.cos(tilt) - y * Math.sin(tilt);
        const next = q.slice();
        next[a] = Math.acos(Math.max(-0.999, Math.min(0.999, up)));
        next[b] = near(Math.atan2(x, ahead), q[b]);
        return next;
      },
    };
  }
  if (r >= 0) {
    const angle = place("phi") >= 0 ? place("phi") : turn, hangs = names[angle] === "theta" || names[angle] === "angle";
    const far = data.ranges.position[r][1];
    const hole = (values) => (data.time_like !== null && values.M > 0 ? values.M + Math.sqrt(Math.max(0, values.M ** 2 - (values.a || 0) ** 2)) : 0);
    return {
      reach: () => 1.15 * far,
      hole,
      lines: hangs,
      joints: (q) => {
        const at = angle >= 0 ? q[angle] : 0;
        return [[0, 0], hangs ? [q[r] * Math.sin(at), -q[r] * Math.cos(at)] : [q[r] * Math.cos(at), q[r] * Math.sin(at)]];
      },
      take: (q, k, [x, y]) => {
        const next = q.slice();
        next[r] = Math.hypot(x, y);
        if (angle >= 0) next[angle] = near(hangs ? Math.atan2(x, -y) : Math.atan2(y, x), q[angle]);
        return next;
      },
    };
  }
  const space = names.map((_, i) => i).filter((i) => i !== data.time_like && !data.periodic[i]);
  if (space.length >= 1 && names.every((_, i) => !data.periodic[i])) {
    const [a, b] = space, size = (i) => (i === undefined ? 0 : Math.max(...data.ranges.position[i].map(Math.abs)));
    return {
      reach: () => 1.2 * Math.max(size(a), size(b)),
      lines: b === undefined,
      joints: (q) => [[0, 0], [q[a], b === undefined ? 0 : q[b]]],
      take: (q, k, [x, y]) => q.map((old, i) => (i === a ? x : i === b ? y : old)),
    };
  }
  return null;
}

// The angle of the same direction that is nearest to another.
function near(angle, other) {
  return angle + 2 * Math.PI * Math.round((other - angle) / (2 * Math.PI));
}

function play(data) {
  const n = data.columns.length / 2, $ = (id) => document.getElementById(id);
  const { learned, exact } = load(data), picture = pictureOf(data);
  const values = Object.fromEntries(((data.exact && data.exact.parameters) || []).map((p) => [p.symbol, p.value]));
  const kinds = [["learned", learned]].concat(exact ? [["exact", exact]] : []);
  const start = { q: data.start.q.slice(), v: data.start.v.slice() };
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const digits = (x) => (Number.isFinite(x) ? Number(x.toPrecision(4)).toString() : "no number");
  let flights, paths, running = false, last = 0, dragged = 0, speed = 1, reading = null;

  function reset() {
    flights = kinds.map(([, motion]) => new Flight(motion, start.q, start.v, data.span / 1000));
    paths = kinds.map(([, motion], k) => [{ t: 0, y: flights[k].y, energy: motion.terms(start.q, start.v).energy }]);
    draw();
  }

  function advance(seconds) {
    const until = flights.reduce((t, f) => Math.min(t, f.ended ? Infinity : f.t), Infinity) + seconds * data.rate * speed;
    flights.forEach((flight, k) => {
      if (flight.ended) return;
      flight.advance(until, 120);
      const y = flight.y, terms = kinds[k][1].terms(y.slice(0, n), y.slice(n));
      paths[k].push({ t: flight.t, y, energy: terms.energy });
      if (paths[k].length > 4000) paths[k].splice(1, 1000);
    });
    if (flights.every((flight) => flight.ended)) running = false;
  }

  // A canvas in pixels of the screen, cleared.
  function sheet(canvas) {
    const scale = window.devicePixelRatio || 1, { clientWidth: width, clientHeight: height } = canvas;
    if (canvas.width !== Math.round(width * scale)) canvas.width = Math.round(width * scale);
    if (canvas.height !== Math.round(height * scale)) canvas.height = Math.round(height * scale);
    const pen = canvas.getContext("2d");
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = "13px system-ui, sans-serif";
    return { pen, width, height };
  }

  const toScreen = ({ width, height }) => {
    const unit = Math.min(width, height) / 2 / picture.reach(values);
    return { to: ([x, y]) => [width / 2 + unit * x, height / 2 - unit * y], from: (x, y) => [(x - width / 2) / unit, (height / 2 - y) / unit], unit };
  };

  function drawStage() {
    const area = sheet($("stage")), { pen, width, height } = area;
    if (!picture) return drawCurves(area, data.columns.slice(0, n).map((name, i) => [name, (point) => point.y[i]]));
    const { to, unit } = toScreen(area);
    pen.strokeStyle = colour("muted");
    pen.lineWidth = 1;
    if (picture.globe) {
      pen.beginPath();
      pen.arc(width / 2, height / 2, unit, 0, 7);
      pen.stroke();
    } else if (picture.hole && picture.hole(values) > 0) {
      // The hole, up to its outer horizon.
      pen.fillStyle = colour("line");
      pen.beginPath();
      pen.arc(width / 2, height / 2, unit * picture.hole(values), 0, 7);
      pen.fill();
      pen.stroke();
    } else if (!picture.lines) {
      // The origin.
      pen.beginPath();
      for (const [x, y] of [[6, 0], [0, 6]]) {
        pen.moveTo(width / 2 - x, height / 2 - y);
        pen.lineTo(width / 2 + x, height / 2 + y);
      }
      pen.stroke();
    }
    kinds.slice().reverse().forEach(([name]) => {
      const k = kinds.findIndex((kind) => kind[0] === name), path = paths[k];
      pen.strokeStyle = pen.fillStyle = colour(name);
      pen.globalAlpha = 0.45;
      pen.lineWidth = 1.5;
      pen.beginPath();
      path.slice(-900).forEach((point) => {
        const joints = picture.joints(point.y, values);
        pen.lineTo(...to(joints[joints.length - 1]));
      });
      pen.stroke();
      pen.globalAlpha = name === "learned" ? 1 : 0.75;
      const joints = picture.joints(path[path.length - 1].y, values).map(to);
      if (picture.lines) {
        pen.lineWidth = name === "learned" ? 2.5 : 1.5;
        pen.beginPath();
        joints.forEach((joint) => pen.lineTo(...joint));
        pen.stroke();
      }
      joints.slice(1).forEach(([x, y]) => {
        pen.beginPath();
        pen.arc(x, y, name === "learned" ? 9 : 6, 0, 7);
        pen.fill();
      });
      pen.globalAlpha = 1;
    });
  }

  // Curves over time: of each kind in its colour, each quantity in a strip of its own.
  function drawCurves({ pen, width, height }, quantities) {
    const t = Math.max(1e-9, ...paths.map((path) => path[path.length - 1].t)), from = Math.max(0, t - data.span);
    quantities.forEach(([label, of], row) => {
      const top = (row * height) / quantities.length, tall = height / quantities.length;
      const seen = paths.map((path) => path.filter((point) => point.t >= from).map((point) => [point.t, of(point, path)]));
      const all = seen.flat().map((point) => point[1]).filter(Number.isFinite);
      let [low, high] = [Math.min(...all), Math.max(...all)];
      if (!(high - low > 1e-12 * Math.max(Math.abs(low), Math.abs(high), 1e-30))) [low, high] = [low - 1, high + 1];
      pen.fillStyle = colour("muted");
      pen.fillText(`${label}: ${digits(low)} to ${digits(high)}`, 8, top + 16);
      seen.forEach((points, k) => {
        pen.strokeStyle = colour(kinds[k][0]);
        pen.lineWidth = 1.5;
        pen.beginPath();
        points.forEach(([time, y]) => pen.lineTo(((time - from) / (t - from || 1)) * width, top + tall - 6 - ((y - low) / (high - low)) * (tall - 30)));
        pen.stroke();
      });
    });
  }

  function draw() {
    drawStage();
    const scale = (path) => Math.max(...path.map((point) => Math.abs(point.energy)), 1e-300);
    drawCurves(sheet($("energy")), [[data.time_like === null ? "change of the energy, relative" : "change of the energy, the constraint, relative", (point, path) => (point.energy - path[0].energy) / scale(path)]]);
    if (picture) drawCurves(sheet($("first")), [[data.columns[n > 1 && data.time_like === 0 ? 1 : 0], (point) => point.y[n > 1 && data.time_like === 0 ? 1 : 0]]]);
    const ended = flights.map((flight, k) => (flight.ended ? `${kinds[k][0]}: ${flight.ended}.` : "")).join(" ");
    $("time").textContent = `t = ${flights[0].t.toFixed(2)} ${data.time_unit} ${ended}`;
    if (!running) read(reading || start.q, reading ? "under the cursor" : "at the start");
    sliders.forEach((slider) => slider.show());
    $("run").textContent = running ? "Pause" : "Play";
  }

  // det M, or the components of a metric, at a point.
  function read(q, where) {
    const text = kinds.map(([name, motion]) => {
      const { determinant, mass } = motion.terms(q, start.v);
      const diagonal = mass.map((row, i) => digits(row[i])).join(", ");
      const line = document.createElement("span");
      line.className = name;
      line.textContent = `${name}: det M = ${digits(determinant)}, diagonal of M ${diagonal}`;
      return line;
    });
    const place = q.map((x, i) => `${data.columns[i]} = ${digits(x)}`).join(", ");
    $("reading").replaceChildren(`${where}, ${place}; M is learned up to one factor`, ...text);
  }

  const sliders = [];
  function slide(box, label, low, high, get, set) {
    const row = document.createElement("label"), input = document.createElement("input"), shown = document.createElement("output");
    row.className = "slide";
    Object.assign(input, { type: "range", min: low, max: high, step: (high - low) / 500 });
    row.append(label, input, shown);
    $(box).append(row);
    const show = () => {
      if (document.activeElement !== input) input.value = get();
      shown.textContent = digits(get());
    };
    input.addEventListener("input", () => {
      set(Number(input.value));
      reset();
      shown.textContent = digits(get());
    });
    sliders.push({ show });
  }
  data.columns.forEach((name, i) => {
    const side = i < n ? "q" : "v", at = i % n, [low, high] = data.ranges[i < n ? "position" : "velocity"][at];
    slide("states", name, low, high, () => start[side][at], (x) => (start[side][at] = x));
  });
  if (exact && data.exact.parameters.length) {
    data.exact.parameters.forEach((p, i) => {
      const [low, high] = p.value === 0 ? [-1, 1] : [Math.min(0.2 * p.value, 3 * p.value), Math.max(0.2 * p.value, 3 * p.value)];
      slide("parameters", `${p.symbol} [${p.unit}]`, low, high, () => values[p.symbol], (x) => (values[p.symbol] = exact.parameters[i] = x));
    });
  } else $("parameters").hidden = true;
  slide("pace", "speed", 0.1, 4, () => speed, (x) => (speed = x));

  // Dragging: a bob follows the pointer and starts from rest; where nothing moves it from rest, with the velocities that the sliders give.
  const stage = $("stage");
  const pointed = (event) => {
    const box = stage.getBoundingClientRect();
    return toScreen({ width: box.width, height: box.height }).from(event.clientX - box.left, event.clientY - box.top);
  };
  const nearest = (point) => {
    const joints = picture.joints(flights[0].y, values).slice(1);
    const away = joints.map(([x, y]) => Math.hypot(x - point[0], y - point[1]));
    return 1 + away.indexOf(Math.min(...away));
  };
  const falls = (q) => {
    const { acceleration } = kinds[kinds.length - 1][1].terms(q, start.v.map(() => 0));
    return acceleration.some((a) => Math.abs(a) > 1e-9);
  };
  if (picture) {
    stage.addEventListener("pointerdown", (event) => {
      stage.setPointerCapture(event.pointerId);
      dragged = nearest(pointed(event));
      running = false;
      start.q = flights[0].y.slice(0, n);
      move(event);
    });
    const move = (event) => {
      start.q = picture.take(start.q, dragged, pointed(event), values);
      if (data.time_like === null && falls(start.q)) start.v = start.v.map(() => 0);
      reading = null;
      reset();
    };
    stage.addEventListener("pointermove", (event) => {
      if (dragged) return move(event);
      reading = picture.take(flights[0].y.slice(0, n), nearest(pointed(event)), pointed(event), values);
      read(reading, "under the cursor");
    });
    stage.addEventListener("pointerleave", () => (reading = null));
    const drop = () => {
      if (dragged) toggle(true);
      dragged = 0;
    };
    stage.addEventListener("pointerup", drop);
    stage.addEventListener("pointercancel", drop);
  }

  function toggle(on = !running) {
    running = on;
    last = performance.now();
    if (running) requestAnimationFrame(frame);
    draw();
  }
  function frame(now) {
    if (!running) return draw();
    advance(Math.min(0.05, (now - last) / 1000));
    last = now;
    draw();
    requestAnimationFrame(frame);
  }
  $("run").addEventListener("click", () => toggle());
  $("step").addEventListener("click", () => { running = false; advance(0.02); draw(); });
  $("reset").addEventListener("click", () => { running = false; reset(); });
  document.addEventListener("keydown", (event) => {
    if (event.target !== document.body && event.target !== stage) return;
    const act = { " ": () => toggle(), ".": () => $("step").click(), r: () => $("reset").click() }[event.key];
    if (act) {
      event.preventDefault();
      act();
    }
  });
  window.addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  if (!picture) $("first").hidden = true;
  reset();
  return { advance, draw, toggle, flights: () => flights, start };
}

if (typeof document !== "undefined") window.player = play(JSON.parse(document.getElementById("data").textContent));
