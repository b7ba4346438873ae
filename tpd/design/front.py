"""Front of the bob's mass against the benefit: what a kilogramme pays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.statistics import Interval
from tpd.core import checks
from tpd.core.formatting import picture
from tpd.core.progress import Progress
from tpd.design.optimise import optimise
from tpd.design.result import Design
from tpd.scene.scene import Pendulum

_LEAST, _LIGHTER = 1.0 / 16.0, 3
"""Share of the largest mass at which a front begins, and how many lighter bobs it has by default."""


class Front(tuple["FrontPoint", ...]):
    """Answers with lighter bobs, the lightest first; the design itself comes last."""

    __slots__ = ()

    def plot(self, *, ax: Any = None) -> Any:
        """Draw the fall of the mean tilt over the bob's mass, with intervals, and return the axes."""
        return picture("compare:plot_front")(self, ax)


class FrontPoint(NamedTuple):
    """Answer with a bob of at most a mass."""

    most: float
    """kg"""
    status: str
    """Name of the status."""
    pendulum: Pendulum | None
    """None where none is offered."""
    saved: tuple[float, float, float]
    """Share by which the mean tilt falls, and its interval of 95 %, on runs that no choice has seen; NaN
    without a pendulum."""


def front(
    design: Design,
    most: Sequence[float] | None = None,
    *,
    method: Any = None,
    progress: Progress | None = None,
) -> Front:
    """Answer the question of a design again with lighter bobs, each verified as the design itself.

    Args:
        design: an answer of `tpd.optimise`.
        most: largest masses over the block's, increasing; by default three in equal ratios from a sixteenth
            of the space's largest on. The design itself comes last.
        method: of each search; default that of the design.
        progress: called with ("front", bobs done, of how many).

    Raises:
        ValueError: masses that do not increase, or that are not within the design space.
        KeyboardInterrupt: Ctrl-C.
    """
    checks.instance("design", design, Design)
    block = design.scene.block
    low, high = design.space.mass_ratio
    shares = np.geomspace(max(low, high * _LEAST), high, _LIGHTER + 2)[1:-1] if most is None else most
    shares = np.asarray(shares, dtype=float)
    if shares.ndim != 1 or np.any(np.diff(shares) <= 0.0) or not np.all((shares > low) & (shares < high)):
        raise ValueError(
            f"`most` must be increasing masses between {low:g} and {high:g} of the block's, but is "
            f"{shares.tolist()}"
        )
    points = []
    for i, share in enumerate(shares):
        if progress is not None:
            progress("front", i, len(shares))
        space = replace(design.space, mass_ratio=(low, float(share)))
        answer = optimise(**design.again(space=space, **({} if method is None else {"method": method})))
        if answer.status.name == "interrupted":
            raise KeyboardInterrupt
        points.append(_point(float(share * block.mass), answer))
    return Front((*points, _point(float(high * block.mass), design)))


def _point(most: float, answer: Design) -> FrontPoint:
    saved = answer.saved or Interval(np.nan, np.nan, np.nan)
    return FrontPoint(most, answer.status.name, answer.pendulum, (saved.mean, saved.low, saved.high))
