"""Pictures of a report, by their files' names."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tpd.design.result import Design, DesignStatus
from tpd.design.study import Study


def available(design: Design, study: Study) -> dict[str, Callable[[], bytes]]:
    """Functions that draw the pictures there is data for, each returning a file's content."""
    out: dict[str, Callable[[], bytes]] = {}
    if len(design.conditions) > 1 and design.conditions.axis is not None:
        out["conditions.png"] = lambda: _conditions(design)
    if len(design.search.screened):
        out["search.png"] = lambda: _search(design, study)
    if study.responses:
        out["response.png"] = lambda: _response(design, study)
    if study.histories:
        out["motion.png"] = lambda: _histories(design, study)
    if study.front is not None:
        out["front.png"] = lambda: _front(design, study)
    if design.status is not DesignStatus.interrupted:
        out["drawing.png"] = lambda: _drawing(design)
        if study.histories:
            out["animation.gif"] = lambda: _animation(design, study)
    return out


# Matplotlib is imported where it draws: a report in words does not wait for it.


def _png(axes: Any) -> bytes:
    from tpd.plot.style import png

    return png(axes.figure)


def _conditions(design: Design) -> bytes:
    from tpd.plot.conditions import plot_conditions

    return _png(plot_conditions(design)[0])


def _search(design: Design, study: Study) -> bytes:
    from tpd.plot.search import plot_search

    return _png(plot_search(design, study.region))


def _response(design: Design, study: Study) -> bytes:
    from tpd.plot.response import plot_response

    return _png(plot_response(study.responses or (), design.scene.motion.frequency))


def _histories(design: Design, study: Study) -> bytes:
    from tpd.plot.histories import plot_histories

    return _png(plot_histories(study.histories or (), design.scene.block.slenderness, design.stroke_limit)[0])


def _front(design: Design, study: Study) -> bytes:
    from tpd.plot.front import plot_front

    assert study.front is not None
    return _png(plot_front(study.front, design))


def _drawing(design: Design) -> bytes:
    from tpd.plot.drawing import plot_scene

    return _png(plot_scene(design.scene, design.pendulum, stroke=design.stroke))


def _animation(design: Design, study: Study) -> bytes:
    from tpd.plot.animation import animate

    return animate(design.scene, design.pendulum, study.histories or ())
