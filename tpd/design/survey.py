"""Survey: many designs followed from rest under every condition, the most promising first.

A search over settled motions does not see the way there: a design may overturn the block or strike a wall
before it settles. So the ends of the searches, designs on their paths and designs spread over the space are
followed by events of the linear equations; the best of these, and designs around them, by the nonlinear
equations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from tpd.core.progress import Count, unreported
from tpd.design.criteria import DesignSpace, Risk, Room, limit_of
from tpd.design.orbits import Orbits, blank
from tpd.design.search import first_apart
from tpd.models.compiled_nonlinear import settle_nonlinear
from tpd.models.piecewise import Piecewise
from tpd.models.rows import settle_all
from tpd.scene.bob import THICKEST
from tpd.scene.conditions import latin_hypercube, under_all
from tpd.scene.status import LOST, UNANSWERED, names_of

ROOM = ("room", "thickness", "room on the way")
"""Names of the limits that the room inside the block sets."""
ON_THE_WAY = ROOM[-1]
"""Name of the room for the bob from the start on, beside the limits on settled motions."""
_SPREAD, _DRAWN = 512, 8192
"""Designs spread over the space, and those drawn to find so many that fit the block at rest."""
_FINER = 64
"""Designs that go on from the linear to the nonlinear equations."""
_CENTRES, _AROUND = 8, 12
"""Boxes around the best designs, and designs in each."""
_ROUNDS = {"linear": (0.1, 0.04), "nonlinear": (0.04, 0.015)}
"""Half widths of these boxes, in shares of the bounds, round after round."""
_RTOL = 1e-6
"""Relative tolerance of a step by the nonlinear equations: a survey only chooses what is verified."""
_WORSE = 0.05
"""Share by which a condition may be worse before it counts against a design twice."""


@dataclass(frozen=True, kw_only=True)
class Survey:
    """Designs followed from rest: arrays of leading axis m, the best first once ordered or refined."""

    designs: np.ndarray
    """(mu, lam, zeta), (m, 3)"""
    severity: np.ndarray
    """Settled tilt over nu under every condition, 1 where the block overturns, (m, n)."""
    bare: np.ndarray
    """Severity of the block without a pendulum, (n,)."""
    excess: dict[str, np.ndarray]
    """Limited sizes over their limits, less one, the largest of all conditions, by name, (m,); those above
    zero are broken."""
    equations: str
    """"linear" or "nonlinear"."""
    risk: Risk = field(default_factory=Risk.expected)
    """Risk measure over the conditions that the search has."""

    @property
    def broken(self) -> np.ndarray:
        """Number of limits that each design breaks, (m,)."""
        return sum((x > 0.0 for x in self.excess.values()), np.zeros(len(self.designs), int))

    @property
    def stands(self) -> np.ndarray:
        """Whether the block stands under some condition, (m,); else no limit on its motion says anything."""
        return self.severity.min(axis=1) < 1.0

    @property
    def keeps(self) -> np.ndarray:
        """Whether a design keeps to all limits and the block stands under some condition, (m,)."""
        return (self.broken == 0) & self.stands

    @property
    def better(self) -> int:
        """Number of designs that keep to all limits and tilt the block less than none."""
        return int(np.sum(self.helps))

    @property
    def helps(self) -> np.ndarray:
        """Whether a design keeps to all limits and has a better score than the bare block, (m,)."""
        return self.keeps & (self.score < self._of(self.bare[None]))

    @property
    def score(self) -> np.ndarray:
        """Mean of the risk and of the mean severity and, once more, what is above the bare block by more than
        a twentieth, (m,)."""
        more = np.maximum(self.severity - (1.0 + _WORSE) * self.bare, 0.0)
        return self._of(self.severity) + more.mean(axis=1)

    def _of(self, severity: np.ndarray) -> np.ndarray:
        """Mean of the risk over the conditions and of the mean severity."""
        # The worst condition alone would call all designs equal under one in which every block overturns.
        return np.asarray(0.5 * (self.risk.of(severity) + severity.mean(axis=-1)))

    @property
    def told(self) -> str:
        """Sentences on the first design."""
        hung, bare = self.severity[0], self.bare
        said = (
            f"By the {self.equations} equations from rest, of {len(bare)} conditions: {np.sum(hung >= 1.0)} "
            f"overturn the block with the pendulum, {np.sum(bare >= 1.0)} without; under "
            f"{np.sum(hung > bare)} it rocks more with it."
        )
        if Room.name not in self.excess or np.all(hung >= 1.0):
            return said
        settled, way = (1.0 + float(self.excess[name][0]) for name in (Room.name, ON_THE_WAY))
        return f"{said} The bob comes to {settled:.0%} of the wall's distance once settled, {way:.0%} before."

    def best_without(self, *names: str) -> int | None:
        """The best design that keeps to all limits but those named, or None."""
        others = [x for name, x in self.excess.items() if name not in names]
        fits = self.stands & ~np.any(np.stack([np.zeros(len(self.designs)), *others]) > 0.0, axis=0)
        return int(np.flatnonzero(fits)[np.argmin(self.score[fits])]) if fits.any() else None

    def relaxed(self) -> dict[str, int | None]:
        """The best design that keeps to all limits from rest, and the best without each limit that designs
        break, by what is asked of it; None where there is no such design."""
        broken = [name for name, x in self.excess.items() if np.any(x > 0.0)]
        # The three sizes that the room sets go together: one without the others would buy nothing.
        groups = {n.replace("_", " "): (n,) for n in broken if n not in ROOM}
        if set(broken) & set(ROOM):
            groups = {"room": ROOM, **groups}
        out = {"limits kept from rest": self.best_without()}
        out |= {f"without the limit on {n}": self.best_without(*g) for n, g in groups.items()}
        if len(groups) > 1:
            out["without any limit"] = self.best_without(*broken)
        return out

    def ordered(self) -> Survey:
        """This survey with the best designs first: those that keep to the limits, then by their score."""
        excess = sum((np.maximum(x, 0.0) for x in self.excess.values()), np.zeros(len(self.designs)))
        # An overturned block breaks no limit on the bob; so it must not come nearer to the limits by that.
        lost = (self.severity >= 1.0).mean(axis=1) - (self.bare >= 1.0).mean()
        excess = excess + np.where(excess > 0.0, np.maximum(lost, 0.0), 0.0)
        # Scores that differ by less than a thousandth are alike: the ends of the searches come first then.
        return self.at(np.lexsort((np.round(self.score, 3), np.round(excess, 6), ~self.stands)))

    def at(self, rows: np.ndarray) -> Survey:
        """Some of the designs."""
        excess = {name: x[rows] for name, x in self.excess.items()}
        return replace(self, designs=self.designs[rows], severity=self.severity[rows], excess=excess)

    def joined(self, other: Survey) -> Survey:
        """Both surveys in one."""
        return replace(
            self,
            designs=np.concatenate([self.designs, other.designs]),
            severity=np.concatenate([self.severity, other.severity]),
            excess={k: np.concatenate([x, other.excess[k]]) for k, x in self.excess.items()},
        )


def survey(
    objective: Orbits, met: np.ndarray, periods: int, seed: int, progress: Count = unreported
) -> tuple[Survey, Survey]:
    """Follow designs that searches met, and others, from rest.

    Args:
        objective: conditions, limits and space.
        met: designs (mu, lam, zeta) of searches, the best first, shape (m, 3).
        periods: most forcing periods of a run.
        seed: of the designs spread over the space and around the best.
        progress: called with (designs followed, of how many).

    Returns:
        All designs by the linear equations, and the best of them with designs around these by the nonlinear
        ones; both ordered.
    """
    space, spread = objective.space, fitting(objective, seed)
    rounds = sum(map(len, _ROUNDS.values()))
    total, before = len(met) + len(spread) + _FINER + rounds * _CENTRES * _AROUND, 0

    def follow(designs: np.ndarray, equations: str) -> Survey:
        nonlocal before
        first, before = before, before + len(designs)

        def after(done: int, _: int) -> None:
            progress(first + min(done, len(designs)), total)

        return followed(objective, designs, periods, equations, after)

    wide = follow(np.concatenate([met, spread]), "linear").ordered()
    wide = _refined(wide, space, lambda designs: follow(designs, "linear"), seed)
    units = space.scaled(wide.designs)
    chosen = first_apart(units, np.arange(len(units)), _FINER, 0.01)
    fine = follow(wide.designs[chosen], "nonlinear").ordered()
    return wide, _refined(fine, space, lambda designs: follow(designs, "nonlinear"), seed)


def _refined(found: Survey, space: DesignSpace, follow: Callable[[np.ndarray], Survey], seed: int) -> Survey:
    """A survey with designs around its best ones, in boxes that shrink from round to round."""
    for i, width in enumerate(_ROUNDS[found.equations]):
        rng = np.random.default_rng([seed, 11, i])
        units = space.scaled(found.designs)
        centres = units[first_apart(units, np.arange(len(units)), _CENTRES)]
        around = centres[:, None] + rng.uniform(-width, width, (len(centres), _AROUND, centres.shape[1]))
        inside = np.clip(around.reshape(-1, centres.shape[1]), 0.0, 1.0)
        found = found.joined(follow(space.unscaled(inside))).ordered()
    return found


def fitting(objective: Orbits, seed: int) -> np.ndarray:
    """Seeded designs (m, 3) over the space, of which as many as possible fit between the walls at rest."""
    space, room = objective.space, limit_of(objective.limits, Room)
    rng = np.random.default_rng([seed, 9])
    if not isinstance(room, Room):
        return space.unscaled(latin_hypercube(rng, _SPREAD, space.bounds.shape[1]))
    drawn = space.unscaled(latin_hypercube(rng, _DRAWN, space.bounds.shape[1]))
    g = objective.geometry
    radius = np.asarray(room.bob.radius(g.mass(drawn)))
    over = np.maximum(radius / g.wall, room.bob.slimness * radius / (THICKEST * g.rod(drawn))).max(axis=1)
    # Those that do not fit at all come last: some remain, since they say what the room costs.
    order = np.argsort(over > 1.0, kind="stable")
    return drawn[order[:_SPREAD]]


def followed(
    objective: Orbits,
    designs: np.ndarray,
    periods: int,
    equations: str,
    progress: Count | None = None,
    rtol: float = _RTOL,
) -> Survey:
    """Survey of designs (m, 3), in their order, and of the bare block, from rest; `rtol` is the relative
    tolerance of a step of the nonlinear equations."""
    none = np.array([[0.0, float(objective.p.lam), float(objective.p.zeta)]])
    every, n = np.concatenate([none, designs]), len(objective.conditions)
    q, y0 = under_all(objective.p, every, objective.conditions), np.zeros((len(every) * n, 4))
    after = None if progress is None else lambda done, of: progress(done // n, of // n)
    if equations == "linear":
        settled = settle_all(q, y0, model=Piecewise(max_periods=periods), progress=after)
    else:
        settled = settle_nonlinear(q, y0, periods=periods, rtol=rtol, progress=after)
    names = names_of(settled.status).reshape(-1, n)
    lost = np.isin(names, (*LOST, *UNANSWERED))
    # What has no answer speaks against a pendulum, and not for it against the bare block.
    lost[0] = np.isin(names[0], LOST)
    sizes = (
        np.asarray(x).reshape(-1, n)
        for x in (settled.amplitude, settled.stroke, settled.peak, settled.peak_stroke)
    )
    amplitude, stroke, peak, peak_stroke = (np.where(lost | np.isnan(x), np.inf, x) for x in sizes)
    severity = np.minimum(amplitude / objective.geometry.slenderness, 1.0)
    # An overturned block breaks no limit on the bob: it counts by its severity.
    still = [np.where(np.isfinite(x), x, 0.0)[1:] for x in (amplitude, stroke, peak, peak_stroke)]
    return Survey(
        designs=designs,
        severity=severity[1:],
        bare=severity[0],
        excess=excess(objective, designs, *still),
        equations=equations,
        risk=objective.risk,
    )


def excess(
    objective: Orbits,
    designs: np.ndarray,
    amplitude: np.ndarray,
    stroke: np.ndarray,
    peak: np.ndarray,
    peak_stroke: np.ndarray,
) -> dict[str, np.ndarray]:
    """Largest excess of every limit on the motion, of angles (rad) under every condition, (m,)."""
    g, m = objective.geometry, len(designs)
    e = blank(m, len(g.slenderness))._replace(tilt=amplitude / g.slenderness, stroke=stroke, design=designs)
    out = {
        size.name: size.value.max(axis=1) - 1.0
        for limit in objective.limits
        if limit.of_motion
        for size in limit.sizes(e, g)
    }
    closed = [limit for limit in objective.limits if not limit.of_motion]
    if closed:
        # A motion from rest does not show how near its orbit is to where it stops attracting.
        orbits = objective.evaluate(designs)
        for size in (size for limit in closed for size in limit.sizes(orbits, g)):
            out[size.name] = np.nan_to_num(size.value.max(axis=1) - 1.0, nan=np.inf, posinf=np.inf)
    room = limit_of(objective.limits, Room)
    if isinstance(room, Room):
        reach = room.bob.reach(g.mass(designs), g.rod(designs), peak + peak_stroke)
        out[ON_THE_WAY] = (reach / g.wall).max(axis=1) - 1.0
    return out
