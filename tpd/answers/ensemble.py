"""Ensembles of runs: how the block may be found when the shaking begins, how the shaking begins, and which
numbers of both are uncertain.

One run decides little: rest, rocking and overturning exist side by side, and a per cent of the amplitude may
change which of them is reached. Shares of a seeded set of runs are stable. Designs that are verified are
put to the same runs (common random numbers) and compared run by run; see `tpd.answers.paired`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.statistics import Share
from tpd.cluster.cluster import Cluster, check_where
from tpd.core import checks
from tpd.core.formatting import Printed
from tpd.core.progress import shown_count
from tpd.exact.rows import row_of
from tpd.exact.runs import HarmonicForcing, follow
from tpd.scene.conditions import FACTORS, Conditions, check_restitution, factors_at, under
from tpd.scene.ensemble import Ensemble
from tpd.scene.parameters import Parameters
from tpd.scene.quantities import parameters_of
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import LOST, SETTLED, UNANSWERED, Outcome, codes_of, names_by_code, names_of
from tpd.theory.equations import Terms

_SIZES = ("peak", "amplitude", "peak_stroke", "stroke")
"""Sizes of a run."""
_QUANTILES = {
    "largest tilt, rad": "peak",
    "settled tilt, rad": "amplitude",
    "bob's angle, rad": "peak_stroke",
}
UNDECIDED_ROW = "runs without an answer"
_CHUNKS = {Terms.linear: 2048, Terms.nonlinear: 128}
"""Runs in a chunk for a cluster: some tenths of a second of work."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Outcomes(Printed):
    """Outcomes of the runs of an ensemble: arrays of shape (size,), angles in rad. All shares and quantiles
    are of the runs with an answer; sizes of the others are NaN."""

    ensemble: Ensemble
    status: np.ndarray
    """Names of statuses; a run that has not settled within its periods is not_settled."""
    peak: np.ndarray
    """Largest |phi| from the start on; infinite where the block overturns."""
    amplitude: np.ndarray
    """Settled |phi|, or the largest of the last periods; infinite where the block overturns."""
    peak_stroke: np.ndarray
    """Largest |psi| from the start on."""
    stroke: np.ndarray
    """Settled |psi|, or the largest of the last periods."""
    ramp: np.ndarray
    """Seconds (or units of tau) over which the shaking grew."""
    nu: np.ndarray
    """Slenderness of the block in every run, as it scatters."""
    mu: np.ndarray
    """Mass ratio of the pendulum."""
    lam: np.ndarray
    """Length ratio."""
    relative: np.ndarray | None = None
    """Largest angle between rod and block; None where only both angles are known by themselves."""
    equations: str = "linear"
    """Equations by which the runs were followed, "linear" or "nonlinear"."""

    @property
    def overturned(self) -> Share:
        """Share of the runs in which the block overturns."""
        return self._share(self.lost)

    @property
    def lost(self) -> np.ndarray:
        """Whether a run overturned."""
        return np.isin(self.status, LOST)

    @property
    def undecided(self) -> np.ndarray:
        """Whether a run has no answer: it met the bound on events, or ended without finite numbers."""
        return np.isin(self.status, UNANSWERED)

    @property
    def stands(self) -> np.ndarray:
        """Whether the block is known not to overturn in a run."""
        return ~(self.lost | self.undecided)

    @property
    def severity(self) -> np.ndarray:
        """Settled tilt over the slenderness, from 0 to 1; 1 where the block overturns, NaN where a run has no
        answer."""
        # A bound at 1 keeps means finite: an overturned block is as bad as one on its corner, and no worse.
        tilt = np.where(self.lost, np.inf, self.amplitude) / self.nu
        return np.where(self.undecided, np.nan, np.minimum(np.where(np.isnan(tilt), np.inf, tilt), 1.0))

    @property
    def turned(self) -> np.ndarray:
        """Largest angle between rod and block, rad. If a run does not record this angle, it is the sum of the
        largest bob angle and the largest tilt, which is never less."""
        return self.peak_stroke + self.peak if self.relative is None else self.relative

    def _share(self, hits: np.ndarray) -> Share:
        return Share.of(hits[~self.undecided])

    def ended(self, falls: bool) -> Outcomes:
        """The runs with an end for each that has none: an overturning, or rest."""
        size, name = (math.inf, Outcome.overturned) if falls else (0.0, Outcome.rest)
        known = (of for of in (*_SIZES, "relative") if getattr(self, of) is not None)
        sizes = {of: np.where(self.undecided, size, getattr(self, of)) for of in known}
        return replace(self, status=np.where(self.undecided, name, self.status), **sizes)

    @property
    def at_rest(self) -> Share:
        """Share of the runs in which the block comes to rest for good."""
        return self._share(self.status == Outcome.rest)

    @property
    def settled(self) -> Share:
        """Share of the runs that reach a periodic motion, or rest."""
        return self._share(np.isin(self.status, SETTLED))

    def summary(self) -> dict[str, Any]:
        """Equations, shares with their intervals, and quantiles, for JSON."""
        return {
            "equations": self.equations,
            "undecided": int(self.undecided.sum()),
            "shares": {n: tuple(getattr(self, n)) for n in ("overturned", "at_rest", "settled")},
            "quantiles_50_90_99": {n: self.quantiles(n) for n in _SIZES},
        }

    def quantiles(self, of: str, at: tuple[float, ...] = (0.5, 0.9, 0.99)) -> tuple[float, ...]:
        """Quantiles of `peak`, `amplitude`, `peak_stroke` or `stroke` over all runs, overturned ones at
        infinity: the least number that at least such a share of the runs does not exceed."""
        # An overturned run has an infinite size: quantiles stay defined, and say so.
        values = np.sort(getattr(self, of)[~self.undecided])
        if not len(values):
            return (math.nan,) * len(at)
        return tuple(float(values[min(len(values) - 1, math.ceil(q * len(values)) - 1)]) for q in at)

    def by_ramp(self) -> dict[float, Share]:
        """Share overturned for each duration over which the shaking grows."""
        known = ~self.undecided
        return {float(r): Share.of(self.lost[known & (self.ramp == r)]) for r in np.unique(self.ramp)}

    def rows(self) -> list[tuple[str, str]]:
        """Lines of a table: a name, and a share or quantiles as text."""
        out = [("overturned", str(self.overturned))]
        for ramp, share in self.by_ramp().items():
            out.append((f"  {label_of_start(ramp)}", f"{share.value:.1%}"))
        out.append(("at rest in the end", str(self.at_rest)))
        for name, of in _QUANTILES.items():
            sizes = (f"{v:.4f}".replace("nan", "unknown").replace("inf", "lost") for v in self.quantiles(of))
            out.append((f"{name}: 50, 90, 99 %", "  ".join(sizes)))
        return out

    def __str__(self) -> str:
        e = self.ensemble
        runs = f"Ensemble of {e.size} runs of up to {e.periods} periods, seed {e.seed or 0}"
        head = f"{runs}, {self.equations} equations"
        lines = [head, *(f"  {name:36}{text:>26}" for name, text in self.rows())]
        if self.undecided.any():
            lines.append(f"  {UNDECIDED_ROW:36}{self.undecided.sum():>26}")
        return "\n".join(lines)


