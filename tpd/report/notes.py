"""Notes of a report: dangers, warnings and facts for somebody who would hang the pendulum."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from tpd.analysis.attractors import Starts
from tpd.analysis.paired import SIGNIFICANT, chance_of
from tpd.analysis.response import Response
from tpd.core.bob import Bob
from tpd.core.scene import STANDARD_GRAVITY, Block, Pendulum
from tpd.core.status import SETTLED
from tpd.design.criteria import Room, Worth, limit_of
from tpd.design.result import DesignStatus, HarmonicDesign
from tpd.design.study import Study
from tpd.design.verified import Verified
from tpd.report import earthquakes
from tpd.report.blocks import Note, danger, information, warning
from tpd.report.words import bob_of, finite_max, source_of_tilts

LARGE_PEAK = 0.7
"""Share of the tilt at which the block topples; a start from rest beyond it is called dangerous."""
GRAVE = 2.0
"""Ratio to the bare block's amplitude above which more rocking at another frequency is told first."""
LARGE_STROKE = 0.3
"""rad; sin(psi) is 1.5 % below psi there, and falls further with its square."""
SLOW = 0.95
"""Largest Floquet multiplier above which a motion attracts slowly."""
_WIDTHS, _FEW = (0.01, 0.03, 0.1), 3
"""Relative half widths about a frequency whose neighbours are counted, and the fewest frequencies."""
_FELT = 0.005
"""Share of the pendulum's frequency by which a body and a rod may change it without a word."""


def notes(design: HarmonicDesign, study: Study) -> tuple[Note, ...]:
    """All notes on a design: dangers first, else in the order of the generators below."""
    found = [*_interruptions(design, study), *_responses(design, study), *_searched(design)]
    if design.winner is not None and design.pendulum is not None:
        found += [*_overturning(design, design.winner), *_repeated(design.winner)]
        found += [*_from_rest(design.winner), *_strikes(design, design.winner, design.pendulum)]
        found += thick(design.pendulum, bob_of(design.limits), design.scene.gravity)
        found += [*_settled(design.winner), *_starts(design, design.winner)]
    found += earthquakes.notes(study.earthquakes)
    return tuple(sorted(found, key=lambda note: note.severity.value))


def _interruptions(design: HarmonicDesign, study: Study) -> Iterator[Note]:
    if design.status is DesignStatus.interrupted:
        yield warning("The search was interrupted; nothing below is the best of the design space.")
    for part in study.left_out:
        yield warning(f"This report goes without {part}: its computation was interrupted.")


def _searched(design: HarmonicDesign) -> Iterator[Note]:
    """Notes on the search as a whole, with or without an answer."""
    lost = design.search.screened_overturned
    if lost.any():
        yield information(
            f"Of the designs screened, {np.mean(lost):.0%} overturn the block or reach no settled motion: a "
            "pendulum in the wrong place does harm."
        )
    yield information(
        f"Tilts are those of {source_of_tilts(design)}, by the linear equations of Collini et al. (2016); "
        "the survey from rest, the refinement and the verification are by the nonlinear ones. Other starts "
        "may settle elsewhere, and an earthquake is not a harmonic motion."
    )


def _overturning(design: HarmonicDesign, winner: Verified) -> Iterator[Note]:
    """Overturning from rest, with the pendulum and without."""
    lost, bare = (m.status == "overturned" for m in (winner.exact, design.bare.exact))
    harmed, saved = np.flatnonzero(lost & ~bare), int(np.sum(bare & ~lost))
    if harmed.size:
        # One run of each condition: near overturning its end is chance, and only the counts say something.
        yield (danger if harmed.size >= saved else warning)(
            "By the linear equations, one run from rest for each condition, this pendulum OVERTURNS the "
            f"block under {harmed.size} of {lost.size} conditions that it stands without, and saves it under "
            f"{saved}. The first: {design.conditions.label(int(harmed[0]))}."
        )
    if lost.any():
        yield warning(
            f"From rest the block overturns under {lost.sum()} of {lost.size} conditions with the pendulum "
            f"and {bare.sum()} without."
        )
    share = winner.exact.peak / (design.scene.block.slenderness * design.conditions.column("slenderness"))
    if np.any(share[~lost] > LARGE_PEAK):
        yield danger("On the way from rest the block comes near the tilt at which it topples.")
    if not _overturns_less(lost, bare, winner):
        yield warning(
            "Nothing shows that the block overturns less with this pendulum: neither from rest nor in the "
            "ensemble are there significantly fewer cases. It lessens the steady tilt."
        )


