"""Notes of a report: dangers, warnings and facts for somebody who would hang the pendulum."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from tpd.analysis.attractors import Starts
from tpd.analysis.paired import SIGNIFICANT, chance_of
from tpd.analysis.response import Response
from tpd.core.scene import Block, Pendulum
from tpd.core.status import SETTLED
from tpd.design.criteria import Walls, limit_of
from tpd.design.result import Bare, Design, DesignStatus, Motions, Verified
from tpd.design.study import Study
from tpd.report.blocks import Note, danger, information, warning
from tpd.report.words import finite_max, source_of_tilts

LARGE_PEAK = 0.7
"""Share of the tilt at which the block topples; a start from rest beyond it is called dangerous."""
GRAVE = 2.0
"""Ratio to the bare block's amplitude above which more rocking at another frequency is a danger."""
LARGE_STROKE = 0.3
"""rad; sin(psi) is 1.5 % below psi there, and falls further with its square."""
SLOW = 0.95
"""Largest Floquet multiplier above which a motion attracts slowly."""
_POINT = 0.5
"""Largest radius of a ball, in lengths of its rod, that counts as a point."""
_TOLERANCE = 0.01
"""Relative difference of two models that agree, unless the method has its own."""


def notes(design: Design, study: Study) -> tuple[Note, ...]:
    """All notes on a design: dangers first, else in the order of the generators below."""
    found = [*_interruptions(design, study), *_responses(design, study), *_searched(design)]
    if design.winner is not None and design.pendulum is not None:
        found += [*_overturning(design, design.winner), *_repeated(design.winner)]
        found += [*_nonlinear(design, design.winner), *_strikes(design, design.winner, design.pendulum)]
        found += [*thick(design.pendulum), *_settled(design.winner), *_starts(design, design.winner)]
    return tuple(sorted(found, key=lambda note: note.severity.value))


def differences(exact: Motions, searched: Motions) -> np.ndarray:
    """Relative differences of the search's model from the exact amplitudes; 0 where neither rocks, infinite
    or NaN where one of the two has no settled amplitude."""
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = searched.amplitude / exact.amplitude - 1.0
    return np.where((searched.amplitude == 0.0) & (exact.amplitude == 0.0), 0.0, relative)


def disagree(design: Design, of: Bare | Verified) -> np.ndarray:
    """Under which conditions the smoothed model of a search and the exact solution give different motions,
    (n,). Other models solve the same equations in the same way, or other equations."""
    if of.searched is None or of.searched.model != "smoothed":
        return np.zeros(len(design.conditions), dtype=bool)
    settled = [np.isin(motions.status, SETTLED) for motions in (of.exact, of.searched)]
    far = ~(np.abs(differences(of.exact, of.searched)) <= getattr(design.method, "tolerance", _TOLERANCE))
    return (settled[0] != settled[1]) | (settled[0] & settled[1] & far)


def _interruptions(design: Design, study: Study) -> Iterator[Note]:
    if design.status is DesignStatus.interrupted:
        yield warning("The search was interrupted; nothing below is the best of the design space.")
    for part in study.left_out:
        yield warning(f"This report goes without {part}: its computation was interrupted.")


def _searched(design: Design) -> Iterator[Note]:
    """Notes on the search as a whole, with or without an answer."""
    if disagree(design, design.bare).any():
        yield warning("The models disagree on the bare block: take its amplitude as a rough one.")
    lost = design.search.screened_overturned
    if lost.any():
        yield information(
            f"Of the designs screened, {np.mean(lost):.0%} overturn the block or reach no settled motion: a "
            "pendulum in the wrong place does harm."
        )
    yield information(
        f"Tilts are those of {source_of_tilts(design)}, by the linear equations of Collini et al. (2016); "
        "the nonlinear equations were solved for the designs that were verified only. Other starts may "
        "settle elsewhere, and an earthquake is not a harmonic motion."
    )


