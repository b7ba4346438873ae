"""Benefit of a design in a report: headline, paired runs, losses, and what limits the design."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping

import numpy as np

from tpd.core.formatting import number
from tpd.core.scene import Pendulum
from tpd.design.criteria import Room, limit_of
from tpd.design.result import DesignStatus, HarmonicDesign
from tpd.design.study import Study, Surveyed
from tpd.design.survey import ON_THE_WAY, Survey
from tpd.design.verified import GRAVE, Reason, ReasonKind, Step, Verified
from tpd.report.blocks import Block, Cell, Note, Table, danger, information, warning

_NAMES = {
    "mean severity": "mean tilt over ν",
    "median severity": "median tilt over ν",
    "worst severity": "tilt over ν, worst tenth of the runs",
    "overturned": "overturned",
    "at rest": "at rest in the end",
}
_LIMIT_NAMES = {
    "room": "room for the settled bob",
    "thickness": "rod at least twice the bob's half height",
    ON_THE_WAY: "room for the bob on the way from rest",
    "relative_stroke": "relative stroke",
}
_SCATTERED = {
    "mass": "the bob's mass",
    "length": "the rod's length",
    "damping": "the hinge's damping",
    "amplitude": "amplitude of the shaking",
}
"""Names of what scatters, where one word is not enough."""
_NO_SAFETY = "That is no verdict of safety: read the shares."
_ROWS = 8
"""Most rows of a table of what limits relax."""


def headline(design: HarmonicDesign) -> str:
    """Verdict in one paragraph: worth hanging by so much, or none worth hanging for this reason."""
    best, status = design.best, design.status
    if status is DesignStatus.found and best is not None and best.benefit is not None:
        worth = "WORTH HANGING under the stated conditions."
        if missing := _missing(design):
            worth = f"FOUND, BUT NOT TO BE HUNG AS IT IS: the search {missing}."
        return " ".join(filter(None, (_sign(design), worth, _gain(best), _NO_SAFETY)))
    if status is DesignStatus.refused and best is not None:
        # How near it comes is known only where it came to the paired runs.
        gain = "" if best.benefit is None else f" {_quoted(best)}."
        return f"{status.value} Nearest comes {_designation(design, best)}. Against it: {_first(best)}.{gain}"
    if status is DesignStatus.none_feasible and design.nearest is not None:
        broken = "; ".join(map(str, design.nearest.broken[:3]))
        return f"{status.value} The nearest: {broken}."
    return status.value


def verdict(design: HarmonicDesign) -> Note:
    """Headline; a danger where the block overturns more often, or the bob strikes a wall."""
    if design.status.is_sound:
        return information(headline(design))
    reasons = () if design.best is None else design.best.reasons
    grave = design.pendulum is None and any(reason.kind in GRAVE for reason in reasons)
    return (danger if grave else warning)(headline(design))


def _missing(design: HarmonicDesign) -> str:
    """Questions of an engineer that the search has left out, in words; empty if there are none."""
    parts = []
    if len(design.conditions) == 1:
        parts.append("knows one shaking and none beside it")
    if limit_of(design.limits, Room) is None:
        parts.append("takes a bob without size and no walls")
    return " and ".join(parts)


def _gain(best: Verified) -> str:
    """Benefit with its interval, and the shares that paired runs quote."""
    assert best.benefit is not None
    assert best.paired is not None
    hung, bare = best.paired.hung, best.paired.bare
    median = next(change for change in best.benefit.changes if change.name == "median severity")
    # Most of a benefit may be that fewer runs overturn: the median says what the others gain.
    return (
        f"{_quoted(best)}; "
        f"{hung.overturned.value:.1%} overturn in place of {bare.overturned.value:.1%}; "
        f"{hung.at_rest.value:.1%} end at rest in place of {bare.at_rest.value:.1%}. The tilt is the "
        f"mean of all runs, in which one that overturns counts as toppling; the median tilt is "
        f"{median.with_it:.1%} of the slenderness in place of {median.without:.1%}."
    )


def _quoted(best: Verified) -> str:
    """Benefit with its interval, and the runs that it is by."""
    assert best.benefit is not None
    fresh = "" if best.chosen_by is None else "fresh "
    return f"Over {best.benefit.runs} {fresh}paired runs of the nonlinear equations: {best.benefit}"


def _sign(design: HarmonicDesign) -> str:
    """Sentence that says first that the benefit hangs on how the block loses energy."""
    # Of the data of a block its losses are known least: what hangs on them comes before any number.
    against = [case for case in design.losses if case.benefit.low <= 0.0]
    if not against:
        return ""
    names = " and ".join(f"{case.name} ({case.benefit.value:.0%})" for case in against)
    return f"THE BENEFIT HANGS ON THE LOSSES: it is not shown where the block loses energy by {names}."


def _designation(design: HarmonicDesign, v: Verified) -> str:
    hung = _pendulum(design, v)
    return f"{number(hung.mass)} kg on {number(hung.length)} m, damping ratio {number(hung.damping_ratio)}"


def _pendulum(design: HarmonicDesign, v: Verified) -> Pendulum:
    ratios = {"mass_ratio": v.mass_ratio, "length_ratio": v.length_ratio, "damping_ratio": v.damping_ratio}
    return design.scene.pendulum(**ratios)


def _first(v: Verified) -> str:
    """Reasons against a design, the gravest first; a later one of the same kind is only counted."""
    kinds: dict[tuple[ReasonKind, str], Reason] = {}
    for reason in v.reasons:
        kinds.setdefault((reason.kind, reason.limit), reason)
    first = sorted(kinds.values(), key=lambda reason: reason.kind not in GRAVE)
    more = len(v.reasons) - len(first)
    return "; ".join([*map(str, first), *([f"and {more} more of these"] if more else [])]) or "nothing"


def paired_runs(design: HarmonicDesign) -> list[Block]:
    """Sizes with the pendulum and without over paired runs of the nonlinear equations."""
    best = design.best
    if best is None or best.benefit is None or best.paired is None:
        return []
    rows: list[tuple[Cell, ...]] = []
    for change in best.benefit.changes:
        interval = f"{change.difference:+.1%}"
        if np.isfinite(change.low):
            interval += f" ({change.low:+.1%} to {change.high:+.1%})"
        rows.append((_NAMES[change.name], f"{change.with_it:.1%}", f"{change.without:.1%}", interval))
    head = ("", "with it", "without", "difference (95 %)")
    caption = (
        f"{best.benefit.runs} paired runs of the nonlinear equations, seed {best.paired.hung.ensemble.seed}"
        f"{_which(design, best)}: starts, phases, growth of the shaking; {_scatter(design)}. Tilt: "
        "settled, 100 % where the block overturns or tilts to ν or further, 0 at rest."
    )
    chance = best.paired.chance_in_words
    out: list[Block] = [Table(head, tuple(rows), caption), information(chance)]
    if best.benefit.undecided:
        missing = f"{best.benefit.undecided} more paired runs have no answer and are left out."
        out.append(information(missing))
    return [*out, *_by_condition(design, best)]


def _which(design: HarmonicDesign, best: Verified) -> str:
    """Which runs judged, and what those gave that chose the design."""
    if best.chosen_by is None:
        return ""
    failed = sum(any(r.step is Step.judgement for r in v.reasons) for v in design.verified if v is not best)
    said = ", which judged the design once and which no choice has seen"
    if failed:
        said = f"; {failed} before it failed by these runs, and each further try may pass by luck"
    return f"{said}; those that chose it, seed {design.ensemble.seed}, gave {best.chosen_by}"


def _scatter(design: HarmonicDesign) -> str:
    """Relative scatter of block, installation and shaking in the runs."""
    widths, by_width = design.ensemble.widths(design.scene.block.restitution), dict[float, list[str]]()
    for name, width in widths.items():
        if width > 0.0 and not (name == "friction" and not design.scene.block.friction):
            by_width.setdefault(width, []).append(_SCATTERED.get(name, name))
    said = "; ".join(
        f"{', '.join(names)} ±{100.0 * width:.2g} %" for width, names in sorted(by_width.items())
    )
    return said or "no scatter"


def _by_condition(design: HarmonicDesign, best: Verified) -> list[Block]:
    """Mean tilt under every condition; none where there are too many or one only."""
    assert best.benefit is not None
    n, (hung, bare) = len(design.conditions), best.benefit.by_condition
    if not 1 < n <= 32:
        return []
    rows = []
    for i in range(len(hung)):
        if math.isnan(hung[i]):
            continue
        mark = "worse" if i in best.benefit.worse_conditions else None
        rows.append((design.conditions.label(i), f"{hung[i]:.1%}", f"{bare[i]:.1%}", mark))
    caption = (
        f"Mean tilt over ν of the paired runs under each condition. Worse: higher by more than "
        f"{best.benefit.share:.0%}, and not by chance (5 %)."
    )
    return [Table(("condition", "with it", "without", ""), tuple(rows), caption)]


def losses(design: HarmonicDesign) -> list[Block]:
    """The offered design where the block loses its energy in another way."""
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            case.name,
            f"k = {number(case.friction, 3)}, e = {number(case.velocity_ratio, 4)}",
            str(case.benefit),
            f"{case.overturned.value:.1%} / {case.overturned_bare.value:.1%}",
            f"{case.at_rest.value:.1%} / {case.at_rest_bare.value:.1%}",
        )
        for case in design.losses
    )
    if not rows:
        return []
    head = ("losses", "", "benefit", "overturned, with / without", "at rest, with / without")
    caption = (
        f"{design.losses[0].benefit.runs} paired runs of the nonlinear equations each. The losses are the "
        "least known data of a block."
    )
    return [Table(head, rows, caption)]


def limiting(design: HarmonicDesign, study: Study | None = None) -> list[Block]:
    """Limits that keep better designs out, the best design without each, and counts of refusals."""
    if not design.surveys:
        return []
    out = _refusals(design)
    wide, by_runs = design.surveys[0], {} if study is None else study.surveyed
    best, *others = wide.relaxed().items()
    # A row that repeats the first would only hide those that differ.
    same = [name for name, i in others if i is not None and i == best[1]]
    rows = [_row(design, wide, n, i, by_runs) for n, i in (best, *others) if n not in same]
    head = (
        "",
        "bob (kg)",
        "length (m)",
        "ζ",
        "room it needs (m)",
        "mean tilt over ν",
        "overturned of conditions",
        "strikes a wall, of runs",
        "overturned, of runs",
    )
    bare = f"{wide.bare.mean():.1%} and {int(np.sum(wide.bare >= 1.0))} of {len(wide.bare)}"
    caption = (
        f"Best of {len(wide.designs)} designs followed from rest by the {wide.equations} equations, and the "
        f"best where a limit is left out: what relaxing it would buy. Without a pendulum: {bare}."
    )
    if same:
        caption += f" The best design is the same {', '.join(same)}."
    if by_runs:
        runs = next(iter(by_runs.values()))
        caption += (
            f" Of runs: shares of {runs.benefit.runs} paired runs of the nonlinear equations, which begin "
            f"elsewhere as well; a bob that strikes in more than {runs.allowed:.1%} of them is refused."
        )
    return [*out, *_held(design), Table(head, tuple(rows[:_ROWS]), caption)]


def _held(design: HarmonicDesign) -> list[Block]:
    """Conditions, limits and bounds that hold the best design, with multipliers, if it is refused."""
    if design.pendulum is not None or design.best is None or not design.best.active:
        return []
    said = "; ".join(f"{held}" for held in design.best.active)
    return [information(f"The best that was verified is held by: {said}.")]


def _row(
    design: HarmonicDesign, of: Survey, name: str, i: int | None, by_runs: Mapping[int, Surveyed]
) -> tuple[Cell, ...]:
    if i is None:
        return (name, *(None,) * 5, "no design", None, None)
    mu, lam, zeta = of.designs[i]
    hung = design.scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta)
    lost = int(np.sum(of.severity[i] >= 1.0))
    sizes = float(hung.mass), float(hung.length), float(zeta)
    way, runs = of.excess.get(ON_THE_WAY), by_runs.get(i)
    needs = None if way is None else (1.0 + float(way[i])) * float(design.scene.block.room)
    from_rest = f"{of.severity[i].mean():.1%}", f"{lost} of {of.severity.shape[1]}"
    if runs is None:
        return (name, *sizes, needs, *from_rest, None, None)
    strikes = None if math.isnan(runs.strikes) else f"{runs.strikes:.1%}"
    return (name, *sizes, needs, *from_rest, strikes, f"{runs.overturned:.1%}")


def _refusals(design: HarmonicDesign) -> list[Block]:
    """Counts of designs that break each limit, or that do not help, and of reasons against those verified."""
    parts = []
    for found in design.surveys:
        counts = {_LIMIT_NAMES.get(n, n): int(np.sum(x > 0.0)) for n, x in found.excess.items()}
        said = [f"{n} exceed the limit on {name}" for name, n in counts.items() if n]
        keep = int(found.keeps.sum())
        parts.append(
            f"Of {len(found.designs)} designs followed from rest by the {found.equations} equations {keep} "
            f"keep to all limits from rest, and {found.better} of these tilt the block less than none"
            + (f" ({'; '.join(said)})." if said else ".")
        )
    # A design may be refused for several reasons, and each of them is counted.
    kinds = Counter(what for v in design.verified for what in {_kind(reason) for reason in v.reasons})
    if kinds:
        told = ", ".join(f"{n} because {what}" for what, n in kinds.most_common())
        refused = sum(bool(v.reasons) for v in design.verified)
        parts.append(f"Of {len(design.verified)} verified, {refused} were refused: {told}.")
    if design.pendulum is None and design.verified:
        return [warning(" ".join(parts))]
    return [information(" ".join(parts))]


def _kind(reason: Reason) -> str:
    return {
        ReasonKind.overturns: "the block overturns with them",
        ReasonKind.overturns_more: "the block overturns more often",
        ReasonKind.breaks_limit: "they break a limit",
        ReasonKind.rocks_more: "the block rocks more",
        ReasonKind.too_little_benefit: "the benefit is too small",
        ReasonKind.rests_less: "the block rests less often",
        ReasonKind.worse_condition: "a condition gets worse",
        ReasonKind.strikes: "the bob strikes a wall",
        ReasonKind.undecided: "the verdict hangs on runs without an answer",
    }[reason.kind] + ("" if reason.step is not Step.nonlinear else " by the nonlinear equations")
