"use strict";
// A recorded function of inputs and parameters, with its first and second derivatives by the inputs: every row of the list of
// operations holds a value, a gradient, and the upper triangle of a Hessian.

function erfc(x) {
  const a = Math.abs(x);
  let value;
  if (a < 2.5) {
    let term = a, sum = a;
    for (let k = 1; k < 60 && term > 1e-17 * sum; k++) sum += term *= (2 * a * a) / (2 * k + 1);
    value = 1 - (2 / Math.sqrt(Math.PI)) * Math.exp(-a * a) * sum;
  } else {
    let fraction = 0;
    for (let k = 60; k > 0; k--) fraction = k / 2 / (a + fraction);
    value = Math.exp(-a * a) / Math.sqrt(Math.PI) / (a + fraction);
  }
  return x < 0 ? 2 - value : value;
}
const logistic = (x) => 1 / (1 + Math.exp(-x));
const softplus = (x) => Math.max(x, 0) + Math.log1p(Math.exp(-Math.abs(x)));
const density = (x) => Math.exp(-0.5 * x * x) / Math.sqrt(2 * Math.PI);
const sech2 = (x) => { const c = Math.cosh(x); return 1 / (c * c); };

// Value and two derivatives of functions of one number, by their names in the table of operations.
const UNARY = {
  Neg: (x) => [-x, -1, 0],
  Recip: (x) => [1 / x, -1 / (x * x), 2 / (x * x * x)],
  Sqrt: (x) => { const y = Math.sqrt(x); return [y, 0.5 / y, -0.25 / (x * y)]; },
  Exp: (x) => { const y = Math.exp(x); return [y, y, y]; },
  ExpM1: (x) => { const y = Math.exp(x); return [Math.expm1(x), y, y]; },
  Ln: (x) => [Math.log(x), 1 / x, -1 / (x * x)],
  Ln1p: (x) => [Math.log1p(x), 1 / (1 + x), -1 / ((1 + x) * (1 + x))],
  Sin: (x) => { const s = Math.sin(x); return [s, Math.cos(x), -s]; },
  Cos: (x) => { const c = Math.cos(x); return [c, -Math.sin(x), -c]; },
  Tan: (x) => { const y = Math.tan(x), d = 1 + y * y; return [y, d, 2 * y * d]; },
  Asin: (x) => { const d = 1 / Math.sqrt((1 - x) * (1 + x)); return [Math.asin(x), d, x * d * d * d]; },
  Acos: (x) => { const d = -1 / Math.sqrt((1 - x) * (1 + x)); return [Math.acos(x), d, x * d * d * d]; },
  Atan: (x) => { const d = 1 / (1 + x * x); return [Math.atan(x), d, -2 * x * d * d]; },
  Sinh: (x) => { const y = Math.sinh(x); return [y, Math.cosh(x), y]; },
  Cosh: (x) => { const y = Math.cosh(x); return [y, Math.sinh(x), y]; },
  Tanh: (x) => { const y = Math.tanh(x), d = sech2(x); return [y, d, -2 * y * d]; },
  Erfc: (x) => { const d = (-2 / Math.sqrt(Math.PI)) * Math.exp(-x * x); return [erfc(x), d, -2 * x * d]; },
  Logistic: (x) => { const y = logistic(x), d = y * logistic(-x); return [y, d, -d * Math.tanh(x / 2)]; },
  Softplus: (x) => { const d = logistic(x); return [softplus(x), d, d * logistic(-x)]; },
  Gelu: (x) => {
    const below = 0.5 * erfc(-x * Math.SQRT1_2), at = density(x);
    return [x * below, below + x * at, at * (2 - x * x)];
  },
  XTanh: (x) => {
    const h = x / 2, t = Math.tanh(h), c = sech2(h);
    return [x * t, t + h * c, c * (1 - h * t)];
  },
  Silu: (x) => {
    const s = logistic(x), d = s * logistic(-x);
    return [x * s, s + x * d, d * (2 - x * Math.tanh(x / 2))];
  },
  LnCosh: (x) => {
    const a = Math.abs(x);
    return [a + Math.log1p(Math.exp(-2 * a)) - Math.LN2, Math.tanh(x), sech2(x)];
  },
  Abs: (x) => [Math.abs(x), Math.sign(x), 0],
};
const power = (n) => (x) => [
  Math.pow(x, n), n === 0 ? 0 : n * Math.pow(x, n - 1), n === 0 || n === 1 ? 0 : n * (n - 1) * Math.pow(x, n - 2),
];

