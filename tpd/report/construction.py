"""Section of a report for whoever builds and hangs the pendulum: sizes, loads, checks on site, tolerances."""

from __future__ import annotations

import math

from tpd.analysis.intervals import Interval
from tpd.core.formatting import number
from tpd.design.build import Build
from tpd.design.ground.judgement import scatter_of
from tpd.design.result import Design
from tpd.report.blocks import Block, Cell, Listing, Table, Text

_SAID = {
    "restitution": ("loss at an impact, 1 - e", "pull the object and release it, below"),
    "friction": ("friction k of the rocking contact", "pull the object and release it, below"),
    "slenderness": ("slenderness ν", "width of the base that bears, and height of the centroid"),
    "amplitude": ("amplitude of the shaking", "the source of the motion"),
    "frequency": ("frequency of the shaking", "the source of the motion"),
    "mass": ("mass of the bob", "weigh it"),
    "length": ("rod, hinge to the bob's centre", "ten swings by a stop-watch, below"),
    "damping": ("moment of the damper", "the first swing back, below"),
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
    rows: list[tuple[Cell, ...]] = [
        ("mass of the bob", f"{number(float(hung.mass))} kg", str(build.bob)),
        ("bob, width by height", f"{number(build.bob_width)} m × {number(build.bob_height)} m", None),
        (
            "rod, hinge to the bob's centre",
            f"{number(build.rod)} m" if math.isfinite(build.rod) else "none swings as often",
            f"a point would hang at {number(float(hung.length))} m; with it the body and a steel rod of "
            f"{build.rod_share:.1%} of its mass swing as often",
        ),
        ("depth below the hinge", f"{number(build.depth)} m", "to the lower end of the hanging bob"),
        (
            "clear way to either side",
            f"{number(build.reach)} m",
            f"of the body from the axis in all but {_allowed(design):.0%} of the runs that stand"
            + (f"; the wall is at {number(build.wall)} m" if math.isfinite(build.wall) else ""),
        ),
        ("own frequency", f"{number(build.frequency)} Hz", "in the block that stands, without the damper"),
        ("damper at the hinge", f"{number(build.damping)} N m s/rad", f"{number(_zeta(design))} of critical"),
        (
            "weight on the top",
            f"{number(build.weight)} N",
            "at the beam across the top that carries the hinge",
        ),
    ]
    if build.loads is not None:
        rows += [
            ("largest force along the rod", f"{number(build.loads.tension)} N", None),
            ("largest force of the hinge on its beam", f"{number(build.loads.hinge)} N", None),
            ("largest moment of the damper", f"{number(build.damper_moment)} N m", None),
            ("largest power of the damper", f"{number(build.damper_power)} W", None),
            ("largest rate between rod and block", f"{number(build.loads.rate)} rad/s", None),
            (
                "friction that keeps the base from sliding",
                number(build.loads.friction),
                "coefficient; the models do not slide",
            ),
        ]
    slow, fast = build.lifts_slow_fast
    settled = ""
    if build.lifts is not None:
        settled = f"; under the harmonic of the job {number(build.lifts[0])} g once the bob has settled"
    bare = float(design.scene.block.slenderness) + float(design.scene.block.friction or 0.0)
    rows.append(
        (
            "acceleration that lifts the resting block",
            f"{number(slow)} to {number(fast)} g",
            f"shaking much slower and much faster than the pendulum{settled}; {number(bare)} g without it",
        )
    )
    motions = "none" if build.loads is None else str(build.loads.motions)
    caption = (
        f"Forces: the largest of {motions} motions of the job in which the block stands, linear equations, "
        "nominal block. Impacts of the block are left out: take a factor of safety. Costs are yours."
    )
    return Table(("part", "size", "remark"), tuple(rows), caption)


def _zeta(design: Design) -> float:
    assert design.pendulum is not None
    return float(design.pendulum.damping_ratio)


def _allowed(design: Design) -> float:
    return design.worth.broken if design.conditions.motions else design.worth.allowed


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
        else "it keeps more than half of this tilt for hundreds of impacts"
    )
    return Listing(
        (
            f"The pendulum, damper off, in the standing block: ten swings take {ten:.3g} s. Within 1 % of "
            "this the rod is within 2 %.",
            f"The pendulum, damper on: pulled aside by some 0.1 rad and let go, {swings}.",
            f"The object, before the pendulum is hung: a horizontal pull of {number(pull.force, 3)} N at the "
            f"top lifts it. Pulled until its top has moved by {number(1e3 * pull.sway, 3)} mm "
            f"({pull.tilt:.2g} rad, a tenth of the tilt of toppling) and released, {decay}. With n impacts "
            "from a tilt a to a tilt b, both over ν, without friction, e = [b (2 - b)/(a (2 - a))]^(1/(2n)). "
            "Fewer impacts mean more loss. Secure the object against falling.",
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
            f"±{m.width:.0%}",
            _interval(m.low),
            _interval(m.high),
            _SAID[m.name][1],
        )
        for m in build.moved
    )
    head = (
        "quantity",
        "within, in the runs",
        "moved by",
        "less tilt, lower",
        "less tilt, higher",
        "measure by",
    )
    caption = (
        "Fall of the mean tilt (95 %) on the runs that judged, or a part of them, where one quantity alone "
        "is lower or higher. The pendulum was judged with all quantities anywhere within the second column: "
        "built within these tolerances the benefit of the first lines holds."
    )
    lost = [_SAID[m.name][0] for m in build.moved if min(m.low.low, m.high.low) <= 0.0]
    said = (
        f"Beyond the tolerances the benefit is not shown for: {'; '.join(lost)}."
        if lost
        else ("In none of these is the benefit lost.")
    )
    return [Table(head, rows, caption), Text(said)]


def _judged(design: Design) -> dict[str, float]:
    """Half widths of what scatters in the runs that judged."""
    block = design.scene.block
    if design.conditions.motions:
        return scatter_of(block, design.ensemble)
    widths = design.ensemble.widths(block.restitution)
    return {n: w for n, w in widths.items() if w and not (n == "friction" and not block.friction)}


def _interval(of: Interval) -> str:
    return f"{of.mean:.0%} ({of.low:.0%} to {of.high:.0%})" if math.isfinite(of.low) else f"{of.mean:.0%}"
