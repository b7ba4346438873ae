"""Variations of a design: how much its benefit depends on one thing, in paired runs.

The list of variations has uncertain quantities, other energy losses, a narrower base, a lower hinge, other
sets of records, parts that fail, and wider bases without a pendulum. Each variation is followed in the runs
of its reference, with the same excitation, initial states and scatter. A report shows the difference from the
reference.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import NamedTuple

import numpy as np

from tpd.answers.paired import PairedRuns
from tpd.answers.statistics import LEVEL, Interval, added_up
from tpd.core.formatting import number, percent
from tpd.core.progress import Progress, unreported
from tpd.design.problem import Problem, Variation, VariationKind
from tpd.design.reasons import OFFERED, VALIDATED
from tpd.design.validate import Validation
from tpd.records.sets import SETS, fema_p695
from tpd.scene.conditions import Conditions
from tpd.scene.ground_motion import earthquakes_of, events_of
from tpd.scene.scene import HOUSNER, Block, Scene, paper_scene
from tpd.theory.equations import Terms
from tpd.theory.free_rocking import equivalent_friction

_QUANTITIES = {
    "impact_loss": (0.5, "energy loss of an impact, 1 - e,"),
    "friction": (0.5, "friction k of the rocking contact"),
    "slenderness": (0.05, "slenderness ν"),
    "centroid": (0.02, "height of the centroid"),
    "amplitude": (0.1, "amplitude of the excitation"),
    "frequency": (0.05, "frequency of the excitation"),
    "mass": (0.05, "mass of the bob"),
    "length": (0.05, "rod, hinge to the bob's centre,"),
    "damping": (0.4, "moment of the damper"),
}
"""Share by which each quantity is varied, and its words. The loss of an impact is 1 - e."""
_OF_PENDULUM = "mass", "length", "damping"
"""Quantities of the pendulum, with which the block without a pendulum stays as it is."""
_OF_SET = re.compile(r"RSN\d+/.* \d{4}/")
"""Beginning of the name of a record of `fema_p695`."""
BEARING = 0.9
"""Share of its base on which the block rocks in the comparison with a narrower base."""
LEVELS = (1.5, 2.0, 3.0, 4.0)
"""Peak accelerations of the records of other sets over the acceleration that lifts the block."""
WIDENING, _SMALL_WIDENINGS, _LARGE_WIDENINGS = 0.2, (0.05, 0.1), (0.35, 0.5)
"""Relative widenings of the base. The wider bases are followed only if the usual one is not worth as much as
the pendulum, and otherwise the narrower ones."""
_EQUIVALENT_TILT = 1.0 / 3.0
"""Tilt over nu at which an equivalent friction and impacts lose the same energy."""
_NO_DAMPER = 0.02
"""Damping ratio that is left by friction and air if the damper fails."""
_SEED = 3
"""Number of the seed of the linear runs; trials and validation have smaller numbers."""
_SAMPLES = 1000
"""Number of bootstrap samples."""


class Dependence(NamedTuple):
    """Paired runs of one variation, and the difference of the reduction from that of the reference."""

    kind: VariationKind
    """Kind of the variation."""
    name: str
    """Name of what changes: a quantity in `tpd.scene.conditions.FACTORS` or "impact_loss" for 1 - e, the
    kinds of losses, or the set of records; else empty."""
    share: float
    """Relative change of a quantity or of the width, or the level of the records in `LEVELS`; else 0."""
    words: str
    """Words for the varied design."""
    runs: PairedRuns
    """Runs with and without the pendulum. A wider base has no pendulum: its runs are `with_pendulum`, and
    those of the stated block `without_pendulum`."""
    measure: str
    """Measure of the reduction, "overturning" or "tilt"; empty if no pendulum is recommended."""
    difference: Interval | None
    """Reduction of this measure minus the reduction of the reference, in the same runs. The reference of a
    wider base is the pendulum in its validation runs, and otherwise the stated design. None without a
    reference, as for a failure."""


class EquivalentWidening(NamedTuple):
    """Widening of the base with which the block without a pendulum does as well as the stated block with
    it."""

    widening: float
    """Relative increase of the width; 0 if the pendulum does not help, and infinite if it is more than
    `most`."""
    low: float
    """Lower end of the 95 % interval, by a paired bootstrap."""
    high: float
    """Upper end of the interval."""
    most: float
    """Largest widening that was followed."""
    measure: str
    """Measure that is equal, "overturning" or "tilt"."""


def dependences(
    problem: Problem, best: Validation | None, progress: Progress = unreported
) -> tuple[Dependence, ...]:
    """Follow all variations of the best design of a search.

    Without a recommended pendulum there are only wider bases, and without validation runs there are none.

    Args:
        problem: problem of the design.
        best: the best design with its validation; None if there is none.
        progress: function of (stage, variations done, total).
    """
    if best is None:
        return ()
    # The list of wider bases depends on the results, so that its rows come last.
    fixed = [*_linear(problem, best), *_other_records(problem, best), *_failures(problem, best)]
    rows = list[Dependence]()
    for varied in chain(fixed, _wider_bases(problem, best, rows)):
        progress("variations", len(rows), len(fixed) + 3)
        stated, measure = rows[0].runs if rows else None, measure_of(best)
        runs = pairs(problem, best, varied, stated)
        # A wider base is an alternative to the pendulum, and not a change of the design.
        reference = best.runs if varied.kind == "base" else stated
        # A failure is compared with no pendulum.
        reference = None if varied.records or not measure or varied.kind == "failure" else reference
        difference = reference and runs.reduction_minus(reference, measure)
        rows.append(Dependence(*varied[:4], runs, measure, difference))
    progress("variations", 1, 1)
    # Bases are followed in another order than that of their widths.
    return tuple(sorted(rows, key=lambda row: row.share if row.kind == "base" else -1.0))


def measure_of(best: Validation | None) -> str:
    """Return the measure by which variations are compared; empty if no pendulum is recommended."""
    return "" if best is None or best.status not in OFFERED else best.measure_of_runs


def pairs(
    problem: Problem, best: Validation, varied: Variation, stated: PairedRuns | None = None
) -> PairedRuns:
    """Return the paired runs of a validated design under a variation.

    Args:
        problem: problem of the design.
        best: the design.
        varied: the variation.
        stated: runs of the stated design, of which those without a pendulum are used again for a variation of
            the pendulum alone.
    """
    if varied.kind in ("base", "failure"):
        assert best.runs is not None
        # Another block has no pendulum. The seed is that of the quoted runs, which have the same initial
        # states and the same scatter.
        design = best.design if varied.scene is None else None
        other = problem.validation_runs(design, best.runs.with_pendulum.seed, varied)
        return replace(best.runs, with_pendulum=other)
    if varied.records:
        # The stated block without scatter, as in a fragility.
        cluster = earthquakes_of(varied.records)
        peak = varied.share * problem.at_rest.uplift * float(problem.scene.gravity)
        factors = np.array([[peak / float(record.pga)] for record in varied.records])
        runs = problem.runs_under([best.pendulum, None], varied.records, factors, brief=True)
        one, other = (runs.of(np.array(i)).reshape(-1) for i in range(2))
        own = {"group": np.zeros(len(cluster), int), "labels": (), "cluster": cluster}
        return PairedRuns(with_pendulum=one, without_pendulum=other, **own)
    # A bob without mass does not act on the block, whatever the pendulum is.
    if stated and (varied.kind == "hinge" or varied.name in _OF_PENDULUM):
        varied = varied._replace(without_pendulum=stated.without_pendulum)
    design, seed = problem.ratios(best.pendulum), problem.run_seed(_SEED)
    return (varied.problem or problem).paired_runs(design, seed, varied)


def _linear(problem: Problem, best: Validation) -> Iterator[Variation]:
    """Yield the stated design, and the variations that are compared with it by the linear model."""
    if not measure_of(best):
        return
    scene, block = problem.scene, problem.scene.block
    e, nu, k = (float(x) for x in (block.velocity_ratio, block.slenderness, block.friction))
    linear = partial(Variation, equations=Terms.linear.value)
    yield linear(words="all as stated")
    present = {"impact_loss": e != 1.0, "friction": k}
    for name, (width, label) in _QUANTITIES.items():
        for share, way in ((-width, "lower"), (width, "higher")) if present.get(name, True) else ():
            varied = linear("quantity", name, share, f"{label} {percent(width)} {way}")
            if name == "impact_loss":
                # A factor on e could exceed 1, and e may follow from the shape of the block. Vary the loss
                # 1 - e of the block instead, and fix the resulting e.
                own = {"restitution": 1.0 - (1.0 - e) * (1.0 + share)}
            elif name == "centroid":
                # The radius of gyration stays as it is.
                own = {"centroid_height": float(block.centroid) * (1.0 + share)}
                own["radius_of_gyration"] = float(block.gyration)
            else:
                yield varied._replace(more=Conditions({name: np.array([1.0 + share])}))
                continue
            # A block at the end of the range of the equations has no variation beyond it.
            with suppress(ValueError):
                yield varied._replace(scene=replace(scene, block=replace(block, **own)))
    for name, other in loss_models(scene).items():
        if other != block:
            size = f"k = {number(other.friction, 3)}, e = {number(other.velocity_ratio, 4)}"
            words = f"losses by {name} ({size})"
            yield linear("losses", name, words=words, scene=replace(scene, block=other))
    # nu is 90 % of its value. Where rho does not follow nu it changes so little that it keeps its value.
    words = f"{percent(BEARING)} of the base (lifts at {number(BEARING * nu + k, 3)} g)"
    narrow = Conditions({"slenderness": np.array([BEARING])})
    yield linear("width", share=BEARING - 1.0, words=words, more=narrow)
    # Only the height of the hinge changes: the design keeps its rod, its damping ratio and its runs.
    middle = 0.5 * float(block.height)
    if block.frame_width is None and best.pendulum.length <= middle < best.pendulum.hinge_in(block):
        lower = replace(problem, space=replace(problem.space, hinge_height=middle))
        yield linear("hinge", words="hinge at mid-height", problem=lower)


def loss_models(scene: Scene) -> dict[str, Block]:
    """Return the block with the losses of friction, of impacts, and of both.

    The block keeps its own losses where it has them. Otherwise the friction is one that loses as much energy
    as the impacts, and the impacts are Housner's.
    """
    block = scene.block
    # The losses are those of the block without a pendulum and do not depend on the excitation, so any
    # harmonic serves.
    p = Scene(block, paper_scene().excitation, scene.gravity).parameters()
    e = float(block.velocity_ratio)
    k = float(block.friction)
    # A block without losses at impacts gets Housner's, and one without friction the equivalent friction.
    impacts = HOUSNER if e == 1.0 else block.restitution
    friction = k or float(equivalent_friction(p, _EQUIVALENT_TILT * float(p.nu))) if e < 1.0 else k
    return {
        "friction only": replace(block, friction=friction, restitution=1.0),
        "impacts only": replace(block, friction=0.0, restitution=impacts),
        "friction and impacts": replace(block, friction=friction, restitution=impacts),
    }


def _other_records(problem: Problem, best: Validation) -> Iterator[Variation]:
    """Yield the sets of FEMA P695 of which a recommended design used no record, at each level.

    There are none if the design used no such set, or if the records are not installed.
    """
    motions = [motion for group in problem.groups for motion in group.motions]
    names = {getattr(motion, "name", "") for motion in motions}
    if best.status not in VALIDATED or not any(map(_OF_SET.match, names)):
        return
    for name in SETS:
        try:
            records = tuple(fema_p695(name))
        except ImportError:
            return
        # A design does not transfer to records that it used itself.
        if not names.isdisjoint(record.name for record in records):
            continue
        # Other stations of an earthquake that the design used are not independent of it.
        events = events_of([*motions, *records])
        quakes, used = set(events[len(motions) :]), set(events[: len(motions)])
        count = f"{len(quakes & used)} of {len(quakes)} earthquakes used at other stations"
        for level in LEVELS:
            words = f"{name}, PGA {level:g} times that of uplift ({count})"
            yield Variation("records", name, level, words, records=records)


def _failures(problem: Problem, best: Validation) -> Iterator[Variation]:
    """Yield the recommended pendulum with a stuck hinge and without its damper, in the validation runs."""
    if not measure_of(best) or best.runs is None:
        return
    # Few pendulums are maintained for decades. Neither failure needs a model: a stuck hinge makes one block,
    # and without a damper only friction and air remain.
    with suppress(ValueError):
        stuck = problem.scene.block.carrying(best.pendulum)
        yield Variation("failure", "hinge", words="hinge stuck", scene=replace(problem.scene, block=stuck))
    if (zeta := float(best.pendulum.damping_ratio)) > _NO_DAMPER:
        none = Conditions({"damping": np.array([_NO_DAMPER / zeta])})
        words = f"damper lost ({_NO_DAMPER:g})"
        yield Variation("failure", "damper", words=words, more=none)


def _wider_bases(problem: Problem, best: Validation, rows: Sequence[Dependence]) -> Iterator[Variation]:
    """Yield wider bases in the validation runs, until one is worth as much as the pendulum.

    Args:
        problem: problem of the design.
        best: the design.
        rows: the results so far, which include those of the bases before.
    """
    # Few widths are followed, because each takes as long as a part of the validation.
    for widening in (WIDENING, *_SMALL_WIDENINGS, *_LARGE_WIDENINGS) if best.runs else ():
        worth = equivalent_widening(best, rows)
        is_short = worth is not None and math.isinf(worth.widening)
        # The equations do not hold for a block that is too wide.
        with suppress(ValueError):
            block = problem.scene.block.widened(1.0 + widening)
            if widening == WIDENING or is_short == (widening > WIDENING):
                words = f"base {percent(widening)} wider, {number(block.width)} m, no pendulum"
                yield Variation("base", "", widening, words, scene=replace(problem.scene, block=block))


def equivalent_widening(best: Validation | None, rows: Sequence[Dependence]) -> EquivalentWidening | None:
    """Return the widening of the base that is worth as much as the pendulum in its validation runs.

    The measure is interpolated linearly between the wider bases among the rows. The narrowest base that is as
    good counts. The bootstrap draws the independent runs, or the earthquakes, again, for all bases and the
    pendulum together. The result is None without a recommended pendulum, and without a base or a run that has
    an answer in all cases.
    """
    bases = sorted((row for row in rows if row.kind == "base"), key=lambda row: row.share)
    measure, runs = measure_of(best), best and best.runs
    if runs is None or not (measure and bases):
        return None
    # Columns: with the pendulum, as it is, and on each wider base.
    cases = [runs.with_pendulum, runs.without_pendulum, *(base.runs.with_pendulum for base in bases)]
    values = np.array([x.severity if measure == "tilt" else 1.0 * x.is_overturned for x in cases])
    # A run counts only if it has an answer in all cases.
    answered = ~np.any([x.is_unanswered for x in cases], axis=0)
    answered &= True if runs.counted is None else runs.counted
    sums = added_up(values.T[answered], None if runs.cluster is None else runs.cluster[answered])
    if not (n := len(sums)):
        return None
    rng, widths = np.random.default_rng(runs.with_pendulum.seed), [0.0, *(base.share for base in bases)]
    # The first sample is that of the runs themselves.
    weights = np.concatenate([np.ones((1, n)), rng.multinomial(n, np.full(n, 1.0 / n), _SAMPLES)])
    # A wider base counts as at least as good as a narrower one. The slight slope makes the values increase
    # for the interpolation, and selects the first of equal ones.
    slope = 1e-9 * np.arange(len(widths))
    samples = [
        np.interp(-pendulum, slope - np.minimum.accumulate(others), widths, right=np.inf)
        for pendulum, *others in weights @ sums
    ]
    low, high = np.quantile(samples[1:], [0.5 * (1.0 - LEVEL), 0.5 * (1.0 + LEVEL)], method="nearest")
    ends = float(samples[0]), float(low), float(high)
    return EquivalentWidening(*ends, widths[-1], measure)