// Value, two first and three second derivatives of functions of two numbers.
const BINARY = {
  Add: (a, b) => [a + b, 1, 1, 0, 0, 0],
  Sub: (a, b) => [a - b, 1, -1, 0, 0, 0],
  Mul: (a, b) => [a * b, b, a, 0, 1, 0],
  Div: (a, b) => { const r = 1 / b, y = a * r; return [y, r, -y * r, 0, -r * r, 2 * y * r * r]; },
  Powf: (a, b) => {
    const y = Math.pow(a, b), l = a === 0 ? 0 : Math.log(Math.abs(a)), s = b * Math.pow(a, b - 1);
    return [y, s, y * l, b * (b - 1) * Math.pow(a, b - 2), Math.pow(a, b - 1) + s * l, y * l * l];
  },
  Atan2: (a, b) => {
    const r = 1 / (a * a + b * b), da = b * r, db = -a * r;
    return [Math.atan2(a, b), da, db, 2 * da * db, db * db - da * da, -2 * da * db];
  },
  Max: (a, b) => { const s = (1 + Math.sign(a - b)) / 2; return [Math.max(a, b), s, 1 - s, 0, 0, 0]; },
  Min: (a, b) => { const s = (1 + Math.sign(b - a)) / 2; return [Math.min(a, b), s, 1 - s, 0, 0, 0]; },
};

class Recorded {
  // `listing` is the function, `d` the number of its inputs.
  constructor(listing, parameters, d) {
    Object.assign(this, { listing, parameters, d, triangle: (d * (d + 1)) / 2 });
    let rows = 0;
    // First row and kind of every operation; whether a row depends on an input.
    const moving = [];
    this.program = listing.operations.map(([kind, ...rest]) => {
      const step = { kind, out: rows, rest, operands: kind === "d" ? rest[0] : rest };
      step.moves = kind === "i" || (kind !== "p" && kind !== "c" && step.operands.some((row) => moving[row]));
      const whole = /^Powi\((-?\d+)\)$/.exec(kind);
      step.unary = whole ? power(Number(whole[1])) : UNARY[kind];
      step.binary = BINARY[kind];
      if (!["i", "p", "c", "d", "SinCos", "Select"].includes(kind) && !step.unary && !step.binary) {
        throw new Error(`unknown operation ${kind}`);
      }
      const count = kind === "d" ? rest[1] : kind === "SinCos" ? 2 : 1;
      for (let k = 0; k < count; k++) moving[rows + k] = step.moves;
      rows += count;
      return step;
    });
    this.moving = moving;
    this.value = new Float64Array(rows);
    this.gradient = new Float64Array(rows * d);
    this.hessian = new Float64Array(rows * this.triangle);
    for (const step of this.program) {
      if (step.kind === "i") this.gradient[step.out * d + step.rest[0]] = 1;
    }
  }

  // Evaluates at inputs; `second` is false where derivatives are not needed.
  evaluate(x, derivatives = true) {
    const { value, parameters, moving } = this;
    for (const step of this.program) {
      const { kind, out, rest } = step;
      if (kind === "i") value[out] = x[rest[0]];
      else if (kind === "p") value[out] = parameters[rest[0]];
      else if (kind === "c") value[out] = rest[0] === null ? NaN : rest[0];
      else if (kind === "d") this.dense(step, derivatives);
      else if (kind === "SinCos") {
        const a = rest[0], s = Math.sin(value[a]), c = Math.cos(value[a]);
        value[out] = s;
        value[out + 1] = c;
        if (derivatives && step.moves) {
          this.chain(out, a, c, -s);
          this.chain(out + 1, a, -s, -c);
        }
      } else if (kind === "Select") {
        const chosen = value[rest[0]] > 0 ? rest[1] : rest[2];
        value[out] = value[chosen];
        if (derivatives && step.moves) this.chain(out, chosen, 1, 0);
      } else if (step.unary) {
        const [y, d1, d2] = step.unary(value[rest[0]]);
        value[out] = y;
        if (derivatives && step.moves) this.chain(out, rest[0], d1, d2);
      } else {
        const [a, b] = rest, all = step.binary(value[a], value[b]);
        value[out] = all[0];
        if (!derivatives || !step.moves) continue;
        if (!moving[b]) this.chain(out, a, all[1], all[3]);
        else if (!moving[a]) this.chain(out, b, all[2], all[5]);
        else this.join(out, a, b, all);
      }
    }
    return value[this.listing.result];
  }

  chain(out, a, d1, d2) {
    const { d, triangle, gradient, hessian } = this, [o, i] = [out * d, a * d];
    let [to, from] = [out * triangle, a * triangle];
    for (let j = 0; j < d; j++) {
      const slope = d2 * gradient[i + j];
      for (let k = j; k < d; k++) hessian[to++] = d1 * hessian[from++] + slope * gradient[i + k];
    }
    for (let j = 0; j < d; j++) gradient[o + j] = d1 * gradient[i + j];
  }

