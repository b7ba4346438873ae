"""Search for the design of least demand on ground motions.

Designs spread over the whole space come first. A response surface through their values and derivatives then
says which design is worth following next (expected improvement of the trend; D. R. Jones, M. Schonlau and
W. J. Welch, J. Global Optim. 13, 1998), and which of all is the best: that of least trend, not the luckiest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from tpd.core import checks, sampling
from tpd.design.criteria import Risk
from tpd.design.ground.demand import Demand, Demands
from tpd.design.ground.objective import GroundObjective
from tpd.design.ground.surface import Observations, Surface, fit
from tpd.design.space import DesignSpace

_CANDIDATES = 1500
_NEAR = 500
"""Designs that are compared on the surface: anywhere in the space, and near the best ones."""
_WIDTHS = (0.03, 0.5)
"""Widths of the candidates about the best, in shares of the space."""
_LEAST_SIZE = 1e-6
_TRIED = 8
"""Designs after which derivatives are given up if they are chaotic."""
TOO_STEEP = 3.0
"""Derivative of a demand along the whole space, beyond which a run is chaotic: no demand goes through its
range several times."""
SPARE = 0.05
"""Share of every limit that the search leaves free: other earthquakes and other blocks take more room than
those that a design is tuned to, by which it would lie on its limits."""
_CHAOTIC = 0.05
"""Weight of the chaotic runs beyond which the derivatives of a risk are not used."""


@dataclass(frozen=True, kw_only=True)
class GroundSearch:
    """How a space is searched on ground motions.

    Raises:
        ValueError: a count below its least.
    """

    starts: int = 32
    """Designs spread over the space."""
    steps: int = 32
    """Designs that follow one by one."""
    derivatives: bool = False
    """Whether derivatives enter the surface. They say nothing of the runs that a step takes beyond the edge,
    and a mean changes mostly by these: a search without them finds better designs."""

    def __post_init__(self) -> None:
        checks.count("starts", self.starts, least=4)
        checks.count("steps", self.steps, least=0)
        checks.flag("derivatives", self.derivatives)


class Evaluated(NamedTuple):
    """Designs that were followed: arrays with a row for each of m designs."""

    designs: np.ndarray
    """(mu, lam, zeta), (m, 3)"""
    value: np.ndarray
    """Risk of the demands, (m,)."""
    slope: np.ndarray
    """Derivatives along the shares of the space, chaotic runs left out, (m, d)."""
    slope_error: np.ndarray
    """Standard errors over the motions, (m, d)."""
    sizes: np.ndarray
    """Limited quantities over their limits, (m, sizes)."""
    overturned: np.ndarray
    """Share of the runs that overturn the block, of those with an answer, (m,)."""
    undecided: np.ndarray
    """Number of the runs without an answer, which value, sizes and share leave out, (m,)."""

    @property
    def feasible(self) -> np.ndarray:
        """Whether each design is within its limits, (m,); one of which no run has an answer is not."""
        return np.all(self.sizes <= 1.0, axis=1) & np.isfinite(self.value)

    @property
    def spares(self) -> np.ndarray:
        """Whether each design is within its limits with `SPARE` to spare, (m,)."""
        return self.feasible & np.all(self.sizes <= 1.0 - SPARE, axis=1)

    def at(self, rows: np.ndarray) -> Evaluated:
        """Some of the designs."""
        return Evaluated(*(x[rows] for x in self))

    def with_one(self, other: Evaluated) -> Evaluated:
        """These and further ones."""
        return Evaluated(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))


@dataclass
class Searcher:
    """One search, which can go on from what was followed before."""

    objective: GroundObjective
    demand: Demand
    risk: Risk
    space: DesignSpace
    method: GroundSearch
    seed: int
    store: Any = None
    """With `get(i)` and `put(i, evaluated)`: what was followed before an interruption."""
    progress: Callable[[int, int], None] | None = None
    names: tuple[str, ...] = ()
    """Limited quantities."""
    interrupted: bool = False
    found: Evaluated | None = None
    surface: Surface | None = None
    limits: list[Surface] = field(default_factory=list)

    def run(self) -> None:
        """Follow designs until all are done, or an interruption."""
        d = len(self.space.names)
        total = self.method.starts + self.method.steps
        # One design after the other: its motions alone keep all cores busy.
        spread = sampling.latin_hypercube(np.random.default_rng([self.seed, 7]), self.method.starts, d)
        try:
            for i in range(total):
                self._follow(i, spread[i] if i < len(spread) else self._next(i, last=total - 4))
                if self.progress is not None:
                    self.progress(i + 1, total)
        except KeyboardInterrupt:
            self.interrupted = True
        self._fit(full=True)

    def best(self) -> int | None:
        """Index of the design of least trend of those that keep to their limits with some to spare, or of
        those that keep to them; None without any."""
        if self.found is None or self.surface is None or not self.found.feasible.any():
            return None
        # The lowest value of many noisy ones is low by luck; the trend has averaged the luck out.
        trend, _ = self.surface.at(self.space.scaled(self.found.designs))
        allowed = self.found.spares if self.found.spares.any() else self.found.feasible
        return int(np.argmin(np.where(allowed, trend, np.inf)))

    def _follow(self, i: int, unit: np.ndarray) -> None:
        """Follow the i-th design, unless it was followed before."""
        one = None if self.store is None else self.store.get(i)
        # Names of the limits come with the first design, even where it was stored.
        if one is None or not self.names:
            one = self.evaluate(self.space.unscaled(np.asarray(unit)[None]))
            if self.store is not None:
                self.store.put(i, one)
        self.found = one if self.found is None else self.found.with_one(one)

    @property
    def _asks_derivatives(self) -> bool:
        """Whether derivatives are worth their time: not where the first designs had hardly any."""
        # Derivatives take as long as the values once more.
        e = self.found
        if e is None or len(e.value) < _TRIED:
            return self.method.derivatives
        return self.method.derivatives and float(np.mean(np.isfinite(e.slope[:_TRIED]))) > 0.2

    def evaluate(self, designs: np.ndarray) -> Evaluated:
        """Follow designs through all motions."""
        runs, found = self.demand.follow(self.objective, designs, slopes=self._asks_derivatives)
        self.names, sizes = self.objective.sizes(runs, designs)
        slope, error = self._slopes(found)
        undecided = runs.undecided.sum(axis=1)
        share = runs.overturned.sum(axis=1) / np.maximum(runs.overturned.shape[1] - undecided, 1)
        value = risk_of_known(self.risk, found.value)
        return Evaluated(designs, value, slope, error, sizes, share, undecided)

    def _slopes(self, found: Demands) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the risk along the shares of the space, and their standard errors over the motions;
        NaN where chaotic runs have too much weight."""
        low, high = self.space.bounds
        each = found.slope[..., : low.size] * (high - low)
        n, weights = found.value.shape[1], _weights(self.risk, found.value)[..., None]
        # The derivative of a chaotic run is exact, but it holds for a step that is no design's.
        sound = np.all(np.isfinite(each) & (np.abs(each) <= TOO_STEEP), axis=-1, keepdims=True)
        kept = weights * np.where(sound, each, 0.0)
        slope = kept.sum(axis=1)
        error = np.sqrt(n / max(n - 1, 1) * np.sum((kept - slope[:, None] / n) ** 2, axis=1))
        # Of a run without an answer the weight is not known.
        known = np.isfinite(found.value).all(axis=1, keepdims=True)
        used = known & (np.sum(weights * ~sound, axis=1) <= _CHAOTIC)
        return np.where(used, slope, np.nan), np.where(used, error, np.nan)

    def _fit(self, full: bool) -> None:
        """Fit the surfaces of demand and limits to all that was followed."""
        if self.found is None:
            return
        # A design of which no run has an answer says nothing.
        e = self.found.at(np.isfinite(self.found.value))
        if len(e.value) < 4:
            return
        at = self.space.scaled(e.designs)
        use = self.method.derivatives
        # Sizes are positive and range over decades: their logarithms are smooth.
        seen = Observations(at, e.value, e.slope if use else None, e.slope_error if use else None)
        steps = 150 if full else 15
        self.surface = fit(seen, self.seed, self.surface, steps)
        before = self.limits or [None] * e.sizes.shape[1]
        over = np.maximum(e.sizes, _LEAST_SIZE) / (1.0 - SPARE)
        self.limits = [
            fit(Observations(at, np.log(over[:, j])), self.seed, before[j], steps)
            for j in range(e.sizes.shape[1])
        ]

    def _next(self, i: int, last: int) -> np.ndarray:
        """The design to be followed next, in shares of the space."""
        assert self.found is not None
        # The numbers of the process change little from one design to the next.
        self._fit(full=i % 8 == 0)
        surface, e = self.surface, self.found
        rng, d = np.random.default_rng([self.seed, 8, i]), len(self.space.names)
        if surface is None:
            # Too few designs have an answer yet: anywhere.
            return rng.random(d)
        trend, _ = surface.at(self.space.scaled(e.designs))
        ranked = np.argsort(np.where(e.spares, trend, np.inf))[:4]
        # The surface is searched everywhere, and more closely where the best designs lie.
        near = self.space.scaled(e.designs[rng.choice(ranked, _NEAR)])
        # Of all widths, since nobody knows beforehand how far the best designs lie apart.
        low, high = np.log(_WIDTHS)
        width = np.exp(rng.uniform(low, high, (_NEAR, 1)))
        near = np.clip(near + width * rng.standard_normal((_NEAR, d)), 0.0, 1.0)
        x = np.concatenate([rng.random((_CANDIDATES, d)), near])
        mean, deviation = surface.at(x)
        # Limits are kept with a probability, as their surfaces see it.
        likely = np.ones(len(x))
        for limit in self.limits:
            middle, width = limit.at(x)
            likely *= _cdf(-middle / np.maximum(width, 1e-9))
        if not e.spares.any():
            # Nothing to improve on yet.
            return x[np.argmax(likely)]
        if i >= last:
            # At last the least of the trend itself.
            return x[np.argmin(np.where(likely > 0.5, mean, np.inf))]
        return x[np.argmax(likely * _improvement(float(trend[ranked[0]]) - mean, deviation))]


