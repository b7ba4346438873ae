"""Judging a design by many runs: how the block may be found when the shaking begins, how the shaking
begins, and what about both is uncertain.

One run decides little: rest, rocking and overturning exist side by side, and which is reached flips with
a per cent of the amplitude. The shares of a seeded set of runs are stable. All designs are put to the same
runs (common random numbers), so that two designs are compared run by run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import numpy as np

from tpd.analysis.work_queue import settle_all
from tpd.core import checks
from tpd.core.conditions import FACTORS, Conditions
from tpd.core.parameters import Parameters, uniform_inertia_ratio
from tpd.core.sampling import latin_hypercube
from tpd.core.scene import Pendulum, Scene
from tpd.core.status import SETTLED, names_of
from tpd.models.base import Settled
from tpd.models.piecewise import Piecewise

_MOST_SCATTER = 0.5
"""Largest relative half width of what is uncertain."""
SIGNIFICANT = 0.05
"""Chance below which a difference between two shares is not left to luck."""
_Z = 1.959964
"""Of the normal distribution, two-sided 95 %."""


@dataclass(frozen=True, kw_only=True)
class Ensemble:
    """A seeded set of runs; every spread is even (a Latin hypercube), and the first run is the nominal
    one: at rest, sudden shaking from tau = 0, nothing scattered.

    Raises:
        ValueError: a number out of range.
    """

    size: int = 512
    seed: int = 0
    periods: int = 100
    """Forcing periods of a run at most; one ends early where nothing new can follow."""
    tilt: float = 0.05
    """Largest |phi| at the start, in shares of nu."""
    tilt_rate: float = 0.05
    """Largest |phi'|, in shares of nu."""
    swing: float = 0.05
    """Largest |psi|, rad."""
    swing_rate: float = 0.05
    """Largest |psi'|, rad per unit tau."""
    any_phase: bool = True
    """Whether the shaking may begin at any of its phases; else at a zero of the base's acceleration."""
    ramps: tuple[float, ...] = (0.0, 2.0)
    """Start profiles: seconds over which the shaking grows, dealt out evenly; 0 is sudden. (Of
    dimensionless parameters: units of tau.) It grows linearly,
    counted from the zero of the base's acceleration before the run begins: a run that begins at another
    phase begins under the share that is reached by then."""
    amplitude: float = 0.01
    """Relative half width of the base's amplitude."""
    frequency: float = 0.01
    """The same of its frequency; the amplitude of the base's displacement stays."""
    friction: float = 0.2
    """The same of k."""
    damping: float = 0.2
    """The same of zeta."""

    def __post_init__(self) -> None:
        checks.count("size", self.size)
        checks.count("periods", self.periods)
        checks.count("seed", self.seed, least=0)
        for name in ("tilt", "tilt_rate", "swing", "swing_rate"):
            checks.not_negative(name, getattr(self, name))
        for name in ("amplitude", "frequency", "friction", "damping"):
            checks.within(name, getattr(self, name), 0.0, _MOST_SCATTER)
        ramps = self.ramps if isinstance(self.ramps, (tuple, list)) else (self.ramps,)
        if not ramps:
            raise ValueError("`ramps` must hold at least one duration, but is empty")
        for ramp in ramps:
            checks.not_negative("ramps", ramp)
        object.__setattr__(self, "ramps", tuple(float(r) for r in ramps))

    def draws(self) -> np.ndarray:
        """The runs' places in the unit cube, shape (size, 10): four of the start, phase, profile, and
        amplitude, frequency, friction and damping. The first is the nominal run."""
        rng = np.random.default_rng(self.seed)
        unit = latin_hypercube(rng, self.size, 10)
        unit[0] = 0.5
        unit[0, 4:6] = 0.0
        return unit


class Share(NamedTuple):
    """A share of the runs, with its 95 % confidence interval (Wilson's)."""

    value: float
    low: float
    high: float

    @staticmethod
    def of(hits: np.ndarray) -> Share:
        """That of a vector of yes and no."""
        n, s = len(hits), float(np.mean(hits))
        middle = (s + _Z**2 / (2 * n)) / (1 + _Z**2 / n)
        half = _Z / (1 + _Z**2 / n) * math.sqrt(s * (1 - s) / n + _Z**2 / (4 * n**2))
        return Share(s, max(0.0, middle - half), min(1.0, middle + half))

    def __str__(self) -> str:
        return f"{self.value:.1%} ({self.low:.1%} to {self.high:.1%})"


