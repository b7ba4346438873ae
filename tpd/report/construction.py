"""Section of a report for whoever builds and hangs the pendulum: sizes, loads, checks on site, tolerances."""

from __future__ import annotations

import math

from tpd.answers.statistics import Interval
from tpd.core.formatting import number
from tpd.design.as_built import ARM, SAFETY, YIELD, Build, Details
from tpd.design.design import Design
from tpd.design.reasons import DesignStatus
from tpd.report.blocks import Block, Cell, Listing, Table, Text

_NAMES = {
    "": ("as stated", None),
    "restitution": ("loss at an impact, 1 - e", "pull the block and release it, above"),
    "friction": ("friction k of the rocking contact", "pull the block and release it, above"),
    "slenderness": ("slenderness ν", "width of the base that bears, and height of the centroid"),
    "amplitude": ("amplitude of the excitation", "the source of the motion"),
    "frequency": ("frequency of the excitation", "the source of the motion"),
    "mass": ("mass of the bob", "weigh it"),
    "length": ("rod, hinge to the bob's centre", "time ten swings, above"),
    "damping": ("moment of the damper", "measure the first swing back, above"),
}
"""Words for a quantity that is varied, and how it is measured."""


def section(design: Design, study: Details) -> list[Block]:
    """Return the blocks of the section; empty where no pendulum is offered."""
    if study.build is None or design.pendulum is None:
        return []
    build = study.build
    return [_sizes(design, build), *_parts(build), _checks(build), *_sensitivity(design, study)]


def _sizes(design: Design, build: Build) -> Table:
    with_it, loads = design.pendulum, build.loads
    assert with_it is not None
    zeta = number(float(with_it.damping_ratio))
    point = f"{number(float(with_it.mass))} kg at {number(float(with_it.length))} m"
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
        ("largest force along the rod", f"{number(loads.tension)} N", None),
        ("largest force of the hinge on its beam", f"{number(loads.hinge)} N", None),
        ("largest moment of the damper", f"{number(build.damper_moment)} N m", None),
        ("largest power of the damper", f"{number(build.damper_power)} W", None),
        ("largest rate between rod and block", f"{number(loads.rate)} rad/s", None),
        ("friction that keeps the base from sliding", loads.friction, "coefficient; the models do not slide"),
    ]
    slow, fast = build.lifts_slow_fast
    settled = ""
    if build.lifts is not None:
        settled = f"; under the harmonic of the job {number(build.lifts[0])} g once the bob has settled"
    lifts = (
        "under motions of the base that are much slower, and much faster, than the pendulum; near its own "
        f"frequency it may be less than both{settled}; {number(float(design.scene.uplift))} g without it"
    )
    rows.append(("acceleration that lifts the resting block", f"{number(slow)} g, {number(fast)} g", lifts))
    forces = (
        "Forces: those of the pendulum released at its largest angle, because the block stands in none of "
        "the motions."
    )
    if loads.motions:
        forces = (
            f"Forces: the largest of {loads.motions} motions of the job in which the block stands (of "
            "many those in which the bob swings most; harmonics for 40 periods from rest), linear equations, "
            "nominal block, in proportion to the whole mass. Impacts of the block are left out: the parts "
            "below have a factor of safety for them."
        )
    return Table(("part", "size", "remark"), tuple(rows), forces)


