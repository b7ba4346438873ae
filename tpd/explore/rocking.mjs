// The nonlinear equations (4) of block and pendulum with friction and impacts, without any access to the page.
//
// Symbols are those of the package: nu, mu, lam, zeta, k, f, xi, rho, e, kappa. Time is tau = omega_0 t, and a state is
// [phi, psi, phi', psi']. The equations are those of tpd/theory/equations.py, the impacts those of
// tpd/scene/impacts.py, and the contact modes and events those of tpd/compiled/contact.py. The load is minus the
// base acceleration over g: a positive acceleration tilts the block to positive phi.

const STEPS = 120; // Steps in the shortest of the periods of forcing, bob and block.
const CAPTURE = 1e-4; // Rate of an impact, over nu, below which a block that can be held comes to rest.
const TRIALS = 80; // Most trials for the time of an event. About ten are enough, except where a signal begins at zero.
const SLACK = 1e-13; // Share of the moment of the weight by which rounding may exceed it.
const MOST_EVENTS = 8000; // Most events in one call of `advance`.
const REST = 0, STICK = 1, SLIP = 2;
const FALLEN = Math.PI / 2; // Tilt from which the block has overturned.

/** Return the constants of the equations of one set of parameters. */
function coefficients(p) {
  const hinge = 2 * p.zeta * Math.sqrt(p.lam * p.rho);
  return {
    ...p,
    up: 1 + p.kappa * p.mu,
    weight: (1 + p.mu) * p.nu,
    inertia: 1 + p.mu * p.rho * (p.kappa ** 2 + p.nu ** 2),
    pull: p.mu * p.rho * p.lam,
    swing: p.lam * p.rho,
    hinge,
    drag: p.mu * p.lam * hinge,
  };
}

/** Return y + by k. Written out, because this is where most of the time goes. */
function moved(y, k, by) {
  return [y[0] + by * k[0], y[1] + by * k[1], y[2] + by * k[2], y[3] + by * k[3]];
}

/** Return psi'' under a block that is held at the angle y[0]; `load` is the base acceleration over g. */
function swingUnderHeldBlock(c, y, load) {
  return (load * Math.cos(y[1]) - Math.sin(y[1]) - c.hinge * y[3]) / c.swing;
}

/** Return phi'' and psi'' of a block that rocks about the corner of the sign `side`; `way` is the sign of phi'. */
function accelerations(c, y, side, way, load) {
  const [phi, psi, rate, bobRate] = y, sin = Math.sin(phi), cos = Math.cos(phi), apart = phi - psi;
  const bigS = side * c.nu * Math.sin(apart) + c.kappa * Math.cos(apart);
  const bigC = side * c.nu * Math.cos(apart) - c.kappa * Math.sin(apart);
  const onBlock = c.up * sin - side * c.weight * cos - load * (side * c.weight * sin + c.up * cos)
    - c.pull * bigC * bobRate ** 2 - way * c.k - c.drag * (rate - bobRate);
  const onBob = load * Math.cos(psi) - Math.sin(psi) + c.rho * bigC * rate ** 2 + c.hinge * (rate - bobRate);
  const coupling = c.pull * bigS, determinant = c.inertia * c.swing - coupling * c.rho * bigS;
  return [
    (c.swing * onBlock + coupling * onBob) / determinant,
    (c.inertia * onBob + c.rho * bigS * onBlock) / determinant,
  ];
}

/** Return the moment on a block that is held, less the moment of its weight about the corner `side`. */
function excess(c, y, side, load) {
  const [phi, psi, , bobRate] = y, apart = phi - psi;
  const bigS = side * c.nu * Math.sin(apart) + c.kappa * Math.cos(apart);
  const bigC = side * c.nu * Math.cos(apart) - c.kappa * Math.sin(apart);
  const weight = side * c.weight, sin = Math.sin(phi), cos = Math.cos(phi);
  return c.up * sin - weight * cos - load * (weight * sin + c.up * cos)
    + c.drag * bobRate + c.pull * (bigS * swingUnderHeldBlock(c, y, load) - bigC * bobRate ** 2);
}