def _overturns_less(lost: np.ndarray, bare: np.ndarray, winner: Verified) -> bool:
    """Whether significantly fewer conditions, or runs of the ensemble, overturn the block than without."""
    pairs, runs = [(int(np.sum(lost & ~bare)), int(np.sum(bare & ~lost)))], winner.paired
    if runs is not None:
        pairs.append((runs.worse, runs.better))
    return any(better > worse and chance_of(better, worse) < SIGNIFICANT for worse, better in pairs)


def _repeated(winner: Verified) -> Iterator[Note]:
    """Overturning in the paired runs."""
    runs = winner.paired
    if runs is None:
        return
    if runs.harms:
        yield danger(f"More runs overturn with the pendulum. {runs.chance_in_words}")
    hung, bare = runs.hung.overturned, runs.bare.overturned
    yield information(
        f"Of {len(runs.hung.status)} runs of the {runs.equations} equations {hung} overturn with the "
        f"pendulum, {bare} without."
    )


def _from_rest(winner: Verified) -> Iterator[Note]:
    """Overturning from rest by the nonlinear equations though the design is offered."""
    rest = winner.rest
    if rest is not None and np.any(rest.severity >= 1.0):
        worse = np.sum(rest.severity >= 1.0) > np.sum(rest.bare >= 1.0)
        said = "A single run near overturning says little: the paired runs decide."
        yield (danger if worse else warning)(f"{rest.told} {said}")


def _strikes(design: HarmonicDesign, winner: Verified, pendulum: Pendulum) -> list[Note]:
    """At most one note: the first angle at which the bob as a body would strike the walls, or its room."""
    e, nu = winner.evaluation, design.scene.block.slenderness * design.conditions.column("slenderness")
    settled = winner.exact.stroke + winner.exact.amplitude
    if design.starts != Starts.rest():
        settled = np.concatenate([settled, e.stroke[0] + e.tilt[0] * nu])
    limit = limit_of(design.limits, Room)
    if isinstance(limit, Room):
        return [_room(design, winner, pendulum, limit.bob)]
    angles = {"once settled": settled, "on the way from rest": winner.exact.peak + winner.exact.peak_stroke}
    largest = {when: finite_max(x) for when, x in angles.items()}
    if winner.paired is not None:
        runs = winner.paired.hung
        reach = float(np.quantile(runs.peak_stroke + runs.peak, 0.5, method="inverted_cdf"))
        largest["in half of the ensemble's runs"] = reach if math.isfinite(reach) else 0.0
    return strikes(design.scene.block, pendulum, largest)[:1]


def _room(design: HarmonicDesign, winner: Verified, pendulum: Pendulum, bob: Bob) -> Note:
    """Room that the bob has as a body."""
    wide = 2.0 * float(bob.radius(pendulum.mass))
    # A job may allow any share: strikes are a danger all the same.
    return (danger if winner.strikes > Worth().allowed else information)(
        f"The bob as {bob} is {wide:.3g} m wide and {bob.slimness * wide:.3g} m high. Between walls "
        f"{design.scene.block.room:.3g} m apart it strikes none in {1.0 - winner.strikes:.1%} of the paired "
        f"runs that stand ({1.0 - design.worth.allowed:.1%} are asked for)."
    )


def strikes(
    block: Block, pendulum: Pendulum, angles: Mapping[str, float], bob: Bob | None = None
) -> list[Note]:
    """A note for every angle at which the bob as a body would strike the block's walls, with a remedy.

    Args:
        block, pendulum: the design.
        angles: between bob and block, rad, by when they are reached: the largest bob angle and the largest
            tilt together, which is never too little.
        bob: default a solid ball of steel.
    """
    bob = Bob() if bob is None else bob
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


def thick(pendulum: Pendulum, bob: Bob | None = None, gravity: float = STANDARD_GRAVITY) -> list[Note]:
    """A note on the bob's own moment of inertia and the rod's mass, where they change the pendulum."""
    bob = Bob() if bob is None else bob
    mass, length = float(pendulum.mass), float(pendulum.length)
    change = bob.frequency_change(mass, length, gravity)
    if abs(change) < _FELT:
        return []
    share = bob.rod(mass, length, gravity) / length - 1.0
    way = "shorter" if share < 0.0 else "longer"
    cure = f"a rod {abs(share):.1%} {way} makes" if math.isfinite(share) else "no rod makes"
    return [
        warning(
            f"The equations take a point on a massless rod. As {bob} the bob has a moment of inertia of its "
            f"own, {bob.inertia_share(mass, length):.1%} of the point's, and a rod for ten times its "
            f"weight {bob.rod_share(length, gravity):.1%} of its mass. Together they change the pendulum's "
            f"frequency by {change:+.1%}; {cure} up for it."
        )
    ]