@dataclass(frozen=True, kw_only=True)
class Outcomes:
    """What became of the runs of an ensemble: arrays of shape (size,), angles in rad."""

    ensemble: Ensemble
    status: np.ndarray
    """Names of statuses; a run that has not settled within its periods is not_settled."""
    peak: np.ndarray
    """Largest |phi| from the start on; infinite where the block overturns."""
    amplitude: np.ndarray
    """Settled |phi|, or the largest of the last periods; infinite where it overturns."""
    peak_stroke: np.ndarray
    """Largest |psi| from the start on."""
    stroke: np.ndarray
    ramp: np.ndarray
    """Start profile: seconds (or units of tau) over which the shaking grew."""

    @property
    def overturned(self) -> Share:
        """Share of the runs in which the block overturns; one that is lost otherwise counts as well."""
        return Share.of(self.lost)

    @property
    def lost(self) -> np.ndarray:
        """Whether a run overturned, or left the numbers."""
        return np.isin(self.status, ("overturned", "failed"))

    @property
    def at_rest(self) -> Share:
        """Share of the runs in which the block comes to rest for good."""
        return Share.of(self.status == "rest")

    @property
    def settled(self) -> Share:
        """Share of the runs that came to a motion that repeats itself, or to rest."""
        return Share.of(np.isin(self.status, SETTLED))

    def summary(self) -> dict[str, Any]:
        """Shares with their intervals, and quantiles, for JSON."""
        shares = {"overturned": self.overturned, "at_rest": self.at_rest, "settled": self.settled}
        quantiles = {n: self.quantiles(n) for n in ("peak", "amplitude", "peak_stroke", "stroke")}
        return {"shares": {n: tuple(s) for n, s in shares.items()}, "quantiles_50_90_99": quantiles}

    def quantiles(self, of: str, at: tuple[float, ...] = (0.5, 0.9, 0.99)) -> tuple[float, ...]:
        """Quantiles of `peak`, `amplitude`, `peak_stroke` or `stroke` over all runs, overturned ones at
        infinity: the least number that at least such a share of the runs does not exceed."""
        values = np.sort(getattr(self, of))
        return tuple(float(values[min(len(values) - 1, math.ceil(q * len(values)) - 1)]) for q in at)

    def by_ramp(self) -> dict[float, Share]:
        """The share overturned for each start profile."""
        return {float(r): Share.of(self.lost[self.ramp == r]) for r in np.unique(self.ramp)}


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """An ensemble with a pendulum and without, run by run."""

    hung: Outcomes
    bare: Outcomes

    @property
    def worse(self) -> int:
        """Runs that overturn with the pendulum only."""
        return int(np.sum(self.hung.lost & ~self.bare.lost))

    @property
    def better(self) -> int:
        """Runs that overturn without the pendulum only."""
        return int(np.sum(self.bare.lost & ~self.hung.lost))

    @property
    def chance(self) -> float:
        """See `chance_of`."""
        return chance_of(self.worse, self.better)

    @property
    def harms(self) -> bool:
        """Whether significantly more runs overturn with the pendulum than without."""
        return self.worse > self.better and self.chance < SIGNIFICANT

    @property
    def objection(self) -> str:
        """What there is to say where it `harms`."""
        return (
            f"{self.worse} of {len(self.hung.status)} runs of the ensemble overturn with the pendulum only, "
            f"{self.better} without it only (chance of that by luck: {self.chance:.2g})"
        )

    @property
    def worse_peaks(self) -> Share:
        """Share of the runs whose largest tilt is above the bare block's by more than a per cent."""
        with np.errstate(invalid="ignore"):
            return Share.of(self.hung.peak > 1.01 * self.bare.peak)

    def summary(self) -> dict[str, Any]:
        """Both, for JSON."""
        pairs = {"worse": self.worse, "better": self.better, "chance": self.chance}
        return {**pairs, "with": self.hung.summary(), "without": self.bare.summary()}

    def table(self) -> str:
        """Both as text."""
        lines = [f"{'':28}{'with pendulum':>26}{'without':>26}"]

        def row(name: str, told: Callable[[Outcomes], object]) -> None:
            lines.append(f"{name:28}{told(self.hung)!s:>26}{told(self.bare)!s:>26}")

        row("overturned", lambda o: o.overturned)
        for ramp in self.hung.by_ramp():
            name = "sudden" if ramp == 0.0 else f"growing for {ramp:g} s"
            row(f"  {name}", lambda o, r=ramp: f"{o.by_ramp()[r].value:.1%}")
        row("at rest in the end", lambda o: o.at_rest)
        for name, of in (("largest tilt, rad", "peak"), ("settled tilt, rad", "amplitude")):
            row(f"{name}: 50, 90, 99 %", lambda o, of=of: _numbers(o.quantiles(of)))
        row(
            "bob's angle: 50, 90, 99 %",
            lambda o: _numbers(o.quantiles("peak_stroke")) if o is self.hung else "",
        )
        return "\n".join(lines)


def chance_of(worse: int, better: int) -> float:
    """Chance that of all runs that differ at least `worse` would go against the pendulum, were either way
    equally likely (McNemar's test, exact and one-sided)."""
    n = worse + better
    return sum(math.comb(n, i) for i in range(worse, n + 1)) / 2**n


def _numbers(values: tuple[float, ...]) -> str:
    return "  ".join(f"{v:.4f}" if math.isfinite(v) else "lost" for v in values)


