"""The question of a design, and checks of it before anything is compiled."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from tpd.answers.attractors import Starts
from tpd.answers.ensemble import Ensemble
from tpd.core import checks
from tpd.design.criteria import DesignSpace, Limit, Mass, Risk, Room, Worth, limit_of
from tpd.scene.conditions import Conditions, check_restitution
from tpd.scene.scene import Block, Scene, check_shaking

_KINDS = {
    "space": DesignSpace,
    "conditions": Conditions,
    "starts": Starts,
    "risk": Risk,
    "ensemble": Ensemble,
    "worth": Worth,
}


@dataclass(frozen=True, kw_only=True, repr=False)
class Question:
    """Inputs of `tpd.optimise`, complete and checked."""

    scene: Scene
    """On ground motions its motion is the first of them."""
    space: DesignSpace
    """Within the limit on the bob's mass, if there is one."""
    conditions: Conditions
    """On ground motions those of the group that a design is tuned to."""
    risk: Risk
    limits: tuple[Limit, ...]
    method: Any
    """A `Method`; on ground motions a `GroundSearch`."""
    ensemble: Ensemble
    """On ground motions its widths are those of block and installation in the judgement."""
    worth: Worth
    seed: int

    @property
    def inputs(self) -> dict[str, Any]:
        """All fields by their names: an answer repeats its question."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


def check_given(seed: int, **given: Any) -> None:
    """Raise unless JAX has 64 bits, the seed is a whole number, and each input is of its class; None stands
    for a default."""
    checks.require_x64()
    checks.seed("seed", seed)
    for name, value in given.items():
        if value is not None:
            checks.instance(name, value, _KINDS[name])


def within_mass(space: DesignSpace, block: Block, limits: tuple[Limit, ...]) -> DesignSpace:
    """The space within the limit on the bob's mass, if there is one.

    Raises:
        ValueError: a mass below the least bob of the space.
    """
    limit, (low, high) = limit_of(limits, Mass), space.mass_ratio
    if not isinstance(limit, Mass):
        return space
    # A bound is kept exactly by every method; a constraint only to its tolerance.
    most = limit.kg / float(block.mass)
    if most <= low:
        raise ValueError(
            f"`mass` must be above the least bob of the design space, {low * block.mass:g} kg, but is "
            f"{limit.kg:g} kg"
        )
    return replace(space, mass_ratio=(low, min(high, most)))


def check_moves(scene: Scene, conditions: Conditions, space: DesignSpace) -> None:
    """Raise `ValueError` where nothing shakes the block, or where a quantity scatters that is zero."""
    if not scene.motion.amplitude > 0.0:
        raise ValueError(
            f"`amplitude` must be above 0 in a search, but is {scene.motion.amplitude:g}: nothing shakes the "
            "block"
        )
    check_scatter(scene, {name for name, v in conditions.factors.items() if np.ptp(v) > 0.0}, space)
    motion, factor = scene.motion, conditions.column
    check_shaking(motion.amplitude * factor("amplitude"), motion.frequency * factor("frequency"))


def check_cavity(block: Block, limits: tuple[Limit, ...]) -> None:
    """Raise `ValueError` where limits ask for room inside a block whose cavity is not stated."""
    if limit_of(limits, Room) is None or block.cavity_width is not None:
        return
    raise ValueError(
        "`cavity_width`, the width in m between the walls that the bob swings within, must be given, but is "
        "not, and no pendulum hangs inside a solid block: state it (--cavity, or `cavity_width` in [block] "
        "or of `Block`), or ask for no room (--no-walls, `room = false` in [limits], or limits without "
        "`Room`)"
    )


def check_scatter(scene: Scene, names: Iterable[str], space: DesignSpace | None = None) -> None:
    """Raise `ValueError` for a name out of `FACTORS` of a quantity that is zero or absent: a factor on it
    would change nothing."""
    zero = {
        "friction": scene.block.friction == 0.0,
        "damping": space is not None and space.damping_ratio == 0.0,
    }
    for name in names:
        if zero.get(name, False):
            raise ValueError(f"`{name}` cannot scatter by a share of itself: it is 0")
        if name == "restitution":
            check_restitution(scene)
