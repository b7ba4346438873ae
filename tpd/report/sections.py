"""Sections of a report that only one kind of design has: those for harmonic shaking, and those on ground
motions."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from tpd.answers.ensemble import Outcomes
from tpd.core.formatting import number
from tpd.design.criteria import LABELS
from tpd.design.ground.design import GroundDesign
from tpd.design.ground.judgement import Role
from tpd.design.ground.search import SPARE
from tpd.design.orbits import KINDS
from tpd.design.result import HarmonicDesign
from tpd.design.search import SearchStatus
from tpd.design.study import Study
from tpd.design.survey import ON_THE_WAY, Survey
from tpd.design.verified import Bare, ReasonKind, Step, Verified
from tpd.records.reading import facts, same_earthquakes
from tpd.report import words
from tpd.report.blocks import Block, Cell, Listing, Table, Text
from tpd.report.notes import unknown
from tpd.scene.record import Record

_ROWS, _MOST = 40, 8
"""Most conditions in a table, evenly over all of them, and most rows of what limits relax."""
_SCATTERED = {
    "mass": "the bob's mass",
    "length": "the rod's length",
    "damping": "the hinge's damping",
    "amplitude": "amplitude of the shaking",
}
"""Names of what scatters, where one word is not enough."""
_WHY = {
    ReasonKind.overturns: "the block overturns with them",
    ReasonKind.overturns_more: "the block overturns more often",
    ReasonKind.breaks_limit: "they break a limit",
    ReasonKind.as_built: "as built they exceed a limit",
    ReasonKind.rocks_more: "the block rocks more",
    ReasonKind.too_little_benefit: "the benefit is too small",
    ReasonKind.rests_less: "the block rests less often",
    ReasonKind.worse_condition: "a condition gets worse",
    ReasonKind.strikes: "the bob strikes a wall",
    ReasonKind.undecided: "the verdict hangs on runs without an answer",
}


def harmonic(
    design: HarmonicDesign, study: Study, figures: Mapping[str, Sequence[Block]]
) -> dict[str, list[Block]]:
    """Blocks by the titles of their sections, in the order of a report; empty ones are left out later."""
    runs, losses = over_runs(design), other_losses(design)
    return {
        "Over the runs": [*figures["benefit"], *runs] if runs else [],
        "Other losses of energy": losses,
        "What limits the design": limiting(design),
        "Beside the shaking of the job": [*figures["response"]],
        "Over time, from rest": [*figures["motion"]],
        "The settled motion": settled(design, study, figures["conditions"]),
        "Where it was searched": _search(design, figures["search"]) if design.search.evaluations else [],
        "Designs refused": _refused(design),
    }


def over_runs(design: HarmonicDesign) -> list[Block]:
    """Shares and sizes over the paired runs that judged the best design, and under each condition."""
    best = design.best
    if best is None or best.benefit is None or best.paired is None:
        return []
    pair = best.paired.hung, best.paired.bare
    rows: list[tuple[Cell, ...]] = []
    for c in best.benefit.changes:
        if c.name == "worst severity":
            rows.append(("tilt over ν, worst tenth of the runs", f"{c.with_it:.1%}", f"{c.without:.1%}"))
    for ramp in pair[0].by_ramp():
        start = "overturned, of sudden starts" if ramp == 0.0 else f"overturned, growing for {ramp:g} s"
        rows.append((start, *(str(o.by_ramp()[ramp]) for o in pair)))
    rows.append(("overturned", *(str(o.overturned) for o in pair)))
    rows.append(("at rest in the end", *(str(o.at_rest) for o in pair)))
    for what, quantity in (("largest tilt", "peak"), ("settled tilt", "amplitude")):
        rows.append((f"{what}, 50, 90, 99 % of the runs (rad)", *(_quantiles(o, quantity) for o in pair)))
    rows.append(("bob's largest angle, 50, 90, 99 % (rad)", _quantiles(pair[0], "peak_stroke"), None))
    told = design.comparison
    assert told is not None
    caption = (
        f"{told.runs}{_which(design, best)}: starts, phases, growth of the shaking; {_scatter(design)}. In "
        "brackets: 95 % confidence. Tilt: settled, 100 % where the block overturns or tilts to ν or further."
    )
    out: list[Block] = [
        Table(("", "with it", "without"), tuple(rows), caption),
        Text(best.paired.chance_in_words),
    ]
    return [*out, *_by_condition(design, best)]


def _quantiles(o: Outcomes, quantity: str) -> str:
    return ", ".join("overturned" if math.isinf(x) else number(x, 3) for x in o.quantiles(quantity))


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
    rows = tuple(
        (
            design.conditions.label(i),
            f"{hung[i]:.0%}",
            f"{bare[i]:.0%}",
            "worse" if i in best.benefit.worse_conditions else None,
        )
        for i in range(len(hung))
        if not math.isnan(hung[i])
    )
    caption = (
        f"Mean tilt over ν of the same runs under each condition. Worse: higher by more than "
        f"{best.benefit.share:.0%}, and not by chance (5 %)."
    )
    return [Table(("condition", "with it", "without", ""), rows, caption)]


def other_losses(design: HarmonicDesign) -> list[Block]:
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
        f"{design.losses[0].benefit.runs} paired runs of the nonlinear equations each, in scenes with other "
        "losses. The losses are the least known data of a block."
    )
    return [Table(head, rows, caption)]


def limiting(design: HarmonicDesign) -> list[Block]:
    """Limits that keep better designs out, the best design without each, and counts of refusals."""
    if not design.surveys:
        return []
    wide = design.surveys[0]
    best, *others = wide.relaxed().items()
    # A row that repeats the first would only hide those that differ.
    same = [name for name, i in others if i is not None and i == best[1]]
    rows = [_row(design, wide, n, i) for n, i in (best, *others) if n not in same]
    head = ("", "bob (kg)", "length (m)", "ζ", "room it needs (m)", "mean tilt over ν, from rest")
    caption = (
        f"Best of {len(wide.designs)} designs followed from rest by the {wide.equations} equations, one run "
        "for each condition, and the best where a limit is left out: what relaxing it would buy. Without a "
        f"pendulum: {wide.bare.mean():.0%}. Runs that begin elsewhere may strike or overturn all the same."
    )
    if same:
        caption += f" The best design is the same {', '.join(same)}."
    return [_refusals(design), Table(head, tuple(rows[:_MOST]), caption)]


def _row(design: HarmonicDesign, of: Survey, name: str, i: int | None) -> tuple[Cell, ...]:
    if i is None:
        return (name, *(None,) * 4, "no design")
    mu, lam, zeta = of.designs[i]
    hung = design.scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta)
    way = of.excess.get(ON_THE_WAY)
    needs = None if way is None else (1.0 + float(way[i])) * float(design.scene.block.room)
    tilt = f"{of.severity[i].mean():.0%}"
    return (name, float(hung.mass), float(hung.length), float(zeta), needs, tilt)


def _refusals(design: HarmonicDesign) -> Block:
    """Counts of designs that break each limit, or that do not help, and of reasons against those verified."""
    parts = []
    for found in design.surveys:
        counts = {LABELS.get(n, n): int(np.sum(x > 0.0)) for n, x in found.excess.items()}
        said = [f"{n} exceed the limit on {name}" for name, n in counts.items() if n]
        keep = int(found.keeps.sum())
        parts.append(
            f"Of {len(found.designs)} designs followed from rest by the {found.equations} equations {keep} "
            f"keep to all limits from rest, and {found.better} of these tilt the block less than none"
            + (f" ({'; '.join(said)})." if said else ".")
        )
    # A design may be refused for several reasons, and each of them is counted.
    by = {True: " by the nonlinear equations", False: ""}
    whys = ({_WHY[r.kind] + by[r.step is Step.nonlinear] for r in v.reasons} for v in design.verified)
    kinds = Counter(why for of_one in whys for why in of_one)
    if kinds:
        told = ", ".join(f"{n} because {what}" for what, n in kinds.most_common())
        refused = sum(bool(v.reasons) for v in design.verified)
        parts.append(f"Of {len(design.verified)} verified, {refused} were refused: {told}.")
    return Text(" ".join(parts))


def settled(design: HarmonicDesign, study: Study, figure: Sequence[Block]) -> list[Block]:
    """Largest settled sizes, how limits are used, and the motion under every condition."""
    best, n = design.best, len(design.conditions)
    rows: list[tuple[Cell, ...]] = [
        (f"{design.risk.name} tilt without a pendulum", words.risk(design, design.bare.value))
    ]
    if best is not None:
        rows.append((f"{design.risk.name} tilt with it", words.risk(design, best.value)))
    if design.winner is not None:
        rows.append(("stroke of the bob", words.angle(design.swing)))
        rows += [
            (f"limit on {LABELS.get(n, n)}", f"{x:.0%} used") for n, x in words.usage(design, study).items()
        ]
    caption = f"Of {words.source_of_tilts(design)}, by the linear equations."
    if design.winner is not None:
        caption += " Limits hold for it."
    out: list[Block] = [Table(("", "value"), tuple(rows), caption), *figure]
    told = [] if best is None or best.rest is None else [Text(best.rest.told)]
    if n == 1:
        return [*out, *told]
    cells: list[tuple[Cell, ...]] = []
    for i in map(int, np.unique(np.linspace(0, n - 1, min(n, _ROWS)).astype(int))):
        row = [design.conditions.label(i), *_motion(design, design.bare, i)]
        if best is not None:
            row += [*_motion(design, best, i), float(best.evaluation.stroke[0, i])]
        cells.append(tuple(row))
    head = ("condition", "bare tilt (rad)", "bare kind", "bare from rest")
    head += () if best is None else ("tilt (rad)", "kind", "from rest", "stroke (rad)")
    caption = "From rest: end of one motion followed by the linear equations."
    if best and not design.winner:
        caption += " The design shown is the best found, which is not offered."
    return [*out, Table(head, tuple(cells), caption), *told]


def _motion(design: HarmonicDesign, of: Verified | Bare, i: int) -> tuple[Cell, ...]:
    """Tilt (rad) and kind of motion under a condition, and end from rest."""
    e, nu = of.evaluation, design.scene.block.slenderness * design.conditions.column("slenderness")[i]
    tilt, kind = float(e.tilt[0, i] * nu), KINDS[int(e.kind[0, i])].replace("_", " ")
    return tilt if math.isfinite(tilt) else None, kind, str(of.exact.status[i]).replace("_", " ")


def _search(design: HarmonicDesign, figure: Sequence[Block]) -> list[Block]:
    search = design.search
    ends = "; ".join(f"{n} {what}" for what, n in Counter(s.value for s in search.statuses).items())
    said = (
        f"{search.evaluations} designs, from {search.description}, seed {design.seed}. Searches: "
        f"{ends or 'none'}. {search.told}"
    )
    mismatch, lost = search.mismatch, int(np.sum(search.lost))
    if np.any(mismatch):
        told = zip(mismatch[:, 0], search.statuses, strict=False)
        good = [np.isfinite(x) and status is not SearchStatus.contradicted for x, status in told]
        tilt, slope = (float(x) for x in np.max(mismatch[: len(good)][good], axis=0, initial=0.0))
        said += (
            f" The exact solution confirms {sum(good)} of {len(mismatch)} ends: their tilts differ from "
            f"those of the smoothed signs by at most {tilt:.1e} and the slopes of these by at most "
            f"{slope:.1e}, relative. An end that it contradicts is not offered. Orbits lost: {lost}."
        )
    return [*figure, Text(said)]


def _refused(design: HarmonicDesign) -> list[Block]:
    rows = tuple(
        (v.source, v.mass_ratio, v.length_ratio, v.damping_ratio, v.value, "; ".join(map(str, v.reasons)))
        for v in design.verified
        if v.reasons
    )
    caption = "Value: the risk, a tilt over nu where the block rocks. A refused design is not offered."
    return [Table(("from", "μ", "λ", "ζ", "value", "reasons"), rows, caption)] if rows else []


def ground(
    design: GroundDesign, figures: Mapping[str, Sequence[Block]], said: Sequence[str]
) -> dict[str, list[Block]]:
    """Blocks by the titles of their sections, in the order of a report; empty ones are left out later."""
    return {
        "Over the runs": _judged(design, figures["groups"]),
        "Where it was searched": _surface(design, figures["search"]),
        "Records": _records(design, said),
    }


def _records(design: GroundDesign, said: Sequence[str]) -> list[Block]:
    """Table of the records of each group, and the notes on their files."""
    rows: list[tuple[Cell, ...]] = []
    for group in design.groups:
        for f in (facts(m) for m in group.motions if isinstance(m, Record)):
            sizes = f["samples"], f["step_s"], f["duration_s"], f["pga_g"]
            noted = "; ".join(f["notes"]) or None
            rows.append((group.name, f["source"] or f["name"], f["earthquake"], *sizes, noted))
    head = ("group", "file", "earthquake", "samples", "step (s)", "length (s)", "PGA (g)", "noted")
    table = [Table(head, tuple(rows), "PGA as read, before any scale.")] if rows else []
    told = dict.fromkeys([*said, *same_earthquakes([m for g in design.groups for m in g.motions])])
    return [*table, *([Listing(tuple(told))] if told else [])]


def _judged(design: GroundDesign, figure: Sequence[Block]) -> list[Block]:
    if not design.judged:
        return []
    head = ("group", "motions", "earthquakes", "overturned without", "with it", "difference (95 %)")
    more = ("tilt/ν, difference (95 %)", "linear equations", "verdicts changed")
    strikes = f"limits broken ({design.worth.broken:.0%} allowed)", "no answer"
    caption = (
        "Runs of the nonlinear equations, each motion at each intensity, without and with the pendulum on "
        "the same block with scattered properties. Intervals take the runs of one earthquake as one. Linear "
        "equations: difference of the share overturned. Verdicts changed: share of the runs in which both "
        "sets of equations differ on overturning. Limits broken: share of the runs that stand, in brackets "
        "by the linear equations. No answer: runs that met too many events, of both sets of "
        "equations, bare and hung; all shares and means leave them out."
    )
    rows: list[tuple[Cell, ...]] = []
    for g in design.judged:
        role = g.name if g.role is Role.tuned or g.name == g.role.value else f"{g.name} (held out)"
        shares = [f"{x:.1%}" for x in g.overturned]
        sizes = g.difference.words(), g.tilt.words(share=False), g.linear.words(), f"{g.changed:.1%}"
        broken = f"{g.strikes:.1%} ({g.linear_strikes:.1%})"
        rows.append((role, str(g.motions), str(g.events), *shares, *sizes, broken, unknown(g)))
    return [*figure, Table((*head, *more, *strikes), tuple(rows), caption)]


def _surface(design: GroundDesign, figure: Sequence[Block]) -> list[Block]:
    found = design.searched
    if found is None:
        return []
    counts = (
        f"{len(found.value)} designs were followed in {len(design.conditions)} runs each: "
        f"{design.method.starts} over the whole space, the others where the surface promised most. "
        f"{int(found.feasible.sum())} keep to the limits, {int(found.spares.sum())} with {SPARE:.0%} of each "
        f"to spare, as the search asks for. Trend of the {design.risk.name} tilt/ν at the best "
        f"{design.trend[0]:.4g} ± {design.trend[1]:.2g}, {design.bare:.4g} without a pendulum."
    )
    return [*figure, Text(counts)]