def label_of_start(ramp: float) -> str:
    """Name the duration in seconds over which the shaking grows."""
    return "sudden starts" if ramp == 0.0 else f"starts over {ramp:g} s"


class Plan(NamedTuple):
    """Inputs of `tpd.exact.runs.follow` for the runs of an ensemble: arrays of leading axis (size,)."""

    p: Parameters
    y0: np.ndarray
    begin: np.ndarray
    """Dimensionless times at which the runs begin."""
    periods: np.ndarray
    """Forcing periods over which the shaking grows."""
    ramp: np.ndarray
    """Seconds (or units of tau, where time has no unit) over which the shaking grows."""


def plan(p: Parameters, ensemble: Ensemble, rate: float = 1.0, conditions: Conditions | None = None) -> Plan:
    """Return the runs of an ensemble for one design.

    Args:
        p: dimensionless parameters, plain numbers.
        ensemble: spreads of the runs.
        rate: omega0 in rad/s where the ramps are in seconds.
        conditions: dealt out evenly among the runs, on top of their scatter; default the scene's own.
    """
    # Tilts scale with nu: at |phi| = nu a block of any shape stands on its corner, about to fall.
    e, unit, nu = ensemble, ensemble.draws(), float(p.nu)
    reach = np.array([e.tilt * nu, e.swing, e.tilt_rate * nu, e.swing_rate])
    scatter = factors_at(unit[:, 6:], e.widths(p.e))
    conditions = Conditions() if conditions is None else conditions
    dealt = e.dealt(len(conditions))
    factor = np.stack([scatter.get(name, 1.0) * conditions.column(name)[dealt] for name in FACTORS])
    design = np.repeat([[float(x)] for x in (p.mu, p.lam, p.zeta)], e.size, axis=1)
    q = under(p, design, factor)
    # Every leaf is given for every run: then all ensembles, also that of the bare block, share one program.
    rho, ratio = (np.broadcast_to(np.asarray(x), e.size) for x in (q.inertia_ratio, q.velocity_ratio))
    q = replace(q, rho=rho, e=ratio)
    xi = np.asarray(q.xi)
    begin = unit[:, 4] * 2.0 * np.pi / xi if e.any_phase else np.zeros(e.size)
    ramps = np.array(e.ramps)
    ramp = ramps[np.minimum((unit[:, 5] * len(ramps)).astype(int), len(ramps) - 1)]
    return Plan(q, (2.0 * unit[:, :4] - 1.0) * reach, begin, ramp * rate * xi / (2.0 * np.pi), ramp)


