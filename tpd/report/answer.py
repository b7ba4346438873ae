"""The answer in a few lines: on the terminal and on the first screen of the page."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

from tpd.core.formatting import aligned, number
from tpd.design.as_built import Details, build_of
from tpd.design.assess import alternatives, needless
from tpd.design.criteria import LABELS, Clearance, limit_of
from tpd.design.design import Design
from tpd.design.reasons import DesignStatus
from tpd.report import words
from tpd.report.blocks import Note, Severity, danger, note, wrapped
from tpd.report.notes import notes

MOST = 24
"""Most lines: with the six lines on block and motion that the command prints before, about thirty."""
_NAME = 14
"""Columns of the names of rows."""
_USED = 0.95
"""Share of a limit that is used where the limit counts as active."""
_ALONE = "block", "motion", "lifts", "slides"
"""Rows on the block without a pendulum, which the command prints before the search."""
_REASONED = DesignStatus.not_recommended, DesignStatus.none_feasible, DesignStatus.undecided
"""Statuses of which the first reason says more than their words."""


def answer(
    design: Design, details: Details | None = None, directory: Path | None = None, most: int = MOST
) -> str:
    """Return the answer of `optimise` in at most `most` lines: verdict, pendulum, benefit, active limits.

    Block and motion are left out: the command prints them before the search. Without a study what needs
    further runs is left out as well."""
    details = Details(build=build_of(design)) if details is None else details
    first = [verdict(design, details), *dangers(design, details)]
    parts = [wrapped(one.marked) for one in first]
    rows = [pair for pair in pairs(design, details) if pair[0] not in _ALONE]
    runs, indent, shown = design.runs, " " * _NAME, False
    for name, text in rows:
        # The table stands after the pendulum, before what limits it.
        if runs is not None and name in ("clearance", "in runs", "reason", "limits") and not shown:
            shown, table = True, words.comparison(runs)
            cells = [indent + line for line in aligned([table.head, *table.cells])]
            parts.append([*cells, *wrapped(table.caption, indent, indent)])
        parts.append(_named(text, name))
    last = [line for name, text in _more(design, directory) for line in _named(text, name)]
    # A long list of reasons must not push away where the report lies. Rows are left out in whole: half a
    # sentence may say the opposite.
    if sum(map(len, parts)) + len(last) > most:
        while len(parts) > 1 and sum(map(len, parts)) + len(last) >= most:
            parts.pop()
        last = [indent + "(more in the report)", *last]
    return "\n".join([line for part in parts for line in part] + last)


def _named(text: str, name: str) -> list[str]:
    """Lines of a sentence behind the name of its row."""
    return wrapped(text, f"  {name:<{_NAME - 2}}", " " * _NAME)


def verdict(design: Design, details: Details | None = None) -> Note:
    """Return the first sentence of a report: recommended with its benefit, or why not. It is a danger where
    the block overturns more often, or the bob touches a wall."""
    runs, best = design.runs, design.best
    if design.status is DesignStatus.recommended and runs is not None and best is not None:
        head, caution = "RECOMMENDED for the stated conditions", ""
        if missing := words.missing(design):
            head = f"NOT TO BE BUILT AS IT IS, since the search {' and '.join(missing)}"
        losses = () if details is None else details.losses
        if against := [case for case in losses if not case.runs.benefit.low > 0.0]:
            cases = " or ".join(f"{case.name} ({words.percent(case.runs.benefit.mean)})" for case in against)
            caution = f" THE BENEFIT DEPENDS ON THE LOSSES: it is not shown if they are {cases}."
        return note(
            f"{head}: {words.reduction(runs, best.measure)}.{caution} This is not a safety assessment."
        )
    if design.status in (DesignStatus.no_uplift, DesignStatus.slides):
        return note(needless(design.problem))
    kind = danger if design.pendulum is None and design.is_harmful else note
    return kind(headline(design.status, design.refusals))


def headline(status: DesignStatus, reasons: Sequence[str]) -> str:
    """Return the sentence of a status, with the first reason where that says more."""
    if status in _REASONED and reasons:
        return f"{status.value.partition(':')[0]}: {reasons[0]}."
    return status.value


def verdict_lines(status: DesignStatus, reasons: Sequence[str]) -> list[str]:
    """Return lines of a verdict: the reasons from the second on, and last the sentence."""
    others = reasons[status in _REASONED :]
    return [*(line for text in others for line in _named(text, "reason")), headline(status, reasons)]


def dangers(design: Design, details: Details) -> list[Note]:
    """Return the notes about overturning and wall contact."""
    return [n for n in notes(design, details) if n.severity is Severity.danger]


def pairs(design: Design, details: Details) -> Iterator[tuple[str, str]]:
    """Yield names and sentences of the answer, block and motion first."""
    yield "block", words.block_of(design.scene)
    yield "motion", words.excitation(design)
    yield "lifts", design.problem.at_rest.lifting_in_words
    yield "slides", design.problem.at_rest.sliding_in_words
    yield "conditions", "; ".join(design.conditions.description) or "this motion exactly"
    yield from _pendulum(design, details)
    if design.runs is not None and design.best is not None and not math.isnan(design.best.over_limit):
        walls = limit_of(design.problem.limits, Clearance) is not None
        yield "clearance" if walls else "in runs", _clearance(design, details)
    # The verdict has the first reason.
    for text in design.refusals[design.status in _REASONED :]:
        yield "reason", text
    if design.status in (DesignStatus.not_recommended, DesignStatus.none_feasible):
        yield "alternatives", str(alternatives(design.problem))
    if design.pendulum is not None:
        yield "limits", active_limits(design, details)
    if details.losses:
        cases = [f"{c.name} {words.percent(c.runs.benefit.mean)}" for c in details.losses]
        # The linear equations may be more favourable than the nonlinear ones: like is compared with like.
        stated = [f"as stated {words.percent(m.low.mean)}" for m in details.sensitivity if not m.name]
        runs_each = details.losses[0].runs.pairs
        listed = ", ".join([*stated, *cases])
        yield "losses", f"reduction by the linear equations, {runs_each} runs each: {listed}"
    if len(details.responses) > 1:
        ends = details.responses[0].frequency[[0, -1]]
        yield "nearby", words.overturned_between(details.responses, *ends)


def _pendulum(design: Design, details: Details) -> Iterator[tuple[str, str]]:
    build, with_it = details.build, design.pendulum
    if with_it is None:
        if design.nearest is not None:
            near = design.problem.pendulum(design.nearest)
            size = f"{number(float(near.mass), 3)} kg on {number(float(near.length), 3)} m"
            yield "nearest", f"{size}, damping ratio {float(near.damping_ratio):.2g}: not recommended"
        return
    # Where other bobs perform as well a third digit says nothing.
    alike = words.range_of_mass(design)
    mass, length = float(with_it.mass), float(with_it.length)
    point = f"{number(mass, 2 if alike else 3)} kg on a rod of {number(length, 3)} m"
    yield "pendulum", f"equivalent point mass {point}{alike}"
    if build is None or not math.isfinite(build.mass):
        yield "bob", "no body of this bob's shape and density acts as such a point"
        return
    size = f"{build.bob}, {number(build.bob_width, 3)} m wide"
    dead = f"{number(build.dead, 2)} kg of its mass only add weight at the top"
    yield "bob", f"{number(build.mass, 3)} kg as built: {size}; {dead}"
    yield "rod", f"{number(build.rod, 3)} m from the hinge to the bob's centre, as built"
    zeta = float(with_it.damping_ratio)
    yield "damper", f"{number(build.damping, 3)} N m s/rad at the hinge, {number(zeta, 3)} of critical"
    period = number(1.0 / build.frequency, 3)
    yield "frequency", f"{number(build.frequency, 3)} Hz (period {period} s), undamped, block at rest"


def _clearance(design: Design, details: Details) -> str:
    assert design.best is not None
    most = design.problem.allowed
    share = f"a limit is exceeded in {design.best.over_limit:.1%} of the runs in which the block stands "
    share += f"(at most {most:.0%} allowed)"
    # Without walls in the search the distance to a wall that the bob passes through says nothing.
    build = details.build
    walls = limit_of(design.problem.limits, Clearance) is not None
    if build is None or not walls or math.isnan(build.reach):
        return share
    reach = f"the bob stays within {number(build.reach, 3)} m of the block's axis"
    return f"{share}; in {1 - most:.0%} of them {reach}, and the wall is at {build.wall:.3g} m"


def active_limits(design: Design, details: Details) -> str:
    """Return the limits and bounds that are active."""
    used, build = words.usage(design), details.build
    if build is not None and build.reach > 0.0 and build.wall > 0.0 and "clearance" in used:
        used["clearance"] = build.reach / build.wall
    active = [f"{LABELS.get(n, n)} ({x:.0%} used)" for n, x in used.items() if x >= _USED]
    found = "; ".join([*active, *words.bounds(design)])
    return f"active: {found}" if found else "no limit is active"


def _more(design: Design, directory: Path | None) -> Iterator[tuple[str, str]]:
    """Questions that the search leaves open, with their commands, and where the report lies."""
    if directory is None:
        return
    at = shlex.quote(str(directory))
    if design.search is not None and design.pendulum is not None:
        records = f"earthquakes (run `tpd fragility {at} --records el-centro loma-prieta`)"
        yield "not checked", f"{records}; contact and sliding (run `tpd check {at} --engine mujoco`)"
    yield "report", f"{directory / 'report.html'}"
    yield "repeat", f"tpd optimise --scene {at}/scene.toml --out {at}-again"
