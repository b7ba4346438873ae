"""Section of a report for the engineer who builds the pendulum: sizes, loads, checks, tolerances."""

from __future__ import annotations

import math

from tpd.core.formatting import number, percent
from tpd.design.as_built import ARM, SAFETY, YIELD, Build, Details
from tpd.design.design import Design
from tpd.report.blocks import Block, Cell, Listing, Table, Text
from tpd.report.words import kept, point
from tpd.scene.scene import Pendulum


def section(design: Design, details: Details) -> list[Block]:
    """Return the blocks of the section; an empty list if no pendulum is recommended."""
    build = details.build
    if build is None or design.pendulum is None:
        return []
    return [_sizes(design, design.pendulum, build), *_parts(build), _checks(build)]


def _sizes(design: Design, pendulum: Pendulum, build: Build) -> Table:
    """Return the table of sizes, and of loads with a damper at the hinge."""
    loads, moment = build.loads, build.damping * build.loads.rate
    zeta = number(pendulum.damping_ratio)
    mass = point(pendulum)
    body = f"no {build.bob.shape} is equivalent to the point mass of {mass}, which has the forces below"
    if math.isfinite(build.mass):
        dead = f"{number(build.mass_at_hinge, 3)} kg of bob and rod act as if fixed at the hinge"
        body = f"{build.bob}, equivalent to a point mass of {mass}; {dead}"
    rod: tuple[Cell, ...] = "–", "no length gives the natural frequency of the equivalent point mass"
    if math.isfinite(build.rod):
        rod = f"{number(build.rod)} m", f"with a steel rod of {percent(build.rod_share, 1)} of the bob's mass"
    reach: list[tuple[Cell, ...]] = []
    # Without runs the distance that the bob needs on each side is unknown.
    if math.isfinite(build.reach):
        text = f"the bob stays within this distance in {kept(design)}"
        text += f"; the wall is at {number(build.wall)} m" if math.isfinite(build.wall) else ""
        reach = [("bob, largest distance from the block's axis", f"{number(build.reach)} m", text)]
    # The uplift acceleration depends on the frequency of the excitation. Its limits for slow and fast
    # motions have closed forms.
    slow, fast = build.uplift_slow_fast
    without = f"without the pendulum {number(design.scene.uplift)} g"
    lifts = "base acceleration that lifts the block"
    quick = "much faster than the pendulum; near its natural frequency it can be below both values"
    rows: list[tuple[Cell, ...]] = [
        ("mass of the bob", f"{number(build.mass)} kg", body),
        ("bob, width by height", f"{number(build.bob_width)} m × {number(build.bob_height)} m", None),
        ("rod, hinge to the bob's centre", *rod),
        ("depth below the hinge", f"{number(build.depth)} m", "to the lower end of the bob at rest"),
        *reach,
        ("natural frequency", f"{number(build.frequency)} Hz", "without the damper, block at rest"),
        ("damper at the hinge", f"{number(build.damping)} N m s/rad", f"rotational; damping ratio {zeta}"),
        ("weight on the hinge", _force(build.weight), "of bob and rod, on the beam that carries the hinge"),
        ("largest force along the rod", _force(loads.tension), None),
        ("largest force of the hinge on its beam", _force(loads.hinge), "if the damper is at the hinge"),
        (
            "hinge, largest breakaway moment",
            f"{number(build.breakaway, 3)} N m",
            "0.05 m g l, a requirement on the bearing, and to be maintained: with four times as much half of "
            "the benefit can be lost, and all of it if the hinge is stuck",
        ),
        (
            "impulse on the hinge at an impact of the base",
            f"{number(build.impulse, 3)} N s",
            "vertical, at the largest rate of a block that comes back from the toppling tilt",
        ),
        ("largest moment of the damper", f"{number(moment)} N m", None),
        ("largest power of the damper", f"{number(moment * loads.rate)} W", None),
        ("largest rate between rod and block", f"{number(loads.rate)} rad/s", None),
        ("coefficient of friction needed at the base", loads.friction, "below this value the base slides"),
        (f"{lifts}, slow motion", f"{number(slow)} g", f"much slower than the pendulum; {without}"),
        (f"{lifts}, fast motion", f"{number(fast)} g", quick),
    ]
    if build.uplift_harmonic is not None:
        settled = f"excitation of the job, after the bob has settled; {without}"
        rows.append((f"{lifts}, harmonic motion", f"{number(build.uplift_harmonic[0])} g", settled))
    # The loads come from motions in which the block stands; there may be none.
    forces = "The block overturns in all motions. Forces are those of a free swing from the largest angle."
    if loads.motions:
        forces = (
            f"Forces are the largest of {loads.motions} motions of the job in which the block does not "
            "overturn, by the linear model with nominal values and the whole mass of bob and rod. "
            "Harmonic motions last 40 periods from rest; if there are many motions, those with the largest "
            "swing are used. Impacts of the block are not included: the factor of safety of the parts below "
            "allows for them."
        )
    return Table(("quantity", "value", "remark"), tuple(rows), forces)


