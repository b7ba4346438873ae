"""Tables of a report: ensemble, comparison of models, sensitivities and front."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tpd.analysis.compare_models import Check
from tpd.analysis.outcomes import Outcomes
from tpd.analysis.sensitivity import Elasticities
from tpd.core.formatting import number
from tpd.design.front import FrontPoint
from tpd.design.result import HarmonicDesign
from tpd.design.study import Study
from tpd.report.blocks import Block, Cell, Table, danger, information, warning

_MEANING = {
    "mu": "mass ratio μ, bob over block",
    "lam": "length ratio λ, pendulum over half height",
    "zeta": "damping ratio ζ of the hinge",
    "k": "friction k of the contact",
    "f": "base acceleration f over g",
    "xi": "frequency ratio ξ",
    "nu": "slenderness ν, width over height",
}


def ensemble(design: HarmonicDesign) -> list[Block]:
    """Shares and quantiles of the paired runs, with the best design and without a pendulum."""
    verdict = None if design.best is None else design.best.paired
    if verdict is None:
        return []
    # The best design may have been refused; its runs are shown all the same, if it came that far.
    pair, runs = (verdict.hung, verdict.bare), verdict.hung.ensemble
    shares: list[tuple[Cell, ...]] = []
    for ramp in verdict.hung.by_ramp():
        name = "overturned, of sudden starts" if ramp == 0.0 else f"overturned, growing for {ramp:g} s"
        shares.append((name, *(str(o.by_ramp()[ramp]) for o in pair)))
    for name, quantity in (("largest tilt", "peak"), ("settled tilt", "amplitude")):
        quantiles = (_quantiles(o, quantity) for o in pair)
        shares.append((f"{name}: 50, 90, 99 % of the runs (rad)", *quantiles))
    shares.append(("bob's largest angle: 50, 90, 99 % (rad)", _quantiles(verdict.hung, "peak_stroke"), None))
    with_it, without = verdict.undecided
    caption = (
        f"Ensemble of {runs.size} runs of the {verdict.equations} equations, seed {runs.seed}: starts, "
        "phases, growth of the shaking and uncertain quantities vary alike for both. Without an answer, and "
        f"left out: {with_it} runs with the pendulum, {without} without. In brackets: 95 % confidence."
    )
    return [Table(("", "with pendulum", "without"), tuple(shares), caption)]


def _quantiles(o: Outcomes, quantity: str) -> str:
    return ", ".join("overturned" if math.isinf(x) else number(x) for x in o.quantiles(quantity))


def comparison(check: Check) -> list[Block]:
    """A design by all models that were asked, and objections of the last one."""
    rows = tuple(
        (r.name, r.amplitude, r.stroke, r.status.replace("_", " "), round(r.seconds * 1e3, 1), r.neglects)
        for r in check.models
    )
    head = ("model", "amplitude (rad)", "stroke (rad)", "status", "time (ms)", "neglects")
    caption = (
        "The design from rest under the scene's own shaking, the cheapest model first; the last one judges. "
        "One harmonic: the motion as a single sine at the forcing frequency (harmonic balance); a rocking "
        "block has higher harmonics, so that its number may be off by a tenth, and it knows no overturning."
    )
    objections = (
        (danger if "overturned" in x else warning)(f"Under the scene's own shaking {x}.")
        for x in check.objections
    )
    return [Table(head, rows, caption), *objections]


def sensitivity(design: HarmonicDesign, study: Study) -> list[Block]:
    """Elasticities: of the motion from rest for one condition, else of the risk; the strongest first."""
    if study.elasticities is not None:
        return _of_motion(study.elasticities)
    # A quantity that moves nothing, such as friction of zero, has no elasticity.
    known = {name: x for name, x in design.elasticities.items() if math.isfinite(x)}
    rows = tuple((name, f"{known[name]:+.2f}") for name in sorted(known, key=lambda name: -abs(known[name])))
    caption = f"Per cent of the {design.risk.name} tilt for one per cent more of each, the others constant."
    return [Table(("quantity", "% for 1 %"), rows, caption)] if rows else []


def _of_motion(found: Elasticities) -> list[Block]:
    """Elasticities of the amplitude or, at rest, of the uplift margin."""
    if not found.slopes:
        return [information(f"There is no gradient: {found.refused}.")]
    amplitude = found.of == "amplitude"
    text = (
        "Change of the settled rocking amplitude, in per cent, for one per cent more of each parameter."
        if amplitude
        else "The block rests, so its amplitude is zero and flat. The table has the uplift margin instead, "
        f"of which {found.value:.2%} is left: its change, in points of per cent, for one per cent more of "
        "each parameter. Where that uses up the margin, the block lifts."
    )
    # Elasticities of the margin are stored as shares; the table has points of per cent.
    scale = 1.0 if amplitude else 100.0
    rows = tuple(
        (_MEANING[name], found.at[name], f"{scale * found.slopes[name]:+.3g}")
        for name in sorted(found.slopes, key=lambda name: -abs(found.slopes[name]))
    )
    head = ("parameter", "value", "% for 1 %" if amplitude else "points for 1 %")
    caption = "From the exact gradient at the design: for small changes that lead to no other motion."
    return [information(text), Table(head, rows, caption)]


def front(points: Sequence[FrontPoint]) -> Table:
    """The answer for every largest mass of the bob."""
    rows: list[tuple[Cell, ...]] = []
    for p in points:
        if p.pendulum is None:
            rows.append((f"{number(p.most)} kg", p.status.replace("_", " "), None))
            continue
        hung = f"{number(p.pendulum.mass)} kg on {number(p.pendulum.length)} m, ζ = "
        saved, low, high = p.saved
        fall = None if math.isnan(saved) else f"{saved:.0%} ({low:.0%} to {high:.0%})"
        rows.append((f"{number(p.most)} kg", f"{hung}{number(float(p.pendulum.damping_ratio))}", fall))
    caption = "Every row is an answer of its own, verified by the same runs; the last is the design itself."
    return Table(("bob at most", "answer", "less tilt (95 %)"), tuple(rows), caption)
