"""The answer of `optimise` in a few lines, for the terminal and for the first screen of the HTML page."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

from tpd.answers.paired import PairedRuns
from tpd.core.formatting import aligned, compared, number
from tpd.design.as_built import Details, build_of
from tpd.design.assess import alternatives, needless
from tpd.design.design import Design
from tpd.design.problem import Problem
from tpd.design.reasons import DesignStatus
from tpd.limits import LABELS, Clearance, limit_of
from tpd.report import words
from tpd.report.blocks import Note, Severity, danger, note, wrapped
from tpd.report.notes import notes
from tpd.theory.no_uplift import SLIDES

MOST = 21
"""Largest number of lines. The command prints up to nine lines on block and motion before the search, so
that the whole output has at most thirty lines."""
_NAME = 14
"""Width of the column with the names of the rows."""
_USED = 0.95
"""Share of a limit that a design must use for the limit to be called active."""
_ALONE = "block", "motion", "lifts", "slides"
"""Rows about the block without a pendulum, which the command prints before the search."""
_REASONED = DesignStatus.not_recommended, DesignStatus.none_feasible, DesignStatus.undecided
"""Statuses for which the first reason is more informative than the sentence of the status."""


def answer(
    design: Design, details: Details | None = None, directory: Path | None = None, most: int = MOST
) -> str:
    """Return the answer for the terminal: verdict, pendulum, benefit and active limits.

    The rows on block and motion are left out, because the command prints them before the search.

    Args:
        design: the answer of `optimise`.
        details: the answer of `tpd.details`. Without this argument, rows that need further runs are left out.
        directory: folder of the report, for the commands at the end.
        most: largest number of lines.
    """
    # The pendulum as built needs only a few motions, so it is always shown.
    details = Details(build=build_of(design)) if details is None else details
    # Verdict and dangers come first, because the last lines are the first to be left out.
    first = [verdict(design, details), *dangers(design, details)]
    parts = [wrapped(entry.marked) for entry in first]
    rows = [pair for pair in pairs(design, details) if pair[0] not in _ALONE]
    runs, indent, has_table = design.runs, " " * _NAME, False
    for name, text in rows:
        # The table of results stands between the pendulum and the limits.
        if runs is not None and name in ("clearance", "runs", "reason", "limits") and not has_table:
            has_table, table = True, words.comparison(runs)
            cells = [indent + line for line in aligned([table.head, *table.cells])]
            parts.append([*cells, *wrapped(table.caption, indent, indent)])
        parts.append(_named(text, name))
    last = [line for name, text in _more(design, directory) for line in _named(text, name)]
    # A long list of reasons must not hide the last lines, which say where the report is. Only whole rows are
    # left out, because half of a sentence can mean the opposite of the whole.
    if sum(map(len, parts)) + len(last) > most:
        while len(parts) > 1 and sum(map(len, parts)) + len(last) >= most:
            parts.pop()
        last = [indent + "(more in the report)", *last]
    return "\n".join([line for part in parts for line in part] + last)


def _named(text: str, name: str) -> list[str]:
    """Return the lines of a row: its name, and its text beside it."""
    return wrapped(text, f"  {name:<{_NAME - 2}}", " " * _NAME)


def verdict(design: Design, details: Details | None = None) -> Note:
    """Return the verdict: recommended with its benefit, or the reason why not.

    The verdict is a danger if the pendulum that comes nearest makes the block overturn more often, or if its
    bob touches a wall.
    """
    runs, best = design.runs, design.best
    if design.status is DesignStatus.recommended and runs is not None and best is not None:
        head, caution = "RECOMMENDED for the stated conditions", ""
        if missing := words.missing(design):
            head = f"NOT TO BE BUILT AS IT IS, because the search {' and '.join(missing)}"
        losses = () if details is None else details.losses
        # The energy losses of a real block are uncertain, so a benefit must not depend on the model of them.
        if against := [case for case in losses if not case.runs.benefit.low > 0.0]:
            cases = " or ".join(words.energy_loss(case.name) for case in against)
            caution = (
                f" THE BENEFIT DEPENDS ON THE ENERGY LOSSES: it is not significant with losses by {cases}."
            )
        result = words.reduction(runs, best.measure)
        return note(f"{head}: {result}.{caution} This is not a safety assessment.")
    # A block that does not rock needs its margin and not the number of rejected designs.
    if design.status in (DesignStatus.no_uplift, DesignStatus.slides):
        return note(needless(design.problem))
    kind = danger if design.pendulum is None and design.is_harmful else note
    return kind(headline(design.status, design.refusals))


def headline(status: DesignStatus, reasons: Sequence[str]) -> str:
    """Return the sentence of a status, with the first reason if that is more informative."""
    if status in _REASONED and reasons:
        return f"{status.value.partition(':')[0]}: {reasons[0]}."
    return status.value


def verdict_lines(status: DesignStatus, reasons: Sequence[str]) -> list[str]:
    """Return lines for the terminal: the reasons that the headline does not contain, then the headline."""
    others = reasons[status in _REASONED :]
    return [*(line for text in others for line in _named(text, "reason")), headline(status, reasons)]


def dangers(design: Design, details: Details) -> list[Note]:
    """Return the notes that are dangers, such as more overturning or wall contact."""
    return [n for n in notes(design, details) if n.severity is Severity.danger]


def pairs(design: Design, details: Details) -> Iterator[tuple[str, str]]:
    """Yield the rows of the answer, each a name and a sentence, block and motion first."""
    yield "block", words.block_of(design.scene)
    yield "motion", words.excitation(design)
    yield "lifts", design.problem.at_rest.lifting_in_words
    yield "slides", design.problem.at_rest.sliding_in_words
    # Without further conditions the design is for the motion of the scene only.
    yield "conditions", "; ".join(design.conditions.description) or "the motion above only"
    yield from _pendulum(design, details)
    if design.runs is not None and design.best is not None and not math.isnan(design.best.over_limit):
        has_walls = limit_of(design.problem.limits, Clearance) is not None
        yield "clearance" if has_walls else "runs", _clearance(design, details)
    # For some statuses the verdict already contains the first reason.
    for text in design.refusals[design.status in _REASONED :]:
        yield "reason", text
    if design.status in (DesignStatus.not_recommended, DesignStatus.none_feasible):
        if design.remedy:
            yield "inputs", design.remedy
        yield "alternative", str(alternatives(design.problem))
    if design.pendulum is not None:
        yield "limits", active_limits(design, details)
    if design.runs is not None:
        yield from (("level", text) for text in at_levels(design.problem, design.runs))
    # A base that slides is one of the dangers, which come first.
    if design.sliding and not design.sliding.startswith(SLIDES):
        yield "sliding", design.sliding
    if details.losses:
        cases = [f"{words.energy_loss(c.name)} {words.percent(c.runs.benefit.mean)}" for c in details.losses]
        # The linear equations can give another benefit than the nonlinear ones, so that the benefit with the
        # stated losses is repeated here from linear runs.
        stated = [f"as stated {words.percent(m.low.mean)}" for m in details.sensitivity if not m.name]
        count, listed = details.losses[0].runs.pairs, ", ".join([*cases, *stated])
        by = f"{count} linear runs each, for comparison only"
        yield "losses", f"reduction of the mean tilt for other losses ({by}): {listed}"
    # The first response is without the pendulum, and the second one, with it, exists only if
    # there is a pendulum.
    if len(details.responses) > 1:
        ends = details.responses[0].frequency[[0, -1]]
        yield "nearby", words.overturned_between(details.responses, *ends)


def at_levels(problem: Problem, runs: PairedRuns) -> Iterator[str]:
    """Yield a sentence for each of several levels of ground motions: the shares of the counted runs that
    overturn with and without the pendulum, with intervals over earthquakes."""
    counted = True if runs.counted is None else runs.counted
    for name, rows in problem.levels.items():
        cases = [case.of(rows & counted) for case in (runs.with_pendulum, runs.without_pendulum)]
        count, shares = cases[0].tilt.size, [str(case.share_overturned) for case in cases]
        overturn = f"{shares[0]} overturn with the pendulum, {shares[1]} without it"
        yield f"{count} run{'s' * (count != 1)} at {name}: {overturn}"


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
    dead = f"{number(build.dead, 2)} kg of its mass only add weight at the top"
    yield "bob", f"{number(build.mass, 3)} kg as built: {size}; {dead}"
    yield "rod", f"{number(build.rod, 3)} m from the hinge to the bob's centre, as built"
    zeta = number(float(pendulum.damping_ratio), 3)
    yield "damper", f"{number(build.damping, 3)} N m s/rad at the hinge (damping ratio {zeta})"
    period = number(1.0 / build.frequency, 3)
    yield "frequency", f"{number(build.frequency, 3)} Hz (period {period} s), undamped, block at rest"


def _clearance(design: Design, details: Details) -> str:
    """Return how often the validation runs exceed a limit, and how near to the wall the bob comes."""
    assert design.best is not None
    most = design.problem.allowed
    share, at_most = compared(design.best.over_limit, most, 1, words.percent)
    text = f"{share} of the runs in which the block stands exceed a limit (at most {at_most} allowed)"
    # If the search ignored the walls, the bob may pass through them, and its distance has no meaning.
    build = details.build
    has_walls = limit_of(design.problem.limits, Clearance) is not None
    if build is None or not has_walls or math.isnan(build.reach):
        return text
    within, wall = compared(build.reach, build.wall, 3)
    reach = f"the bob stays within {within} m of the block's axis"
    return f"{text}; in {words.percent(1.0 - most)} of these runs {reach}; the wall is at {wall} m"


def active_limits(design: Design, details: Details) -> str:
    """List the active limits, and the bounds of the search that the design lies on."""
    shares, build = words.usage(design), details.build
    if build is not None and build.reach > 0.0 and build.wall > 0.0 and "clearance" in shares:
        # The distance in the validation runs is more informative than the ratio at nominal values.
        shares["clearance"] = build.reach / build.wall
    active = [f"{LABELS.get(n, n)}, {words.percent(x)} used" for n, x in shares.items() if x >= _USED]
    listed = "; ".join([*active, *design.at_bounds])
    return f"active: {listed}" if listed else "no limit is active"


def _more(design: Design, directory: Path | None) -> Iterator[tuple[str, str]]:
    """Yield rows on questions that the search did not answer, with commands, and on the files."""
    if directory is None:
        return
    at = shlex.quote(str(directory))
    # Under ground motions the search itself used earthquakes, so these checks are offered for harmonic jobs
    # only.
    if design.problem.settles and design.pendulum is not None:
        records = f"earthquakes (run `tpd fragility {at} --records el-centro loma-prieta`)"
        yield "not checked", f"{records}; contact and sliding (run `tpd check {at} --engine mujoco`)"
    yield "report", f"{directory / 'report.html'}"
    yield "repeat", f"tpd optimise --scene {at}/scene.toml --out {at}-again"