def outcomes(
    subject: Parameters | Scene,
    pendulum: Pendulum | None = None,
    *,
    ensemble: Ensemble | None = None,
    conditions: Conditions | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Outcomes:
    """The runs of an ensemble, by the exact solution of the linear equations.

    Args:
        subject: a scene, or dimensionless parameters (plain numbers).
        pendulum: in the scene; default none.
        ensemble: default `Ensemble()`.
        conditions: dealt out evenly among the runs, on top of their scatter; default the scene's own.
        workers: threads; default the number of cores.
        progress: called with (runs done, of how many).

    Raises:
        ValueError: bad input, or a pendulum beside parameters.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    ensemble = Ensemble() if ensemble is None else ensemble
    if isinstance(subject, Scene):
        p, rate = subject.parameters(pendulum), subject.rate
    elif pendulum is not None:
        raise ValueError("`pendulum` goes with a scene; dimensionless parameters have their own")
    else:
        p, rate = subject, 1.0
    if not all(checks.is_concrete(x) and np.ndim(x) == 0 for x in jax.tree.leaves(p)):
        raise ValueError("`subject` must hold plain numbers, but is traced or batched")
    runs = plan(p, ensemble, rate, conditions)
    model = Piecewise(max_periods=ensemble.periods)
    settled = settle_all(
        *runs[:2], begin=runs.begin, ramp=runs.periods, model=model, workers=workers, progress=progress
    )
    return _told(ensemble, runs, settled)


class Runs(NamedTuple):
    """What `settle_all` needs for the runs of an ensemble."""

    p: Parameters
    y0: np.ndarray
    begin: np.ndarray
    """Units of tau."""
    periods: np.ndarray
    """Forcing periods over which the shaking grows."""
    ramp: np.ndarray
    """The same in seconds, or in units of tau where time has none."""


def plan(p: Parameters, ensemble: Ensemble, rate: float = 1.0, conditions: Conditions | None = None) -> Runs:
    """The runs of an ensemble for one design; `rate` is omega0 in rad/s where ramps are in seconds."""
    unit, nu = ensemble.draws(), float(p.nu)
    conditions = Conditions() if conditions is None else conditions
    dealt = np.random.default_rng([ensemble.seed, 1]).permutation(ensemble.size) % len(conditions)
    factor = {name: conditions.column(name)[dealt] for name in FACTORS}
    reach = np.array([ensemble.tilt * nu, ensemble.swing, ensemble.tilt_rate * nu, ensemble.swing_rate])
    y0 = (2.0 * unit[:, :4] - 1.0) * reach
    spread = (ensemble.amplitude, ensemble.frequency, ensemble.friction, ensemble.damping)
    amplitude, frequency, friction, damping = (1.0 + (2.0 * unit[:, 6:] - 1.0) * np.array(spread)).T
    frequency, ones = frequency * factor["frequency"], np.ones(ensemble.size)
    xi = float(p.xi) * frequency
    scattered: dict[str, Any] = {
        "nu": nu * factor["slenderness"],
        "mu": float(p.mu) * factor["mass"],
        "lam": float(p.lam) * factor["length"],
        "zeta": float(p.zeta) * damping * factor["damping"],
        "k": float(p.k) * friction * factor["friction"],
        "f": float(p.f) * amplitude * factor["amplitude"] * frequency**2,
        "xi": xi,
        "rho": ones * (uniform_inertia_ratio(nu * factor["slenderness"]) if p.rho is None else float(p.rho)),
        "e": ones * float(p.e),
    }
    begin = unit[:, 4] * 2.0 * np.pi / xi if ensemble.any_phase else np.zeros(ensemble.size)
    kinds = np.array(ensemble.ramps)
    ramp = kinds[np.minimum((unit[:, 5] * len(kinds)).astype(int), len(kinds) - 1)]
    return Runs(Parameters(**scattered), y0, begin, ramp * rate * xi / (2.0 * np.pi), ramp)


def _told(ensemble: Ensemble, runs: Runs, settled: Settled) -> Outcomes:
    names = names_of(settled.status)
    lost = np.isin(names, ("overturned", "failed"))

    def size(values: Any) -> np.ndarray:
        return np.where(lost, math.inf, np.asarray(values))

    return Outcomes(
        ensemble=ensemble,
        status=names,
        peak=size(settled.peak),
        amplitude=size(settled.amplitude),
        peak_stroke=size(settled.peak_stroke),
        stroke=size(settled.stroke),
        ramp=runs.ramp,
    )


def verdict(
    scene: Scene,
    pendulum: Pendulum,
    *,
    ensemble: Ensemble | None = None,
    conditions: Conditions | None = None,
    bare: Outcomes | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Verdict:
    """An ensemble of runs with the pendulum and without; see `outcomes`. The bare block's may be given if
    known already."""
    both: dict[str, Any] = {"ensemble": ensemble, "conditions": conditions, "progress": progress}
    hung = outcomes(scene, pendulum, **both)
    return Verdict(hung=hung, bare=outcomes(scene, **both) if bare is None else bare)
