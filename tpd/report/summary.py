"""Summary of a design as data: verdict, notes, rows, comparison, and commands for further questions."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tpd.answers.paired import Change, PairedRuns
from tpd.core.formatting import number, pair_of, per_cent, percent, unanswered
from tpd.design.alternatives import alternatives
from tpd.design.as_built import Details
from tpd.design.design import Design
from tpd.design.problem import Problem
from tpd.design.reasons import CERTAIN, DesignStatus
from tpd.design.variations import WIDENING
from tpd.limits import LABELS, MEASURED, Clearance
from tpd.report import words
from tpd.report.blocks import Cell, Group, Note, Row, Summary, Table, danger, note
from tpd.report.notes import notes
from tpd.scene.conditions import MEASURE_NAMES

_ALIKE = 0.02
"""Difference of two shares below which they are called alike."""
_RANGES = 4
"""Largest number of ranges of levels in the answer."""
_REASONS = 3
"""Largest number of reasons in the answer."""
_USED = 0.95
"""Share of a limit that a design must use for the limit to be called active."""
_LARGEST = 2
"""Number of variations in the row on what the benefit depends on."""


def summary(design: Design, details: Details, directory: Path | None = None) -> Summary:
    """Return the summary of a design.

    Args:
        design: the answer of `optimise`.
        details: the answer of `tpd.details`. Rows whose results it does not have are left out.
        directory: folder of the report, for the commands.
    """
    # An owner who reads only the beginning learns the verdict, what is cheaper, and what to buy.
    groups = {
        "What would change it": _refused(design),
        "Compare first": _compared(design, details),
        "Build": _pendulum(design, details),
        "": _facts(design, details),
    }
    rows = {title: tuple(row for row in every if row[1]) for title, every in groups.items()}
    return Summary(
        verdict=verdict(design, details),
        notes=notes(design, details),
        table=None if design.runs is None else overview(design, design.runs),
        groups=tuple(Group(title, every) for title, every in rows.items() if every),
        commands=() if directory is None else tuple(_commands(design, directory)),
    )


def verdict(design: Design, details: Details | None = None) -> Note:
    """Return the verdict of the design, with a caution if the benefit depends on the energy losses."""
    caution = ""
    # The energy losses of a real block are uncertain, so a benefit must not depend on the model of them.
    for case in () if details is None else details.of("losses"):
        # Fewer runs alone can make a benefit insignificant. The same runs must also show a difference.
        if (x := case.difference) and x.high < 0.0 and not case.runs.reduction(case.measure)[1]:
            by, low, high = (per_cent(-value) for value in (x.mean, x.high, x.low))
            caution += (
                f" THE BENEFIT DEPENDS ON THE ENERGY LOSSES: with {case.words} "
                f"the reduction of the {MEASURED[case.measure]} is not significant, and it is smaller by "
                f"{by} points (95 % interval {low} to {high}) than with the stated losses."
            )
    return (danger if design.is_danger else note)(design.verdict + caution)


def overview(design: Design, runs: PairedRuns) -> Table:
    """Return the runs that overturn in both cases, all and by start or level, and the tilt."""
    rows = list[tuple[Cell, ...]]()
    every = runs.change("overturned")
    falls = every.without_pendulum > 0.0 or every.with_pendulum > 0.0
    if falls:
        way = "more" if every.with_pendulum > every.without_pendulum else "fewer"
        rows.append(("runs that overturn", *_shares(every, 1), _reduced(runs, "overturning", way)))
        for part, of in design.problem.parts_of(runs, _RANGES):
            cases = runs.without_pendulum, runs.with_pendulum
            rows.append((f"  {part}", *(percent(case.is_overturned[of].mean(), 1) for case in cases), ""))
    # The mean of all runs falls mainly because fewer overturn. The median shows the runs that survive.
    name = "median tilt" if falls and design.best and design.best.measure != "tilt" else "mean tilt"
    tilt, remark = runs.change(name), ""
    if name == "mean tilt":
        less = "less" if tilt.with_pendulum <= tilt.without_pendulum else "more"
        remark = _reduced(runs, "tilt", less)
    elif abs(tilt.with_pendulum - tilt.without_pendulum) < _ALIKE:
        remark = "alike in runs that do not overturn"
    rows.append((f"{name} / toppling tilt", *_shares(tilt, 0), remark))
    caption = f"{runs.description}. In a mean, a run that overturns counts as 100 %."
    return Table(("", "without", "with pendulum", ""), tuple(rows), caption + unanswered(runs.undecided))


def _shares(x: Change, digits: int) -> tuple[str, str]:
    return percent(x.without_pendulum, digits), percent(x.with_pendulum, digits)


def _reduced(runs: PairedRuns, measure: str, way: str) -> str:
    """Return the reduction of a measure with its interval, in a few words; empty if it is unknown."""
    size, significant = runs.reduction(measure)
    if math.isnan(size.mean):
        return ""
    less, by, around = size.fall_in_words()
    return f"{by} {way}{around}{'' if significant or not less else ', not significant'}"


def _compared(design: Design, details: Details) -> Iterator[Row]:
    """Yield what to compare with the pendulum: measures without one, a wider block, the rule of thumb."""
    if design.status in (DesignStatus.no_uplift, DesignStatus.slides):
        return
    yield "no pendulum", alternatives(design.problem).brief
    if details.of("base"):
        yield "wider block", wider_bases(details)
    # Under earthquakes the pendulum of the rule is an answer, and not only a comparison.
    if design.rule is not None:
        yield from words.rule_and_search(design)
    elif details.first_guess is not None:
        yield "rule of thumb", words.first_guess(details.first_guess, design.problem.allowed)


def _refused(design: Design) -> Iterator[Row]:
    """Yield the reasons against a pendulum that the verdict does not state, and what to change."""
    yield from (("reason", text) for text in design.status.other(design.refusals)[:_REASONS])
    if design.status in (DesignStatus.not_recommended, DesignStatus.none_feasible):
        yield "inputs", design.remedy
        # A design that came near shows how far the limits or bounds are from an answer.
        if design.nearest is not None:
            near = design.problem.pendulum(design.nearest)
            yield "nearest", f"{words.point(near, 3, 3)}, damping ratio {float(near.damping_ratio):.2g}"
        yield "limits", active_limits(design)


def _facts(design: Design, details: Details) -> Iterator[Row]:
    """Yield what the benefit depends on, and what the runs leave out."""
    # The last rows are the first that a long answer leaves out.
    yield "part fails", if_a_part_fails(details)
    yield "depends on", depends_on(details, words.range_of_mass(design))
    if design.runs is not None:
        needed = design.sliding.needed if design.sliding else math.nan
        friction = "sliding" if math.isnan(needed) else f"sliding (needs friction {number(needed, 2)})"
        yield "not simulated", f"{friction}, wall contact, vertical shaking, the second direction"
        yield "annual rate", ". ".join(design.problem.yearly(design.runs.annual_rates)[:1])


def rows_of(design: Design, details: Details) -> Iterator[Row]:
    """Yield further rows of the report: block, excitation, conditions, starts, limits and friction."""
    block = design.scene.block
    yield "block", f"{words.block_of(block)}; topples at {words.toppling(block)}; {words.losses(block)}"
    yield "excitation", design.problem.words.excitation
    yield "uplift", design.problem.at_rest.lifting_in_words
    yield "sliding", design.problem.at_rest.sliding_in_words
    # Without further conditions the design is for the excitation of the scene only.
    yield "conditions", "; ".join(design.conditions.description) or "only the excitation above"
    if design.runs is not None and design.best is not None:
        yield "required", required(design)
        yield "benefit", design.result
        yield "runs", f"{design.problem.words.starts}; {design.problem.words.duration}"
        if first := design.problem.first_overturning(design.runs.without_pendulum):
            with_it = design.problem.first_overturning(design.runs.with_pendulum)
            yield "pulses", f"without a pendulum {first}; with it {with_it}"
        yield from (("rate", text) for text in design.problem.yearly(design.runs.annual_rates))
        yield from (("level", text) for text in at_levels(design.problem, design.runs))
    yield from (("reason", text) for text in design.status.other(design.refusals))
    yield "no pendulum", str(alternatives(design.problem))
    if design.pendulum is not None:
        yield "limits", active_limits(design)
    # A base that slides is one of the dangers, which come first.
    if design.sliding and not design.sliding.slides:
        yield "friction", design.sliding.sentence
    # The first response is without the pendulum, and the second one, with it, exists only if
    # there is a pendulum.
    if len(details.responses) > 1:
        ends = details.responses[0].frequency[[0, -1]]
        yield "nearby", words.overturned_between(details.responses, *ends)


def required(design: Design) -> str:
    """Return what a recommended pendulum must keep."""
    of, measure = design.problem.requirements, (design.best and design.best.measure) or "overturning"
    least, low, worse = (percent(float(x)) for x in (of.at_least, CERTAIN * of.at_least, of.worse))
    limits = f"at most {percent(design.problem.allowed)} of the surviving runs beyond a limit"
    return (
        f"the {MEASURED[measure]} falls by at least {least} (lower end of the 95 % interval above {low}); "
        f"no part of the runs has a mean tilt that is significantly higher by more than {worse}; {limits}"
    )


def wider_bases(details: Details) -> str:
    """Return a clause on the widening of the base that is worth the pendulum, or on wider bases."""
    if (worth := details.equivalent_widening) is not None:
        # The report has a table with the wider bases.
        return f"{words.wider(worth)} has the same effect"
    bases = (of for of in details.of("base") if of.share <= WIDENING)
    shares = (f"{percent(of.runs.change('overturned').with_pendulum, 1)} ({of.words})" for of in bases)
    return f"overturned in the same runs: {', '.join(shares)}"


def depends_on(details: Details, alike: str = "") -> str:
    """Return the masses that perform equally well, and the variations that reduce the benefit most in linear
    runs; empty without any."""
    rows = [(x, of.words) for of in details.of("quantity", "losses", "width") if (x := of.difference)]
    smaller = sorted((x.mean, of) for x, of in rows if x.high < 0.0)
    parts = [f"little on the mass ({alike} are as good)"] if alike else []
    parts += [f"{of}: {per_cent(-mean)} points less" for mean, of in smaller[:_LARGEST]]
    if rows and not smaller:
        parts.append("nothing varied reduces the benefit significantly")
    return "; ".join(parts)


def if_a_part_fails(details: Details) -> str:
    """Return the runs that overturn, or the mean tilt, if a part fails; empty without a pendulum."""
    # A case with more overturned runs than without a pendulum is also a danger, see `tpd.report.notes`.
    failures, parts = details.of("failure"), list[str]()
    if not failures:
        return ""
    name = "mean tilt" if failures[0].measure == "tilt" else "overturned"
    for of in failures:
        x = of.runs.change(name)
        kind = "more" if x.low > 0.0 else "fewer" if x.high < 0.0 else "no significant difference"
        parts.append(f"{of.words}, {percent(x.with_pendulum, 1)} ({kind})")
    # A held bob can make the block too wide for its centroid.
    if all(of.name != "hinge" for of in failures):
        parts.append("hinge stuck, not simulated: that block is outside of the range of the equations")
    without = percent(failures[0].runs.change(name).without_pendulum, 1)
    return f"{name}: {'; '.join(parts)}; without a pendulum {without}"


def at_levels(problem: Problem, runs: PairedRuns) -> Iterator[str]:
    """Yield the lines of a table of several levels of ground motions: the shares of the counted runs that
    overturn with and without the pendulum."""
    counted = True if runs.counted is None else runs.counted
    # Pulses have few runs at each level.
    levels = () if problem.first_overturning(runs.without_pendulum) else problem.levels.items()
    if levels:
        count = int(np.sum(next(iter(levels))[1] & counted))
        measure = MEASURE_NAMES[problem.conditions.intensity]
        yield f"{measure}: share of {count} runs that overturn with (without) the pendulum"
    for name, rows in levels:
        cases = (x.of(rows & counted) for x in (runs.with_pendulum, runs.without_pendulum))
        pendulum, without = (percent(x.share_overturned.value, 1) for x in cases)
        yield f"{name}: {pendulum} ({without})"


def _pendulum(design: Design, details: Details) -> Iterator[Row]:
    """Yield the rows on the pendulum as it is built."""
    build, pendulum = details.build, design.pendulum
    if pendulum is None:
        return
    point = f"as a point {words.point(pendulum, 3, 3)}"
    # A bob of low density can be too large for its rod: then no body is equivalent to the point mass.
    if build is None or not math.isfinite(build.mass):
        yield "bob", f"no body with this shape and density is equivalent; {point}"
        return
    size = f"{build.bob}, {number(build.bob_width, 3)} m wide"
    yield "bob", f"{number(build.mass, 3)} kg, {size} ({point})"
    hertz, period = number(build.frequency, 3), number(1.0 / build.frequency, 3)
    yield "rod", f"{number(build.rod, 3)} m from the hinge to the bob's centre: {hertz} Hz, {period} s"
    zeta = number(pendulum.damping_ratio, 3)
    breaks = f"breakaway moment at most {number(build.breakaway, 2)} N m"
    yield "hinge", f"damper {number(build.damping, 3)} N m s/rad (damping ratio {zeta}); {breaks}"
    # If the search ignored the walls, the bob may pass through them, and its distance has no meaning.
    if design.best is not None and not math.isnan(design.best.over_limit):
        allowed, used = percent(design.problem.allowed, 1), design.usage.get(Clearance.name, math.nan)
        share = percent(design.best.over_limit, 1)
        wall = "" if math.isnan(used) else f"{pair_of(used, 1.0, 0, percent)[0]} of the way to the wall; "
        yield "limits", f"{wall}exceeded in {share} of surviving runs ({allowed} allowed)"


def active_limits(design: Design) -> str:
    """List the active limits, and the bounds of the search that the design lies on."""
    shares = {LABELS.get(name, name): x for name, x in design.usage.items() if x >= _USED}
    active = [f"{label}, utilisation {pair_of(x, 1.0, 0, percent)[0]}" for label, x in shares.items()]
    listed = "; ".join([*active, *design.at_bounds])
    return f"active: {listed}" if listed else "no limit is active"


def _commands(design: Design, directory: Path) -> Iterator[tuple[str, str]]:
    """Yield rows on questions that the search did not answer, with commands, and on the files."""
    at = shlex.quote(str(directory))
    # Under ground motions the search itself used earthquakes, so these checks are offered for harmonic jobs
    # only.
    if design.pendulum is not None and not design.problem.has_earthquakes:
        yield "next", f"tpd fragility {at} --records fema-p695; tpd check {at} --engine mujoco"
    yield "report", f"{directory / 'report.html'}"
    yield "repeat", repeat(directory)


def repeat(directory: Path) -> str:
    """Return the command that repeats the search of the report in a folder."""
    # The quotes allow blanks in the name of the folder.
    scene, to = shlex.quote(str(directory / "scene.toml")), shlex.quote(f"{directory}-again")
    return f"tpd optimise {scene} --out {to}"
