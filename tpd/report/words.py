"""Scenes, designs and results as words and tables, for reports and for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tpd.core.formatting import number, pair_of, per_cent, percent
from tpd.limits import DEPTH, LABELS, LIMIT_KINDS, MEASURED, THICKNESS, TOP, Clearance, Limit, Reserve
from tpd.records.read import facts, in_words
from tpd.report.blocks import NO_VALUE
from tpd.scene.bob import THICKEST
from tpd.scene.quantities import UNITS
from tpd.scene.record import Record
from tpd.scene.scene import HOUSNER, Block, Harmonic, Pendulum, Scene, paper_scene

if TYPE_CHECKING:
    # These modules load JAX, and the commands describe a scene before they wait for that.
    from tpd.answers.response import Response
    from tpd.design.design import Design
    from tpd.design.first_guess import FirstGuess
    from tpd.design.variations import EquivalentWidening

_PAPER = "the paper's block (Collini et al. 2016)"


def angle(x: float) -> str:
    """Format a largest tilt or swing (rad) in radians and degrees.

    An infinite angle is "overturns", and NaN is "unknown".
    """
    if not math.isfinite(x):
        return "unknown" if math.isnan(x) else "overturns"
    return f"{number(x)} rad ({number(math.degrees(x), 3)}°)"


def kept(design: Design) -> str:
    """Return words for the share of the validation runs that must keep all limits."""
    return f"{percent(1.0 - design.problem.allowed)} of the surviving validation runs"


def exceeding(share: float, allowed: float) -> str:
    """Return a clause with the share of the runs that exceed a limit, beside the share that is allowed."""
    exceeds, most = pair_of(share, allowed, 1, percent)
    return f"{exceeds} of the surviving runs exceed a limit (at most {most} allowed)"


def finite_max(values: np.ndarray) -> float:
    """Return the largest finite number in an array, or 0 if there is none."""
    return float(np.max(values, where=np.isfinite(values), initial=0.0))


def losses(block: Block) -> str:
    """Describe how the rocking block loses energy: by friction, by impacts, or by both."""
    if block.velocity_ratio == 1.0:
        return f"friction k = {block.friction:g}"
    # Housner's e also depends on the pendulum, which makes it smaller.
    model = " (Housner, without a pendulum)" if block.restitution == HOUSNER else ""
    impacts = f"impacts e = {block.velocity_ratio:.4g}{model}"
    return f"{impacts}; friction k = {block.friction:g}" if block.friction else impacts


def first_guess(of: FirstGuess, allowed: float) -> str:
    """Describe the pendulum of a rule of thumb, with the share of the runs that overturn."""
    exceeds = ""
    if of.over_limit > allowed:
        share = percent(of.over_limit)
        exceeds = f", but {share} of the others exceed the limit on {LABELS.get(of.limit, of.limit)}"
        if of.limit == Clearance.name:
            exceeds = f"; wall contact in {share} of the others"
    share = percent(of.runs.share_overturned.value, 1)
    return f"{point(of.pendulum, 2, 2)}: {share} overturn{exceeds}"


def rule_and_search(design: Design) -> Iterator[tuple[str, str]]:
    """Yield rows on the pendulums of the rule of thumb and of the search with its groups of earthquakes."""
    for name, of in (("rule", design.rule), ("search", design.searched)):
        if of is None:
            continue
        text = point(of.pendulum, 3, 3)
        if of.runs is not None:
            less, by, around = of.runs.reduction(of.measure)[0].fall_in_words()
            text += f": {by} {'lower' if less else 'higher'} {MEASURED[of.measure]}{around}"
        if of.refusals:
            text += f"; not recommended, because {of.refusals[0]}"
        # A search that depends on single earthquakes finds other masses without them.
        if of.crossed is not None:
            masses = [float(design.problem.pendulum(x).mass) for x in of.crossed]
            ends = " to ".join(dict.fromkeys(number(x, 3) for x in (min(masses), max(masses))))
            text += f"; without each group of earthquakes: {ends} kg"
        yield name, text


def wider(worth: EquivalentWidening) -> str:
    """Return the widening of the base that is worth as much as the pendulum, with its interval.

    Example:
        >>> from tpd.design.variations import EquivalentWidening
        >>> wider(EquivalentWidening(np.inf, 0.42, np.inf, 0.5, "tilt"))
        'more than 50 % wider (95 % interval 42 to more than 50 %)'
    """
    # Beyond the widest base that was followed, and below one per cent, there is no number.
    size, low, high = (
        f"more than {per_cent(worth.most)}"
        if x >= worth.most
        else per_cent(x)
        if x >= 0.005
        else "less than 1"
        for x in (worth.widening, worth.low, worth.high)
    )
    around = "" if low == high else f" (95 % interval {low} to {high} %)"
    return f"{size} % wider{around}"


def settled_tilt(design: Design, of: Any) -> str:
    """Describe the largest settled tilt of exact motions under all conditions."""
    tilt, margin = float(of.orbits.tilt.max()), float(of.margin.min())
    if not of.orbits.attracts.all():
        return "no settled motion under some condition: the block may overturn"
    if tilt == 0.0:
        return f"none: the block stays at rest with {percent(margin, 1)} of the lifting moment in reserve"
    return f"{tilt * design.scene.block.slenderness:.5f} rad ({percent(tilt, 1)} of ν)"


def limit(of: Limit) -> str:
    """Describe a limit by its largest or smallest value."""
    if isinstance(of, Clearance):
        return f"the bob, {of.bob}, does not touch the walls"
    if type(of) not in LIMIT_KINDS:
        # A limit that the user defined may have any fields, in units that are unknown here.
        return ", ".join(f"{k} = {v}" for k, v in vars(of).items())
    (value,) = vars(of).values()
    return f"at {'least' if isinstance(of, Reserve) else 'most'} {number(value)} {of.unit}".strip()


def limit_of_size(name: str, design: Design, build: Any = None) -> str | None:
    """Describe the limit on thickness or depth, which belongs to the limit on clearance; None for another
    size. See `usage` for the arguments."""
    if name in (DEPTH, TOP):
        below = "the base" if name == DEPTH else "the top of the block"
        return f"at most {number(design.problem.geometry.depth)} m, to {below}"
    if name != THICKNESS:
        return None
    text = f"at most {THICKEST:g} times the rod"
    if build is None or not math.isfinite(build.rod):
        return text
    return f"{text}: {number(THICKEST * build.rod, 3)} m"


def range_of_mass(design: Design) -> str:
    """Return the range of masses of the equivalent point that perform equally well.

    The text is empty if the range is unknown or contains only the mass of the design.
    """
    if design.equivalent is None or design.pendulum is None:
        return ""
    low, high = (float(mu) * float(design.scene.block.mass) for mu, *_ in design.equivalent)
    # A range such as "510 to 510 kg" would not be a range.
    if number(low, 2) == number(high, 2):
        return ""
    return f"{number(low, 2)} to {number(high, 2)} kg"


def records(design: Design) -> list[tuple[str, dict[str, Any]]]:
    """Return the facts of all records, each with the name of its group of ground motions."""
    by_group = ((group.name, motion) for group in design.problem.groups for motion in group.motions)
    return [(name, facts(motion)) for name, motion in by_group if isinstance(motion, Record)]


def overturned_between(responses: Sequence[Response], low: float, high: float) -> str:
    """Return a clause with the share of the runs from rest, between two values, in which the block overturns.

    Args:
        responses: responses without and, if there is one, with the pendulum.
        low: lower of the two values, in Hz or in the unit of the quantity that varies.
        high: upper value.
    """
    cases = zip(("without the pendulum", "with the pendulum"), responses, strict=False)
    shares = (f"{percent(r.share_overturned(low, high).value)} {case}" for case, r in cases)
    unit = UNITS.get(responses[0].name, "")
    between = f"{low:.3g} and {high:.3g} {unit}".rstrip()
    return f"share of the runs from rest between {between} that overturn: {', '.join(shares)}"


def points(mean: float, low: float, high: float, digits: int = 0) -> str:
    """Return a difference of two shares in points with its interval; a dash if the interval is unknown."""
    if not np.isfinite(low):
        return NO_VALUE
    mean, low, high = (round(100.0 * x, digits) + 0.0 for x in (mean, low, high))
    return f"{mean:+.{digits}f} points ({low:+.{digits}f} to {high:+.{digits}f})"


def origin(scene: Scene) -> str:
    """Describe the block of the paper, and what differs from the paper's scene; empty for another block."""
    # The numbers decide, because a job file may list the paper's numbers without naming the paper.
    paper = paper_scene()
    block, original = scene.block, paper.block
    sizes = "width", "height", "mass", "radius_of_gyration", "centroid_height", "effective_width"
    if any(getattr(block, key) != getattr(original, key) for key in sizes):
        return ""
    # Only the block decides whether the scene is that of the paper.
    same = {
        "excitation": scene.excitation == paper.excitation,
        "losses": (block.friction, block.velocity_ratio) == (original.friction, original.velocity_ratio),
        "gravity": scene.gravity == paper.gravity,
    }
    if other := [name for name, is_same in same.items() if not is_same]:
        return f"{_PAPER} with other {' and '.join(other)} than the paper's"
    return f"{_PAPER} with the paper's excitation and losses"