/** Return phi' after an impact over phi' before it; `side` is the sign of the tilt before the impact. */
function velocityRatio(c, side, psi) {
  const sine = Math.sin(psi), cosine = Math.cos(psi), share = c.mu * c.rho;
  const high = c.kappa * sine, wide = side * c.nu * cosine, before = high + wide, after = high - wide;
  const inertia = 1 + share * after ** 2;
  const square = c.kappa ** 2, twice = 2 * c.kappa;
  const turn = c.e * ((c.nu ** 2 - square) * sine + twice * side * c.nu * cosine) + (square + c.nu ** 2) * sine;
  // A bob far from the axis must not give energy to the block: the ratio has an upper bound.
  const most = Math.sqrt((1 + share * before ** 2) / inertia);
  return c.e >= 1 ? c.e : Math.min(c.e + (share * sine * turn) / inertia, most);
}

/** Return the change of psi' in an impact, over phi' before it. */
function bobChange(c, ratio, side, psi) {
  const upwards = c.e === 1 ? 0 : side * c.nu * Math.sin(psi) * (ratio + 1);
  return (c.kappa * Math.cos(psi) * (ratio - 1) + upwards) / c.lam;
}

/** Return Housner's velocity ratio of a block with a bob below its hinge. */
export function housner(nu, rho, mu) {
  const share = rho * nu ** 2;
  return (1 - (2 + mu) * share) / (1 + mu * share);
}

/** Return whether the block overturns in run n of the validation, which has the parameters `p` with its scatter. */
export function overturns(p, scatter, n, isHousner, periods) {
  const own = { ...p, phase: scatter.phase[n], growth: scatter.growth[n] };
  for (const name of ["nu", "mu", "lam", "zeta", "k", "f", "xi", "rho", "e"]) own[name] *= scatter[name][n];
  // Runs differ from Housner's restitution by a number.
  const e = housner(own.nu, own.rho, own.mu);
  if (isHousner) own.e = Math.max(0, Math.min(e + scatter.e[n], Math.max(e, 0.999)));
  const motion = new Motion(own, scatter.start[n]).complete((2 * Math.PI * periods) / own.xi, periods);
  return motion.stalled ? NaN : Number(motion.overturned);
}

/** One motion of block and pendulum. `advance` follows it to a later time. */
export class Motion {
  /**
   * @param p parameters by name
   * @param start state at tau = 0
   * @param ground base acceleration over f g as { powers, order, span }: the coefficients of `order` powers of the
   *   elapsed share of each piece, whose duration is `span` in tau; null for the load f sin(xi tau)
   */
  constructor(p, start = [0, 0, 0, 0], ground = null) {
    this.c = coefficients(p);
    this.ground = ground;
    [this.piece, this.pieceEnd] = [0, ground ? ground.span : Infinity];
    this.y = [...start];
    this.tau = p.phase / p.xi || 0;
    this.impacts = 0;
    this.overturned = this.stalled = this.hasEnded = false;
    // A pendulum on a block that is free to move swings faster than one on a fixed hinge.
    const bob = Math.sqrt((this.c.lam * p.rho) / (1 + p.kappa ** 2 * p.mu));
    this.step = (2 * Math.PI * Math.min(1, bob, 1 / p.xi)) / STEPS;
    this.decide(Math.sign(start[0]), Math.sign(start[2]), this.load(this.tau));
  }

  /** Return minus the base acceleration over g; it jumps between pieces, and is zero after the last one. */
  load(tau) {
    const { f, xi, growth } = this.c, share = growth ? Math.min(1, (xi * tau) / (2 * Math.PI * growth)) : 1;
    if (!this.ground) return f * share * Math.sin(xi * tau);
    const { powers, order, span } = this.ground, first = this.piece * order, elapsed = tau / span - this.piece;
    let value = 0;
    if (first < powers.length) for (let n = order - 1; n >= 0; n--) value = value * elapsed + powers[first + n];
    return -f * value;
  }