  join(out, a, b, [, da, db, daa, dab, dbb]) {
    const { d, triangle, gradient, hessian } = this, [o, i, l] = [out * d, a * d, b * d];
    let [to, first, second] = [out * triangle, a * triangle, b * triangle];
    for (let j = 0; j < d; j++) {
      const along = daa * gradient[i + j] + dab * gradient[l + j];
      const beside = dab * gradient[i + j] + dbb * gradient[l + j];
      for (let k = j; k < d; k++) {
        hessian[to++] = da * hessian[first++] + db * hessian[second++] + along * gradient[i + k] + beside * gradient[l + k];
      }
    }
    for (let j = 0; j < d; j++) gradient[o + j] = da * gradient[i + j] + db * gradient[l + j];
  }

  dense({ out, rest: [inputs, outputs, weights, bias], moves }, derivatives) {
    const { d, triangle, value, gradient, hessian, parameters } = this, width = inputs.length;
    for (let row = 0; row < outputs; row++) {
      const at = weights + row * width, here = out + row;
      let sum = bias === null ? 0 : parameters[bias + row];
      for (let k = 0; k < width; k++) sum += parameters[at + k] * value[inputs[k]];
      value[here] = sum;
      if (!derivatives || !moves) continue;
      const [g, h] = [here * d, here * triangle];
      gradient.fill(0, g, g + d);
      hessian.fill(0, h, h + triangle);
      for (let k = 0; k < width; k++) {
        if (!this.moving[inputs[k]]) continue;
        const w = parameters[at + k], [i, l] = [inputs[k] * d, inputs[k] * triangle];
        for (let j = 0; j < d; j++) gradient[g + j] += w * gradient[i + j];
        for (let j = 0; j < triangle; j++) hessian[h + j] += w * hessian[l + j];
      }
    }
  }

  // Second derivative by the inputs j and k.
  second(j, k) {
    if (j > k) [j, k] = [k, j];
    return this.hessian[this.listing.result * this.triangle + j * this.d - (j * (j - 1)) / 2 + k - j];
  }
  first(j) {
    return this.gradient[this.listing.result * this.d + j];
  }
}

// Solves M x = b by elimination with exchanges; also det M.
function solve(matrix, right) {
  const n = right.length, m = matrix.map((row) => row.slice()), x = right.slice();
  let determinant = 1;
  for (let k = 0; k < n; k++) {
    let best = k;
    for (let i = k + 1; i < n; i++) if (Math.abs(m[i][k]) > Math.abs(m[best][k])) best = i;
    if (best !== k) {
      [m[k], m[best]] = [m[best], m[k]];
      [x[k], x[best]] = [x[best], x[k]];
      determinant = -determinant;
    }
    determinant *= m[k][k];
    for (let i = k + 1; i < n; i++) {
      const factor = m[i][k] / m[k][k];
      for (let j = k; j < n; j++) m[i][j] -= factor * m[k][j];
      x[i] -= factor * x[k];
    }
  }
  for (let k = n - 1; k >= 0; k--) {
    for (let j = k + 1; j < n; j++) x[k] -= m[k][j] * x[j];
    x[k] /= m[k][k];
  }
  return { x, determinant };
}

// Scalar product, length, largest magnitude.
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const length = (a) => Math.hypot(...a);
const largest = (a) => a.reduce((most, x) => Math.max(most, Math.abs(x)), 0);

// Rows at unit length whose part beside the others is below this depend on them.
const DEPENDENT = 16 * Math.sqrt(Number.EPSILON);

// An orthonormal basis of rows, and what a vector has along it that has given products with the rows; rows that depend on others are
// left out.
function orthonormal(rows, products) {
  const basis = [], along = [];
  rows.forEach((row, k) => {
    const size = length(row);
    if (!(size > 0)) return;
    let [rest, product] = [row.map((x) => x / size), products[k] / size];
    // Twice, since once leaves rounding.
    for (let pass = 0; pass < 2; pass++) {
      basis.forEach((u, i) => {
        const part = dot(u, rest);
        rest = rest.map((x, j) => x - part * u[j]);
        product -= part * along[i];
      });
    }
    const left = length(rest);
    if (!(left > DEPENDENT)) return;
    basis.push(rest.map((x) => x / left));
    along.push(product / left);
  });
  return { basis, along };
}