def scene_lines(scene: Scene, motion: str = "") -> tuple[str, ...]:
    """Return lines for the terminal that describe a scene: block, energy losses and excitation.

    Args:
        scene: the scene; under harmonic excitation a title names the block of the paper.
        motion: description of the excitation; by default the function writes one.
    """
    own = scene.block
    shape = f"slenderness {number(own.slenderness)}; topples at {toppling(own)}"
    block, damping = f"  block       {block_of(own)}; {shape}", f"  losses      {losses(own)}"
    # The description of a ground motion replaces the numbers of the harmonic.
    if motion or not isinstance(scene.excitation, Harmonic):
        return block, damping, f"  excitation  {motion or in_words((scene.excitation,))}"
    motion = f"  excitation  {scene.excitation.in_words}, {number(scene.peak)} g"
    # A block of the user needs no title; the paper's block may be a wrong default.
    title = (f"Scene: {name}.",) if (name := origin(scene)) else ()
    return *title, block, motion, damping


def pendulum_line(scene: Scene, pendulum: Pendulum) -> str:
    """Return a line for the terminal with the equivalent point mass, which differs from the bob as built."""
    block = scene.block
    ratios = pendulum.mass / block.mass, pendulum.length / block.centroid, pendulum.damping_ratio
    mu, lam, zeta = (number(x) for x in ratios)
    return f"  point       {point(pendulum)}; μ = {mu}, λ = {lam}, ζ = {zeta}"


