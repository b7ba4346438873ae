"""Symmetric orbits of designs under all conditions, with their derivatives: exact, or followed step by step.

`Orbits` solves all symmetric period-one orbits of a design in closed form, so its values hold for any
initial state. It computes the objective of the relevant orbit under each condition, applies the risk measure
over the conditions, and states the limits as constraints.

`SmoothedOrbits` avoids the settling of an orbit for every design that a descent evaluates. Each descent keeps
its design and the orbit under every condition. From the orbit of the previous design an evaluation integrates
half a period of the smoothed equations by diffrax, with tangents (see `tpd.models.half_period`). This gives
one Newton step of the orbit and the gradient. The exact solution provides the first orbits. It also replaces
the smoothed model where there is no orbit to follow: where the block rests, and where an orbit was lost.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tpd.compiled.columns import LAM, MU, SIZES, WIDTH, ZETA, E
from tpd.compiled.orbits import orbit_slopes, solve_orbits
from tpd.compiled.rows import row_of
from tpd.core.batch import in_chunks, prepare
from tpd.core.progress import Count, unreported
from tpd.design.geometry import Geometry
from tpd.design.newton import Linearisation
from tpd.design.power_law import PowerLaw
from tpd.design.risk import Risk
from tpd.design.sizes import NEAR, NONE, REST, ROCKING, UNSTABLE, Evaluation, Size, evaluate_sizes
from tpd.design.space import DesignSpace
from tpd.limits import LIMIT_KINDS, Limit, Objective, SteadyTilt
from tpd.models.half_period import half_period, newton, remaining
from tpd.models.smoothed import Smoothed
from tpd.scene.conditions import Conditions, under, under_all
from tpd.scene.impacts import housner
from tpd.scene.parameters import Parameters
from tpd.scene.quantities import with_design
from tpd.theory.no_uplift import uplift

_PAIRS = 16_384
"""Approximate number of pairs of design and condition that are solved at once."""
BACK_OFF = 1e-5
"""Share of every limit that a search leaves unused. A descent may exceed its constraints by this much, by
rounding or where a limit has no derivative, and the design still keeps the limit itself."""
_KIND_OF = np.repeat([ROCKING, UNSTABLE, NEAR, NONE], [1, 8, 2, 3])
"""Index into `MOTION_KINDS` for each number of a status, see `tpd.compiled.columns`; an orbit has some of the
statuses. The best motion has the smallest index."""
_DESIGN = {"mass": MU, "length": LAM, "damping": ZETA}
"""Columns of the parameters of a design, by the names of their factors in conditions."""
_RESERVE = ("fold", "symmetry", "torus")
"""Sizes of an orbit that are positive if it attracts."""
OF_PAIRS = Evaluation._fields[: Evaluation._fields.index("design")]
"""Fields of an evaluation that have one value per pair of design and condition. These fields come first."""

SMOOTHED = Smoothed(rtol=1e-8, sharpness=0.005)
"""Default model of a descent. The error control ignores derivatives, so the tolerance is smaller and the
smoothing is wider than for motions: second derivatives of a narrow layer need small steps."""
_CHUNK = 20
"""Number of orbits that take a step together on each core. All of them wait for the slowest."""
_STEPS = 3
"""Largest number of steps of an orbit at one design. One step is sufficient if the design has moved
little."""
_LEAST_RESIDUAL, _MOST_RESIDUAL = 0.01, 0.5
"""Residual in units of nu below which no further step follows, and above which the orbit is lost."""
_GAP = 0.01
"""Relative difference between the tilts of two orbits above which they count as different orbits."""


@dataclass(frozen=True)
class Orbits:
    """Objective, risk and limits of the exact orbits of designs under all conditions.

    The orbit that counts under a condition is the largest attracting symmetric period-one orbit, or rest.
    """

    p: Parameters
    """Parameters of the block without a pendulum."""
    conditions: Conditions
    space: DesignSpace
    risk: Risk
    limits: tuple[Limit, ...]
    geometry: Geometry
    rest_counts: bool = False
    """Whether rest counts wherever the block can stay at rest, although it also rocks from other initial
    states."""
    objective: Objective = field(default_factory=SteadyTilt)
    factors: Mapping[str, PowerLaw] = field(default_factory=dict)
    """Factors on limited quantities of orbits, by name, because transients are larger."""

    def evaluate(self, designs: np.ndarray, progress: Count = unreported) -> Evaluation:
        """Evaluate designs (mu, lam, zeta), shape (m, 3), under all conditions."""
        m, n = len(designs), len(self.conditions)
        # Arrays for every orbit of every pair would not fit in memory, so evaluate a part of the designs at a
        # time.
        size, parts = max(1, _PAIRS // n), []
        for i in range(0, m, size):
            parts.append(_evaluate(self.p, designs[i : i + size], self.conditions, self.rest_counts))
            progress(min(i + size, m) * n, m * n)
        joined = (np.concatenate(x) for x in zip(*(part[: len(OF_PAIRS)] for part in parts), strict=True))
        return self.with_merits(Evaluation(*joined, design=designs))

    def with_merits(self, e: Evaluation) -> Evaluation:
        """Return the evaluation with the values of the objective as merits where the block rocks.

        Raises:
            ValueError: the objective cannot be differentiated.
        """
        (size,) = evaluate_sizes([self.objective], e, self.geometry, slopes=True)
        # Where an orbit stops attracting the merit increases by one. Its slope leads back to stability.
        has_orbit, unstable = (e.kind <= NEAR) | (e.kind == UNSTABLE), e.kind == UNSTABLE
        slope = np.where(has_orbit[..., None], size.slope, e.merit_slope)
        return e._replace(merit=np.where(has_orbit, size.value + unstable, e.merit), merit_slope=slope)

    @property
    def needs_remaining(self) -> bool:
        """Whether the objective, or a limit of a user, can depend on what remains of a disturbance."""
        of_orbits = (x for x in (self.objective, *self.limits) if not x.of_motion)
        return any(type(x) not in LIMIT_KINDS for x in of_orbits)

    def margins(self, designs: np.ndarray) -> np.ndarray:
        """Return the uplift margins of designs (m, 3) under all conditions, (m, n), in closed form."""
        rows = self.conditions.factor_rows()
        # Evaluate one condition after the other: all at once would need n times the memory.
        return np.stack([np.asarray(uplift(under(self.p, designs.T, row)).margin) for row in rows], axis=1)

    def value(self, e: Evaluation) -> np.ndarray:
        """Return the risk of the merits, (m,)."""
        return self.risk.of(e.merit)

    def limited(self, e: Evaluation) -> list[Size]:
        """Return the limited quantities over their limits, with the factors by which runs exceed orbits."""
        out = list[Size]()
        for name, value, slope in evaluate_sizes(self.limits, e, self.geometry, slopes=True):
            if (law := self.factors.get(name)) is not None:
                by, moved = law.at(e.design)
                slope = by[:, None, None] * slope + value[..., None] * moved[:, None]
                value = by[:, None] * value
            out.append(Size(name, value, slope))
        return out

    def constraints(self, e: Evaluation) -> tuple[np.ndarray, np.ndarray]:
        """Return constraints (<= 0), shape (m, l), and their derivatives; l is n times the number of
        sizes."""
        m, sizes = len(e.kind), self.limited(e)
        value = np.concatenate([np.zeros((m, 0)), *(s.value - 1.0 for s in sizes)], axis=1)
        slope = np.concatenate([np.zeros((m, 0, 3)), *(s.slope for s in sizes)], axis=1)
        # A quantity that is not finite breaks its limit, but has no derivative that shows the direction back.
        return np.where(np.isfinite(value), value, 10.0), slope

    def linearised(self, e: Evaluation) -> Linearisation:
        """Return merits, tightened constraints and their derivatives along the searched shares of the
        bounds."""
        # In shares of the bounds a step has the same length along every coordinate.
        limit, by_ratio = self.constraints(e)
        merit_slope, limit_slope = (self.space.slopes(e.design, x) for x in (e.merit_slope, by_ratio))
        return Linearisation(e.merit, merit_slope, limit + BACK_OFF, limit_slope)

    def at(self, unit: np.ndarray) -> Linearisation:
        """Return the linearisation at designs in shares of the bounds, (m, d)."""
        return self.linearised(self.evaluate(self.space.unscaled(unit)))


_STEP = 1e-100
"""Imaginary step for complex-step differentiation."""


def _evaluate(p: Parameters, designs: np.ndarray, conditions: Conditions, rest_counts: bool) -> Evaluation:
    """Evaluate designs (m, 3) under all conditions."""
    m, n = len(designs), len(conditions)
    q = under_all(p, designs, conditions)
    x, along = row_of(q), _directions(p, q, conditions, m)
    orbits = solve_orbits(x)
    kinds = _KIND_OF[orbits["status"].astype(int)]
    # Orbits are sorted by amplitude, largest first. Among orbits of equal kind the largest counts.
    best = np.argmin(kinds, axis=1)
    o = orbits[np.arange(len(best)), best]
    slope = orbit_slopes(x, o[:, None], along, (0, SIZES["remaining"] + 1)).squeeze(1)
    sizes, slopes = ({name: of[..., at] for name, at in SIZES.items()} for of in (o["sizes"], slope))
    lift, design, still = uplift(q), np.stack([q.mu, q.lam, q.zeta]), []
    for i in range(3):
        # The uplift margin is a closed form in real numbers, so a complex step gives its exact
        # derivative.
        stepped = uplift(with_design(q, design + 1j * _STEP * along[:, i, [MU, LAM, ZETA]].T))
        still.append([np.imag(x) / _STEP for x in stepped])
    margin_slope, still_slope = np.moveaxis(np.array(still), 0, -1)
    margin = np.asarray(lift.margin)
    kind = kinds[np.arange(m * n), best]
    # Rest counts where no orbit attracts and the block can stay at rest, or wherever it can stay at rest.
    kind = np.where((margin > 0.0) & ((kind > REST) | rest_counts), REST, kind)
    at_rest, moves = kind == REST, (kind != REST) & (kind != NONE)

    def chosen(slope: np.ndarray, other: np.ndarray | float) -> np.ndarray:
        return _finite(np.where(moves[:, None], slope, other))

    # The orbit stops attracting at the nearest of three bifurcations: its reserve is the smallest distance.
    least = np.argmin([sizes[name] for name in _RESERVE], axis=0)[None]
    reserve, reserve_slope = (
        np.take_along_axis(np.array([of[name] for name in _RESERVE]), i, axis=0)[0]
        for of, i in ((sizes, least), (slopes, least[..., None]))
    )
    nu = np.asarray(q.nu)
    tilt = np.where(moves, sizes["amplitude"] / nu, np.where(at_rest, 0.0, np.inf))
    tilt_slope = chosen(slopes["amplitude"] / nu[:, None], 0.0)
    multiplier = np.max(np.abs(o["multipliers"]), axis=-1)
    turn = np.stack([sizes["amplitude"], o["bob"], sizes["phase"], o["bob_rate"]], axis=-1)
    # A design without an orbit is worse than acceptable ones with an orbit. The search leaves such designs,
    # and the slope of the uplift margin shows the direction towards rest.
    out = Evaluation(
        merit=np.where(kind == REST, -margin, 2.0 - margin),
        merit_slope=-_finite(margin_slope),
        tilt=tilt,
        tilt_slope=tilt_slope,
        swing=np.where(moves, sizes["swing"], lift.swing),
        swing_slope=chosen(slopes["swing"], still_slope),
        margin=margin,
        multiplier=np.where(moves, multiplier, np.where(at_rest, 0.0, np.inf)),
        reserve=np.where(moves, reserve, np.where(at_rest, 1.0, 0.0)),
        reserve_slope=chosen(reserve_slope, 0.0),
        remaining=np.where(moves, sizes["remaining"], np.where(at_rest, 0.0, np.inf)),
        remaining_slope=chosen(slopes["remaining"], 0.0),
        kind=kind,
        turn=turn,
        design=designs,
    )
    shaped = {name: getattr(out, name).reshape(m, n, *getattr(out, name).shape[1:]) for name in OF_PAIRS}
    return out._replace(**shaped)


def _directions(p: Parameters, q: Parameters, conditions: Conditions, m: int) -> np.ndarray:
    """Return the derivatives of the parameters `q` of m designs under all conditions with respect to (mu,
    lam, zeta) of the designs, as rows of the compiled code, (m n, 3, 10)."""
    along = np.zeros((m * len(conditions), 3, WIDTH))
    for i, (name, column) in enumerate(_DESIGN.items()):
        along[:, i, column] = np.tile(conditions.column(name), m)
    if p.e is None:
        # Housner's coefficient of restitution depends on the mass of the bob.
        stepped = housner(np.asarray(q.nu), np.asarray(q.rho), np.asarray(q.mu) + 1j * _STEP)
        along[:, 0, E] = stepped.imag / _STEP * along[:, 0, MU]
    return along


def _finite(x: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(x), x, 0.0)


class SmoothedOrbits:
    """Designs of m descents with their orbits under all conditions, starting from an exact evaluation."""

    def __init__(self, orbits: Orbits, model: Smoothed, e: Evaluation) -> None:
        # For each descent and condition: the state at the turn, its derivatives, and whether an orbit is
        # followed.
        self.orbits, self.model, self.designs = orbits, model, e.design
        self.turns, self.slopes = np.zeros((*e.kind.shape, 4)), np.zeros((*e.kind.shape, 4, 3))
        self.follows = np.zeros(e.kind.shape, bool)
        self.stopped = np.zeros(len(e.design), int)
        """Number of orbits so far that each descent could not follow."""
        self._take(e, np.arange(len(e.design)), e.kind == ROCKING)
        # A step at the same design yields the derivatives that predict the orbit of the next design.
        self._step(e.design)

    def at(self, unit: np.ndarray) -> Linearisation:
        """Return the linearisation at designs in shares of the bounds, (m, d), the next design of each
        descent."""
        return self.orbits.linearised(self.evaluate(self.orbits.space.unscaled(unit)))

    def evaluate(self, designs: np.ndarray) -> Evaluation:
        """Evaluate the next designs (m, 3) of the descents by a step of their orbits."""
        e = self._step(designs)
        # Where no orbit is followed, the exact solution shows whether there is one by now.
        rows = np.flatnonzero(~self.follows.all(axis=1))
        if len(rows):
            exact, mine = self.orbits.evaluate(designs[rows]), e.at(rows)
            # Another orbit may count by now: one that attracts and is larger, or the followed orbit no longer
            # attracts.
            other = (exact.kind != mine.kind) | (np.abs(exact.tilt - mine.tilt) > _GAP * exact.tilt)
            other |= ~self.follows[rows]
            for name in OF_PAIRS:
                where = other.reshape(*other.shape, *(1,) * (getattr(mine, name).ndim - 2))
                getattr(e, name)[rows] = np.where(where, getattr(exact, name), getattr(mine, name))
            self.follows[rows] &= ~other
            self._take(exact, rows, other & (exact.kind == ROCKING))
        return e

    def _step(self, designs: np.ndarray) -> Evaluation:
        """Integrate half a period of every orbit that is followed. All other orbits and lost orbits keep
        blank values."""
        o, m = self.orbits, len(designs)
        own = {name: np.array(getattr(Evaluation.blank(m, len(o.conditions)), name)) for name in OF_PAIRS}
        e = Evaluation(**own | {"margin": o.margins(designs)}, design=designs)
        # The derivatives of the last step predict the orbit of the next design to first order.
        self.turns = self.turns + np.einsum("mnud,md->mnu", self.slopes, designs - self.designs)
        self.designs, todo, before = designs, self.follows.copy(), self.follows.copy()
        for _ in range(_STEPS):
            rows = np.nonzero(todo)
            if not len(rows[0]):
                break
            batch = o.p, designs[rows[0]], o.conditions.factor_rows()[rows[1]], self.turns[rows]
            step = newton(batch[3], in_chunks(half_period(self.model), batch, chunk=_CHUNK))
            nu = o.geometry.slenderness[rows[1]]
            self.turns[rows], self.slopes[rows] = step.turn, step.slope
            e.tilt[rows], e.tilt_slope[rows] = step.turn[:, 0] / nu, step.slope[:, 0] / nu[:, None]
            e.swing[rows], e.swing_slope[rows] = step.swing, step.swing_slope
            e.multiplier[rows], e.reserve[rows] = step.multiplier, step.reserve
            # One step is sufficient if the design has moved little, since the error is quadratic in the
            # residual.
            has_failed = ~step.solved | (step.residual > _MOST_RESIDUAL) | (step.turn[:, 0] <= 0.0)
            self.follows[rows] = ~has_failed
            todo[rows] = ~has_failed & (step.residual > _LEAST_RESIDUAL)
        rows = np.nonzero(self.follows)
        if len(rows[0]) and o.needs_remaining:
            # A second integration along the change of the orbit gives the derivatives of its stability.
            batch = (
                o.p,
                designs[rows[0]],
                o.conditions.factor_rows()[rows[1]],
                self.turns[rows],
                self.slopes[rows],
            )
            factor = in_chunks(remaining(self.model), batch, chunk=_CHUNK)
            sound = factor.done & np.isfinite(factor.value) & np.isfinite(factor.slope).all(axis=1)
            e.remaining[rows], e.remaining_slope[rows] = factor.value, factor.slope
            self.follows[rows] = sound
        # The exact solution decides for orbits that did not converge or no longer attract.
        rests = (e.margin > 0.0) & o.rest_counts
        self.follows &= ~todo & ~rests & (e.multiplier < 1.0)
        self.stopped += (before & ~self.follows & ~rests).sum(axis=1)
        self.turns[~self.follows], self.slopes[~self.follows] = 0.0, 0.0
        return o.with_merits(e)

    def _take(self, e: Evaluation, descents: np.ndarray, new: np.ndarray) -> None:
        """Follow the exact orbits of an evaluation of some descents from now on, where `new` is true."""
        rows = np.nonzero(new)
        self.turns[descents[rows[0]], rows[1]] = e.turn[rows]
        self.slopes[descents[rows[0]], rows[1]] = 0.0
        self.follows[descents[rows[0]], rows[1]] = True


def prepare_step(orbits: Orbits, model: Smoothed) -> None:
    """Start to compile the step in a thread. The first evaluation waits until the step is compiled."""
    batch = orbits.p, np.zeros((1, 3)), orbits.conditions.factor_rows()[:1], np.zeros((1, 4))
    prepare(half_period(model), batch, chunk=_CHUNK)
    if orbits.needs_remaining:
        prepare(remaining(model), (*batch, np.zeros((1, 4, 3))), chunk=_CHUNK)
