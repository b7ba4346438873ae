"""Whether a pendulum can be hung: nonlinear equations, shakings around its own, and room for the bob."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tpd.analysis.compare_models import Check, check
from tpd.core.bob import THICKEST, Bob
from tpd.core.conditions import Conditions, under_all
from tpd.core.parameters import as_arrays
from tpd.core.progress import Progress
from tpd.core.scene import Block, Pendulum, Scene
from tpd.core.status import names_of
from tpd.models.compiled_nonlinear import settle_nonlinear

_NEARBY = (-0.01, -0.005, 0.005, 0.01)
"""Changes of the base motion's amplitude, and of its frequency."""
_MOST = 64
"""Most conditions of a job that are followed."""


@dataclass(frozen=True, kw_only=True)
class Motions:
    """Motions from rest by the nonlinear equations, (n,); infinite where the block overturns."""

    status: np.ndarray
    amplitude: np.ndarray
    """Settled |phi|, rad."""
    settled: np.ndarray
    """Bound on the settled angle between rod and block, rad."""
    way: np.ndarray
    """Bound on that angle from the start on, rad."""

    @property
    def overturned(self) -> int:
        """Number of motions that overturn the block."""
        return int(np.sum(self.status == "overturned"))


@dataclass(frozen=True, kw_only=True)
class Suitability:
    """A pendulum by all models, under the shakings around its own, and in the cavity of its block."""

    scene: Scene
    pendulum: Pendulum
    bob: Bob
    check: Check
    shakings: Conditions
    """The scene's own shaking first, then its neighbours, or the conditions of a job."""
    several: bool
    """Whether the shakings are the conditions of a job."""
    hung: Motions
    bare: Motions

    @property
    def tried(self) -> int:
        """Number of shakings beside the scene's own."""
        return len(self.shakings) - 1

    @property
    def lost(self) -> tuple[int, int]:
        """Shakings beside the own one that overturn the block: with the pendulum and without."""
        # The own shaking is told by the comparison of models already.
        own = (m.status[0] == "overturned" for m in (self.hung, self.bare))
        with_it, without = (m.overturned - int(o) for m, o in zip((self.hung, self.bare), own, strict=True))
        return with_it, without

    @property
    def worse(self) -> int:
        """Shakings beside the own one under which the block stands bare, and with the pendulum rocks more."""
        with_it, without = self.hung.amplitude[1:], self.bare.amplitude[1:]
        # A block that rests up to round-off is no worse than any other.
        return int(np.sum(np.isfinite(without) & (with_it > 1e-9) & (with_it > without)))

    @property
    def around(self) -> str:
        """Phrase for the shakings."""
        what = "conditions of the job" if self.several else "shakings within 1 % in amplitude or frequency"
        return f"{self.tried} {what}"

    @property
    def reach(self) -> tuple[float, float]:
        """Largest distances (m) of the bob's surface from the block's axis, settled and on the way from
        rest, of the motions that stand; NaN where none does."""
        # A job's conditions need not hold the scene's own shaking.
        rows = slice(1, None) if self.several else slice(0, 1)
        length, mass = (self.shakings.column(name)[rows] for name in ("length", "mass"))
        rod, heavy = self.pendulum.length * length, self.pendulum.mass * mass

        def largest(angle: np.ndarray) -> float:
            stands = np.isfinite(angle)
            far = np.asarray(self.bob.reach(heavy, rod, np.where(stands, angle, 0.0)))
            return float(np.max(far[stands], initial=-math.inf)) if stands.any() else math.nan

        return largest(self.hung.settled[rows]), largest(self.hung.way[rows])

    @property
    def refusals(self) -> tuple[str, ...]:
        """Sentences that say why not to hang it, the gravest last; empty if nothing speaks against it."""
        return (
            *(f"does not help: {x}" for x in self._no_help()),
            *(f"does not fit: {x}" for x in misfits(self.scene.block, self.pendulum, self.bob, self.reach)),
            *(f"DO NOT USE: {x}" for x in self._unconfirmed()),
        )

    def _no_help(self) -> Iterator[str]:
        a, bare = self.check.top.amplitude, self.check.bare
        if not self.several and math.isfinite(a) and a > 0.0 and a >= bare:
            yield f"by the nonlinear equations the block rocks {a:.4g} rad, and {bare:.4g} without"
        # Where the bare block overturns, a pendulum that holds it is no worse: most shakings have to be.
        if 2 * self.worse > self.tried:
            yield f"under {self.worse} of {self.around} the block rocks more than without the pendulum"

    def _unconfirmed(self) -> Iterator[str]:
        lost, bare = self.lost
        share = f"under {lost} of {self.around} the block overturns, and under {bare} without the pendulum"
        # Rocking more is told by `_no_help`.
        against = replace(self.check, bare=math.inf).objections
        # Under one of many conditions a single run near overturning is no fact; their number is.
        if self.several and self.check.top.status == "overturned":
            against = ()
        yield from (f"{x} ({share})" if "overturned" in x else x for x in against)
        if lost > (bare if self.several else 0) and not any("overturned" in x for x in against):
            yield f"by the nonlinear equations, {share}"


