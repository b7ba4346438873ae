"""Pictures of a report, by their files' names: SVG where they are lines, PNG where they are fields."""

from __future__ import annotations

from typing import Any

from tpd.design.ground.design import GroundDesign
from tpd.design.result import Design, DesignStatus, HarmonicDesign
from tpd.design.study import Study
from tpd.report.responses import topplings

CAPTIONS = {
    "drawing.svg": (
        "The block on its base and its pendulum, to scale, with dimensions",
        "To scale; the pendulum to a larger scale as it is to be built. Dashed: the bob at the ends of its "
        "swing. The rod differs from the length in the equations by the size of the bob and the mass of the"
        " rod.",
    ),
    "animation.gif": (
        "Animation of the block on its moving base, without the pendulum and with it",
        "First seconds from rest under the scene's own shaking, by the linear equations.",
    ),
    "benefit.svg": (
        "Mean tilt with the pendulum (filled) and without (open), over all runs and under each condition",
        "Paired runs of the nonlinear equations: the further a dot lies to the left of its square, the "
        "better. Above the line: over all runs, the bar a 95 % interval of the difference. A tilt of 1 is "
        "the slenderness, where the block topples; overturned runs count as 1.",
    ),
    "response.svg": (
        "Settled amplitude over frequency, and share of runs that overturn, bare (open) and hung (filled)",
        "Above: the motion that the block settles into from rest, by the linear equations; triangles and "
        "crosses: it overturns. Below: share that overturns of the runs from rest near each frequency, with"
        " its 95 % interval: next to overturning a single run is chance. Dotted: the frequency of the "
        "scene.",
    ),
    "motion.svg": (
        "Tilt of the block without and with the pendulum, and angle of the rod, against time from rest",
        "First periods from rest under the scene's own shaking, by the linear equations: grey without the "
        "pendulum, blue with it. A block that stands here may overturn later. A limit on the stroke "
        "(dotted) holds for the settled motion only.",
    ),
    "search.png": (
        "Tilt over mass ratio and length ratio as a shaded field, with edges of the limits and the answer",
        "The darker, the more the block tilts: the trend through the designs that the search followed from "
        "rest by the linear equations, at the damping of the answer (the star). Hatched: a limit is broken;"
        " each edge bears the name of its limit. Lines: ways of the descents.",
    ),
    "conditions.svg": (
        "Tilt and bob angle over the quantity that the conditions differ in, with and without a pendulum",
        "Lines: largest steady tilt of the motions that count. Near the top: the block overturns from rest.",
    ),
    "front.svg": (
        "Fall of the mean tilt against the mass of the bob",
        "The gain of each kilogramme: answers whose bob may be no heavier than a bound, over its own mass.",
    ),
    "groups.svg": (
        "Share of motions that overturn the block over their intensity, without and with the pendulum",
        "Marks: shares of the motions of each group by the nonlinear equations; curves: lognormal fits with"
        " bands of 95 %. The title says the difference over all stripes, with its interval.",
    ),
}
"""Alternative text of every picture, and a caption that says what to see."""


def names(design: Design, study: Study) -> tuple[str, ...]:
    """Names of the pictures that there is data for."""
    # A drawing of a design that the search had only come to by an interruption would be taken for the answer.
    whole = design.status is not DesignStatus.interrupted
    there = {}
    if isinstance(design, GroundDesign):
        there |= {"groups.svg": bool(design.judged), "search.png": design.searched is not None}
    elif isinstance(design, HarmonicDesign):
        there |= {
            "benefit.svg": whole and design.best is not None and design.best.benefit is not None,
            "conditions.svg": len(design.conditions) > 1 and design.conditions.axis is not None,
            "search.png": len(design.search.screened) > 0,
            "response.svg": bool(study.responses),
            "motion.svg": bool(study.histories),
        }
    there |= {"front.svg": bool(study.front), "drawing.svg": whole}
    there |= {"animation.gif": whole and bool(study.histories)}
    return tuple(name for name, exists in there.items() if exists)


def draw(name: str, design: Design, study: Study) -> bytes:
    """Content of one of the files in `names`.

    Raises:
        ValueError: another name.
    """
    # A report in words does not wait for Matplotlib.
    from tpd.plot import animation, compare, motion, response
    from tpd.plot.style import png, svg

    axes: Any
    scene, histories = design.scene, study.histories or ()
    what, _, kind = name.partition(".")
    match what:
        case "search":
            axes = design.plot()
        case "benefit" | "conditions" | "groups" | "drawing":
            axes = design.plot(what)
        case "response":
            levels = topplings(scene, design.pendulum)
            axes = response.plot_response(study.responses or (), scene.motion.frequency, toppling=levels)
        case "motion":
            limit = design.stroke_limit if isinstance(design, HarmonicDesign) else float("inf")
            axes = motion.plot_motions(histories, scene.block.slenderness, stroke_limit=limit)
        case "front":
            axes = compare.plot_front(study.front)
        case "animation":
            return animation.animate(scene, design.pendulum, histories)
        case _:
            raise ValueError(f"`name` must be one of {', '.join(names(design, study))}, but is {name!r}")
    figure = (axes if hasattr(axes, "figure") else axes[0]).figure
    return svg(figure) if kind == "svg" else png(figure)
