// The pendulum of the sliders: dimensionless parameters, the body that can be built, and the limits that it keeps.
//
// The formulas are those of tpd/scene/scene.py, tpd/scene/bob.py, tpd/theory/no_uplift.py and
// tpd/design/geometry.py. A pendulum is { mass, length, damping }, in kg, m and as a damping ratio.

import { housner } from "./rocking.mjs";

const MOST = 1 + 1e-4; // Share from which a limit is exceeded: the tables round by 1e-5 of their largest value.
const TURNS = 50; // Steps of Newton's method for the rod of the body; it stops earlier where it has converged.

/** Return the dimensionless parameters under a harmonic { amplitude, frequency }; without a pendulum mu is 0. */
export function parameters(scene, motion, pendulum = null) {
  const { nu, rho, k, restitution, gravity, rate, mass, centroid, kappa } = scene;
  const mu = pendulum ? pendulum.mass / mass : 0, omega = 2 * Math.PI * motion.frequency;
  return {
    nu, rho, k, mu, kappa,
    lam: pendulum ? pendulum.length / centroid : 1,
    zeta: pendulum ? pendulum.damping : 0.3,
    f: "peak" in motion ? motion.peak / gravity : (motion.amplitude * omega ** 2) / gravity,
    xi: omega / rate,
    e: restitution === "housner" ? housner(nu, rho, mu) : restitution,
  };
}

/**
 * Return the tilt and the swing f/|D| of a block at rest under a settled bob, and the margin
 * 1 - |B| f/((1 + mu) nu + k), which is positive where the block stays at rest.
 */
export function atRest(p) {
  const c = 2 * p.zeta * Math.sqrt(p.lam * p.rho), square = p.lam * p.rho * p.xi ** 2;
  const real = 1 - square, imaginary = p.xi * c, size = real ** 2 + imaginary ** 2;
  const hReal = p.kappa * p.mu * square, hImaginary = -p.xi * p.mu * p.lam * c;
  const bReal = 1 + p.kappa * p.mu + (hReal * real + hImaginary * imaginary) / size;
  const bImaginary = (hImaginary * real - hReal * imaginary) / size;
  const margin = 1 - (p.f * Math.hypot(bReal, bImaginary)) / ((1 + p.mu) * p.nu + p.k);
  return { margin, tilt: 0, swing: p.f / Math.sqrt(size) };
}

/** Return the body that swings as the point of the pendulum does, in m and kg; the point where none `exists`. */
export function bodyOf(scene, pendulum) {
  const { bob } = scene, ball = bob.shape === "ball";
  const radius = (mass) => Math.cbrt(mass / (bob.density * Math.PI * (ball ? 4 / 3 : 2 * bob.aspect)));
  const own = ball ? 0.4 * radius(1) ** 2 : ((3 + 4 * bob.aspect ** 2) / 12) * radius(1) ** 2;
  const share = bob.rodShare, pull = pendulum.mass * pendulum.length;
  const half = (mass) => radius(mass) * (ball ? 1 : bob.aspect);
  const sized = (mass, rod, exists) => ({ exists, mass, rod, radius: radius(mass), half: half(mass) });
  const point = sized(pendulum.mass, pendulum.length, false);
  let rod = 1.5 * pendulum.length;
  for (let i = 0; i < TURNS; i++) {
    // The value is a convex function of the rod: Newton's method comes to its root from above.
    const lever = rod * (1 + 0.5 * share * rod), turn = 1 + share * rod;
    const inertia = own * Math.cbrt(pull / lever) ** 2;
    const value = rod ** 2 * (1 + (share * rod) / 3) + inertia - pendulum.length * lever;
    const slope = rod * (1 + turn) - pendulum.length * turn - (inertia * turn) / (1.5 * lever);
    if (!(slope > 0)) return point;
    rod -= value / slope;
    if (!(rod > 0)) return point;
    if (Math.abs(value) < 1e-14 * slope * rod) break;
  }
  return sized(pull / (rod * (1 + 0.5 * share * rod)), rod, true);
}

/** Return the largest distance of a body from the block's axis at angles up to `angle` between rod and block. */
export function reachOf(scene, body, angle) {
  const ball = scene.bob.shape === "ball", tail = ball ? 0 : body.half;
  const widest = Math.atan2(body.rod + tail, ball ? 0 : body.radius), at = Math.min(angle, widest);
  return (body.rod + tail) * Math.sin(at) + (ball ? body.radius : body.radius * Math.cos(at));
}

/**
 * Return the limited quantities over their limits, as { name, share, exceeded }.
 *
 * @param motion { tilt, swing, without, rodAngle }: tilt over nu, bob angle in rad, tilt over nu without a pendulum,
 *   and angle between rod and block in rad (by default the sum of both angles); null keeps only the limits of the bob
 *   that hangs at rest
 * @param body the body of the pendulum, if it is known already
 */
export function limitShares(scene, limits, pendulum, motion, body = bodyOf(scene, pendulum)) {
  const shares = [], add = (name, share) => shares.push({ name, share, exceeded: share > MOST });
  const { tilt, swing, rodAngle } = motion ?? { tilt: 0, swing: 0 }, angle = rodAngle ?? swing + tilt * scene.nu;
  const { rod, mass, half, exists } = body;
  if ("mass" in limits) add("mass", mass / limits.mass);
  if ("clearance" in limits) {
    add("thickness", half / (0.6 * rod) + (exists ? 0 : 1));
    add(scene.lowest, (rod + half) / scene.depth);
    add("clearance", reachOf(scene, body, angle) / scene.wall);
  }
  if (!motion) return shares;
  if ("stroke" in limits) add("stroke", swing / limits.stroke);
  if ("relative_stroke" in limits) add("relative_stroke", angle / limits.relative_stroke);
  if ("tilt" in limits) add("tilt", tilt / limits.tilt);
  if ("offset" in limits) add("offset", (rod * Math.sin(Math.min(angle, Math.PI / 2))) / limits.offset);
  // Relative to a very small tilt every tilt would be a worsening: at least 0.02 of the slenderness is allowed.
  const most = (1 + limits.worsening) * Math.max(motion.without, 0.02);
  if ("worsening" in limits && Number.isFinite(most)) add("worsening", tilt / most);
  return shares;
}
