"use strict";
// Where a state is drawn, by the names of its coordinates.

// A picture of states: `joints` gives bobs in units of length, behind the place of their joint, `take` the coordinates that put a bob at
// a point, `links` the rods where they do not join one bob with the next; null where nothing but curves over time is known.
function pictureOf(data, learned) {
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
    const known = constant("l1") || constant("l"), unit = known ? known.unit : "lengths of a rod";
    return {
      axes: [`x [${unit}]`, `y [${unit}]`],
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
    const turned = hangs ? ["r sin", "\u2212r cos"] : ["r cos", "r sin"], unit = data.units[r];
    return {
      axes: angle < 0 ? [withUnit("r", unit), null] : turned.map((of) => withUnit(`${of} ${names[angle]}`, unit)),
      reach: () => 1.15 * far,
      hole: (values) => (hole(values) > 0 ? [hole(values), hole(values)] : null),
      centre: () => [0, 0],
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
  const spatial = pointsOf(names);
  if (spatial) return pictureOfPoints(data, spatial, learned);
  const space = names.map((_, i) => i).filter((i) => i !== data.time_like && !data.periodic[i]);
  if (space.length >= 1 && names.every((_, i) => !data.periodic[i])) {
    const [a, b] = space, size = (i) => (i === undefined ? 0 : Math.max(...data.ranges.position[i].map(Math.abs)));
    return {
      axes: [a, b].map((i) => (i === undefined ? null : withUnit(names[i], data.units[i]))),
      reach: () => 1.2 * Math.max(size(a), size(b)),
      centre: () => [0, 0],
      lines: b === undefined,
      joints: (q) => [[0, 0], [q[a], b === undefined ? 0 : q[b]]],
      take: (q, k, [x, y]) => q.map((old, i) => (i === a ? x : i === b ? y : old)),
    };
  }
  return null;
}

// A quantity with its unit, if it has one.
function withUnit(name, unit) {
  return unit && unit !== "1" ? `${name} [${unit}]` : name;
}

// The angle of the same direction that is nearest to another.
function near(angle, other) {
  return angle + 2 * Math.PI * Math.round((other - angle) / (2 * Math.PI));
}

// The points in a plane or in space whose coordinates the names are: x1, y1, x2, y2 or x, y, z, or the columns of a rotation matrix; null
// for others. Every point is a list of its coordinates' places.
function pointsOf(names) {
  const turned = (k) => [1, 2, 3].map((i) => names.indexOf(`r${i}${k}`));
  if (names.length === 9 && [1, 2, 3].every((k) => turned(k).every((at) => at >= 0))) {
    return { points: [1, 2, 3].map(turned), letters: "123", arms: true };
  }
  const found = new Map();
  names.forEach((name, at) => {
    const parts = /^([xyz])(\d*)$/.exec(name);
    if (parts) found.set(parts[2], { ...found.get(parts[2]), [parts[1]]: at });
  });
  const points = [...found.values()], letters = points.length ? Object.keys(points[0]).sort().join("") : "";
  const alike = points.every((point) => Object.keys(point).sort().join("") === letters);
  if (!alike || letters.length < 2) return null;
  return { points: points.map((point) => [...letters].map((letter) => point[letter])), letters, arms: false };
}

// Points in a plane, or in space from a side that can be turned, with the rods that their constraints are.
function pictureOfPoints(data, { points, letters, arms }, learned) {
  const names = data.columns.slice(0, data.columns.length / 2), solid = letters.length === 3;
  const view = solid ? { turn: 0.6, lift: 0.4 } : null;
  const place = (q, k) => points[k].map((at) => q[at]);
  const heading = !solid && points.length === 1 ? names.indexOf("theta") : -1;

  // A row that keeps a point at a distance: from another one, or from a place. Second derivatives of a squared distance are a multiple
  // of the identity for each of its points, and the opposite between them.
  function rod({ holonomic, of }, q) {
    if (!holonomic) return null;
    of.evaluate(q.concat(q.map(() => 0)));
    const size = largest(names.map((_, i) => of.second(i, i)));
    const same = (a, b) => Math.abs(a - b) <= 1e-9 * size;
    const joined = points.map((_, k) => k).filter((k) => points[k].some((at) => !same(of.second(at, at), 0)));
    if (!(size > 0) || joined.length < 1 || joined.length > 2) return null;
    const [k, l] = joined, unit = of.second(points[k][0], points[k][0]);
    const block = (a, b, value) => points[a].every((i, r) => points[b].every((j, c) => same(of.second(i, j), r === c ? value : 0)));
    const known = joined.flatMap((k) => points[k]);
    if (names.some((_, i) => !known.includes(i) && !same(of.first(i), 0)) || !block(k, k, unit)) return null;
    if (l !== undefined) return block(l, l, unit) && block(k, l, -unit) ? [l, k] : null;
    return [points[k].map((at) => q[at] - of.first(at) / unit), k];
  }
  const rods = (motion, q) => (arms ? points.map((_, k) => [[0, 0, 0], k]) : motion.held.map((row) => rod(row, q)).filter(Boolean));

  // The box that is seen: what the model knows, the origin, and the places that rods hang from.
  const pivots = rods(learned, data.start.q).map(([from]) => from).filter(Array.isArray);
  const sides = [...letters].map((_, axis) => {
    const ends = points.flatMap((point) => data.ranges.position[point[axis]]).concat(0, pivots.map((pivot) => pivot[axis]));
    return [Math.min(...ends), Math.max(...ends)];
  });
  const middle = sides.map(([low, high]) => (low + high) / 2), half = Math.max(...sides.map(([low, high]) => (high - low) / 2));
  const reach = (solid ? 1.35 : 1.15) * (half || 1);

  // Directions of the picture: right, up, and towards who looks.
  function axes() {
    if (!solid) return [[1, 0], [0, 1]];
    const [s, c, up, level] = [Math.sin(view.turn), Math.cos(view.turn), Math.sin(view.lift), Math.cos(view.lift)];
    return [[c, s, 0], [-s * up, c * up, level], [s * level, -c * level, up]];
  }
  const seen = (point) => axes().map((axis) => dot(axis, point.map((x, i) => x - middle[i])));

  // The surface or the wire that a single point is held to, as dots.
  const dots = [];
  const [only] = learned.held;
  if (points.length === 1 && learned.held.length === 1 && only.holonomic && (solid || !rod(only, data.start.q))) {
    const still = data.start.q.map(() => 0), fraction = (x) => x - Math.floor(x);
    for (let k = 1; k <= (solid ? 1200 : 240); k++) {
      const q = data.start.q.slice();
      points[0].forEach((at, axis) => {
        const [low, high] = data.ranges.position[at];
        q[at] = low + (high - low) * fraction(k * [0.8191725134, 0.6710436067, 0.5497004779][axis]);
      });
      const on = learned.project(q, still);
      if (on) dots.push(place(on.q, 0));
    }
  }

  const hole = (values) => {
    if (data.time_like === null || !(values.M > 0)) return null;
    const spin = values.a || 0, radius = values.M + Math.sqrt(Math.max(0, values.M ** 2 - spin ** 2)), wide = Math.hypot(radius, spin);
    // The horizon of Cartesian coordinates is a spheroid.
    return solid ? [wide, Math.hypot(wide * Math.sin(view.lift), radius * Math.cos(view.lift))] : [wide, wide];
  };
  return {
    axes: solid ? null : points[0].map((at, i) => withUnit(points.length > 1 ? letters[i] : names[at], data.units[at])),
    origin: middle,
    reach: () => reach,
    view,
    names: arms ? points.map((_, k) => `axis ${k + 1}`) : [],
    hole,
    centre: () => seen(middle.map(() => 0)),
    free: true,
    triad: () => (solid ? [...letters].map((letter, i) => [arms ? `r${letter}` : letter, axes().map((axis) => axis[i])]) : []),
    dots: () => dots.map(seen),
    joints: (q) => [seen(middle.map(() => 0)), ...points.map((_, k) => seen(place(q, k)))],
    links: (q, motion) => {
      const found = rods(motion, q).map(([from, to]) => [seen(Array.isArray(from) ? from : place(q, from)), seen(place(q, to))]);
      if (heading >= 0) {
        const at = place(q, 0), length = 0.15 * reach;
        found.push([seen(at), seen([at[0] + length * Math.cos(q[heading]), at[1] + length * Math.sin(q[heading])])]);
      }
      return found;
    },
    take: (q, k, [x, y]) => {
      const next = q.slice(), now = seen(place(q, k - 1)), [right, up, towards = [0, 0]] = axes();
      // At the rim of a surface the way back to it leads to the rim again: from a little before it, it does not.
      const before = solid && learned.held.length && Math.abs(now[2]) < 0.02 * reach ? 0.02 * reach : 0;
      points[k - 1].forEach((at, i) => (next[at] += right[i] * (x - now[0]) + up[i] * (y - now[1]) + before * towards[i]));
      return next;
    },
  };
}

// Round numbers within bounds, with their texts.
function ticks(low, high, most) {
  const least = (high - low) / Math.max(1, most), unit = 10 ** Math.floor(Math.log10(least));
  const step = unit * ([1, 2, 5].find((factor) => factor * unit >= least * (1 - 1e-9)) || 10), found = [];
  const power = Math.floor(Math.log10(step) + 1e-9), plain = power > -6 && Math.max(Math.abs(low), Math.abs(high)) < 1e5;
  const text = (x) => (plain ? x.toFixed(Math.max(0, -power)) : x === 0 ? "0" : String(Number(x.toPrecision(3)))).replaceAll("-", "\u2212");
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step && found.length < 50; k++) found.push([k * step, text(k * step)]);
  return found;
}

// A line across, or up, through a tick.
function rule(pen, colour, from, to) {
  pen.strokeStyle = colour;
  pen.lineWidth = 1;
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...to);
  pen.stroke();
}
