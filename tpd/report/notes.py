"""What somebody who would hang a pendulum must know of its design."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from tpd.analysis.response import Response
from tpd.core.scene import HOUSNER, Block, Pendulum
from tpd.core.status import SETTLED
from tpd.design.result import Candidate, Design

LARGE_PEAK = 0.7
"""Of the toppling tilt; above it a start from rest is called dangerous."""
GRAVE = 2.0
"""Times the bare block's amplitude; above it rocking more at another frequency is a danger."""
LARGE_STROKE = 0.3
"""rad; sin(psi) is 1.5 % below psi there, and falls further with its square."""
_POINT = 0.5
"""Largest radius of a ball, in lengths of its rod, that counts as a point."""
_HINTS = (
    "`--stroke` limits the settled angle of the rod; over many conditions `--walls` keeps a settled ball off",
    "the limit on walls is one on the settled motion",
)
"""What can be done about a ball that strikes the walls, and what has been."""


def toppling(design: Design, mass_ratio: float) -> float:
    """The tilt (rad) at which the linear block topples of itself, nu (1 + mu)/(1 + 2 mu)."""
    return design.scene.block.slenderness * (1.0 + mass_ratio) / (1.0 + 2.0 * mass_ratio)


def notes(design: Design, responses: tuple[Response, ...] = ()) -> list[str]:
    """What somebody who would hang this pendulum must know, dangers first."""
    out = [
        "amplitudes, strokes and responses are those of the linear equations of Collini et al. (2016) under "
        "one harmonic motion of the base, switched on suddenly at rest; the nonlinear ones were asked of the "
        "design itself. Other starts may settle elsewhere, and an earthquake is not a harmonic."
    ]
    if design.interrupted:
        out.insert(0, "the search was interrupted; nothing below is the best of the design space.")
    winner = design.winner
    out = _dangers(design, responses) + out
    if winner is not None and design.pendulum is not None:
        out.extend(_margins(winner))
        out.extend([*_walls(design, design.pendulum), *thick(design.pendulum)])
        out.extend(_edges(design, winner))
    if not design.bare.agree and design.bare.smoothed_status != "not solved":
        out.append("the models disagree on the bare block: take its amplitude as a rough one.")
    if (design.history.screened_status == "overturned").any():
        share = np.mean(design.history.screened_status == "overturned")
        out.append(
            f"of the designs screened, {share:.0%} overturn the block: "
            "a pendulum in the wrong place does harm."
        )
    return dangers_first(out)


def dangers_first(said: list[str]) -> list[str]:
    """What begins with DANGER before the rest, else in the order given."""
    return sorted(said, key=lambda note: not note.startswith("DANGER"))


def _margins(winner: Candidate) -> list[str]:
    """How far the settled motion is from being another."""
    out = []
    if winner.status == "rest":
        out.append(
            f"the resting block keeps {winner.margin:.1%} of the moment that would lift it in hand, once the "
            "pendulum has settled; the sudden start may lift it before."
        )
    elif winner.margin > 0:
        out.append("the block could rest under this pendulum, but a start from rest ends in rocking.")
    if winner.stroke > LARGE_STROKE:
        out.append(f"a stroke of {winner.stroke:.2f} rad stretches the linear equations of the pendulum.")
    if winner.multiplier > 0.95:
        out.append(f"the motion attracts slowly (Floquet multiplier {winner.multiplier:.3f}).")
    return out


def _walls(design: Design, pendulum: Pendulum) -> list[str]:
    """Whether a bob of steel keeps within the width of the block."""
    angles = {"once settled": design.stroke + design.amplitude, "on the way there": sum(design.peak)}
    return strikes(design.scene.block, pendulum, angles)[:1]


def strikes(
    block: Block, pendulum: Pendulum, angles: Mapping[str, float], limited: bool = False
) -> list[str]:
    """A note for every one of the `angles` at which a solid ball of steel would strike the walls, and what
    would keep it off.

    Args:
        block, pendulum: the design.
        angles: between bob and block, rad, by when they are reached: the largest bob angle and the largest
            tilt together, which is never too little.
        limited: whether the search has kept the settled ball off them.
    """
    wall, length, ball = 0.5 * block.width, pendulum.length, pendulum.ball_radius

    def clear(room: float) -> str:
        """The largest stroke at which so much room (m) to a side is enough, rounded down."""
        return f"{math.floor(1000.0 * math.asin(min(room / length, 1.0))) / 1000.0:g} rad"

    fits = f"up to {clear(wall - ball)}" if ball < wall else "at no angle"
    out = []
    for when, angle in angles.items():
        swing = length * math.sin(min(angle, 0.5 * math.pi))
        if swing + ball > wall:
            out.append(
                f"DANGER: {when} the bob may swing {swing:.3g} m out of the block's axis, and the block's "
                f"half width is {wall:.3g} m. Inside it, a solid ball of steel of this mass ({ball:.3g} m "
                "in radius) would STRIKE the walls, which nothing here computes. On a rod of this length "
                f"it stays off them {fits} between rod and block, a point up to {clear(wall)} "
                f"({_HINTS[limited]})."
            )
    return out


