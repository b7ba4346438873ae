"""What `Auto` picks, how often its estimate holds, and what it saves: `python -m tests.benchmarks.ladder`."""

from __future__ import annotations

import collections
import time

import jax
import numpy as np

from tests.reference import NAMES
from tpd import Auto, Parameters, Segmented, status_name, steady_state
from tpd.core.files import versions
from tpd.scene.status import SETTLED

SCENES, SEED = 320, 11
LOW = np.array([0.08, 0.0, 0.1, 0.05, 0.01, 0.05, 1.0])
HIGH = np.array([0.3, 0.3, 1.5, 0.5, 0.1, 0.5, 5.0])
TOLERANCES = (0.02, 0.05, 0.1)


def scenes() -> np.ndarray:
    """Seeded random scenes in NAMES[:7]; every eighth without a pendulum."""
    x = LOW + (HIGH - LOW) * np.random.default_rng(SEED).random((SCENES, 7))
    x[::8, 1] = 0.0
    return x


def timed(p: Parameters, model) -> tuple:
    """The steady state and the seconds it took."""
    begin = time.perf_counter()
    steady = jax.block_until_ready(steady_state(p, model=model))
    return steady, time.perf_counter() - begin


def main() -> None:
    """Print the tables."""
    jax.config.update("jax_enable_x64", True)
    print(versions())
    all_scenes = [Parameters(**dict(zip(NAMES, map(float, x), strict=False))) for x in scenes()]
    models = {"top": Segmented(), **{t: Auto(tolerance=t) for t in TOLERANCES}}
    for model in models.values():
        for p in all_scenes[:20]:
            timed(p, model)
    results = [{name: timed(p, model) for name, model in models.items()} for p in all_scenes]
    for tolerance in TOLERANCES:
        report(tolerance, results)


def report(tolerance: float, results: list) -> None:
    """One tolerance: models, how often the estimate held, the time."""
    by_model: dict[str, list] = collections.defaultdict(list)
    for r in results:
        (steady, seconds), (top, _) = r[tolerance], r["top"]
        by_model[steady.model].append((held(steady, top), seconds))
    total, always = (sum(r[name][1] for r in results) for name in (tolerance, "top"))
    print(
        f"\ntolerance {tolerance}: {total:.2f} s, {always / total:.1f} times faster than the top model alone"
    )
    print(f"{'model':14}{'scenes':>8}{'estimate held':>15}{'other motion':>14}{'median ms':>11}")
    for model, rows in by_model.items():
        kinds = collections.Counter(kind for kind, _ in rows)
        ms = 1e3 * np.median([seconds for _, seconds in rows])
        print(f"{model:14}{len(rows):8}{kinds['held']:15}{kinds['other']:14}{ms:11.2f}")
        if kinds["broken"]:
            print(f"  broken: {kinds['broken']}")


def held(steady, top) -> str:
    """Whether the true error, against the top model, was within the estimate; or whether the top model
    ends in another kind of motion."""
    name, truth = status_name(steady.status), status_name(top.status)
    if steady.model == "nonlinear":
        return "held"
    rests = name == "rest"
    if truth not in SETTLED or rests != (truth == "rest"):
        return "other"
    error = 0.0 if rests else abs(float(steady.amplitude) / float(top.amplitude) - 1.0)
    return "held" if error <= float(steady.estimate) else "broken"


if __name__ == "__main__":
    main()
