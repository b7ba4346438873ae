"""The answer in a few lines, for designs of both kinds: on the terminal and the first screen of the page."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from tpd.answers.paired import Change
from tpd.core.formatting import aligned, number
from tpd.design.criteria import LABELS
from tpd.design.result import Comparison, Design, DesignStatus, HarmonicDesign
from tpd.design.study import Study, build_of, usage
from tpd.report import words
from tpd.report.blocks import Note, Severity, Table, danger, note, wrapped
from tpd.report.notes import notes

MOST = 25
"""Most lines: the command has said block and motion in four before them, so that a terminal has thirty."""
_NAME = 13
"""Columns of the names of rows."""
_CHANGES = {
    "mean severity": "mean tilt over toppling",
    "median severity": "median tilt",
    "overturned": "overturned",
    "at rest": "at rest in the end",
}
"""Rows of the comparison, and their names."""
_USED = 0.95
"""Share of a limit that is used where it is said to hold the design."""


def answer(
    design: Design, study: Study | None = None, directory: Path | None = None, most: int = MOST
) -> str:
    """The answer of `optimise` in at most `most` lines: verdict, pendulum, what it brings, what limits it.

    Block and motion are left out: the command says them before the search. Without a study what needs further
    runs is left out as well."""
    if study is None:
        used = usage(design) if isinstance(design, HarmonicDesign) else ()
        study = Study(build=build_of(design), usage=used)
    found = [verdict(design), *dangers(design, study)]
    lines = [line for one in found for line in wrapped(one.marked)]
    rows = [pair for pair in pairs(design, study) if pair[0] not in ("block", "motion")]
    places = {name for name, _ in rows}
    told = design.comparison
    for name, said in rows:
        # The table stands after the pendulum, before what limits it.
        if told is not None and name in ("room", "against it", "held by") and "table" not in places:
            places.add("table")
            lines += _table(comparison(told))
        lines += _named(said, name)
    more = list(_more(design, directory))
    # A long list of reasons must not push away where the report lies.
    room = most - sum(len(_named(said, name)) for name, said in more)
    if len(lines) > room:
        lines = [*lines[: room - 1], " " * _NAME + "(more in the report)"]
    return "\n".join([*lines, *(line for name, said in more for line in _named(said, name))])


def _named(said: str, name: str) -> list[str]:
    """Lines of a sentence behind the name of its row."""
    return wrapped(said, f"  {name:<{_NAME - 2}}", " " * _NAME)


def _table(of: Table) -> Iterator[str]:
    yield from (" " * _NAME + line for line in aligned([of.head, *of.cells]))
    yield from wrapped(of.caption, " " * _NAME, " " * _NAME)


def verdict(design: Design) -> Note:
    """First sentence of a report: worth hanging by so much, or why not. A danger where the block overturns
    more often, or the bob strikes."""
    told, status = design.comparison, design.status
    if status is DesignStatus.found and told is not None:
        worth, sign, missing = "WORTH HANGING under the stated conditions", "", words.missing(design)
        if missing:
            worth = f"FOUND, BUT NOT TO BE HUNG AS IT IS, since the search {' and '.join(missing)}"
        losses = design.losses if isinstance(design, HarmonicDesign) else ()
        if against := [case for case in losses if not case.benefit.low > 0.0]:
            cases = " and ".join(f"{case.name} ({case.benefit.value:.0%})" for case in against)
            sign = "THE BENEFIT HANGS ON THE LOSSES: it is not shown where the block loses energy by "
            sign += f"{cases}. "
        return note(f"{worth}: {saved(told)}. {sign}No verdict of safety.")
    kind = danger if design.pendulum is None and design.harmful else note
    return kind(headline(status, design.refusals))


def headline(status: DesignStatus, reasons: Sequence[str]) -> str:
    """Sentence of a status, with the weightiest of the reasons where that says more."""
    if status in _REASONED and reasons:
        return f"{status.value.partition(':')[0]}: {reasons[0]}."
    return status.value


def judgement(status: DesignStatus, reasons: Sequence[str]) -> list[str]:
    """Lines of a verdict: the reasons against a pendulum from the second on, and last the sentence."""
    others = reasons[status in _REASONED :]
    return [*(line for said in others for line in _named(said, "against it")), headline(status, reasons)]


_REASONED = DesignStatus.refused, DesignStatus.too_few, DesignStatus.undecided
"""Statuses of which the first reason says more than their words."""


def saved(told: Comparison) -> str:
    """Benefit with its interval."""
    size = told.saved
    if math.isnan(size.mean):
        return "the benefit is unknown"
    # A share that rounds to zero must not read "-0 %".
    mean, low, high = (0.0 + x for x in (size.mean, size.low, size.high))
    way = "less" if mean >= 0.0 else "more"
    low, high = (low, high) if mean >= 0.0 else (0.0 - high, 0.0 - low)
    around = f" (95 %: {low:.0%} to {high:.0%})" if math.isfinite(low) else ""
    return f"{abs(mean):.0%} {way} tilt{around}"


def dangers(design: Design, study: Study) -> list[Note]:
    """Notes about overturning and strikes."""
    return [n for n in notes(design, study) if n.severity is Severity.danger]


def pairs(design: Design, study: Study) -> Iterator[tuple[str, str]]:
    """Names and sentences of the answer, block and motion first."""
    yield "block", words.block_of(design.scene)
    yield "motion", words.shaking(design)
    yield "conditions", "; ".join(design.conditions.description) or "this motion exactly"
    yield from _pendulum(design, study)
    told = design.comparison
    if told is not None and not math.isnan(told.strikes):
        yield "room", _room(design, study, told)
    # The verdict has the first reason.
    for said in design.refusals[design.status in _REASONED :]:
        yield "against it", said
    if design.pendulum is not None:
        yield "held by", held(design, study)
    if isinstance(design, HarmonicDesign):
        if design.losses:
            cases = ", ".join(f"{c.name} {c.benefit.value:.0%}" for c in design.losses)
            yield "losses", f"less tilt by other losses: {cases} ({design.losses[0].benefit.runs} runs each)"
        if beside := words.beside(study):
            yield "beside", beside


def _pendulum(design: Design, study: Study) -> Iterator[tuple[str, str]]:
    build, hung = study.build, design.pendulum
    if hung is None:
        nearest = words.best_of(design)
        if nearest is not None:
            mu, lam, zeta = map(float, nearest)
            near = design.scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta)
            size = f"{number(float(near.mass), 3)} kg on {number(float(near.length), 3)} m, ζ = {zeta:.2g}"
            yield "nearest", f"{size}: not offered"
        return
    if build is None:
        point = f"{number(float(hung.mass), 3)} kg on {number(float(hung.length), 3)} m"
        yield "pendulum", f"acts as a point of {point}; the body that does is not known"
        return
    # Where other bobs do as well a third digit says nothing.
    alike = words.range_of_mass(design)
    point = f"{number(float(hung.mass), 2 if alike else 3)} kg on {number(float(hung.length), 3)} m"
    yield "pendulum", f"acts as a point of {point}{alike}"
    if math.isfinite(build.mass):
        size = f"{build.bob}, {number(build.bob_width, 3)} m wide"
        yield "bob", f"{number(build.mass, 3)} kg as built: {size}; {number(build.dead, 2)} kg do not swing"
        yield "rod", f"{number(build.rod, 3)} m from the hinge to the bob's centre, as built"
    else:
        yield "bob", f"no body, {build.bob}, swings as such a point does"
    zeta = float(hung.damping_ratio)
    yield "damper", f"{number(build.damping, 3)} N m s/rad at the hinge, {number(zeta, 3)} of critical"
    period = number(1.0 / build.frequency, 3)
    yield "by itself", f"{number(build.frequency, 3)} Hz, a period of {period} s, without the damper"


def comparison(told: Comparison) -> Table:
    """With and without the pendulum, from one set of runs."""
    rows = [
        (_CHANGES[c.name], f"{c.with_it:.{d}%}", f"{c.without:.{d}%}", _points(c, d))
        for c in told.changes
        # Tilts vary by more than a tenth of a per cent from one seed to the next; a share may be small.
        for d in (0 if c.name in ("mean severity", "median severity") else 1,)
        # Where no run rests with it nor without there is nothing to compare.
        if c.name in _CHANGES and not (c.name == "at rest" and c.with_it == c.without == 0.0)
    ]
    left = f"; {told.undecided} runs without an answer are left out" if told.undecided else ""
    caption = f"{told.runs}; overturned counts as toppled{left}"
    return Table(("", "with it", "without", "points (95 %)"), tuple(rows), caption)


def _points(of: Change, digits: int) -> str:
    """Difference in points of per cent with its interval; a dash where it has none."""
    if not np.isfinite(of.low):
        return "–"
    # What rounds to zero must not read "-0".
    mean, low, high = (round(100.0 * x, digits) + 0.0 for x in (of.difference, of.low, of.high))
    return f"{mean:+.{digits}f} ({low:+.{digits}f} to {high:+.{digits}f})"


def _room(design: Design, study: Study, told: Comparison) -> str:
    harmonic = isinstance(design, HarmonicDesign)
    most, what = design.strikes_allowed, "strikes a wall" if harmonic else "breaks a limit"
    share = f"{what} in {told.strikes:.1%} of those that stand ({most:.0%} allowed)"
    build = study.build
    if build is None or math.isnan(build.wall) or math.isnan(build.reach):
        return share
    which = f"in all but {most:.0%}" if harmonic else f"on what it is tuned to, in all but {most:.0%}"
    return f"{share}; {which} it comes to {number(build.reach, 3)} of {build.wall:.3g} m"


def held(design: Design, study: Study) -> str:
    """Conditions, limits and bounds that hold a design."""
    used, build = words.usage(design, study), study.build
    if build is not None and build.reach > 0.0 and build.wall > 0.0 and "room" in used:
        used["room"] = build.reach / build.wall
    limits = [f"{LABELS.get(n, n)}, {x:.0%} used" for n, x in used.items() if x >= _USED]
    return "; ".join([*limits, *words.bounds(design)]) or "no limit and no bound"


def _more(design: Design, directory: Path | None) -> Iterator[tuple[str, str]]:
    """Questions that were not asked, with their commands, and where the report lies."""
    if directory is None:
        return
    at = shlex.quote(str(directory))
    if isinstance(design, HarmonicDesign) and design.pendulum is not None:
        shaken = f"earthquakes: tpd fragility {at} --records el-centro loma-prieta"
        yield "not asked", f"{shaken}; contact and sliding: tpd check {at} --engine mujoco"
    yield "report", f"{directory / 'report.html'}"
    yield "again", f"tpd optimise --scene {at}/scene.toml --out {at}-again"
