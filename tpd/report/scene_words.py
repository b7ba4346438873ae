"""Block, base motion and losses of a scene in words: title, lines for a terminal, section of a report."""

from __future__ import annotations

import math

from tpd.core.formatting import number
from tpd.core.scene import Pendulum, Scene, paper_scene
from tpd.design.result import Design
from tpd.report import words
from tpd.report.blocks import Block, Cell, Table

_PAPER = "the paper's block (Collini et al. 2016)"


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
    if any(
        getattr(own, key) != getattr(papers, key) for key in ("width", "height", "mass", "radius_of_gyration")
    ):
        return "a block of your own"
    losses = (own.friction, own.velocity_ratio) == (papers.friction, papers.velocity_ratio)
    same = {
        "motion": scene.motion == paper.motion,
        "losses": losses,
        "gravity": scene.gravity == paper.gravity,
    }
    other = [name for name, is_same in same.items() if not is_same]
    if other:
        return f"{_PAPER} with other {' and '.join(other)} than the paper's"
    return f"{_PAPER} with the paper's motion and losses"


def lines(scene: Scene) -> tuple[str, ...]:
    """Lines for a terminal; the first says whose block it is."""
    motion = f"  motion  {_motion(scene)}, {number(acceleration(scene))} g: {_lifts(scene)}"
    block, losses = block_lines(scene)
    return f"Scene: {origin(scene)}.", block, motion, losses


def block(scene: Scene) -> str:
    """The block and its losses in a sentence."""
    return f"{_block(scene)}; topples at {_toppling(scene)}; {words.losses(scene.block)}"


def shaking(design: Design) -> str:
    """What shakes the block in a design, in a sentence."""
    said, scene = "; ".join(design.conditions.description), design.scene
    if design.conditions.motions:
        return f"{said}, from rest"
    lifts = f"lifts above {number(threshold(scene), 3)} g"
    return f"{_motion(scene)}, {number(acceleration(scene), 3)} g ({lifts}){f'; {said}' if said else ''}"


def block_lines(scene: Scene) -> tuple[str, str]:
    """Lines for a terminal about the block and its losses, whatever shakes it."""
    shape = f"slenderness {number(_slenderness(scene))}; topples at {_toppling(scene)}"
    return f"  block   {_block(scene)}; {shape}", f"  losses  {words.losses(scene.block)}"


def pendulum(scene: Scene, hung: Pendulum) -> str:
    """Line for a terminal about a pendulum in the scene."""
    block = scene.block
    numbers = hung.mass / block.mass, hung.length / block.half_height, hung.damping_ratio
    mu, lam, zeta = (number(float(x)) for x in numbers)
    ratios = f"μ = {mu}, λ = {lam}, ζ = {zeta}"
    return f"  bob     {number(float(hung.mass))} kg on a rod of {number(float(hung.length))} m; {ratios}"


def section(scene: Scene, name: str = "", date: str = "") -> list[Block]:
    """Blocks of the section about the scene."""
    exact = words.angle(math.atan(_slenderness(scene)))
    named: list[tuple[Cell, ...]] = [("project", name, None)] if name else []
    dated: list[tuple[Cell, ...]] = [("date", date, None)] if date else []
    rows: tuple[tuple[Cell, ...], ...] = (
        ("block", _block(scene), origin(scene)),
        ("slenderness ν", number(_slenderness(scene)), "width over height"),
        ("toppling angle", _toppling(scene), f"linear equations; nonlinear {exact}"),
        ("motion of the base", _motion(scene), "horizontal, harmonic"),
        ("acceleration of the base", f"{number(acceleration(scene))} g", _lifts(scene)),
        ("losses", words.losses(scene.block), None),
    )
    return [Table(("", "value", "remark"), (*named, *dated, *rows))]


def acceleration(scene: Scene) -> float:
    """Largest acceleration of the base over gravity, f = A omega^2/g."""
    return float(scene.motion.amplitude * scene.motion.rate**2 / scene.gravity)


def threshold(scene: Scene) -> float:
    """Base acceleration over gravity beyond which the bare block at rest lifts, nu + k."""
    return _slenderness(scene) + float(scene.block.friction or 0.0)


def _slenderness(scene: Scene) -> float:
    return float(scene.block.slenderness)


def _toppling(scene: Scene) -> str:
    return words.angle(words.toppling(_slenderness(scene), 0.0))


def _block(scene: Scene) -> str:
    block = scene.block
    width, height, mass = (number(float(x)) for x in (block.width, block.height, block.mass))
    own = block.radius_of_gyration
    shape = "" if own is None else f", radius of gyration {number(float(own))} m"
    return f"{width} m wide, {height} m high, {mass} kg{shape}, {_cavity(scene)}"


def _cavity(scene: Scene) -> str:
    """Width of the cavity in words: on it hangs whether a bob has room."""
    block = scene.block
    if block.cavity_width is None:
        return "no cavity stated"
    as_wide = " (as wide as the block)" if block.cavity_width == block.width else ""
    return f"cavity {number(float(block.cavity_width))} m wide{as_wide}"


def _motion(scene: Scene) -> str:
    return f"{number(float(scene.motion.amplitude))} m at {number(float(scene.motion.frequency))} Hz"


def _lifts(scene: Scene) -> str:
    """Whether the bare block at rest lifts."""
    limit = f"{number(threshold(scene))} g"
    if acceleration(scene) > threshold(scene):
        return f"above {limit}, so the bare block at rest lifts"
    return f"not above {limit}, so the bare block stays at rest once it is at rest"