// The shortest vector that has given products with rows.
function shortest(rows, products, n) {
  const { basis, along } = orthonormal(rows, products), x = Array(n).fill(0);
  basis.forEach((u, k) => u.forEach((part, i) => (x[i] += along[k] * part)));
  return x;
}

// An orthonormal basis of what is perpendicular to rows.
function perpendicular(rows, n) {
  const spanned = orthonormal(rows, rows.map(() => 0)).basis, all = spanned.slice();
  const axis = (i) => Array.from({ length: n }, (_, k) => (k === i ? 1 : 0));
  const outside = (x) => {
    for (let pass = 0; pass < 2; pass++) {
      for (const u of all) {
        const part = dot(u, x);
        x = x.map((x, j) => x - part * u[j]);
      }
    }
    return x;
  };
  while (all.length < n) {
    // The axis with the largest part outside what there is.
    const left = Array.from({ length: n }, (_, i) => outside(axis(i)));
    const best = left.reduce((a, b) => (length(b) > length(a) ? b : a)), size = length(best);
    if (!(size > 0)) break;
    all.push(best.map((x) => x / size));
  }
  return all.slice(spanned.length);
}

// Something that moves: a Lagrangian, perhaps a dissipation and constraints, angles that are reduced to one turn.
class Motion {
  constructor({ lagrangian, dissipation, held }, parameters, n, wrapped) {
    Object.assign(this, { n, wrapped, parameters });
    this.lagrangian = new Recorded(lagrangian, parameters, 2 * n);
    this.friction = dissipation ? new Recorded(dissipation, parameters, 2 * n) : null;
    const given = held.parameters ? Float64Array.from(held.parameters) : parameters;
    this.held = held.rows.map(({ name, holonomic, value }) => ({ name, holonomic, of: new Recorded(value, given, 2 * n) }));
  }
  // What holds the motion at a state: rows A, values, rates A v - b and drifts gamma.
  rows(q, v) {
    const n = this.n, x = q.concat(v), list = (f) => Array.from({ length: n }, (_, i) => f(i));
    return this.held.map(({ name, holonomic, of }) => {
      const value = of.evaluate(x);
      if (!holonomic) {
        const row = list((i) => of.first(n + i)), drift = dot(list((i) => of.first(i)), v);
        return { name, holonomic, row, value: 0, rate: value, drift };
      }
      const row = list((i) => of.first(i));
      const drift = v.reduce((sum, a, i) => sum + a * v.reduce((sum, b, j) => sum + of.second(i, j) * b, 0), 0);
      return { name, holonomic, row, value, rate: dot(row, v), drift };
    });
  }
  // The nearest state on the constraints: q by Newton's method, then v; null where there is none.
  project(q, v) {
    const n = this.n, holonomic = ({ holonomic }) => holonomic;
    if (!this.held.length) return { q, v };
    for (let step = 0, last = Infinity; step < 60; step++) {
      const rows = this.rows(q, v).filter(holonomic);
      const change = shortest(rows.map(({ row }) => row), rows.map(({ value }) => value), n), size = largest(change);
      q = q.map((x, i) => x - change[i]);
      const rounding = Number.EPSILON * largest(q);
      if (!(size > rounding) || (step > 3 && size > last / 2 && size < 1024 * rounding)) break;
      last = size;
    }
    for (let pass = 0; pass < 2; pass++) {
      const rows = this.rows(q, v);
      const change = shortest(rows.map(({ row }) => row), rows.map(({ rate }) => rate), n);
      v = v.map((x, i) => x - change[i]);
    }
    return this.distance(q, v) <= 1e-9 * (largest(q.concat(v)) || 1) ? { q, v } : null;
  }
  // How far a state is off the constraints, in units of the coordinates or of the velocities.
  distance(q, v) {
    const off = ({ row, value, rate }) => Math.max(Math.abs(value), Math.abs(rate)) / (length(row) || 1);
    return this.rows(q, v).map(off).reduce((most, x) => (x > most || Number.isNaN(x) ? x : most), 0);
  }
  // L, p, M, a, E, of a state, and det M, under constraints that of M within them.
  terms(q, v) {
    const { n, lagrangian, wrapped, friction } = this, turn = 2 * Math.PI;
    const x = q.map((q, i) => (wrapped[i] ? q - turn * Math.floor(q / turn) : q)).concat(v);
    const value = lagrangian.evaluate(x);
    const list = (f) => Array.from({ length: n }, (_, i) => f(i));
    const momentum = list((i) => lagrangian.first(n + i)), slope = list((i) => lagrangian.first(i));
    const mass = list((i) => list((j) => lagrangian.second(n + i, n + j)));
    const drift = list((i) => v.reduce((sum, v, j) => sum + lagrangian.second(j, n + i) * v, 0));
    // Where a function is not defined, as the logarithm of a negative number, its derivatives may be finite all the same.
    const defined = !Number.isNaN(value) && !(friction && Number.isNaN(friction.evaluate(x)));
    const force = list((i) => (friction ? -friction.first(n + i) : 0));
    const right = list((i) => (defined ? slope[i] - drift[i] + force[i] : NaN));
    const energy = dot(momentum, v) - value, found = { lagrangian: value, momentum, mass, energy };
    if (!this.held.length) {
      const { x: acceleration, determinant } = solve(mass, right);
      return { ...found, acceleration, determinant };
    }
    // [M A^T; A 0] [a; -lambda] = [f; -gamma]
    const rows = this.rows(q, v), a = rows.map(({ row }) => row);
    const matrix = mass.map((row, i) => row.concat(a.map((row) => row[i]))).concat(a.map((row) => row.concat(a.map(() => 0))));
    const acceleration = solve(matrix, right.concat(rows.map(({ drift }) => -drift))).x.slice(0, n);
    const free = perpendicular(a, n), images = free.map((z) => mass.map((row) => dot(row, z)));
    const within = free.map((z) => images.map((image) => dot(z, image)));
    return { ...found, acceleration, determinant: solve(within, free.map(() => 0)).determinant };
  }
  rate(y) {
    const q = y.slice(0, this.n), v = y.slice(this.n);
    return v.concat(this.terms(q, v).acceleration);
  }
}