  /** Set the contact mode of the state; `tilt` and `way` are the signs of phi and phi', zero included. */
  decide(tilt, way, load) {
    const { c, y } = this, friction = c.k + SLACK * (c.k + c.weight);
    const up = excess(c, y, tilt === 0 ? 1 : tilt, load);
    const down = tilt === 0 ? excess(c, y, -1, load) : up;
    const goes = way !== 0 ? way : up > friction ? 1 : down < -friction ? -1 : 0;
    this.kind = goes !== 0 ? SLIP : tilt !== 0 ? STICK : REST;
    this.side = tilt !== 0 ? tilt : goes;
    this.way = goes;
  }

  /** Return the derivative of a state in the present mode. */
  rates(y, tau) {
    const load = this.load(tau);
    if (this.kind !== SLIP) return [0, y[3], 0, swingUnderHeldBlock(this.c, y, load)];
    const [tilt, swing] = accelerations(this.c, y, this.side, this.way, load);
    return [y[2], y[3], tilt, swing];
  }

  /** Return the state after a time h in the present mode, by the classical method of Runge and Kutta. */
  after(h) {
    const { y, tau } = this, k1 = this.rates(y, tau), k2 = this.rates(moved(y, k1, h / 2), tau + h / 2);
    const k3 = this.rates(moved(y, k2, h / 2), tau + h / 2), k4 = this.rates(moved(y, k3, h), tau + h);
    return moved(y, moved(moved(moved(k1, k2, 2), k3, 2), k4, 1), h / 6);
  }

  /** Return the time within a step h from which on a signal of the state is positive, as it is at the end. */
  timeOf(signal, h, atEnd) {
    const at = (t) => signal(this.after(t), this.tau + t), tolerance = 1e-15 * (1 + this.tau);
    let [low, high, atLow, atHigh, last, previous] = [0, h, at(0), atEnd, h, ""];
    for (let i = 0; i < TRIALS && high - low > tolerance; i++) {
      // The method of false position in its Illinois form. A signal that begins at zero has no secant: halve.
      const t = atLow < 0 ? high - (atHigh * (high - low)) / (atHigh - atLow) : (low + high) / 2, value = at(t);
      const side = value > 0 ? "high" : "low";
      if (side === "high") [high, atHigh, atLow] = [t, value, previous === side ? atLow / 2 : atLow];
      else [low, atLow, atHigh] = [t, value, previous === side ? atHigh / 2 : atHigh];
      previous = side;
      if (Math.abs(t - last) < tolerance) return Math.min(t + tolerance, high);
      last = t;
    }
    return high;
  }

  /** Return the first event of a step of length h, its time, and the state there; no event leaves `name` empty. */
  firstEvent(h) {
    const { c, side, way, kind } = this;
    let end = this.after(h), name = "";
    const check = (candidate, signal) => {
      const atEnd = signal(end, this.tau + h);
      if (!(atEnd > 0)) return;
      h = this.timeOf(signal, h, atEnd);
      [name, end] = [candidate, this.after(h)];
    };
    if (kind === SLIP) {
      check("fall", (y) => Math.abs(y[0]) - FALLEN);
      check("turn", (y) => -way * y[2]);
      // Until it turns, the block moves one way: it has landed if its tilt has another sign by then.
      if (side !== way) check("landing", (y) => -side * y[0]);
    } else {
      // On the base the weight resists both directions.
      const limit = c.k + SLACK * (c.k + c.weight), [right, left] = kind === REST ? [1, -1] : [side, side];
      check("up", (y, tau) => excess(c, y, right, this.load(tau)) - limit);
      check("down", (y, tau) => -excess(c, y, left, this.load(tau)) - limit);
    }
    return { name, h, end };
  }

