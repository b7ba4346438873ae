"""How long designs over many conditions take, cold and warm, and an ensemble.

    .venv/bin/python -m tests.benchmarks.designs

Cold is the first of its kind in a process that has compiled nothing and keeps nothing compiled; warm the
median of others with other seeds, everything included: search, events, nonlinear equations, ensemble. The
search alone is that which `tpd.optimise_over` begins with.
"""

import os
import statistics
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tpd.analysis.ensemble import Outcomes  # noqa: E402
from tpd.design.checkpoint import Kept  # noqa: E402
from tpd.design.many_result import DesignOver  # noqa: E402
from tpd.design.objective import Objective  # noqa: E402
from tpd.design.search import Search  # noqa: E402

SCENE = tpd.paper_scene()
SPACE = tpd.DesignSpace(damping_ratio=(0.05, 0.4))
LIMITS = tpd.Limits(mass=3.0)
BAND = tpd.Conditions.band(SCENE, 2.0, 3.5, 20)
SCATTER = tpd.Conditions.scatter(
    256, friction=0.2, amplitude=0.05, slenderness=0.02, frequency=0.02, length=0.02, damping=0.2
)
STARTS, SCREENING, STEPS = 64, 512, 40
SEEDS = (1, 2, 3)


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """What it gives, and its seconds."""
    begun = time.perf_counter()
    out = work()
    return out, time.perf_counter() - begun


def band(seed: int) -> DesignOver:
    """20 frequencies, 64 starts, three variables, stroke and mass limited."""
    return tpd.optimise_over(SCENE, BAND, SPACE, limits=LIMITS, seed=seed)


def search(seed: int) -> Search:
    """Its search, without what judges."""
    objective = Objective(SCENE.parameters(), BAND, SPACE, tpd.Measure.worst(), LIMITS, False)
    out = Search(objective, STARTS, SCREENING, STEPS, seed, None)
    out.run(Kept.of(None, None))
    return out


def robust(seed: int, starts: int = STARTS) -> DesignOver:
    """256 samples, the mean of the worst tenth."""
    measure = tpd.Measure.cvar(0.1)
    return tpd.optimise_over(SCENE, SCATTER, SPACE, limits=LIMITS, measure=measure, seed=seed, starts=starts)


def few(seed: int) -> DesignOver:
    """The same from a quarter of the starts."""
    return robust(seed, 16)


def ensemble(seed: int) -> Outcomes:
    """10 000 runs of 100 periods of the bare block."""
    return tpd.outcomes(SCENE, ensemble=tpd.Ensemble(size=10_000, seed=seed))


WORK = {
    "band of 20 frequencies, 64 starts, (μ, λ, ζ), stroke and mass limited": (band, "5 s; cold 20 s"),
    "its search alone": (search, ""),
    "256 samples, worst tenth, 64 starts": (robust, "20 s"),
    "the same, 16 starts": (few, "20 s"),
    "ensemble of 10 000 runs of 100 periods": (ensemble, "40 s, aim 10 s"),
}


def main() -> None:
    """Print the table."""
    about = ", ".join(f"{name} {version(name)}" for name in ("tpd", "jax", "numpy"))
    print(f"{about}, {os.cpu_count()} cores\n")
    print("| what | reach, warm | first, s | warm, s |\n|---|---|---|---|")
    for name, (work, reach) in WORK.items():
        out, first = timed(lambda work=work: work(0))
        others, warm = zip(*(timed(lambda work=work, seed=seed: work(seed)) for seed in SEEDS), strict=True)
        print(f"| {name} | {reach} | {first:.1f} | {statistics.median(warm):.2f} |", flush=True)
        for found in (out, *others):
            if isinstance(found, DesignOver):
                value, left = found.judged[-1].value, found.judged[-1].stationarity
                print(f"  {found.status.name}, {value:.6f}, gain left {left:.1e}", flush=True)


if __name__ == "__main__":
    main()
