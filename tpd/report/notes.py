"""Notes of a report: dangers (overturning and wall contact), and what else affects the conclusions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from tpd.answers.response import Response, window
from tpd.design.as_built import Details
from tpd.design.criteria import Clearance, Requirements, limit_of
from tpd.design.design import Design
from tpd.design.harmonic import ExactMotions
from tpd.report.blocks import Note, danger, note
from tpd.report.words import finite_max, overturned_between, reduced
from tpd.scene.bob import Bob
from tpd.scene.scene import Block, Pendulum

LARGE_STROKE = 0.3
"""rad; sin(psi) is 1.5 % below psi there, and the difference grows with its square."""
_MANY = 1.5
"""Factor on an interval of 95 %: of a dozen bands that do not overlap, all are then within it with 96 %."""
SLOW = 0.95
"""Largest Floquet multiplier above which a motion attracts slowly."""


def notes(design: Design, details: Details) -> tuple[Note, ...]:
    """Return all notes on a design: dangers first, else in the order of the generators below."""
    block, found = design.scene.block, list[Note]()
    if float(block.velocity_ratio) == 1.0 and not block.friction:
        found.append(note("The block loses no energy at all, unlike any real block. Give it a restitution."))
    found += [*_runs(design), *_responses(details), *_earthquakes(design)]
    if design.pendulum is not None and design.best is not None and design.best.exact is not None:
        exact, without_it = design.best.exact, design.problem.without_pendulum
        found += [
            *_from_rest(design, exact, without_it),
            *_settled(exact),
            *_orbits(design, exact, without_it),
        ]
        if limit_of(design.problem.limits, Clearance) is None:
            found += _without_walls(design, exact, design.pendulum)
    return tuple(sorted(found, key=lambda n: n.severity.value))


def _runs(design: Design) -> Iterator[Note]:
    """Wall contact, overturning that is not reduced, and runs without an answer."""
    runs, best = design.runs, design.best
    if runs is None or best is None:
        return
    if design.pendulum is not None:
        # A job may allow any share: wall contact is a danger all the same.
        if limit_of(design.problem.limits, Clearance) is not None and best.over_limit > max(
            Requirements().allowed, 0.0 if runs.cluster is None else Requirements().broken
        ):
            yield danger(
                f"A limit is exceeded in {best.over_limit:.1%} of the runs in which the block stands."
            )
        least = design.problem.requirements.at_least
        if (
            best.quoted is not None
            and best.decided is not None
            and (runs.reduction(best.measure)[0].mean < least)
        ):
            # The runs that are quoted took no part in the decision: they may fall short by chance.
            yield note(
                f"In the runs that decided, {reduced(best.decided, best.measure)}, and {least:.0%} is "
                "required. The runs that are quoted are independent of them and show less."
            )
        fell = runs.change("overturned")
        if not fell.high < 0.0:
            yield note(
                "The pendulum reduces the tilt. The share of runs that overturn does not fall significantly: "
                f"{fell.with_pendulum:.1%} with the pendulum, {fell.without_pendulum:.1%} without it."
            )
    if runs.undecided:
        yield note(
            f"{runs.undecided} of {len(runs.known)} runs have no answer (too many events). They are left "
            "out, and a pendulum is recommended only if the verdict is the same whichever way they end."
        )


def _from_rest(design: Design, exact: ExactMotions, without_it: ExactMotions) -> Iterator[Note]:
    """Overturning from rest, one motion for each condition."""
    lost, without = (m.status == "overturned" for m in (exact, without_it))
    harmed, saved = np.flatnonzero(lost & ~without), int(np.sum(without & ~lost))
    if harmed.size:
        # Near overturning the end of one motion is chance, and only the counts mean something.
        yield (danger if harmed.size >= saved else note)(
            "By the linear equations, from rest, the block OVERTURNS with the pendulum under "
            f"{harmed.size} of {lost.size} conditions that it withstands without it; under {saved} "
            f"conditions it is the other way round. The first: {design.conditions.label(int(harmed[0]))}."
        )


def _without_walls(design: Design, exact: ExactMotions, pendulum: Pendulum) -> list[Note]:
    """At most one note: the first angle at which the bob as a body would touch the walls."""
    angles = {
        "once settled": exact.swing + exact.amplitude,
        "on the way from rest": exact.peak + exact.peak_swing,
    }
    if not design.problem.rest_counts:
        nu = design.scene.block.slenderness * design.conditions.column("slenderness")
        orbits = exact.orbits.swing[0] + exact.orbits.tilt[0] * nu
        angles["once settled"] = np.concatenate([angles["once settled"], orbits])
    largest = {when: finite_max(x) for when, x in angles.items()}
    if design.turned.size:
        largest["in half of the validation runs"] = float(np.median(design.turned))
    return wall_contacts(design.scene.block, pendulum, largest)[:1]


def wall_contacts(block: Block, pendulum: Pendulum, angles: Mapping[str, float]) -> list[Note]:
    """Return a note for every angle at which a solid ball of steel would touch the block's walls, with a
    remedy.

    Args:
        block, pendulum: the design.
        angles: between bob and block, rad, by when they are reached: the largest bob angle and the largest
            tilt together, which is never too little.
    """
    bob = Bob()
    wall, mass, length = 0.5 * block.clear_width, pendulum.mass, pendulum.length
    tried = np.linspace(0.0, 0.5 * math.pi, 1571)
    clear = tried[np.asarray(bob.reach(mass, length, tried)) <= wall]
    fits = f"up to {clear[-1]:.3g} rad" if clear.size else "at no angle"
    return [
        danger(
            f"{when[0].upper() + when[1:]} the bob, as {bob}, would reach {reach:.3g} m from the block's "
            f"axis, and the walls are {wall:.3g} m from it: it would TOUCH them, which no model here "
            "includes. "
            f"It stays clear of them {fits} between rod and block. Without `--exactly` the search has walls."
        )
        for when, angle in angles.items()
        if (reach := float(bob.reach(mass, length, angle))) > wall
    ]


def _settled(exact: ExactMotions) -> Iterator[Note]:
    """How far the settled motion is from another one, and from the limits of the linear equations."""
    n, rocks = exact.status.size, np.isin(exact.status, ("rocking", "sticking"))
    if count := int(np.sum(rocks & (exact.margin > 0.0))):
        where = f" under {count} of {n} conditions" if n > 1 else ""
        yield note(f"The block could rest with this pendulum{where}, but from rest it ends in rocking.")
    if (swing := finite_max(exact.swing)) > LARGE_STROKE:
        yield note(f"At a stroke of {swing:.2f} rad the linear equations of the pendulum are inaccurate.")
    if (multiplier := finite_max(exact.multiplier[rocks])) > SLOW:
        yield note(f"The motion attracts slowly (Floquet multiplier {multiplier:.3f}).")


def _orbits(design: Design, exact: ExactMotions, without_it: ExactMotions) -> Iterator[Note]:
    """Conditions in which the orbits of the search do not describe the whole motion."""
    if exact.value > without_it.value:
        yield note(
            f"The {design.problem.risk.name} settled tilt, which the descents reduce, is larger with this "
            "pendulum than without it: the trial runs from many initial states chose it."
        )
    e = exact.orbits
    if not design.problem.rest_counts and not np.all(e.attracts):
        under = f"Under {np.sum(~e.attracts)} of {e.attracts.size} conditions"
        yield note(f"{under} no symmetric orbit that attracts was found.")


def _earthquakes(design: Design) -> Iterator[Note]:
    """Doubts about the groups of ground motions."""
    # Without the name of its earthquake a record that is held out may belong to one of the others.
    nameless = sum(getattr(m, "event", None) == "" for m in design.conditions.motions)
    if nameless and len(design.problem.groups) > 1:
        yield note(
            f"{nameless} of the records name no earthquake: motions that were held out may belong to an "
            "earthquake that the design was tuned to. Give the names (--event), or a folder for each."
        )


def _responses(details: Details) -> Iterator[Note]:
    """Frequencies at which the block overturns more often with the pendulum."""
    if len(details.responses) < 2:
        return
    without_it, with_it = details.responses
    worse = overturns_more(without_it, with_it)
    if worse.any():
        i = int(np.argmax(np.where(worse, with_it.overturning[0] - without_it.overturning[0], -1.0)))
        low, high = with_it.frequency[worse][[0, -1]]
        where = f"Between {low:.3g} and {high:.3g} Hz" if high > low else f"At {low:.3g} Hz"
        yield danger(
            f"{where} the block OVERTURNS more often with the pendulum "
            f"({overturned_between((without_it, with_it), *window(with_it.frequency[i]))}; "
            "linear equations, same base amplitude)."
        )


def overturns_more(without_it: Response, with_it: Response) -> np.ndarray:
    """Where significantly more of the runs near a frequency overturn with the pendulum: Newcombe's interval
    of the difference of two shares, wider for many frequencies, lies above zero."""
    (value, low, _), (other, _, high) = with_it.overturning, without_it.overturning
    return value - other > _MANY * np.hypot(value - low, high - other)