  /** Change rates and mode at an event. */
  meet(name, h) {
    const { y } = this, load = this.load(this.tau);
    if (name === "landing") {
      y[0] = 0;
      this.land(load);
    } else if (name === "turn") {
      y[2] = 0;
      this.decide(this.side, 0, load);
      // A block that turns in the moment of its release has only touched the limit: it stays.
      if (h < 1e-12 && this.kind === SLIP) this.kind = y[0] === 0 ? REST : STICK;
    } else if (name === "fall") {
      this.overturned = true;
    } else if (name !== "") {
      this.way = name === "up" ? 1 : -1;
      this.side = this.kind === REST ? this.way : this.side;
      this.kind = SLIP;
    }
  }

  /** Change the rates at an impact. */
  land(load) {
    const { c, y, side } = this, before = y[2];
    let ratio = velocityRatio(c, side, y[1]);
    this.impacts += 1;
    if (Math.abs(ratio * before) <= CAPTURE * c.nu) {
      // Ever smaller hops would follow without end: the block rests if weight and friction can hold it.
      this.decide(0, 0, load);
      if (this.kind === REST) ratio = 0;
    }
    y[3] += bobChange(c, ratio, side, y[1]) * before;
    y[2] = ratio * before;
    this.decide(0, Math.sign(y[2]), load);
  }

  /**
   * Follow the motion to the time `until`, or until the block overturns; `each` is called after every step.
   *
   * A motion with too many events is `stalled` and stays where it is.
   */
  advance(until, each = () => {}) {
    let events = 0;
    while (!this.hasEnded && this.tau < until) {
      // A step ends with its piece: the acceleration has a kink at every sample of a record, and may jump. The free
      // motion has pieces, too.
      const stop = Math.min(until, this.pieceEnd), left = stop - this.tau;
      const { name, h, end } = this.firstEvent(Math.min(this.step, left));
      this.y = end;
      this.tau = h > left - 1e-14 * (1 + stop) ? stop : this.tau + h;
      this.meet(name, h);
      if (this.tau === this.pieceEnd) {
        this.piece += 1;
        this.pieceEnd = (this.piece + 1) * this.ground.span;
        // A jump of the acceleration may release a block that is held.
        if (this.kind !== SLIP) this.decide(this.kind === REST ? 0 : this.side, 0, this.load(this.tau));
      }
      if (name !== "") events += 1;
      this.stalled = events > MOST_EVENTS || !Number.isFinite(end[0]);
      this.hasEnded = this.overturned || this.stalled;
      each(this);
    }
    return this;
  }

  /** Follow the motion over a time in equal parts; `each` is called after every step. */
  complete(span, parts, each) {
    const begin = this.tau, returns = () => Math.abs(this.y[0]) > this.c.nu;
    // The bound on the events holds for each part. A block beyond its toppling tilt at the end falls, or returns.
    for (let n = 1; !this.hasEnded && (n <= parts || (n < 2 * parts && returns())); n++) {
      this.advance(begin + (n / parts) * span, each);
    }
    return this;
  }

  /** Return the force along the rod over the weight of the bob; positive where the rod pulls. */
  get tension() {
    const { c, y, tau, side } = this, [phi, psi, rate, bobRate] = y;
    const [, , turning] = this.rates(y, tau), sin = Math.sin(phi), cos = Math.cos(phi);
    // Acceleration of the hinge, which moves about the corner of the base; lengths are in heights of the centroid.
    const across = side * c.nu * (sin * turning + cos * rate ** 2) + c.kappa * (cos * turning - sin * rate ** 2);
    const upwards = side * c.nu * (cos * turning - sin * rate ** 2) - c.kappa * (sin * turning + cos * rate ** 2);
    // In tau, g is one height of the centroid over rho.
    return (c.rho * across + this.load(tau)) * Math.sin(psi) + (c.rho * upwards + 1) * Math.cos(psi)
      + c.rho * c.lam * bobRate ** 2;
  }
}