def _parts(build: Build) -> list[Block]:
    """Return first sizes of rod, pin, linear damper and stop, and a text on the second direction."""
    parts = build.parts
    if parts is None:
        return []
    # A narrow cavity limits the stroke of the damper, and with it the arm.
    arm = "a quarter of the rod" if parts.arm >= ARM * build.rod else "the largest arm that fits the cavity"
    assumed = build.rod_share * build.mass
    bar = f"steel bar of {number(parts.rod_mass, 3)} kg; the table above assumes {number(assumed, 3)} kg"
    # The sizes above assume a rod that carries only ten times the weight of the bob. Bending can need more.
    if parts.rod_mass > assumed:
        bar += (
            ". To keep the frequency, use a tube of equal strength or move the bob: see the rod check below"
        )
    both = f"{_force(build.loads.hinge, 3)} from the first table plus the force of the linear damper"
    angle = f"twice the arm times the largest angle of {number(build.angle, 3)} rad"
    rows: list[tuple[Cell, ...]] = [
        ("rod, diameter", _mm(parts.rod_diameter), bar),
        (
            "pin of the hinge, diameter",
            _mm(parts.pin_diameter),
            "double shear, under the force in the next row",
        ),
        ("hinge, largest force with the linear damper", _force(build.loads.hinge + parts.force, 3), both),
        ("linear damper, arm", f"{number(parts.arm, 3)} m", f"distance from the hinge along the rod: {arm}"),
        ("linear damper, coefficient", f"{number(parts.coefficient, 3)} N s/m", "hinge damper over arm²"),
        ("linear damper, largest force", _force(parts.force, 3), "largest moment of the damper over the arm"),
        ("linear damper, stroke", _mm(parts.stroke), angle),
        ("linear damper, largest speed", f"{number(parts.speed, 3)} m/s", "arm times the largest rate"),
    ]
    # The distance is NaN if the bob has no free distance, and a comparison with NaN is false.
    if parts.stop_way > 0.0:
        spring = f"of a spring that stops the bob within {_mm(parts.stop_way)} from its largest rate"
        rows += [
            ("stop, distance from the axis", f"{number(parts.stop)} m", "one stop on each side of the bob"),
            ("stop, largest force", _force(parts.stop_force, 3), spring),
        ]
    caption = (
        f"First sizes for steel S235 (yield stress {YIELD / 1e6:g} MPa, EN 10025-2) with a factor of safety "
        f"of {SAFETY:g} on the yield stress, for fatigue, impacts and stronger motions. The rod carries its "
        "largest force together with the moment of the damper in bending. The linear damper is an "
        "alternative to the damper at the hinge: it lies horizontally between rod and wall. Beam, plates, "
        "threads and welds are not included."
    )
    second = (
        "A pin lets the pendulum swing in one direction only. The second direction needs a second design "
        "(universal joint or second pendulum). A square block or chimney can rock in both directions: use a "
        "linear damper in each of them."
    )
    return [Table(("part", "size", "remark"), tuple(rows), caption), Text(second)]


def _mm(x: float) -> str:
    """Format a length (m) in mm."""
    return f"{number(1e3 * x, 3)} mm"


def _force(x: float, digits: int = 4) -> str:
    """Format a force (N) in N or kN."""
    return f"{number(1e-3 * x, digits)} kN" if x >= 1e3 else f"{number(x, digits)} N"


def _checks(build: Build) -> Listing:
    """Return the measurements on site, with the readings to expect."""
    # Ten oscillations reduce the error of a stop watch to a tenth.
    ten, pull = 10.0 / build.frequency, build.pull
    # Half a per cent of the angle cannot be seen on site.
    swings = (
        "It should come to rest without a swing to the other side."
        if build.rebound < 0.005
        else f"It should swing to about {percent(build.rebound)} of this angle on the other side."
    )
    decay = (
        f"After about {pull.impacts} impacts ({pull.seconds:.2g} s) the tilt should be about half of this."
        if pull.impacts
        else "The block stays there, or keeps more than half of this tilt for hundreds of impacts."
    )
    return Listing(
        (
            f"Rod: remove the damper and keep the block at rest. Ten complete oscillations (there and "
            f"back) must take {ten:.3g} s. If this time is correct within 1 %, the length is correct within "
            "2 %.",
            f"Damper: pull the pendulum with its damper aside by about 0.1 rad and release it. {swings}",
            "Energy loss of the block: remove the pendulum and secure the block against toppling. A "
            f"horizontal pull of {_force(pull.force, 3)} at the top starts uplift. The pull needed then "
            "decreases, so control the displacement, not the force. Pull until the top has moved by "
            f"{number(1e3 * pull.sway, 3)} mm ({pull.tilt:.2g} rad, a tenth of the "
            f"slenderness ν) and release the block. {decay} If the tilt falls from a to b within n impacts, "
            "both divided by ν and without friction, then e = [b (2 - b)/(a (2 - a))]^(1/(2n)). Fewer "
            "impacts mean a larger energy loss. Friction makes the decay faster at small tilts.",
        )
    )