def risk_of_known(risk: Risk, values: np.ndarray) -> np.ndarray:
    """Risk of every row of demands over its runs with an answer; NaN where no run has one."""
    known = ~np.isnan(values)
    return np.array([float(risk.of(v[k])) if k.any() else np.nan for v, k in zip(values, known, strict=True)])


def _weights(risk: Risk, values: np.ndarray) -> np.ndarray:
    """Weights of the runs in a risk measure, its derivatives in the values; (m, n)."""
    n, cap = values.shape[-1], risk.cap(values.shape[-1])
    # The measure is linear between changes of the order of its values.
    order = np.argsort(-values, axis=-1, kind="stable")
    weights = np.zeros_like(values)
    np.put_along_axis(
        weights, order, np.broadcast_to(np.clip(1.0 - cap * np.arange(n), 0.0, cap), values.shape), -1
    )
    return weights


def _improvement(gain: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Expected improvement where the trend is `gain` below the best, give or take a deviation."""
    s = np.maximum(deviation, 1e-12)
    z = gain / s
    return gain * _cdf(z) + s * np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi)


def _cdf(x: np.ndarray) -> np.ndarray:
    """Normal distribution function."""
    return 0.5 * np.vectorize(math.erfc, otypes=[float])(-x / math.sqrt(2.0))