def _parts(build: Build) -> list[Block]:
    """Sizes of rod, pin, linear damper and stop; what the pendulum does in the second direction."""
    parts = build.parts
    if parts is None:
        return []
    quarter = (
        "a quarter of the rod" if parts.arm >= ARM * build.rod else "the most that has room in the cavity"
    )
    heavy = f"round bar of {number(parts.rod_mass, 3)} kg"
    angle = f"twice the arm times the largest angle, {number(build.angle, 3)} rad"
    rows: list[tuple[Cell, ...]] = [
        (
            "rod, diameter",
            _mm(parts.rod_diameter),
            f"{heavy}; the table above has a rod of {number(build.rod_share * build.mass, 3)} kg",
        ),
        ("pin of the hinge, diameter", _mm(parts.pin_diameter), "in double shear"),
        ("linear damper, arm", f"{number(parts.arm, 3)} m", f"from the hinge along the rod: {quarter}"),
        ("linear damper, coefficient", f"{number(parts.coefficient, 3)} N s/m", "moment/rate over arm²"),
        ("linear damper, largest force", f"{number(parts.force, 3)} N", "largest moment over the arm"),
        ("linear damper, stroke", _mm(parts.stroke), angle),
        ("linear damper, largest speed", f"{number(parts.speed, 3)} m/s", "the arm times the largest rate"),
    ]
    if parts.stop_way > 0.0:
        stops = f"spring that stops the bob, at its largest rate, in {_mm(parts.stop_way)}"
        rows += [
            ("stop, distance from the axis", f"{number(parts.stop)} m", "one on each side of the bob"),
            ("stop, largest force", f"{number(parts.stop_force, 3)} N", f"{stops}: a tenth of its free way"),
        ]
    caption = (
        f"First sizes for steel S235 (yield stress {YIELD / 1e6:g} MPa, EN 10025-2). The largest stress is "
        f"the yield stress over a factor of safety of {SAFETY:g}, for fatigue, impacts and stronger motions. "
        "The rod carries its largest force and the moment of the damper as bending. The linear damper stands "
        "horizontally between rod and wall, in place of a damper at the hinge. Not included: beam, plates, "
        "threads and welds."
    )
    second = (
        "On a pin, the pendulum does not swing in the second horizontal direction: there it moves as a rigid "
        "part of the block and reduces no rocking. If the block can rock in both directions, as a square "
        "block or flue can, hang the rod on a universal joint with a linear damper in each direction, and "
        "check each direction as a design of its own."
    )
    return [Table(("part", "size", "remark"), tuple(rows), caption), Text(second)]


def _mm(x: float) -> str:
    """A length (m) in mm."""
    return f"{number(1e3 * x, 3)} mm"


def _way(design: Design, build: Build) -> list[tuple[Cell, ...]]:
    """Row of the clear way; none where no run is known."""
    if not math.isfinite(build.reach):
        return []
    share = 1.0 - design.problem.allowed
    said = (
        f"distance of the body from the axis in {share:.0%} of the validation runs in which the block stands"
    )
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
        f"about {pull.impacts} impacts ({pull.seconds:.2g} s) later its largest tilt is half of this tilt"
        if pull.impacts
        else "it stays there, or keeps more than half of this tilt for hundreds of impacts"
    )
    return Listing(
        (
            f"The pendulum without its damper, block at rest: ten swings take {ten:.3g} s. If the time "
            "agrees to 1 %, the rod agrees to 2 %.",
            f"The pendulum with its damper: pull it aside by about 0.1 rad and release it; {swings}.",
            f"The block without the pendulum, secured against toppling: a horizontal pull of "
            f"{number(pull.force, 3)} N at the top starts uplift. The pull needed then decreases, so "
            "control the "
            f"displacement, not the force. Pull until the top has moved by {number(1e3 * pull.sway, 3)} mm "
            f"({pull.tilt:.2g} rad, a tenth of the tilt of toppling) and release: {decay}. With n impacts "
            "from a tilt a to a tilt b, both over ν, without friction, e = [b (2 - b)/(a (2 - a))]^(1/(2n)). "
            "Fewer impacts mean more loss; friction makes the decay faster at small tilts.",
        )
    )


def _sensitivity(design: Design, study: Details) -> list[Block]:
    if not study.sensitivity:
        return []
    e, validated = float(design.scene.block.velocity_ratio), dict(design.problem.scatter)
    # A restitution scatters as a number; the table is about the loss, 1 - e.
    if "restitution" in validated and e < 1.0:
        validated["restitution"] *= e / (1.0 - e)
    rows = tuple(
        (
            _NAMES[m.name][0],
            f"±{validated[m.name]:.0%}" if m.name in validated else None,
            f"±{m.width:.0%}" if m.width else None,
            _interval(m.low),
            _interval(m.high),
            _NAMES[m.name][1],
        )
        for m in study.sensitivity
    )
    head = ("quantity", "tolerance", "varied by", "reduction, lower", "reduction, higher", "how to measure")
    caption = (
        "Reduction of the mean tilt (95 %) where one quantity alone is lower or higher, on the same runs "
        "of the linear equations as the first row. A restitution is varied as a number, without scatter."
    )
    if design.status is DesignStatus.recommended:
        caption += " Column 2 gives the tolerances for which the benefit was validated."
    lost = [_NAMES[m.name][0] for m in study.sensitivity if not min(m.low.low, m.high.low) > 0.0]
    text = "The benefit remains significant in all of these cases."
    if lost:
        text = f"The benefit is no longer significant if these are varied as in column 3: {'; '.join(lost)}."
    return [Table(head, rows, caption), Text(text)]


def _interval(of: Interval) -> str:
    return f"{of.mean:.0%} ({of.low:.0%} to {of.high:.0%})" if math.isfinite(of.low) else f"{of.mean:.0%}"
