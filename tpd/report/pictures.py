"""Pictures of a report, by their files' names."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tpd.design.criteria import Room, limit_of
from tpd.design.result import DesignStatus, HarmonicDesign
from tpd.design.study import Study
from tpd.report.responses import topplings
from tpd.report.words import settled_stroke

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def names(design: HarmonicDesign, study: Study) -> tuple[str, ...]:
    """Names of the pictures that there is data for."""
    # A drawing of a design that the search had only come to by an interruption would be taken for the answer.
    whole = design.status is not DesignStatus.interrupted
    there = {
        "benefit.png": whole and design.best is not None and design.best.benefit is not None,
        "conditions.png": len(design.conditions) > 1 and design.conditions.axis is not None,
        "search.png": len(design.search.screened) > 0,
        "response.png": bool(study.responses),
        "motion.png": bool(study.histories),
        "front.png": bool(study.front),
        "drawing.png": whole,
        "animation.gif": whole and bool(study.histories),
    }
    return tuple(name for name, exists in there.items() if exists)


def draw(name: str, design: HarmonicDesign, study: Study) -> bytes:
    """Content of one of the files in `names`."""
    # A report in words does not wait for Matplotlib.
    from tpd.plot import animation, benefit, conditions, front, histories, response, search
    from tpd.plot.style import png

    scene, motions = design.scene, study.histories or ()
    match name:
        case "benefit.png":
            axes = benefit.plot_benefit(design)
        case "conditions.png":
            axes = conditions.plot_conditions(design)[0]
        case "search.png":
            axes = search.plot_search(design, study.region)
        case "response.png":
            levels = topplings(scene, design.pendulum)
            axes = response.plot_response(study.responses or (), scene.motion.frequency, toppling=levels)
        case "motion.png":
            axes = histories.plot_histories(motions, scene.block.slenderness, design.stroke_limit)[0]
        case "front.png":
            axes = front.plot_front(study.front)
        case "drawing.png":
            axes = _drawing(design)
        case "animation.gif":
            return animation.animate(scene, design.pendulum, motions)
        case _:
            raise ValueError(f"`name` must be one of {', '.join(names(design, study))}, but is {name!r}")
    return png(axes.figure)


def drawing_svg(design: HarmonicDesign) -> bytes:
    """The drawing to scale as SVG, for those who go on drawing."""
    from tpd.plot.style import svg

    return svg(_drawing(design).figure)


def _drawing(design: HarmonicDesign) -> Axes:
    """Drawing to scale, the bob as the body that the limits ask room for."""
    from tpd.plot import drawing

    # Without the limit the search took a point; a body in the drawing would claim that it fits.
    room = limit_of(design.limits, Room)
    bob = room.bob if isinstance(room, Room) else None
    return drawing.plot_scene(design.scene, design.pendulum, stroke=settled_stroke(design), bob=bob)