def _settled(winner: Verified) -> Iterator[Note]:
    """How far the settled motion is from another one, and from the limits of the linear equations."""
    motions, several = winner.exact, winner.exact.status.size > 1
    rests, rocks = motions.status == "rest", np.isin(motions.status, ("rocking", "sticking"))
    if rests.any():
        yield information(
            f"{'Where the block settles at rest it' if several else 'The resting block'} keeps "
            f"{'at least ' if several else ''}{np.min(winner.margin[rests]):.1%} of the moment that would "
            "lift it in reserve, once the pendulum has settled; the sudden start may lift it before."
        )
    if np.any(rocks & (winner.margin > 0.0)):
        count = np.sum(rocks & (winner.margin > 0.0))
        at = f" under {count} of {rocks.size} conditions" if several else ""
        yield warning(f"The block could rest under this pendulum{at}, but a start from rest ends in rocking.")
    if (stroke := finite_max(motions.stroke)) > LARGE_STROKE:
        yield warning(f"A stroke of {stroke:.2f} rad stretches the linear equations of the pendulum.")
    if (multiplier := finite_max(motions.multiplier[rocks])) > SLOW:
        yield warning(f"The motion attracts slowly (Floquet multiplier {multiplier:.3f}).")


def _starts(design: HarmonicDesign, winner: Verified) -> Iterator[Note]:
    """Starts, and conditions, in which the search's tilts do not tell the whole motion."""
    e = winner.evaluation
    if winner.value > design.bare.value:
        yield warning(
            f"The {design.risk.name} settled tilt, which the searches make small, is larger with this "
            "pendulum than without: runs from many starts chose it."
        )
    if design.starts == Starts.any() and not np.all(e.attracts):
        yield warning(
            f"Under {np.sum(~e.attracts)} of {e.attracts.size} conditions no symmetric motion attracts."
        )


def _responses(design: HarmonicDesign, study: Study) -> Iterator[Note]:
    """Frequencies near the design's at which the block overturns or rocks more, each with its neighbours."""
    if study.responses is None or len(study.responses) < 2:
        return
    bare, hung = study.responses
    away = np.abs(hung.frequency / design.scene.motion.frequency - 1.0)
    lost, lost_bare = hung.status == "overturned", bare.status == "overturned"
    harmed = np.flatnonzero(lost & ~lost_bare)
    if harmed.size:
        i = int(harmed[np.argmin(away[harmed])])
        near, words = _neighbourhood(hung, i)
        k, m = int(lost[near].sum()), int(lost_bare[near].sum())
        # A single run near overturning may end either way, but the neighbours count as well.
        yield (danger if k > m else warning)(
            f"Of {near.size} {words}, same base amplitude, from rest, {k} OVERTURN the block with this "
            f"pendulum and {m} without, by the linear equations."
        )
    yield from _rocks_more(bare, hung, away)
    yield information(
        f"Of {lost.size} frequencies tried from {hung.frequency[0]:.4g} to {hung.frequency[-1]:.4g} Hz, "
        f"{lost.sum()} overturn the block with the pendulum and {lost_bare.sum()} without."
    )
    if lost.any() or lost_bare.any():
        yield information(
            "On its way a motion from rest can be chaotic. Then rounding decides whether it overturns at a "
            "single frequency: rely on shares of many runs, not on one."
        )


def _neighbourhood(of: Response, i: int) -> tuple[np.ndarray, str]:
    """Indices of the frequencies about the i-th, in the least of a few widths that holds some, in words."""
    # Far from the design the frequencies lie 2 % apart and within 1 % there would be one run alone, which
    # is what must not be told.
    apart = np.abs(of.frequency / of.frequency[i] - 1.0)
    width = next((w for w in _WIDTHS if np.sum(apart <= w) >= _FEW), _WIDTHS[-1])
    return np.flatnonzero(
        apart <= width
    ), f"frequencies within {100.0 * width:g} % of {of.frequency[i]:.4g} Hz"


def _rocks_more(bare: Response, hung: Response, away: np.ndarray) -> Iterator[Note]:
    """The nearest frequency at which the block rocks gravely more or, if there is none, somewhat more."""
    settled = np.isin(bare.status, SETTLED) & np.isin(hung.status, SETTLED)
    more = settled & (hung.amplitude > 1.02 * bare.amplitude)
    grave = more & (hung.amplitude > GRAVE * bare.amplitude)
    chosen = np.flatnonzero(grave if grave.any() else more)
    if not chosen.size:
        return
    i = int(chosen[np.argmin(away[chosen])])
    # Where motions are chaotic an amplitude is that of one run: neighbours say whether it is the rule.
    near, words = _neighbourhood(hung, i)
    # Grave or not, a block that rocks more stands: dangers are overturning and strikes.
    yield warning(
        f"At {more[near].sum()} of {near.size} {words} the block rocks more with this pendulum than without, "
        f"at that frequency {hung.amplitude[i]:.4g} rad in place of {bare.amplitude[i]:.4g} rad."
    )
