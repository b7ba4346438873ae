"""Scenes and designs in words, and what both kinds of design have in one form."""

from __future__ import annotations

import math

import numpy as np

from tpd.answers.attractors import Starts
from tpd.core.formatting import number
from tpd.design.criteria import KINDS, Limit, Room, limit_of
from tpd.design.ground.design import GroundDesign
from tpd.design.ground.judgement import Judged
from tpd.design.result import Design, HarmonicDesign
from tpd.design.study import Study
from tpd.scene.scene import HOUSNER, Block, Pendulum, Scene, paper_scene

_PAPER = "the paper's block (Collini et al. 2016)"


def angle(x: float) -> str:
    """A largest angle (rad) in radians and degrees; infinite where the block overturns, NaN if unknown."""
    # NaN is not known, infinity is known very well: the two must not share a word.
    if not math.isfinite(x):
        return "unknown" if math.isnan(x) else "overturns"
    return f"{number(x)} rad ({number(math.degrees(x), 3)}°)"


def source_of_tilts(design: HarmonicDesign) -> str:
    """Motions that the search's tilts belong to, in words."""
    if design.starts == Starts.rest():
        return "rest wherever it holds, else the largest attracting symmetric motion"
    return "the largest attracting symmetric motion, whichever start leads to it"


def finite_max(values: np.ndarray) -> float:
    """Largest finite one of `values`, or 0."""
    return float(np.max(values, where=np.isfinite(values), initial=0.0))


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
    return f"{name} {number(value)} {of.unit}".strip()


def missing(design: Design) -> list[str]:
    """Questions of an engineer that the search has left out."""
    parts = []
    if len(design.conditions) == 1:
        parts.append("knows one shaking and none beside it")
    if limit_of(design.limits, Room) is None:
        parts.append("takes a bob without size and no walls")
    return parts


def best_of(design: Design) -> np.ndarray | None:
    """(mu, lam, zeta) of the design that is offered or came nearest; None without any."""
    if isinstance(design, GroundDesign):
        return design.best
    assert isinstance(design, HarmonicDesign)
    if design.best is not None:
        return design.best.design
    return None if design.nearest is None else design.nearest.design


def range_of_mass(design: Design) -> str:
    """Masses of bobs that do as well, in brackets; empty where that is not known, or is the mass itself."""
    if design.alike is None or design.pendulum is None:
        return ""
    low, high = (float(x) * float(design.scene.block.mass) for x in design.alike[:, 0])
    if high - low < 0.02 * float(design.pendulum.mass):
        return ""
    return f" ({number(low, 2)} to {number(high, 2)} kg do as well)"


def group(g: Judged) -> str:
    """Line for a terminal about a group of motions, with the interval: a mean alone would claim too much."""
    before, after = g.overturned
    left = f"; {g.undecided} runs without an answer" if g.undecided else ""
    return (
        f"  {g.name} ({g.motions} motions, {g.events} earthquakes): overturned {before:.1%} without and "
        f"{after:.1%} with it, {g.difference.words()}{left}"
    )


def usage(design: Design, study: Study) -> dict[str, float]:
    """Limited quantities of the best design over their limits."""
    if isinstance(design, GroundDesign):
        return {} if design.usage is None else dict(zip(design.names, map(float, design.usage), strict=True))
    # A reserve is bounded from below, so that a share of it says nothing.
    return {name: x for name, x in study.usage if name != "reserve"}


def bounds(design: Design) -> list[str]:
    """Bounds of the design space that the best design lies on: beyond them may be a better one."""
    best, out = best_of(design), []
    if best is None:
        return out
    unit = design.space.scaled(np.asarray(best)[None])[0]
    for name, x, value in zip(("mass", "length", "damping"), unit, best, strict=False):
        if not 0.01 < x < 0.99:
            side = "largest" if x > 0.5 else "least"
            out.append(f"{side} {name} ratio of the search, {number(float(value), 3)}")
    return out


