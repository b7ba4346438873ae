"""Measure the choices of `Auto` for random scenes, whether its estimate is right, and the time it saves."""

import collections
import time
from typing import Any

import jax
import numpy as np

from tests.benchmarks.stored import columns
from tests.reference import NAMES
from tpd import Auto, Nonlinear, Parameters, status_name, steady_state
from tpd.scene.status import SETTLED, names_of

QUESTION = "Which model does `Auto` choose, and is its error estimate right?"
SEED, SCENES = 11, 160
LOW = np.array([0.08, 0.0, 0.1, 0.05, 0.01, 0.05, 1.0])
HIGH = np.array([0.3, 0.3, 1.5, 0.5, 0.1, 0.5, 5.0])
TOLERANCES = (0.02, 0.05, 0.1)


def scenes(count: int) -> list[Parameters]:
    """Return random scenes; every eighth has no pendulum."""
    x = LOW + (HIGH - LOW) * np.random.default_rng(SEED).random((count, 7))
    x[::8, 1] = 0.0
    return [Parameters(**dict(zip(NAMES, map(float, row), strict=False))) for row in x]


def timed(p: Parameters, model: Any) -> tuple[Any, float]:
    """Return the steady state and the seconds of the call."""
    begun = time.perf_counter()
    return jax.block_until_ready(steady_state(p, model=model)), time.perf_counter() - begun


def run(quick: bool) -> list[dict[str, Any]]:
    """Return a row for each tolerance and each model that was chosen."""
    all_scenes = scenes(12 if quick else SCENES)
    models = {"top": Nonlinear(), **{f"{t:.0%}": Auto(tolerance=t) for t in TOLERANCES[-1 if quick else 0 :]}}
    for model in models.values():
        for p in all_scenes[:20]:
            timed(p, model)
    results = {name: [timed(p, model) for p in all_scenes] for name, model in models.items()}
    rows, always = [], sum(seconds for _, seconds in results["top"])
    for name in list(models)[1:]:
        total = sum(seconds for _, seconds in results[name])
        by_model: dict[str, list[str]] = collections.defaultdict(list)
        for (steady, _), (top, _) in zip(results[name], results["top"], strict=True):
            by_model[steady.model].append(held(steady, top))
        for model, ends in by_model.items():
            row = {"tolerance": name, "model": model, "scenes": len(ends), "time": total / always}
            rows.append(row | {k: ends.count(k) for k in ("held", "broken", "other")})
    return rows


def held(steady: Any, top: Any) -> str:
    """Whether the true error, against the nonlinear equations, was within the estimate ("held", "broken"), or
    whether these end in another kind of motion ("other")."""
    name, truth = status_name(steady.status), status_name(top.status)
    if steady.model == "nonlinear":
        return "held"
    rests = name == "rest"
    if truth not in names_of(SETTLED) or rests != (truth == "rest"):
        return "other"
    error = 0.0 if rests else abs(float(steady.amplitude) / float(top.amplitude) - 1.0)
    return "held" if error <= float(steady.estimate) else "broken"


def table(rows: list[dict[str, Any]]) -> str:
    """Return the table; the time of all scenes is divided by that of the nonlinear model."""
    plain = {key: f"{{{key}}}" for key in ("tolerance", "model", "scenes")}
    more = {"error above estimate": "{broken}", "error within estimate": "{held}", "other motion": "{other}"}
    more |= {"time/nonlinear": "{time:.2f}"}
    return columns(rows, **plain, **more)
