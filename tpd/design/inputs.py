"""Checks of the inputs of a search before anything is compiled: their types, and what cannot be searched."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tpd.analysis.attractors import Starts
from tpd.core import checks
from tpd.core.conditions import Conditions, check_restitution
from tpd.core.scene import Block, Scene, check_shaking
from tpd.design.criteria import Limit, Risk, Room, limit_of
from tpd.design.methods import Method
from tpd.design.space import DesignSpace


def check_types(
    scene: Scene,
    space: DesignSpace | None,
    conditions: Conditions | None,
    starts: Starts | None,
    risk: Risk | None,
    method: Method | None,
) -> None:
    """Raise `ValueError` unless every input is of its class; None stands for a default."""
    checks.instance("scene", scene, Scene)
    given = {
        "space": (space, DesignSpace),
        "conditions": (conditions, Conditions),
        "starts": (starts, Starts),
        "risk": (risk, Risk),
        "method": (method, Method),
    }
    for name, (value, kind) in given.items():
        if value is not None:
            checks.instance(name, value, kind)


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
