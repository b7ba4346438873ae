"""Section of a report for whoever builds and hangs the pendulum: sizes, loads, checks on site, tolerances."""

from __future__ import annotations

import math

from tpd.answers.statistics import Interval
from tpd.core.formatting import number
from tpd.design.build import Build
from tpd.design.ground.judgement import scatter_of
from tpd.design.result import Design, DesignStatus
from tpd.report.blocks import Block, Cell, Listing, Table, Text
from tpd.report.words import threshold

_SAID = {
    "": ("nothing moved", None),
    "restitution": ("loss at an impact, 1 - e", "pull the object and release it, above"),
    "friction": ("friction k of the rocking contact", "pull the object and release it, above"),
    "slenderness": ("slenderness ν", "width of the base that bears, and height of the centroid"),
    "amplitude": ("amplitude of the shaking", "the source of the motion"),
    "frequency": ("frequency of the shaking", "the source of the motion"),
    "mass": ("mass of the bob", "weigh it"),
    "length": ("rod, hinge to the bob's centre", "ten swings by a stop-watch, above"),
    "damping": ("moment of the damper", "the first swing back, above"),
}
"""Words for a quantity that is moved, and how it is known."""


def section(design: Design, build: Build | None) -> list[Block]:
    """Blocks of the section; empty where no pendulum is offered."""
    if build is None:
        return []
    return [_sizes(design, build), _checks(build), *_moved(design, build)]


def _sizes(design: Design, build: Build) -> Table:
    hung = design.pendulum
    assert hung is not None
    zeta = number(float(hung.damping_ratio))
    point = f"{number(float(hung.mass))} kg at {number(float(hung.length))} m"
    body = f"no body, {build.bob}, acts as a point of {point}: forces are those of the point"
    if math.isfinite(build.mass):
        dead = f"with the rod {number(build.dead, 3)} kg load the top without swinging"
        body = f"{build.bob}; as a body it acts as a point of {point}, and {dead}"
    rod: tuple[Cell, ...] = "none swings as often", None
    if math.isfinite(build.rod):
        rod = f"{number(build.rod)} m", f"with a steel rod of {build.rod_share:.1%} of the bob's mass"
    beam = "at the beam across the top that carries the hinge"
    rows: list[tuple[Cell, ...]] = [
        ("mass of the bob", f"{number(build.mass)} kg", body),
        ("bob, width by height", f"{number(build.bob_width)} m × {number(build.bob_height)} m", None),
        ("rod, hinge to the bob's centre", *rod),
        ("depth below the hinge", f"{number(build.depth)} m", "to the lower end of the hanging bob"),
        *_way(design, build),
        ("own frequency", f"{number(build.frequency)} Hz", "in the block that stands, without the damper"),
        ("damper at the hinge", f"{number(build.damping)} N m s/rad", f"{zeta} of critical"),
        ("weight on the top", f"{number(build.weight)} N", beam),
    ]
    if (loads := build.loads) is not None:
        slides = "coefficient; the models do not slide"
        rows += [
            ("largest force along the rod", f"{number(loads.tension)} N", None),
            ("largest force of the hinge on its beam", f"{number(loads.hinge)} N", None),
            ("largest moment of the damper", f"{number(build.damper_moment)} N m", None),
            ("largest power of the damper", f"{number(build.damper_power)} W", None),
            ("largest rate between rod and block", f"{number(loads.rate)} rad/s", None),
            ("friction that keeps the base from sliding", number(loads.friction), slides),
        ]
    slow, fast = build.lifts_slow_fast
    settled = ""
    if build.lifts is not None:
        settled = f"; under the harmonic of the job {number(build.lifts[0])} g once the bob has settled"
    lifts = (
        "shaking much slower, much faster than the pendulum, as a point; near its own frequency maybe less "
        f"than both{settled}; {number(threshold(design.scene))} g without it"
    )
    rows.append(("acceleration that lifts the resting block", f"{number(slow)} g, {number(fast)} g", lifts))
    forces = "There are no forces, since the block stands in none of the motions."
    if loads is not None:
        forces = (
            f"Forces: the largest of {loads.motions} motions of the job in which the block stands (of "
            "many those in which the bob swings most; harmonics for 40 periods from rest), linear equations, "
            "nominal block, in proportion to the whole mass. Impacts of the block are left out: take a "
            "factor of safety."
        )
    return Table(("part", "size", "remark"), tuple(rows), f"{forces} Costs are yours.")


