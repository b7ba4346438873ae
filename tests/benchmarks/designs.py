"""Seconds that designs over many conditions take, cold and warm, and an ensemble.

    .venv/bin/python -m tests.benchmarks.designs [--quick]

Cold is the first of its kind in a process that has compiled nothing and has no compiled programs stored; warm
is the median of others with other seeds, verification included: search, events, nonlinear equations,
ensemble. The search alone is the first stage of `tpd.optimise`. `--quick` has one seed and small budgets.
"""

import argparse
import os
import statistics
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tpd.answers.ensemble import Outcomes, outcomes  # noqa: E402
from tpd.design.checkpoint import Checkpoint  # noqa: E402
from tpd.design.problem import Problem  # noqa: E402
from tpd.design.result import Design  # noqa: E402
from tpd.design.search import Multistart  # noqa: E402

SCENE = tpd.paper_scene()
SPACE = tpd.DesignSpace(damping_ratio=(0.05, 0.4))
LIMITS = (tpd.limits.Stroke(), tpd.limits.Reserve(), tpd.limits.Mass(3.0))
BAND = tpd.Conditions.band(SCENE, 2.0, 3.5, 20)
SCATTER = tpd.Conditions.scatter(
    256, friction=0.2, amplitude=0.05, slenderness=0.02, frequency=0.02, length=0.02, damping=0.2
)
METHOD = tpd.Sequential(searches=64, screening=512, steps=40)
FEW = tpd.Sequential(searches=16, screening=512, steps=40)
QUICK = tpd.Sequential(searches=4, screening=32, steps=16)
SEEDS = (1, 2, 3)


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Result of a call, and its seconds."""
    begun = time.perf_counter()
    out = work()
    return out, time.perf_counter() - begun


def band(seed: int, method: tpd.Sequential) -> Design:
    """20 frequencies, three variables, stroke and mass limited."""
    return tpd.optimise(SCENE, SPACE, conditions=BAND, limits=LIMITS, method=method, seed=seed)


def search(seed: int, method: tpd.Sequential) -> Multistart:
    """Its search, without the verification."""
    objective = Problem.of(SCENE, SPACE, conditions=BAND, limits=LIMITS, method=method, seed=seed).objective
    out = Multistart(objective, method, seed, None)
    out.run(Checkpoint.of(None, None))
    return out


def robust(seed: int, method: tpd.Sequential) -> Design:
    """256 samples, the mean of the worst tenth."""
    options = {"risk": tpd.Risk.cvar(0.1), "limits": LIMITS, "method": method, "seed": seed}
    return tpd.optimise(SCENE, SPACE, conditions=SCATTER, **options)


def ensemble(seed: int, size: int) -> Outcomes:
    """Runs of 100 periods of the bare block."""
    return outcomes(SCENE, ensemble=tpd.Ensemble(size=size, seed=seed))


Work = Callable[[int], Any]
WORK: dict[str, tuple[Work, str]] = {
    "band of 20 frequencies, 64 searches, (mu, lam, zeta), stroke and mass limited": (
        lambda seed: band(seed, METHOD),
        "5 s; cold 20 s",
    ),
    "its search alone": (lambda seed: search(seed, METHOD), ""),
    "256 samples, worst tenth, 64 searches": (lambda seed: robust(seed, METHOD), "20 s"),
    "the same, 16 searches": (lambda seed: robust(seed, FEW), "20 s"),
    "ensemble of 10 000 runs of 100 periods": (lambda seed: ensemble(seed, 10_000), "40 s, aim 10 s"),
}
SMALL: dict[str, tuple[Work, str]] = {
    "band of 20 frequencies, 4 searches": (lambda seed: band(seed, QUICK), ""),
    "its search alone": (lambda seed: search(seed, QUICK), ""),
    "ensemble of 200 runs of 100 periods": (lambda seed: ensemble(seed, 200), ""),
}


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--quick", action="store_true", help="small budgets, one seed")
    quick = options.parse_args().quick
    about = ", ".join(f"{name} {version(name)}" for name in ("tpd", "jax", "numpy"))
    print(f"{about}, {os.cpu_count()} cores\n")
    print("| what | reach, warm | first, s | warm, s |\n|---|---|---|---|")
    for name, (work, reach) in (SMALL if quick else WORK).items():
        out, first = timed(lambda work=work: work(0))
        seeds = SEEDS[:1] if quick else SEEDS
        others, warm = zip(*(timed(lambda work=work, seed=seed: work(seed)) for seed in seeds), strict=True)
        print(f"| {name} | {reach} | {first:.1f} | {statistics.median(warm):.2f} |", flush=True)
        for found in (out, *others):
            if isinstance(found, Design) and found.best is not None:
                value, left = found.best.value, found.best.stationarity
                print(f"  {found.status.name}, {value:.6f}, gain left {left:.1e}", flush=True)


if __name__ == "__main__":
    main()