def suitability(
    scene: Scene,
    pendulum: Pendulum,
    *,
    conditions: Conditions | None = None,
    stroke: float = math.inf,
    bob: Bob | None = None,
    models: tuple[str, ...] | None = None,
    progress: Progress | None = None,
) -> Suitability:
    """Ask whether a pendulum can be hung.

    Args:
        scene: the block and its shaking.
        pendulum: the one to be hung.
        conditions: those that it was designed for; by default, and where there is one, eight neighbours of
            the scene's own shaking are asked in their place.
        stroke: limit on the bob's settled angle, rad.
        bob: the body at the end of the rod; default a ball of steel.
        models: names of models, as in `tpd.check`.
        progress: called with ("checking", models done, of how many).

    Raises:
        ValueError: an unknown model, or a limit that is not positive.
        RuntimeError: JAX is in 32-bit mode.
    """
    found = check(scene, pendulum, stroke=stroke, models=models, progress=progress)
    several = conditions is not None and len(conditions) > 1
    shakings = _with_own(conditions.subset(_MOST) if conditions is not None and several else neighbours())
    return Suitability(
        scene=scene,
        pendulum=pendulum,
        bob=Bob() if bob is None else bob,
        check=found,
        shakings=shakings,
        several=several,
        hung=motions(scene, pendulum, shakings),
        bare=motions(scene, None, shakings),
    )


def neighbours() -> Conditions:
    """Eight shakings within 1 % in amplitude or frequency."""
    shakes = [(1.0 + d, 1.0) for d in _NEARBY] + [(1.0, 1.0 + d) for d in _NEARBY]
    amplitude, frequency = np.array(shakes).T
    return Conditions({"amplitude": amplitude, "frequency": frequency})


def _with_own(conditions: Conditions) -> Conditions:
    """The scene's own shaking, followed by the conditions."""
    return Conditions({name: np.concatenate([[1.0], x]) for name, x in conditions.factors.items()})


def motions(scene: Scene, pendulum: Pendulum | None, conditions: Conditions) -> Motions:
    """Follow the block from rest by the nonlinear equations under every condition."""
    p = as_arrays(scene.parameters(pendulum))
    design = np.array([[p.mu, p.lam, p.zeta]])
    settled = settle_nonlinear(under_all(p, design, conditions), np.zeros((len(conditions), 4)))
    status = names_of(settled.status)

    def column(*names: str) -> np.ndarray:
        return np.where(status == "overturned", np.inf, sum(np.asarray(getattr(settled, n)) for n in names))

    return Motions(
        status=status,
        amplitude=np.where(status == "rest", 0.0, column("amplitude")),
        # Both largest angles need not occur at once: their sum is a bound.
        settled=column("amplitude", "stroke"),
        way=column("peak", "peak_stroke"),
    )


def misfits(block: Block, pendulum: Pendulum, bob: Bob, reach: tuple[float, float]) -> Iterator[str]:
    """Sentences that say why the bob does not fit into the block.

    Args:
        block, pendulum, bob: the design.
        reach: largest distances (m) of the bob's surface from the block's axis, settled and on the way
            there; NaN if unknown.
    """
    radius, rod, room = float(bob.radius(pendulum.mass)), float(pendulum.length), 0.5 * float(block.room)
    half = bob.slimness * radius
    body = f"the bob as {bob} has a radius of {radius:.3g} m"
    if radius >= room:
        yield f"{body}, and there are {room:.3g} m to either side"
        return
    if half > THICKEST * rod:
        yield f"{body}, its half height is more than half of its rod of {rod:.3g} m"
    if rod + half > block.height:
        yield f"rod and bob are {rod + half:.3g} m long, and the block is {block.height:.3g} m high"
    for when, far in zip(("once settled", "on the way from rest"), reach, strict=True):
        if far > room:
            yield f"{when} the bob reaches {far:.3g} m to the side, and there are {room:.3g} m"