def beside(study: Study) -> str:
    """Overturnings over frequency, from rest; empty without a response of both."""
    if study.responses is None or len(study.responses) < 2:
        return ""
    bare, hung = study.responses
    band = f"from rest at {hung.frequency[0]:.3g} to {hung.frequency[-1]:.3g} Hz (linear)"
    if hung.overturning is None or bare.overturning is None:
        lost, lost_bare = (int(np.sum(r.status == "overturned")) for r in (hung, bare))
        return f"{lost} of {hung.frequency.size} runs {band} overturn with it, {lost_bare} without"
    shares = hung.overturning[0], bare.overturning[0]
    with_it, without = (float(np.trapezoid(x, hung.frequency)) for x in shares)
    width = float(np.ptp(hung.frequency))
    return f"{with_it / width:.0%} of the runs {band} overturn with it, {without / width:.0%} without"


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


def scene_lines(scene: Scene) -> tuple[str, ...]:
    """Lines for a terminal; the first says whose block it is."""
    limit, block, losses = f"{number(threshold(scene))} g", *block_lines(scene)
    lifts = f"not above {limit}, so the bare block stays at rest once it is at rest"
    if acceleration(scene) > threshold(scene):
        lifts = f"above {limit}, so the bare block at rest lifts"
    motion = f"  motion  {_motion(scene)}, {number(acceleration(scene))} g: {lifts}"
    return f"Scene: {origin(scene)}.", block, motion, losses


def block_of(scene: Scene) -> str:
    """The block and its losses in a sentence."""
    return f"{_block(scene)}; topples at {_toppling(scene)}; {losses(scene.block)}"


def shaking(design: Design) -> str:
    """The shaking of a design in a sentence."""
    scene = design.scene
    if design.conditions.motions:
        groups = ", ".join(f"{g.name} {len(g.motions)}" for g in getattr(design, "groups", ()))
        return f"ground motions, from rest: {groups}"
    lifts = f"lifts above {number(threshold(scene), 3)} g"
    return f"{_motion(scene)}, {number(acceleration(scene), 3)} g ({lifts})"


def block_lines(scene: Scene) -> tuple[str, str]:
    """Lines for a terminal about the block and its losses, whatever shakes it."""
    shape = f"slenderness {number(float(scene.block.slenderness))}; topples at {_toppling(scene)}"
    return f"  block   {_block(scene)}; {shape}", f"  losses  {losses(scene.block)}"


def pendulum_line(scene: Scene, hung: Pendulum) -> str:
    """Line for a terminal about a pendulum in the scene."""
    block = scene.block
    numbers = hung.mass / block.mass, hung.length / block.half_height, hung.damping_ratio
    mu, lam, zeta = (number(float(x)) for x in numbers)
    ratios = f"μ = {mu}, λ = {lam}, ζ = {zeta}"
    return f"  bob     {number(float(hung.mass))} kg on a rod of {number(float(hung.length))} m; {ratios}"


def acceleration(scene: Scene) -> float:
    """Largest acceleration of the base over gravity, f = A omega^2/g."""
    return float(scene.motion.amplitude * scene.motion.rate**2 / scene.gravity)


def threshold(scene: Scene) -> float:
    """Base acceleration over gravity beyond which the bare block at rest lifts, nu + k."""
    return float(scene.block.slenderness) + float(scene.block.friction or 0.0)


def _toppling(scene: Scene) -> str:
    return angle(float(scene.block.slenderness))


def _block(scene: Scene) -> str:
    block = scene.block
    width, height, mass = (number(float(x)) for x in (block.width, block.height, block.mass))
    own, wide = block.radius_of_gyration, block.cavity_width
    shape = "" if own is None else f", radius of gyration {number(float(own))} m"
    # On the width of the cavity hangs whether a bob has room.
    as_wide = " (as wide as the block)" if wide == block.width else ""
    cavity = "no cavity stated" if wide is None else f"cavity {number(float(wide))} m wide{as_wide}"
    return f"{width} m wide, {height} m high, {mass} kg{shape}, {cavity}"


def _motion(scene: Scene) -> str:
    return f"{number(float(scene.motion.amplitude))} m at {number(float(scene.motion.frequency))} Hz"