def outcomes(
    subject: Parameters | Scene,
    pendulum: Pendulum | None = None,
    *,
    ensemble: Ensemble | None = None,
    conditions: Conditions | None = None,
    equations: Terms | str = Terms.linear,
    rtol: checks.Real = 1e-8,
    workers: checks.Whole | None = None,
    cluster: Cluster | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
) -> Outcomes:
    """Follow the runs of an ensemble.

    Args:
        subject: a scene, or dimensionless parameters (plain numbers).
        pendulum: in the scene; default none.
        ensemble: default `Ensemble()`.
        conditions: dealt out evenly among the runs, on top of their scatter; default the scene's own.
        equations: the linear ones by their exact solution, or the nonlinear ones by a compiled event loop.
        rtol: relative tolerance of a step of the nonlinear equations.
        workers: threads; default the number of cores.
        cluster: processes or machines in place of threads.
        progress: True for a bar on stderr, or called with (runs done, of how many).

    Raises:
        ValueError: bad input, or a pendulum beside parameters.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    check_where(workers, cluster)
    checks.one_of("equations", equations, (Terms.linear.value, Terms.nonlinear.value))
    terms = Terms(equations)
    ensemble = Ensemble() if ensemble is None else ensemble
    checks.instance("ensemble", ensemble, Ensemble)
    ensemble = ensemble.seeded(0)
    if ensemble.restitution and isinstance(subject, Scene):
        check_restitution(subject)
    checks.optional("conditions", conditions, Conditions)
    rate = float(subject.rate) if isinstance(subject, Scene) else 1.0
    runs = plan(parameters_of(subject, pendulum), ensemble, rate, conditions)
    batch = {"p": runs.p, "y0": runs.y0, "begin": runs.begin, "ramp": runs.periods}
    shared = terms, ensemble.periods, rtol
    with shown_count(progress, "following") as report:
        if cluster is None:
            settled = _settled(batch, *shared, workers, report)
        else:
            chunk = _CHUNKS[terms]
            settled = cluster.map("runs", _settled, batch, shared, chunk=chunk, progress=report)
    names = names_by_code(settled["status"])
    # The sizes at the moment of overturning depend on when the run was stopped, and mean nothing; neither are
    # they known where a run has no answer.
    lost, unknown = np.isin(names, LOST), np.isin(names, UNANSWERED)
    sizes = {name: np.where(lost, math.inf, np.where(unknown, math.nan, settled[name])) for name in _SIZES}
    drawn = {name: np.asarray(getattr(runs.p, name)) for name in ("nu", "mu", "lam")}
    return Outcomes(ensemble=ensemble, status=names, ramp=runs.ramp, equations=terms.value, **sizes, **drawn)


def _settled(
    batch: dict[str, Any],
    terms: Terms,
    periods: int,
    rtol: float,
    workers: int | None = 1,
    progress: Any = None,
) -> dict[str, np.ndarray]:
    """Sizes and statuses, by their codes, of runs; in one thread on a cluster, whose processes share the
    cores."""
    forcing = HarmonicForcing(periods, batch["begin"], batch["ramp"])
    how = {"y0": batch["y0"], "rtol": rtol, "workers": workers, "progress": progress}
    settled = follow(terms, row_of(batch["p"]), forcing, **how)
    sizes = {name: np.asarray(getattr(settled, name)) for name in _SIZES}
    return {**sizes, "status": codes_of(names_of(settled.status))}