// Determinant and diagonal of a mass matrix after the factors of its coordinates, under so many constraints; those have one factor.
function aligned({ determinant, mass }, factors, constraints) {
  const of = factors || mass.map(() => 1), within = of.slice(0, of.length - constraints);
  return { determinant: within.reduce((product, factor) => product * factor, determinant), diagonal: mass.map((row, i) => of[i] * row[i]) };
}

// Dormand and Prince, order 5(4).
const STAGES = [
  [], [1 / 5], [3 / 40, 9 / 40], [44 / 45, -56 / 15, 32 / 9], [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
  [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656], [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
];
const ERROR = [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40];

const OFF = "the constraints have no state near this one";

// A motion from a start, brought to its constraints there and after every step; `advance` goes on to a time, or as far as its evaluations
// reach.
class Flight {
  constructor(motion, q, v, step) {
    const on = motion.project(q, v);
    Object.assign(this, { motion, t: 0, y: on ? on.q.concat(on.v) : q.concat(v), step, ended: on ? null : OFF });
  }
  advance(until, evaluations = Infinity, rtol = 1e-7, atol = 1e-9) {
    const { motion } = this;
    while (this.t < until && !this.ended && evaluations > 0) {
      const h = Math.min(this.step, until - this.t), rates = [];
      let next = this.y;
      for (const row of STAGES) {
        next = this.y.map((y, i) => y + h * row.reduce((sum, a, k) => sum + a * rates[k][i], 0));
        rates.push(motion.rate(next));
      }
      evaluations -= STAGES.length;
      let error = 0;
      this.y.forEach((y, i) => {
        const off = h * ERROR.reduce((sum, e, k) => sum + e * rates[k][i], 0);
        error += (off / (atol + rtol * Math.max(Math.abs(y), Math.abs(next[i])))) ** 2;
      });
      error = Math.sqrt(error / this.y.length);
      if (error <= 1) {
        const n = motion.n, on = motion.project(next.slice(0, n), next.slice(n));
        this.t += h;
        this.y = on ? on.q.concat(on.v) : next;
        if (!on) this.ended = OFF;
      }
      const factor = Number.isFinite(error) ? Math.min(5, Math.max(0.2, 0.9 * (error || 1e-10) ** -0.2)) : 0.2;
      if (error > 1 || h === this.step || factor < 1) this.step = h * factor;
      if (!this.ended && !(this.step > 1e-12 * Math.max(1, Math.abs(this.t)))) this.ended = "the motion goes no further: its equations have no solution here";
    }
  }
}

// Single-precision numbers from their base64.
function decode(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return Float64Array.from(new Float32Array(bytes.buffer));
}

// The learned motion and, if it is known, the exact one.
function load(data) {
  const n = data.columns.length / 2, none = Array(n).fill(false);
  const learned = new Motion(data.learned, decode(data.learned.weights), n, data.periodic);
  const exact = data.exact && new Motion(data.exact, Float64Array.from(data.exact.parameters, (p) => p.value), n, none);
  return { learned, exact };
}

if (typeof module !== "undefined") module.exports = { load, Flight, Motion, Recorded, aligned };
