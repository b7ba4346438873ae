"""Quantities of a design in words."""

from __future__ import annotations

import math

import numpy as np

from tpd.analysis.attractors import Starts
from tpd.core.formatting import number
from tpd.core.scene import HOUSNER, Block, Pendulum
from tpd.design.criteria import KINDS, Bob, Limit, Mass, Room, limit_of
from tpd.design.result import HarmonicDesign


def angle(x: float) -> str:
    """A largest angle (rad) in radians and degrees; infinite where the block overturns, NaN if unknown."""
    # NaN is not known, infinity is known very well: the two must not share a word.
    if not math.isfinite(x):
        return "unknown" if math.isnan(x) else "overturns"
    return f"{number(x)} rad ({number(math.degrees(x), 3)}°)"


def toppling(slenderness: float, mass_ratio: float) -> float:
    """Tilt (rad) at which the linear block topples by itself, nu (1 + mu)/(1 + 2 mu)."""
    return slenderness * (1.0 + mass_ratio) / (1.0 + 2.0 * mass_ratio)


def source_of_tilts(design: HarmonicDesign) -> str:
    """Motions that the search's tilts belong to, in words."""
    if design.starts == Starts.rest():
        return "rest wherever it holds, else the largest attracting symmetric motion"
    return "the largest attracting symmetric motion, whichever start leads to it"


def finite_max(values: np.ndarray) -> float:
    """Largest finite one of `values`, or 0."""
    return float(np.max(values, where=np.isfinite(values), initial=0.0))


def bob_of(limits: tuple[Limit, ...]) -> Bob:
    """The body of the limit on room, or a ball of steel."""
    room = limit_of(limits, Room)
    return room.bob if isinstance(room, Room) else Bob()


def rod(pendulum: Pendulum, bob: Bob, gravity: float) -> tuple[str, str, str]:
    """Row of a table: where a body hangs that swings as often as the point of the equations."""
    at = bob.rod(float(pendulum.mass), float(pendulum.length), gravity)
    built = f"{number(at)} m" if math.isfinite(at) else "none"
    return "hinge to the bob's centre, to be built", built, "as a body with its rod, of the same frequency"


def of_toppling(design: HarmonicDesign, tilt: float, mass_ratio: float) -> tuple[str, str | None]:
    """A tilt (rad), and its share of the tilt at which the block topples."""
    # A tilt in radians means little to somebody who has not computed the slenderness.
    share = f"{tilt / toppling(design.scene.block.slenderness, mass_ratio):.1%} of toppling"
    return angle(tilt), share if math.isfinite(tilt) else None


def losses(block: Block) -> str:
    """Energy losses of the rocking block."""
    if block.restitution is None:
        return f"friction k = {block.friction:g}"
    # With a pendulum Housner's e is smaller.
    model, of = ("Housner, ", " for the bare block") if block.restitution == HOUSNER else ("", "")
    impacts = f"impact loss: {model}e = {block.velocity_ratio:.4g}{of}"
    return f"{impacts}; friction k = {block.friction:g}" if block.friction else impacts


def risk(design: HarmonicDesign, value: float) -> str:
    """A value of the risk measure, which is a tilt over nu where every motion that counts rocks."""
    if design.risk.share > 0.0 and value <= 0.0:
        return f"{value:.4f} times nu, rest counted as less its uplift margin"
    if value <= 0.0:
        return f"none: at rest with {-value:.1%} of the lifting moment in reserve"
    if value > 1.0:
        return "no settled motion under the worst condition: by events the block may overturn"
    return f"{value * design.scene.block.slenderness:.5f} rad ({value:.1%} of nu)"


def limit(of: Limit) -> str:
    """A limit with its value."""
    name = of.name.replace("_", " ")
    if isinstance(of, Room):
        return f"the bob, {of.bob}, keeps off the walls"
    if type(of) not in KINDS:
        # A limit of the user's own has any fields, in units of its own.
        return " ".join([name, ", ".join(f"{k} = {v}" for k, v in vars(of).items())]).strip()
    (value,) = vars(of).values()
    return f"{name} {number(value)}{' kg' if isinstance(of, Mass) else _UNITS.get(of.name, '')}"


_UNITS = {
    "stroke": " rad",
    "relative_stroke": " rad",
    "tilt": " of nu",
    "offset": " m",
    "worsening": " of the bare tilt",
}
