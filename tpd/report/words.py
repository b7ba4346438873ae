"""Scenes and designs in words, and what both kinds of design have in one form."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tpd.core.formatting import number
from tpd.design.criteria import KINDS, Clearance, Limit, limit_of
from tpd.records.read import in_words
from tpd.report.blocks import NO_VALUE, Table
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.quantities import UNITS
from tpd.scene.scene import HOUSNER, Block, Harmonic, Pendulum, Scene, paper_scene

if TYPE_CHECKING:
    # Words on a scene do not wait for JAX.
    from tpd.answers.paired import PairedRuns, Part
    from tpd.answers.response import Response
    from tpd.design.design import Design

_CHANGES = {
    "mean severity": "mean tilt / toppling tilt",
    "median severity": "median tilt",
    "overturned": "overturned",
    "at rest": "at rest in the end",
}
"""Rows of the comparison, and their names."""
_PAPER = "the paper's block (Collini et al. 2016)"


def angle(x: float) -> str:
    """A largest angle (rad) in radians and degrees; infinite where the block overturns, NaN if unknown."""
    # NaN is not known, infinity is known very well: the two must not share a word.
    if not math.isfinite(x):
        return "unknown" if math.isnan(x) else "overturns"
    return f"{number(x)} rad ({number(math.degrees(x), 3)}°)"


def source_of_tilts(design: Design) -> str:
    """Motions that the tilts of the search belong to, in words."""
    if design.problem.rest_counts:
        return "Rest wherever it holds, else the largest attracting symmetric orbit"
    return "Largest attracting symmetric orbit, whichever initial state leads to it"


def finite_max(values: np.ndarray) -> float:
    """Largest finite one of `values`, or 0."""
    return float(np.max(values, where=np.isfinite(values), initial=0.0))


def losses(block: Block) -> str:
    """Energy losses of the rocking block."""
    if block.velocity_ratio == 1.0:
        return f"friction k = {block.friction:g}"
    # With a pendulum Housner's e is smaller.
    model, of = ("Housner, ", " for the bare block") if block.restitution == HOUSNER else ("", "")
    impacts = f"impact loss: {model}e = {block.velocity_ratio:.4g}{of}"
    return f"{impacts}; friction k = {block.friction:g}" if block.friction else impacts


def risk(design: Design, value: float) -> str:
    """A value of the risk measure, which is a tilt over nu where every motion that counts rocks."""
    if design.problem.risk.share > 0.0 and value <= 0.0:
        return f"{value:.4f} times nu, rest counted as less its uplift margin"
    if value <= 0.0:
        return f"none: at rest with {-value:.1%} of the lifting moment in reserve"
    if value > 1.0:
        return "no settled motion under the worst condition: by events the block may overturn"
    return f"{value * design.scene.block.slenderness:.5f} rad ({value:.1%} of nu)"


def limit(of: Limit) -> str:
    """A limit with its value."""
    name = of.name.replace("_", " ")
    if isinstance(of, Clearance):
        return f"the bob, {of.bob}, keeps off the walls"
    if type(of) not in KINDS:
        # A limit of the user's own has any fields, in units of its own.
        return " ".join([name, ", ".join(f"{k} = {v}" for k, v in vars(of).items())]).strip()
    (value,) = vars(of).values()
    return f"{name} {number(value)} {of.unit}".strip()


def missing(design: Design) -> list[str]:
    """Questions of an engineer that the search has left out."""
    parts = []
    if len(design.conditions) == 1:
        parts.append("considered one excitation only")
    if limit_of(design.problem.limits, Clearance) is None:
        parts.append("assumed a bob without size, and no walls")
    return parts


def range_of_mass(design: Design) -> str:
    """Masses of bobs that perform equally well; empty where that is not known, or is the mass itself."""
    if design.equivalent is None or design.pendulum is None:
        return ""
    low, high = (float(x) * float(design.scene.block.mass) for x in design.equivalent[:, 0])
    # Both ends must differ after rounding.
    if number(low, 2) == number(high, 2):
        return ""
    return f"; {number(low, 2)} to {number(high, 2)} kg perform equally well"


def group(part: Part) -> str:
    """Line for a terminal about a group of motions: its mean tilts over the slenderness."""
    return (
        f"  {part.label} ({part.rows.sum()} runs): mean tilt {part.with_pendulum:.1%} with the pendulum, "
        f"{part.without_pendulum:.1%} without"
    )


def usage(design: Design) -> dict[str, float]:
    """Limited quantities of the best design over their limits."""
    # A reserve is bounded from below, so that a share of it says nothing.
    return {name: x for name, x in design.usage.items() if name != "reserve"}


def groups(design: Design) -> dict[str, tuple[GroundMotion, ...]]:
    """Ground motions by the names of their groups; empty under harmonic excitation."""
    return {g.name: g.motions for g in design.problem.groups}


def bounds(design: Design) -> list[str]:
    """Bounds of the design space that the best design lies on: beyond them may be a better one."""
    best, out = design.nearest, []
    if best is None:
        return out
    unit, words = design.space.scaled(np.asarray(best)), ("mass", "length", "damping")
    for i, x in zip(design.space.searched, unit, strict=True):
        if not 0.01 < x < 0.99:
            side = "largest" if x > 0.5 else "least"
            out.append(f"{side} {words[i]} ratio of the search, {number(float(best[i]), 3)}")
    return out


def overturned_between(responses: Sequence[Response], low: float, high: float) -> str:
    """Return the shares of the runs from rest between two values in which the block overturns.

    Args:
        responses: without and, if there is one, with the pendulum.
        low, high: the two values; Hz, or of what the responses vary.
    """
    cases = zip(("without the pendulum", "with it"), responses, strict=False)
    shares = (f"{percent(r.share_overturned(low, high).value)} {case}" for case, r in cases)
    unit = UNITS.get(responses[0].name, "")
    between = f"{low:.3g} and {high:.3g} {unit}".rstrip()
    return f"runs from rest between {between}: the block overturns in {', '.join(shares)}"


def reduction(runs: PairedRuns, measure: str) -> str:
    """Return what the pendulum reduces as sentences, with intervals: first the measure that was required,
    then the other one. The overturning is left out where it is rare and was not required."""
    other = "tilt" if measure == "overturning" else "overturning"
    first, then = reduced(runs, measure), reduced(runs, other)
    return first if other == "overturning" != runs.first_measure else f"{first}. T{then[1:]}"


def reduced(runs: PairedRuns, measure: str) -> str:
    """Return how much the pendulum reduces a measure, "overturning" or "tilt", with its interval."""
    (size, significant), fell = runs.reduction(measure), runs.change("overturned")
    name, shares = "mean tilt", ""
    if measure == "overturning":
        with_it, without = (f"{100.0 * x:.1f} %" for x in (fell.with_pendulum, fell.without_pendulum))
        name, shares = "share of runs that overturn", f", from {without} to {with_it}"
        if fell.without_pendulum == 0.0:
            return f"the block overturns in {with_it} of the runs with the pendulum, and in none without it"
    if math.isnan(size.mean):
        return f"the reduction of the {name} is unknown"
    less, by, around = size.fall_in_words()
    doubt = ", which is not significant" if less and not significant else ""
    return f"the pendulum {'reduces' if less else 'increases'} the {name} by {by}{around}{shares}{doubt}"


def percent(share: float) -> str:
    """A share in whole per cent."""
    return f"{100.0 * share + 0.0:.0f} %"


def comparison(runs: PairedRuns) -> Table:
    """Return the changes with and without the pendulum, from one set of runs."""
    rows = []
    for c in runs.changes:
        # Where no run ends at rest in either case there is nothing to compare.
        if c.name not in _CHANGES or (c.name == "at rest" and c.with_pendulum == c.without_pendulum == 0.0):
            continue
        # Tilts vary by more than a tenth of a per cent from one seed to the next; a share may be small.
        d, points = 0 if "severity" in c.name else 1, NO_VALUE
        if np.isfinite(c.low):
            # What rounds to zero must not read "-0".
            mean, low, high = (round(100.0 * x, d) + 0.0 for x in (c.difference, c.low, c.high))
            points = f"{mean:+.{d}f} ({low:+.{d}f} to {high:+.{d}f})"
        rows.append((_CHANGES[c.name], f"{c.with_pendulum:.{d}%}", f"{c.without_pendulum:.{d}%}", points))
    left = f"; {runs.undecided} runs without an answer are left out" if runs.undecided else ""
    caption = f"{runs.description}; an overturned block counts as toppled{left}"
    return Table(("", "with pendulum", "without", "difference, points (95 %)"), tuple(rows), caption)


def title(scene: Scene, name: str = "", date: str = "") -> str:
    """Title of a report, with the name of the project and the date where they are given."""
    block = scene.block
    size = f"{number(float(block.width))} m × {number(float(block.height))} m"
    head = f"{name}: pendulum" if name else "Pendulum"
    return f"{head} for a block of {size}" + (f", {date}" if date else "")


def origin(scene: Scene) -> str:
    """Whose block it is: the paper's, the paper's with changes, or another one."""
    # By numbers and not by what was typed: a file that lists the paper's numbers is the paper's scene.
    paper = paper_scene()
    own, papers = scene.block, paper.block
    sizes = "width", "height", "mass", "radius_of_gyration"
    if any(getattr(own, key) != getattr(papers, key) for key in sizes):
        return "a block of your own"
    same = {
        "motion": scene.motion == paper.motion,
        "losses": (own.friction, own.velocity_ratio) == (papers.friction, papers.velocity_ratio),
        "gravity": scene.gravity == paper.gravity,
    }
    if other := [name for name, is_same in same.items() if not is_same]:
        return f"{_PAPER} with other {' and '.join(other)} than the paper's"
    return f"{_PAPER} with the paper's motion and losses"


def scene_lines(scene: Scene, motion: str = "") -> tuple[str, ...]:
    """Lines for a terminal; under a harmonic the first says whose block it is. Other words for the motion can
    be given."""
    shape = f"slenderness {number(float(scene.block.slenderness))}; topples at {_toppling(scene)}"
    block, lost = f"  block   {_block(scene)}; {shape}", f"  losses  {losses(scene.block)}"
    if motion or not isinstance(scene.motion, Harmonic):
        return block, lost, f"  motion  {motion or in_words((scene.motion,))}"
    motion = f"  motion  {_motion(scene)}, {number(float(scene.peak))} g"
    return f"Scene: {origin(scene)}.", block, motion, lost


def block_of(scene: Scene) -> str:
    """The block and its losses in a sentence."""
    return f"{_block(scene)}; topples at {_toppling(scene)}; {losses(scene.block)}"


def excitation(design: Design) -> str:
    """The excitation of a design in a sentence."""
    scene = design.scene
    if design.conditions.motions:
        listed = ", ".join(f"{name} {len(motions)}" for name, motions in groups(design).items())
        return f"ground motions, from rest: {listed}"
    lifts = f"lifts above {number(float(scene.uplift), 3)} g"
    return f"{_motion(scene)}, {number(float(scene.peak), 3)} g ({lifts})"


def pendulum_line(scene: Scene, hung: Pendulum) -> str:
    """Line for a terminal about a pendulum: the equivalent point mass, and not the body as built."""
    block = scene.block
    numbers = hung.mass / block.mass, hung.length / block.half_height, hung.damping_ratio
    mu, lam, zeta = (number(float(x)) for x in numbers)
    ratios = f"μ = {mu}, λ = {lam}, ζ = {zeta}"
    return f"  point   {number(float(hung.mass))} kg on a rod of {number(float(hung.length))} m; {ratios}"


def _toppling(scene: Scene) -> str:
    return angle(float(scene.block.slenderness))


def _block(scene: Scene) -> str:
    block = scene.block
    width, height, mass = (number(float(x)) for x in (block.width, block.height, block.mass))
    own, wide = block.radius_of_gyration, block.cavity_width
    shape = "" if own is None else f", radius of gyration {number(float(own))} m"
    # On the width of the cavity hangs whether a bob has room.
    cavity = "no cavity stated" if wide is None else f"cavity {number(float(wide))} m wide"
    return f"{width} m wide, {height} m high, {mass} kg{shape}, {cavity}"


def _motion(scene: Scene) -> str:
    return f"{number(float(scene.motion.amplitude))} m at {number(float(scene.motion.frequency))} Hz"
