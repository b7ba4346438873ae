"""Measure the speed of batches, with SciPy and a Numba loop that a user could write for comparison."""

from functools import partial
from typing import Any

import jax
import numpy as np

import tpd
from tests.benchmarks.stored import columns, timed
from tests.reference import WITH, parameters

QUESTION = "How fast are many designs with gradients, multipliers and statuses, and how fast are runs?"
MEASURES = "compiled", "core/batch", "answers/ensemble", "answers/run_table", "answers/symmetric_orbits"
SEED = 0
PERIODS, SPREAD = 100, 0.1
"""Periods of a run; share by which mass, length and damping vary around the reference scenes."""
GRADIENTS, RUNS = "symmetric orbits, gradients in 3 parameters", "run until it repeats"
WHOLE, LOOP = "run of 100 periods", "Numba loop, run of 100 periods"
BY_SCIPY, BY_LOOP = (
    "SciPy DOP853, gradient in 3 parameters",
    "Numba loop, gradient in 3 parameters (200 periods)",
)
ENSEMBLE = "ensemble without a pendulum, 100 periods"
PERIOD = "forcing period of a run on one core, {equations}, {scene}"


def designs(n: int) -> np.ndarray:
    """Return designs (n, 8) around the reference scenes."""
    x = np.ones((n, 8))
    x[:, :7] = np.array([WITH[i % 4].x for i in range(n)])
    x[:, 1:4] *= np.random.default_rng(SEED).uniform(1.0 - SPREAD, 1.0 + SPREAD, (n, 3))
    return x


def describe(x: jax.Array) -> tuple:
    """Return amplitudes, gradients in (mu, lam, zeta), multipliers and statuses of all symmetric orbits."""

    def sizes(design: jax.Array) -> tuple:
        o = tpd.symmetric_orbits(parameters((x[0], *design, *x[4:])))
        return o.amplitude, (o.amplitude, o.multipliers, o.status)

    return jax.jacfwd(sizes, has_aux=True)(x[1:4])


def scenes_of_runs() -> dict[str, tuple[tpd.Scene, tpd.Pendulum, tuple[float, ...]]]:
    """The chimney, the paper's block, and that block with a pendulum with which most runs stick, each with
    the periods over which the shaking grows."""
    size = {"width": 1.3, "height": 10.0, "mass": 16_280.0, "cavity_width": 0.9, "radius_of_gyration": 2.92}
    sway, own = tpd.Harmonic(frequency=0.85, amplitude=0.081), tpd.paper_scene()
    chimney = tpd.Scene(tpd.Block(**size, restitution="housner"), sway)
    return {
        "chimney": (chimney, tpd.Pendulum(mass=532.0, length=0.51, damping_ratio=0.2), (0.0, 10.0)),
        "paper's block": (own, tpd.Pendulum(mass=1.6, length=0.04, damping_ratio=0.1), (0.0, 10.0)),
        "sticking": (own, tpd.Pendulum(mass=1.6, length=0.12, damping_ratio=0.1), (10.0,)),
    }


def run(quick: bool) -> list[dict[str, Any]]:
    """Return the seconds of each kind of work."""
    from tests.benchmarks.precision.numba_loop import gradients
    from tests.benchmarks.precision.numba_loop import settle_all as loop
    from tests.benchmarks.precision.peers import METHODS
    from tests.benchmarks.precision.scenes import SCENES
    from tpd.answers.ensemble import plan
    from tpd.compiled.rows import row_of
    from tpd.compiled.simulate import HarmonicForcing, follow
    from tpd.scene.parameters import as_arrays
    from tpd.scene.quantities import parameters_of

    rows = []

    def note(what: str, n: int, seconds: float) -> None:
        rows.append({"what": what, "designs": n, "seconds": seconds})

    tpd.in_chunks(describe, designs(300))
    for n in (100, 1000) if quick else (100, 1000, 10_000, 100_000):
        x = designs(n)
        note(GRADIENTS, n, timed(lambda x=x: tpd.in_chunks(describe, x), 3))
    n = 200 if quick else 5000
    x, rest = designs(n), np.zeros((n, 4))
    p = as_arrays(parameters(list(x.T)))
    every = tpd.Piecewise(max_periods=PERIODS, tolerance=1e-16, lyapunov_periods=1)
    for what, model in ((RUNS, tpd.Piecewise()), (WHOLE, every)):
        forcing, limits = HarmonicForcing(model.max_periods), {**model.accuracy, "tolerance": model.tolerance}
        run = partial(follow, tpd.Terms.linear, forcing=forcing, **limits)
        run(row_of(p)[:100])
        note(what, n, timed(lambda run=run: run(row_of(p)), 3))
    loop(x[:4], rest[:4], PERIODS)
    note(LOOP, n, timed(lambda: loop(x, rest, PERIODS), 3))
    few = n // 10
    note(BY_LOOP, few, timed(lambda: gradients(x[:few], rest[:few], (1, 2, 3), 200, loop), 3))
    scenes = SCENES[1:2] if quick else SCENES[1:3]
    work = [METHODS[0].gradient(scene, 1e-5) for scene in scenes]
    note(BY_SCIPY, len(scenes), timed(lambda: [w() for w in work]))
    many, scene = (200 if quick else 10_000), tpd.paper_scene()
    tpd.outcomes(scene, ensemble=tpd.Ensemble(size=50, seed=1))
    note(ENSEMBLE, many, timed(lambda: tpd.outcomes(scene, ensemble=tpd.Ensemble(size=many, seed=SEED))))
    for name, (scene, pendulum, growth) in scenes_of_runs().items():
        ensemble = tpd.Ensemble(size=40 if quick else 400, seed=SEED, periods=50, growth=growth)
        runs = plan(parameters_of(scene, pendulum), ensemble)
        p, y0, forcing = runs.p, runs.y0, HarmonicForcing(50, begin=runs.begin, ramp=runs.growth)
        for equations in tpd.Terms.linear, tpd.Terms.nonlinear:
            work = partial(follow, equations, row_of(p), forcing, y0=y0, workers=1)
            what = PERIOD.format(equations=equations.value, scene=name)
            note(what, int(work().elapsed.sum()), timed(work, 3))
    return rows


def per_design(rows: list[dict[str, Any]], what: str) -> float:
    """Return the smallest time per design in seconds; SciPy uses one core."""
    return min(r["seconds"] / r["designs"] for r in rows if r["what"] == what)


def table(rows: list[dict[str, Any]]) -> str:
    """Return times and rates."""
    each = ((r, r["seconds"] / r["designs"]) for r in rows)
    rates = [r | {"each": 1e6 * s, "rate": 1.0 / s} for r, s in each]
    heads = {"work (all cores; SciPy one core)": "{what}", "designs": "{designs:,}", "s": "{seconds:.3g}"}
    return columns(rates, **heads, **{"µs per design": "{each:.3g}", "designs per second": "{rate:,.0f}"})
