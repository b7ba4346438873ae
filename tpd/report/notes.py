"""Notes of a report: dangers (overturning and strikes), and what else changes what one may conclude."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from tpd.answers.attractors import Starts
from tpd.answers.response import Response
from tpd.answers.statistics import SIGNIFICANT, chance_of
from tpd.design.criteria import Room, Worth, limit_of
from tpd.design.ground.design import GroundDesign
from tpd.design.ground.judgement import Judged, Role, unnamed
from tpd.design.result import Design, HarmonicDesign
from tpd.design.study import Study
from tpd.design.verified import Verified
from tpd.report.blocks import Note, danger, note
from tpd.report.words import finite_max
from tpd.scene.bob import Bob
from tpd.scene.scene import Block, Pendulum

LARGE_STROKE = 0.3
"""rad; sin(psi) is 1.5 % below psi there, and falls further with its square."""
_MANY = 1.5
"""Factor on an interval of 95 %: of a dozen bands that do not overlap, all are then within it with 96 %."""
SLOW = 0.95
"""Largest Floquet multiplier above which a motion attracts slowly."""


def notes(design: Design, study: Study) -> tuple[Note, ...]:
    """All notes on a design: dangers first, else in the order of the generators below."""
    found: list[Note] = []
    block = design.scene.block
    if float(block.velocity_ratio) == 1.0 and not block.friction:
        said = "The block loses no energy at all: no real block rocks like that. Give it a restitution."
        found.append(note(said))
    if isinstance(design, GroundDesign):
        found += _groups(design)
        if (seen := design.searched) is not None and seen.undecided.any():
            found.append(
                note(
                    f"In the search {int(seen.undecided.sum())} of "
                    f"{len(seen.value) * len(design.conditions)} runs have no answer (too many events), with "
                    f"{int((seen.undecided > 0).sum())} of {len(seen.value)} designs: their tilt is that of "
                    "the other runs."
                )
            )
    elif isinstance(design, HarmonicDesign):
        found += _responses(study)
        if design.winner is not None and design.pendulum is not None:
            found += [*_from_rest(design, design.winner), *_strikes(design, design.winner, design.pendulum)]
            found += [*_settled(design.winner), *_starts(design, design.winner)]
    return tuple(sorted(found, key=lambda n: n.severity.value))


def _from_rest(design: HarmonicDesign, winner: Verified) -> Iterator[Note]:
    """Overturning from rest, one run for each condition, and whether anything shows that it is less."""
    lost, bare = (m.status == "overturned" for m in (winner.exact, design.bare.exact))
    harmed, saved = np.flatnonzero(lost & ~bare), int(np.sum(bare & ~lost))
    if harmed.size:
        # Near overturning the end of one run is chance, and only the counts say something.
        yield (danger if harmed.size >= saved else note)(
            "By the linear equations, one run from rest for each condition, this pendulum OVERTURNS the "
            f"block under {harmed.size} of {lost.size} conditions that it stands without, and saves it under "
            f"{saved}. The first: {design.conditions.label(int(harmed[0]))}."
        )
    rest = winner.rest
    if rest is not None and np.any(rest.severity >= 1.0):
        worse = np.sum(rest.severity >= 1.0) > np.sum(rest.bare >= 1.0)
        said = "A single run near overturning says little: the paired runs decide."
        yield (danger if worse else note)(f"{rest.told} {said}")
    pairs = [(harmed.size, saved)]
    if winner.paired is not None:
        pairs.append((winner.paired.worse, winner.paired.better))
    if not any(b > w and chance_of(b, w) < SIGNIFICANT for w, b in pairs):
        yield note(
            "Nothing shows that the block overturns less with this pendulum: neither from rest nor in the "
            "paired runs are there significantly fewer cases. It lessens the tilt."
        )


def _strikes(design: HarmonicDesign, winner: Verified, pendulum: Pendulum) -> Iterator[Note]:
    """At most one note: strikes in the runs or, where no room was asked for, the first angle at which the bob
    as a body would strike the walls."""
    if limit_of(design.limits, Room) is not None:
        # A job may allow any share: strikes are a danger all the same.
        if winner.strikes > Worth().allowed:
            yield danger(f"The bob strikes a wall in {winner.strikes:.1%} of the paired runs that stand.")
        return
    e, nu = winner.evaluation, design.scene.block.slenderness * design.conditions.column("slenderness")
    settled = winner.exact.stroke + winner.exact.amplitude
    if design.starts != Starts.rest():
        settled = np.concatenate([settled, e.stroke[0] + e.tilt[0] * nu])
    angles = {"once settled": settled, "on the way from rest": winner.exact.peak + winner.exact.peak_stroke}
    largest = {when: finite_max(x) for when, x in angles.items()}
    if winner.paired is not None:
        runs = winner.paired.hung
        reach = float(np.quantile(runs.peak_stroke + runs.peak, 0.5, method="inverted_cdf"))
        largest["in half of the paired runs"] = reach if math.isfinite(reach) else 0.0
    yield from strikes(design.scene.block, pendulum, largest)[:1]


def strikes(block: Block, pendulum: Pendulum, angles: Mapping[str, float]) -> list[Note]:
    """A note for every angle at which a solid ball of steel would strike the block's walls, with a remedy.

    Args:
        block, pendulum: the design.
        angles: between bob and block, rad, by when they are reached: the largest bob angle and the largest
            tilt together, which is never too little.
    """
    bob = Bob()
    wall, mass, length = 0.5 * block.room, pendulum.mass, pendulum.length
    tried = np.linspace(0.0, 0.5 * math.pi, 1571)
    clear = tried[np.asarray(bob.reach(mass, length, tried)) <= wall]
    fits = f"up to {clear[-1]:.3g} rad" if clear.size else "at no angle"
    return [
        danger(
            f"{when[0].upper() + when[1:]} the bob, as {bob}, would reach {reach:.3g} m from the block's "
            f"axis, and the walls are {wall:.3g} m from it: it would STRIKE them; no model here does. "
            f"It keeps off them {fits} between rod and block. Without `--exactly` the search asks for room."
        )
        for when, angle in angles.items()
        if (reach := float(bob.reach(mass, length, angle))) > wall
    ]


def _settled(winner: Verified) -> Iterator[Note]:
    """How far the settled motion is from another one, and from the limits of the linear equations."""
    motions, several = winner.exact, winner.exact.status.size > 1
    rocks = np.isin(motions.status, ("rocking", "sticking"))
    if np.any(rocks & (winner.margin > 0.0)):
        count = np.sum(rocks & (winner.margin > 0.0))
        at = f" under {count} of {rocks.size} conditions" if several else ""
        yield note(f"The block could rest under this pendulum{at}, but a start from rest ends in rocking.")
    if (stroke := finite_max(motions.stroke)) > LARGE_STROKE:
        yield note(f"A stroke of {stroke:.2f} rad stretches the linear equations of the pendulum.")
    if (multiplier := finite_max(motions.multiplier[rocks])) > SLOW:
        yield note(f"The motion attracts slowly (Floquet multiplier {multiplier:.3f}).")


def _starts(design: HarmonicDesign, winner: Verified) -> Iterator[Note]:
    """Starts, and conditions, in which the search's tilts do not tell the whole motion."""
    e = winner.evaluation
    if winner.value > design.bare.value:
        yield note(
            f"The {design.risk.name} settled tilt, which the searches make small, is larger with this "
            "pendulum than without: runs from many starts chose it."
        )
    if design.starts == Starts.any() and not np.all(e.attracts):
        under = f"Under {np.sum(~e.attracts)} of {e.attracts.size} conditions"
        yield note(f"{under} no symmetric motion that attracts was found.")