def _overturning(design: Design, winner: Verified) -> Iterator[Note]:
    """Overturning from rest, with the pendulum and without."""
    lost, bare = (m.status == "overturned" for m in (winner.exact, design.bare.exact))
    harmed = np.flatnonzero(lost & ~bare)
    if harmed.size:
        yield danger(
            f"From rest this pendulum OVERTURNS the block under {harmed.size} of {lost.size} conditions that "
            f"it stands without, the first at {design.conditions.label(int(harmed[0]))}."
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
    pairs = [(int(np.sum(lost & ~bare)), int(np.sum(bare & ~lost)))]
    if winner.verdict is not None:
        pairs.append((winner.verdict.worse, winner.verdict.better))
    return any(better > worse and chance_of(better, worse) < SIGNIFICANT for worse, better in pairs)


def _repeated(winner: Verified) -> Iterator[Note]:
    """Overturning in runs beside the one from rest: shakings nearby, and the ensemble."""
    near, verdict = winner.neighbours, winner.verdict
    if near is not None and near.overturned:
        yield danger(
            f"Of {near.tried} shakings within 1 % in amplitude or frequency, {near.overturned} overturn the "
            f"block with this pendulum ({near.overturned_bare} without), from rest."
        )
    if verdict is None:
        return
    if verdict.harms:
        yield danger(
            f"In the ensemble {verdict.worse} runs overturn with the pendulum only, and {verdict.better} "
            "without it only."
        )
    hung, bare = verdict.hung.overturned, verdict.bare.overturned
    yield information(f"Of the ensemble {hung} overturn with the pendulum, {bare} without.")


def _nonlinear(design: Design, winner: Verified) -> Iterator[Note]:
    """Conditions under which the block overturns by the nonlinear equations though the design is offered."""
    lost = [n for n in winner.nonlinear if n.status == "overturned"]
    alone = [n for n in lost if n.bare_status != "overturned"]
    both = [n for n in lost if n.bare_status == "overturned"]
    start = "By the nonlinear equations, from rest, the block overturns with the pendulum at "
    if alone:
        names = ", ".join(design.conditions.label(n.condition) for n in alone)
        yield danger(
            f"{start}{names}, and bare it stands. This is no reason to refuse the design, since by the "
            "linear equations the bare block overturns there: a single run near overturning says little."
        )
    if both:
        names = ", ".join(design.conditions.label(n.condition) for n in both)
        yield warning(f"{start}{names}, and it overturns there without the pendulum as well.")


def _strikes(design: Design, winner: Verified, pendulum: Pendulum) -> list[Note]:
    """At most one note: the first angle at which a bob of steel would strike the block's walls."""
    e, nu = winner.evaluation, design.scene.block.slenderness * design.conditions.column("slenderness")
    settled = winner.exact.stroke + winner.exact.amplitude
    if design.starts != Starts.rest():
        settled = np.concatenate([settled, e.stroke[0] + e.tilt[0] * nu])
    angles = {"once settled": settled, "on the way from rest": winner.exact.peak + winner.exact.peak_stroke}
    largest = {when: finite_max(x) for when, x in angles.items()}
    if winner.verdict is not None:
        runs = winner.verdict.hung
        reach = float(np.quantile(runs.peak_stroke + runs.peak, 0.5, method="inverted_cdf"))
        largest["in half of the ensemble's runs"] = reach if math.isfinite(reach) else 0.0
    limited = limit_of(design.limits, Walls) is not None
    return strikes(design.scene.block, pendulum, largest, limited)[:1]


def strikes(block: Block, pendulum: Pendulum, angles: Mapping[str, float], limited: bool) -> list[Note]:
    """A note for every angle at which a solid ball of steel would strike the block's walls, with a remedy.

    Args:
        block, pendulum: the design.
        angles: between bob and block, rad, by when they are reached: the largest bob angle and the largest
            tilt together, which is never too little.
        limited: whether the search has kept the settled ball off the walls.
    """
    wall, length, ball = 0.5 * block.width, pendulum.length, pendulum.ball_radius

    def clear(room: float) -> str:
        """Largest angle at which so much room (m) to a side is enough, rounded down."""
        return f"{math.floor(1000.0 * math.asin(min(room / length, 1.0))) / 1000.0:g} rad"

    fits = f"up to {clear(wall - ball)}" if ball < wall else "at no angle"
    hint = (
        "the limit on walls holds for the settled motion only"
        if limited
        else "`--stroke` limits the settled angle of the rod, `--walls` keeps a settled ball off the walls"
    )
    return [
        danger(
            f"{when[0].upper() + when[1:]} the bob may swing {swing:.3g} m out of the block's axis, and the "
            f"block's half width is {wall:.3g} m. Inside it, a solid ball of steel of this mass ({ball:.3g} "
            "m in radius) would STRIKE the walls, which nothing here computes. On a rod of this length it "
            f"stays off them {fits} between rod and block, a point up to {clear(wall)} ({hint})."
        )
        for when, angle in angles.items()
        if (swing := length * math.sin(min(angle, 0.5 * math.pi))) + ball > wall
    ]


def thick(pendulum: Pendulum) -> list[Note]:
    """A note where a solid ball of steel is no point on its rod."""
    share = pendulum.ball_radius / pendulum.length
    if share <= _POINT:
        return []
    return [
        warning(
            f"A solid ball of steel of this mass is {pendulum.ball_radius:.3g} m in radius, on a rod of "
            f"{pendulum.length:.3g} m: no point, as is assumed here. Its own moment of inertia adds "
            f"{0.4 * share**2:.0%} to that of the point"
            + (", and it is thicker than the rod is long." if share >= 1.0 else ".")
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


def _starts(design: Design, winner: Verified) -> Iterator[Note]:
    """Starts, and conditions, in which the search's tilts do not tell the whole motion."""
    e = winner.evaluation
    if winner.source == "path":
        yield warning(
            "The best design at which a search ended was refused, see below; a search passed through this "
            "one. It is not the best of its neighbours, and a neighbour may be refused as well."
        )
    if np.any(e.lost):
        yield warning(
            f"From {np.mean(e.lost):.1%} of the starts the block overturns with the pendulum, from "
            f"{np.mean(design.bare.evaluation.lost):.1%} without: tilts are those of the others."
        )
    if np.any(e.unsettled):
        yield warning(
            f"From {np.mean(e.unsettled):.1%} of the starts the motion does not repeat, or is about to "
            "vanish: it counts by its largest tilt, and the search had no derivative there."
        )
    if design.starts == Starts.any() and not np.all(e.attracts):
        yield warning(
            f"Under {np.sum(~e.attracts)} of {e.attracts.size} conditions no symmetric motion attracts."
        )


def _responses(design: Design, study: Study) -> Iterator[Note]:
    """Frequencies near the design's at which the block overturns or rocks more."""
    if study.responses is None or len(study.responses) < 2:
        return
    bare, hung = study.responses
    away = np.abs(hung.frequency / design.scene.motion.frequency - 1.0)
    lost, lost_bare = hung.status == "overturned", bare.status == "overturned"
    harmed = np.flatnonzero(lost & ~lost_bare)
    if harmed.size:
        i = harmed[np.argmin(away[harmed])]
        yield danger(
            f"At {hung.frequency[i]:.4g} Hz, same base amplitude, from rest, this pendulum OVERTURNS the "
            f"block; without it the motion ends {bare.status[i]}. The design is for its one frequency."
        )
    yield from _rocks_more(bare, hung, away)
    yield information(
        f"Of {lost.size} frequencies tried from {hung.frequency[0]:.4g} to {hung.frequency[-1]:.4g} Hz, "
        f"{lost.sum()} overturn the block with the pendulum and {lost_bare.sum()} without."
    )


def _rocks_more(bare: Response, hung: Response, away: np.ndarray) -> Iterator[Note]:
    """The nearest frequency at which the block rocks gravely more or, if there is none, somewhat more."""
    settled = np.isin(bare.status, SETTLED) & np.isin(hung.status, SETTLED)
    worse = np.flatnonzero(settled & (hung.amplitude > 1.02 * bare.amplitude))
    if not worse.size:
        return
    gravely = worse[hung.amplitude[worse] > GRAVE * bare.amplitude[worse]]
    chosen = gravely if gravely.size else worse
    i = chosen[np.argmin(away[chosen])]
    text = (
        f"At {hung.frequency[i]:.4g} Hz the block rocks more with this pendulum ({hung.amplitude[i]:.4g} "
        f"rad) than without ({bare.amplitude[i]:.4g} rad)."
    )
    yield danger(text) if gravely.size else warning(text)