def point(pendulum: Pendulum, of_mass: int = 4, of_length: int = 4) -> str:
    """Describe the equivalent point mass, with significant digits for mass and length."""
    mass, length = number(pendulum.mass, of_mass), number(pendulum.length, of_length)
    hinge = pendulum.hinge_height
    at = "" if hinge is None else f" with its hinge {number(hinge)} m above the base"
    return f"{mass} kg on a rod of {length} m{at}"


def toppling(block: Block) -> str:
    """Return the toppling angle, whose tangent is the slenderness."""
    return angle(math.atan(float(block.slenderness)))


def block_of(block: Block) -> str:
    """Describe the sizes of the block."""
    width, height, mass = (number(x) for x in (block.width, block.height, block.mass))
    gyration, wide = block.radius_of_gyration, block.clear_width
    shape = "" if gyration is None else f", radius of gyration {number(gyration)} m"
    # The height of the centroid decides at which acceleration the block lifts, so it is always stated.
    shape += f", centroid at {number(block.centroid)} m"
    if block.effective_width is not None:
        shape += f", rocks on {percent(float(block.effective_width))} of its width"
    # The cavity is always mentioned, because a bob needs one, or a frame.
    name = "cavity" if block.frame_width is None else "frame"
    cavity = f"{name} {number(wide)} m wide" if math.isfinite(wide) else "no cavity stated"
    return f"{width} m wide, {height} m high, {mass} kg{shape}, {cavity}"