def _responses(study: Study) -> Iterator[Note]:
    """Frequencies at which the block overturns more often with the pendulum."""
    if study.responses is None or len(study.responses) < 2:
        return
    bare, hung = study.responses
    worse = overturns_more(bare, hung)
    if worse.any() and hung.overturning is not None and bare.overturning is not None:
        i = int(np.argmax(np.where(worse, hung.overturning[0] - bare.overturning[0], -1.0)))
        low, high = hung.frequency[worse][[0, -1]]
        where = f"From {low:.3g} to {high:.3g}" if high > low else f"At {low:.3g}"
        yield danger(
            f"{where} Hz the block OVERTURNS more often with this pendulum: near {hung.frequency[i]:.3g} Hz "
            f"in {hung.overturning[0, i]:.0%} of the runs from rest, {bare.overturning[0, i]:.0%} without "
            "(linear equations, same base amplitude)."
        )


def overturns_more(bare: Response, hung: Response) -> np.ndarray:
    """Where significantly more of the runs near a frequency overturn with the pendulum: Newcombe's interval
    of the difference of two shares, wider for many frequencies, lies above zero."""
    if hung.overturning is None or bare.overturning is None:
        return np.zeros(hung.frequency.size, dtype=bool)
    (value, low, _), (other, _, high) = hung.overturning, bare.overturning
    return value - other > _MANY * np.hypot(value - low, high - other)


def _groups(design: GroundDesign) -> Iterator[Note]:
    """Harm on single groups, and doubts about the groups."""
    benefit = design.benefit
    if benefit is not None and design.pendulum is not None and not benefit.overturned.is_below:
        yield note(
            "On motions that were held out the tilts are smaller, but the number of overturnings is not "
            f"significantly so: {benefit.overturned.words()} of the runs."
        )
    # Without the name of its earthquake a record that is held out may be of one that was tuned to.
    nameless = unnamed(design.conditions.motions)
    if nameless and any(g.role is Role.held_out for g in design.judged):
        yield note(
            f"{nameless} of the records name no earthquake: motions that were held out may belong to an "
            "earthquake that the design was tuned to. Give the names (--event), or a folder for each."
        )
    for g in design.judged:
        if g.overturns_more:
            more = (g.difference if g.difference.is_above else g.linear).words()
            yield danger(f"On {g.name} the block overturns more often with the pendulum: {more}.")
        if g.tilt.is_above:
            more = g.tilt.words(share=False)
            yield note(f"On {g.name} the mean tilt/ν is larger with the pendulum: {more}.")
        if g.strikes > design.worth.broken:
            yield danger(
                f"On {g.name} with scattered blocks a limit is broken in {g.strikes:.1%} of the runs that "
                f"stand ({g.linear_strikes:.1%} by the linear equations); {design.worth.broken:.1%} are "
                "allowed."
            )
        if g.undecided:
            yield note(
                f"On {g.name} {unknown(g)} runs have no answer (too many events). They are left out, and "
                "a design is offered only if the verdict is the same whichever way they end."
            )


def unknown(g: Judged) -> str:
    """Number of runs without an answer, and of all: bare and hung by both sets of equations."""
    return f"{g.undecided} of {4 * g.motions * len(g.stripes)}"
