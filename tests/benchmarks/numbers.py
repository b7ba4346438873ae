"""The numbers of the README's accuracy table, measured side by side in one run.

    .venv/bin/python -m tests.benchmarks.numbers [--quick]

`--quick` leaves out the grids, which take a minute or two.
"""

import argparse
import time
from importlib.metadata import version

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tests.reference import BARE, HUNG, parameters  # noqa: E402
from tpd.design.criteria import DEFAULT_LIMITS, stroke_limit  # noqa: E402
from tpd.design.screening import with_design  # noqa: E402
from tpd.scene.parameters import as_arrays  # noqa: E402

CASES = HUNG + BARE
NAMES = ("nu", "mu", "lam", "zeta", "k", "f", "xi")
EXACT = tpd.Piecewise()


def solver(model):
    """Compiled (amplitude, gradient as a vector) of the settled amplitude."""
    both = jax.jit(jax.value_and_grad(lambda p, y0: tpd.steady_state(p, model=model, y0=y0).amplitude))

    def solve(x, y0):
        value, gradient = both(as_arrays(parameters(x)), jnp.asarray(y0))
        return float(value), np.array([float(getattr(gradient, name)) for name in NAMES])

    return solve


def richardson(solve, x, y0, i, share=3e-3):
    """Central difference of the amplitude in parameter `i`, one step of extrapolation. The step, a
    share of the parameter, keeps truncation and round-off both near 1e-7."""

    def difference(h):
        up, down = np.array(x), np.array(x)
        up[i], down[i] = x[i] + h, x[i] - h
        return (solve(up, y0)[0] - solve(down, y0)[0]) / (2.0 * h)

    h = share * x[i]
    return (4.0 * difference(0.5 * h) - difference(h)) / 3.0


def accuracy():
    """Rows (what, worst) about amplitudes and gradients of both models."""
    exact, smooth = solver(EXACT), solver(tpd.Smoothed())
    truth = [exact(c.x, c.y0) for c in CASES]
    soft = [smooth(c.x, c.y0) for c in CASES]
    hung = range(len(HUNG))
    yield (
        "exact amplitude, 4 pendulum cases, relative error",
        max(abs(truth[i][0] / CASES[i].amplitude - 1.0) for i in hung),
    )
    yield (
        "exact amplitude, 3 bare cases, absolute error (7 digits known)",
        max(abs(t[0] - c.amplitude) for t, c in zip(truth, CASES, strict=True) if c in BARE),
    )
    yield (
        "exact gradient, 4 pendulum cases x 7 parameters, relative error",
        max(np.max(np.abs(truth[i][1] / np.array(CASES[i].gradient) - 1.0)) for i in hung),
    )
    yield (
        "exact gradient against Richardson differences, relative error",
        max(
            abs(richardson(exact, c.x, c.y0, i, 2e-3) / truth[n][1][i] - 1.0)
            for n, c in enumerate(HUNG)
            for i in range(7)
        ),
    )
    for sharpness in (0.008, 0.004, 0.002):
        solve = solver(tpd.Smoothed(sharpness=sharpness))
        values = soft if sharpness == 0.002 else [solve(c.x, c.y0) for c in CASES]
        label = " (default)" if sharpness == 0.002 else ""
        yield (
            f"smoothed amplitude against exact, 7 cases, sharpness {sharpness}{label}",
            max(abs(v[0] / t[0] - 1.0) for v, t in zip(values, truth, strict=True)),
        )
    yield (
        "smoothed gradient against central differences, mu lam zeta k f xi",
        max(
            abs(richardson(smooth, c.x, c.y0, i) / soft[n][1][i] - 1.0)
            for n, c in enumerate(HUNG)
            for i in range(1, 7)
        ),
    )
    yield (
        "smoothed gradient against exact gradient, 4 pendulum cases",
        max(np.max(np.abs(soft[i][1] / truth[i][1] - 1.0)) for i in hung),
    )


TOWER = tpd.Scene(
    tpd.Block(width=0.08, height=0.4, mass=13.0, friction=0.05, cavity_width=0.08),
    tpd.Harmonic(amplitude=0.009243, frequency=2.839),
)
LIGHT = tpd.DesignSpace(mass_ratio=(0.01, 0.1))
WIDE = (tpd.limits.Stroke(1.5), tpd.limits.Reserve())
SCENES = {
    "the paper's block, defaults": (tpd.paper_scene(), tpd.DesignSpace(), DEFAULT_LIMITS),
    "the paper's block, mu <= 0.1, stroke 1.5": (tpd.paper_scene(), LIGHT, WIDE),
    "a slimmer block, mu <= 0.1": (TOWER, LIGHT, DEFAULT_LIMITS),
    "a slimmer block, mu <= 0.1, stroke 1.5": (TOWER, LIGHT, WIDE),
}
"""Scene, space and limits."""


def grid_best(scene, space, limits, n=40):
    """Least exact amplitude within the limit on the stroke on an n x n grid over (mu, lam)."""
    p, best, most = as_arrays(scene.parameters()), np.inf, stroke_limit(limits)
    for mu in np.linspace(*space.mass_ratio, n):
        for lam in np.linspace(*space.length_ratio, n):
            s = tpd.steady_state(with_design(p, jnp.array([mu, lam, space.damping_ratio])), model=EXACT)
            if tpd.status_name(s.status) in ("rocking", "rest") and float(s.stroke) <= most:
                best = min(best, float(s.amplitude))
    return best


def main():
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--quick", action="store_true", help="without the grids")
    options.add_argument("--points", type=int, default=40, help="of the grids along each axis (40)")
    asked = options.parse_args()
    quick, points = asked.quick, asked.points
    packages = ", ".join(f"{name} {version(name)}" for name in ("jax", "diffrax", "optax", "equinox"))
    print(f"tpd {tpd.__version__}, {packages}, {time.strftime('%Y-%m-%d')}\n")
    for what, worst in accuracy():
        print(f"| {what} | {worst:.1e} |", flush=True)
    if quick:
        return
    print(
        f"\n| scene | best of {points} x {points} grid (rad) | optimum (rad) | optimum over grid "
        "| bare (rad) | status |"
    )
    for name, (scene, space, limits) in SCENES.items():
        best = grid_best(scene, space, limits, points)
        design = tpd.optimise(scene, space, limits=limits)
        ratio = "both 0" if best == design.amplitude == 0.0 else f"{design.amplitude / best - 1.0:+.2%}"
        print(
            f"| {name} | {best:.6f} | {design.amplitude:.6f} | {ratio} "
            f"| {design.amplitude_without:.6f} | {design.status.name} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