def _way(design: Design, build: Build) -> list[tuple[Cell, ...]]:
    """Row of the clear way; none where no run is known."""
    if not math.isfinite(build.reach):
        return []
    runs = "of the runs that it is tuned to" if design.conditions.motions else "of the same runs"
    said = f"of the body from the axis in all but {design.strikes_allowed:.0%} {runs} where the block stands"
    wall = f"; the wall is at {number(build.wall)} m" if math.isfinite(build.wall) else ""
    return [("clear way to either side", f"{number(build.reach)} m", said + wall)]


def _checks(build: Build) -> Listing:
    """Measurements on site, with the readings to expect."""
    ten, pull = 10.0 / build.frequency, build.pull
    swings = (
        "it comes to rest without swinging back"
        if build.rebound < 0.005
        else f"it swings to {build.rebound:.0%} of the angle on the other side"
    )
    decay = (
        f"about {pull.impacts} impacts ({pull.seconds:.2g} s) after the release it turns at half of this tilt"
        if pull.impacts
        else "it stays there, or keeps more than half of this tilt for hundreds of impacts"
    )
    return Listing(
        (
            f"The pendulum, damper off, in the standing block: ten swings take {ten:.3g} s. Within 1 % of "
            "this the rod is within 2 %.",
            f"The pendulum, damper on: pulled aside by some 0.1 rad and let go, {swings}.",
            f"The object, before the pendulum is hung, held against toppling: {number(pull.force, 3)} N at "
            "the top lift it, and ever less holds it the further it tilts, so that the way is controlled and "
            f"not the force. Drawn until its top has moved by {number(1e3 * pull.sway, 3)} mm "
            f"({pull.tilt:.2g} rad, a tenth of the tilt of toppling) and released, {decay}. With n impacts "
            "from a tilt a to a tilt b, both over ν, without friction, e = [b (2 - b)/(a (2 - a))]^(1/(2n)). "
            "Fewer impacts mean more loss; friction shows as a decay that quickens at small tilts.",
        )
    )


def _moved(design: Design, build: Build) -> list[Block]:
    if not build.moved:
        return []
    judged = _judged(design)
    rows = tuple(
        (
            _SAID[m.name][0],
            f"±{judged[m.name]:.0%}" if m.name in judged else None,
            f"±{m.width:.0%}" if m.width else None,
            _interval(m.low),
            _interval(m.high),
            _SAID[m.name][1],
        )
        for m in build.moved
    )
    head = ("quantity", "within, in the runs", "moved by", "less tilt, lower", "less tilt, higher")
    caption = (
        "Fall of the mean tilt (95 %) where one quantity alone is lower or higher, all on the same runs of "
        "the nonlinear equations as the first row. The second column is the scatter in the runs that judged. "
        "A restitution is moved as a number, without scatter."
    )
    if design.status is DesignStatus.found:
        caption += (
            " Built within the second column, which is the tolerance, it is the pendulum that was judged."
        )
    lost = [_SAID[m.name][0] for m in build.moved if not min(m.low.low, m.high.low) > 0.0]
    said = (
        f"Moved as in the third column the benefit is not shown for: {'; '.join(lost)}."
        if lost
        else "In none of these is the benefit lost."
    )
    return [Table((*head, "measure by"), rows, caption), Text(said)]


def _judged(design: Design) -> dict[str, float]:
    """Half widths of what scatters in the runs that judged; of a restitution that of the loss, 1 - e."""
    block, e = design.scene.block, float(design.scene.block.velocity_ratio)
    found = scatter_of(block, design.ensemble)
    if not design.conditions.motions:
        found |= {name: getattr(design.ensemble, name) for name in ("amplitude", "frequency")}
    if "restitution" in found and e < 1.0:
        found["restitution"] *= e / (1.0 - e)
    return {name: width for name, width in found.items() if width}


def _interval(of: Interval) -> str:
    return f"{of.mean:.0%} ({of.low:.0%} to {of.high:.0%})" if math.isfinite(of.low) else f"{of.mean:.0%}"
