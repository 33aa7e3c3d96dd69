"use strict";
// The page: what is drawn, what is dragged, what is read off. The numbers are those of engine.js.

function play(data) {
  const n = data.columns.length / 2, $ = (id) => document.getElementById(id);
  const { learned, exact } = load(data), picture = pictureOf(data, learned);
  const values = Object.fromEntries(((data.exact && data.exact.parameters) || []).map((p) => [p.symbol, p.value]));
  const kinds = [["learned", learned]].concat(exact ? [["exact", exact]] : []);
  const start = { q: data.start.q.slice(), v: data.start.v.slice() };
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const digits = (x) => {
    if (!Number.isFinite(x)) return "no number";
    return x !== 0 && Math.abs(x) < 1e-3 ? x.toExponential(2) : Number(x.toPrecision(4)).toString();
  };
  const named = (i) => withUnit(data.columns[i], data.units[i]);
  const held = kinds.some(([, motion]) => motion.held.length);
  let flights, paths, running = false, last = 0, dragged = 0, speed = 1, reading = null, turning = null;

  // The state that `put` asks for, as near to it as the constraints allow: it is put again after every way to them.
  function settle(q, v, put) {
    let on = { q: q.slice(), v: v.slice() };
    for (let pass = 0; pass < (learned.held.length ? 24 : 1) && on; pass++) {
      put(on);
      on = learned.project(on.q, on.v);
    }
    return on;
  }

  function reset() {
    Object.assign(start, learned.project(start.q, start.v));
    flights = kinds.map(([, motion]) => new Flight(motion, start.q, start.v, data.span / 1000));
    paths = kinds.map(([, motion], k) => [point(motion, flights[k])]);
    draw();
  }

  function point(motion, { t, y }) {
    const q = y.slice(0, n), v = y.slice(n);
    return { t, y, energy: motion.terms(q, v).energy, off: motion.distance(q, v) };
  }

  function advance(seconds) {
    const until = flights.reduce((t, f) => Math.min(t, f.ended ? Infinity : f.t), Infinity) + seconds * data.rate * speed;
    flights.forEach((flight, k) => {
      if (flight.ended) return;
      flight.advance(until, 120);
      paths[k].push(point(kinds[k][1], flight));
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
    if (!picture) return drawCurves(area, data.columns.slice(0, n).map((name, i) => [named(i), (point) => point.y[i]]));
    const { to, unit } = toScreen(area);
    pen.strokeStyle = colour("muted");
    pen.lineWidth = 1;
    if (picture.axes) drawAxes(area, toScreen(area), picture.axes, picture.origin || [0, 0]);
    pen.strokeStyle = colour("muted");
    if (picture.globe) {
      pen.beginPath();
      pen.arc(width / 2, height / 2, unit, 0, 7);
      pen.stroke();
    } else if (picture.hole && picture.hole(values)) {
      // The hole, up to its outer horizon.
      const [wide, tall] = picture.hole(values), [x, y] = to(picture.centre());
      pen.fillStyle = colour("line");
      pen.beginPath();
      pen.ellipse(x, y, unit * wide, unit * tall, 0, 0, 7);
      pen.fill();
      pen.stroke();
    } else if (!picture.lines) {
      // The origin.
      const [x, y] = to(picture.centre());
      pen.beginPath();
      for (const [a, b] of [[6, 0], [0, 6]]) {
        pen.moveTo(x - a, y - b);
        pen.lineTo(x + a, y + b);
      }
      pen.stroke();
    }
    if (picture.free) drawSpace(area, to);
    kinds.slice().reverse().forEach(([name]) => {
      const k = kinds.findIndex((kind) => kind[0] === name), path = paths[k];
      pen.strokeStyle = pen.fillStyle = colour(name);
      pen.globalAlpha = 0.45;
      pen.lineWidth = 1.5;
      const now = path[path.length - 1].y, joints = picture.joints(now, values);
      const links = picture.links ? picture.links(now.slice(0, n), kinds[k][1]) : picture.lines ? joints.slice(1).map((to, i) => [joints[i], to]) : [];
      // Of bobs on rods the way of the last one, of others all ways.
      const trailed = path.slice(-900).map((point) => picture.joints(point.y, values));
      for (let bob = links.length ? joints.length - 1 : 1; bob < joints.length; bob++) {
        pen.beginPath();
        trailed.forEach((joints) => pen.lineTo(...to(joints[bob])));
        pen.stroke();
      }
      pen.globalAlpha = name === "learned" ? 1 : 0.75;
      pen.lineWidth = name === "learned" ? 2.5 : 1.5;
      links.forEach(([from, end]) => {
        pen.beginPath();
        pen.moveTo(...to(from));
        pen.lineTo(...to(end));
        pen.stroke();
      });
      // What is nearer is drawn later and larger.
      (picture.names || []).forEach((label, bob) => {
        const [x, y] = to(joints[bob + 1]);
        pen.fillText(label, x + 12, y - 8);
      });
      joints.slice(1).sort(([, , a = 0], [, , b = 0]) => a - b).forEach((joint) => {
        const [x, y] = to(joint), near = 1 + (0.3 * (joint[2] || 0)) / picture.reach(values);
        pen.beginPath();
        pen.arc(x, y, near * (name === "learned" ? 9 : 6), 0, 7);
        pen.fill();
      });
      pen.globalAlpha = 1;
    });
  }

  // What a point is held to, and the directions of space.
  function drawSpace({ pen, height }, to) {
    pen.fillStyle = colour("muted");
    picture.dots().forEach((dot) => {
      const [x, y] = to(dot);
      pen.globalAlpha = dot.length < 3 ? 0.6 : dot[2] > 0 ? 0.75 : 0.25;
      pen.fillRect(x - 1, y - 1, 2, 2);
    });
    pen.globalAlpha = 1;
    picture.triad().forEach(([name, [x, y]]) => {
      pen.beginPath();
      pen.moveTo(48, height - 48);
      pen.lineTo(48 + 30 * x, height - 48 - 30 * y);
      pen.stroke();
      pen.fillText(name, 44 + 40 * x, height - 44 - 40 * y);
    });
  }

  // The axes of a plane at the edges of the stage; `origin` is the place in its middle.
  function drawAxes({ pen, width, height }, { to, from }, [across, up], [ox, oy]) {
    const [left, top] = from(0, 0), [right, bottom] = from(width, height);
    const write = (text, x, y, align) => {
      Object.assign(pen, { fillStyle: colour("muted"), textAlign: align });
      pen.fillText(text, x, y);
    };
    ticks(left + ox, right + ox, width / 70).forEach(([at, text]) => {
      const [x] = to([at - ox, 0]);
      rule(pen, colour("line"), [x, 0], [x, height]);
      if (x > 56 && x < width - 20) write(text, x, height - 7, "center");
    });
    write(across, width - 8, height - 24, "right");
    if (up) {
      ticks(bottom + oy, top + oy, height / 70).forEach(([at, text]) => {
        const [, y] = to([0, at - oy]);
        rule(pen, colour("line"), [0, y], [width, y]);
        if (y > 30 && y < height - 24) write(text, 6, y - 3, "left");
      });
      write(up, 6, 17, "left");
    }
    pen.textAlign = "left";
  }

  // Curves over time: of each kind in its colour, each quantity in a strip of its own.
  function drawCurves({ pen, width, height }, quantities) {
    const t = Math.max(1e-9, ...paths.map((path) => path[path.length - 1].t)), from = Math.max(0, t - data.span);
    const left = 58, right = width - 10, foot = height - 20, tall = foot / quantities.length;
    const across = (time) => left + ((time - from) / (t - from || 1)) * (right - left);
    const label = withUnit(data.time_like === null ? "t" : "tau", data.time_unit), room = right - pen.measureText(label).width - 8;
    pen.fillStyle = colour("muted");
    pen.fillText(label, room + 8, height - 5);
    pen.textAlign = "center";
    if (t > 1e-9) {
      ticks(from, t, 6).map(([at, text]) => [across(at), text]).forEach(([x, text]) => {
        rule(pen, colour("line"), [x, 0], [x, foot]);
        if (x + pen.measureText(text).width / 2 < room) pen.fillText(text, x, height - 5);
      });
    }
    quantities.forEach(([label, of], row) => {
      const top = row * tall;
      const seen = paths.map((path) => path.filter((point) => point.t >= from).map((point) => [point.t, of(point, path)]));
      const all = seen.flat().map((point) => point[1]).filter(Number.isFinite);
      if (!all.length) return;
      let [low, high] = [Math.min(...all), Math.max(...all)];
      const room = 1e-9 + 1e-3 * Math.max(Math.abs(low), Math.abs(high));
      if (!(high - low > room)) [low, high] = [low - room, high + room];
      const up = (y) => top + tall - 6 - ((y - low) / (high - low)) * (tall - 30);
      pen.textAlign = "right";
      ticks(low, high, tall / 36).forEach(([at, text]) => {
        rule(pen, colour("line"), [left, up(at)], [right, up(at)]);
        pen.fillText(text, left - 6, up(at) + 4);
      });
      pen.textAlign = "left";
      pen.fillText(label, left, top + 15);
      // What is exact lies wide below what was learned.
      seen.map((points, k) => [points, kinds[k][0]]).reverse().forEach(([points, name]) => {
        pen.strokeStyle = colour(name);
        [pen.lineWidth, pen.globalAlpha] = name === "exact" ? [4, 0.5] : [1.5, 1];
        pen.beginPath();
        points.forEach(([time, y]) => pen.lineTo(across(time), up(y)));
        pen.stroke();
      });
      pen.globalAlpha = 1;
    });
  }

  function draw() {
    drawStage();
    // Before a motion there is nothing to plot.
    const still = paths.every((path) => path.length < 2);
    $("energy").hidden = still;
    $("first").hidden = still || !picture;
    const scale = (path) => Math.max(...path.map((point) => Math.abs(point.energy)), 1e-300);
    const curves = [[data.time_like === null ? "change of the energy, relative" : "change of the energy, the constraint, relative", (point, path) => (point.energy - path[0].energy) / scale(path)]];
    if (held) curves.push(["distance from the constraints", (point) => point.off]);
    drawCurves(sheet($("energy")), curves);
    const first = n > 1 && data.time_like === 0 ? 1 : 0;
    if (picture) drawCurves(sheet($("first")), [[named(first), (point) => point.y[first]]]);
    const ended = flights.map((flight, k) => (flight.ended ? `${kinds[k][0]}: ${flight.ended}.` : "")).join(" ");
    $("time").textContent = `${data.time_like === null ? "t" : "tau"} = ${flights[0].t.toFixed(2)} ${data.time_unit} ${ended}`;
    if (!running) read(reading || start.q, reading ? "under the cursor" : "at the start");
    sliders.forEach((slider) => slider.show());
    $("run").textContent = running ? "Pause" : "Play";
  }

  // det M, or the components of a metric, at a point.
  function read(q, where) {
    const within = held ? " within the constraints" : "";
    const text = kinds.map(([name, motion]) => {
      const factors = name === "learned" ? data.learned.factors : null;
      const { determinant, diagonal } = aligned(motion.terms(q, start.v), factors, motion.held.length);
      const line = document.createElement("span");
      line.className = name;
      line.textContent = `${name}: det M${within} = ${digits(determinant)}, diagonal of M ${diagonal.map(digits).join(", ")}`;
      return line;
    });
    const place = q.map((x, i) => `${data.columns[i]} = ${digits(x)}`).join(", ");
    const { factors } = data.learned, same = factors && factors.every((factor) => factor === factors[0]);
    const taken = factors ? `the learned M is taken times ${factors.slice(0, same ? 1 : n).map(digits).join(", ")}, its best ${same ? "factor" : "factors"}` : "M is learned up to one factor";
    $("reading").replaceChildren(`${where}, ${place}; ${taken}`, ...text);
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
    const put = (x) => Object.assign(start, settle(start.q, start.v, (state) => (state[side][at] = x)));
    slide("states", named(i), low, high, () => start[side][at], put);
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
    const away = joints.map(([x, y]) => Math.hypot(x - point[0], y - point[1])), least = Math.min(...away);
    return { bob: 1 + away.indexOf(least), away: least };
  };
  const asked = (q, bob, point) => settle(q, start.v, (state) => (state.q = picture.take(state.q, bob, point, values)));
  const turn = (by, up) => {
    picture.view.turn += by;
    picture.view.lift = Math.max(-1.5, Math.min(1.5, picture.view.lift + up));
    draw();
  };
  const falls = (q) => {
    const still = start.v.map(() => 0), motion = kinds[kinds.length - 1][1];
    const on = motion.project(q, still) || { q, v: still }, { acceleration } = motion.terms(on.q, on.v);
    return acceleration.some((a) => Math.abs(a) > 1e-9);
  };
  if (picture) {
    stage.addEventListener("pointerdown", (event) => {
      stage.setPointerCapture(event.pointerId);
      const { bob, away } = nearest(pointed(event)), box = stage.getBoundingClientRect();
      // In space the background turns the view.
      if (picture.view && away * toScreen(box).unit > 24) {
        turning = [event.clientX, event.clientY];
        return;
      }
      dragged = bob;
      running = false;
      start.q = flights[0].y.slice(0, n);
      move(event);
    });
    const move = (event) => {
      const on = asked(start.q, dragged, pointed(event));
      if (on) start.q = on.q;
      if (data.time_like === null && falls(start.q)) start.v = start.v.map(() => 0);
      reading = null;
      reset();
    };
    stage.addEventListener("pointermove", (event) => {
      if (turning) {
        turn((turning[0] - event.clientX) / 150, (event.clientY - turning[1]) / 150);
        turning = [event.clientX, event.clientY];
        return;
      }
      if (dragged) return move(event);
      const on = asked(flights[0].y.slice(0, n), nearest(pointed(event)).bob, pointed(event));
      reading = on && on.q;
      if (on) read(reading, "under the cursor");
    });
    stage.addEventListener("pointerleave", () => (reading = null));
    const drop = () => {
      if (dragged) toggle(true);
      dragged = 0;
      turning = null;
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
    const turns = picture && picture.view ? { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] } : {};
    const keys = { " ": () => toggle(), ".": () => $("step").click(), r: () => $("reset").click() };
    const act = turns[event.key] ? () => turn(...turns[event.key]) : keys[event.key];
    if (act) {
      event.preventDefault();
      act();
    }
  });
  window.addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  if (held) $("energy").classList.add("tall");
  $("held").textContent = Object.entries(data.constraints).map(([name, formula]) => `${name}: ${formula} = 0`).join("; ");
  $("held").hidden = !Object.keys(data.constraints).length;
  $("turned").hidden = !(picture && picture.view);
  reset();
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) toggle(true);
  return { advance, draw, toggle, flights: () => flights, start };
}

if (typeof document !== "undefined") window.player = play(JSON.parse(document.getElementById("data").textContent));
