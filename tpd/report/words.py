"""Quantities of a design in words."""

from __future__ import annotations

import math

from tpd.analysis.attractors import Starts
from tpd.core.formatting import number
from tpd.core.scene import HOUSNER, Block
from tpd.design.criteria import Limit, Mass, Walls
from tpd.design.result import Design


def angle(x: float) -> str:
    """An angle (rad) in radians and degrees."""
    return f"{number(x)} rad ({number(math.degrees(x), 3)}°)" if math.isfinite(x) else "overturns"


def losses(block: Block) -> str:
    """Energy losses of the rocking block."""
    if block.restitution is None:
        return f"friction k = {block.friction:g}"
    model = "Housner, " if block.restitution == HOUSNER else ""
    impacts = f"impact loss: {model}e = {block.velocity_ratio:.4g}"
    return f"{impacts}; friction k = {block.friction:g}" if block.friction else impacts


def risk(design: Design, value: float) -> str:
    """A value of the risk measure, which is a tilt over nu where every motion that counts rocks."""
    sampled = design.starts not in (Starts.rest(), Starts.any())
    mean = design.risk.share > 0.0 or (sampled and not design.starts.worst)
    mixed = f"{value:.4f} times nu, rest counted as less its uplift margin"
    if sampled and (mean or value > 1.0):
        return f"{mixed}, a start that overturns as 2 less that margin"
    if mean and value <= 0.0:
        return mixed
    if value <= 0.0:
        return f"none: at rest with {-value:.1%} of the lifting moment in reserve"
    if value > 1.0:
        return "no settled motion under the worst condition: by events the block may overturn"
    return f"{value * design.scene.block.slenderness:.5f} rad ({value:.1%} of nu)"


def limit(of: Limit) -> str:
    """A limit with its value."""
    name = of.name.replace("_", " ")
    if isinstance(of, Walls):
        return "a settled ball of steel keeps off the walls"
    (value,) = vars(of).values()
    return f"{name} {number(value)}{' kg' if isinstance(of, Mass) else _UNITS.get(of.name, '')}"


_UNITS = {"stroke": " rad", "relative_stroke": " rad", "tilt": " of nu", "offset": " m"}