def thick(pendulum: Pendulum) -> list[str]:
    """A note where a solid ball of steel is no point on its rod."""
    share = pendulum.ball_radius / pendulum.length
    if share <= _POINT:
        return []
    return [
        f"a solid ball of steel of this mass is {pendulum.ball_radius:.3g} m in radius, on a rod of "
        f"{pendulum.length:.3g} m: no point, as is assumed here. Its own moment of inertia adds "
        f"{0.4 * share**2:.0%} to that of the point"
        + (", and it is thicker than the rod is long." if share >= 1.0 else ".")
    ]


def _dangers(design: Design, responses: tuple[Response, ...]) -> list[str]:
    """Where, near the design's shaking, the block overturns or rocks more."""
    out = []
    tried, hung_lost, bare_lost = design.overturned_nearby
    if design.pendulum is not None and hung_lost:
        out.append(
            f"DANGER: of {tried} shakings within 1 % in amplitude or frequency, {hung_lost} overturn the "
            f"block with this pendulum ({bare_lost} without), from rest."
        )
    if design.pendulum is not None and design.peak[0] > LARGE_PEAK * toppling(design, 0.0):
        out.append(
            "DANGER: in the first 24 periods from rest the block comes near the tilt at which it topples."
        )
    if len(responses) < 2:
        return out
    bare, hung = responses
    away = np.abs(hung.frequency / design.scene.motion.frequency - 1.0)
    lost, lost_bare = hung.status == "overturned", bare.status == "overturned"
    harmed = np.flatnonzero(lost & ~lost_bare)
    if harmed.size:
        i = harmed[np.argmin(away[harmed])]
        out.append(
            f"DANGER: at {hung.frequency[i]:.4g} Hz, same base amplitude, from rest, this pendulum OVERTURNS "
            f"the block, which without it ends {bare.status[i]}. The design is for its one frequency; see "
            "response.png."
        )
    settled = [np.isin(r.status, SETTLED) for r in responses]
    worse = np.flatnonzero(settled[0] & settled[1] & (hung.amplitude > 1.02 * bare.amplitude))
    if worse.size:
        gravely = worse[hung.amplitude[worse] > GRAVE * bare.amplitude[worse]]
        told = gravely if gravely.size else worse
        i, grave = told[np.argmin(away[told])], "DANGER: " if gravely.size else ""
        out.append(
            f"{grave}at {hung.frequency[i]:.4g} Hz the block rocks more with this pendulum "
            f"({hung.amplitude[i]:.4g} rad) than without ({bare.amplitude[i]:.4g} rad)."
        )
    out.append(
        f"of {lost.size} frequencies tried from {hung.frequency[0]:.4g} to {hung.frequency[-1]:.4g} Hz, "
        f"{lost.sum()} overturn the block with the pendulum and {lost_bare.sum()} without."
    )
    return out


def _edges(design: Design, winner: Candidate) -> list[str]:
    space, out = design.space, []
    searched = [
        ("mass", winner.mass_ratio, space.mass_ratio),
        ("length", winner.length_ratio, space.length_ratio),
    ]
    if isinstance(space.damping_ratio, tuple):
        searched.append(("damping", winner.damping_ratio, space.damping_ratio))
    for name, value, bounds in searched:
        width = bounds[1] - bounds[0]
        for bound, word in ((bounds[0], "least"), (bounds[1], "largest")):
            if abs(value - bound) < 0.002 * width:
                out.append(f"the {name} ratio is at the {word} allowed, {bound:g}.")
    if winner.stroke > 0.98 * space.stroke:
        out.append(f"the settled stroke is at its limit, {space.stroke:g} rad.")
    return out


def losses(block: Block) -> str:
    """What takes the rocking block's energy, in words."""
    if block.restitution is None:
        return f"friction k = {block.friction:g}"
    model = "Housner, " if block.restitution == HOUSNER else ""
    impacts = f"impact loss: {model}e = {block.velocity_ratio:.4g}"
    return f"{impacts}; friction k = {block.friction:g}" if block.friction else impacts
