"""Many searches: lighter bobs for one block, the front of mass against benefit; and pendulums for many
blocks, on the processes of a cluster or one after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from tpd.answers.statistics import Interval
from tpd.cluster.cluster import Cluster, check_where
from tpd.core import checks
from tpd.core.formatting import Printed, Tabular, counted
from tpd.core.progress import Progress, shown_count
from tpd.design.build import FrontPoint
from tpd.design.optimise import optimise
from tpd.design.result import Design, DesignStatus
from tpd.scene.scene import Block, Scene

_LEAST, _LIGHTER = 1.0 / 16.0, 3
"""Share of the largest mass at which a front begins, and how many lighter bobs it has by default."""


class Front(tuple["FrontPoint", ...]):
    """Answers with lighter bobs, the lightest first; the design itself comes last."""

    __slots__ = ()


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
    """
    checks.instance("design", design, Design)
    block = design.scene.block
    low, high = design.space.mass_ratio
    shares = np.geomspace(max(low, high * _LEAST), high, _LIGHTER + 2)[1:-1] if most is None else most
    shares = checks.array("most", shares, (-1,), "a vector of increasing masses")
    if np.any(np.diff(shares) <= 0.0) or not np.all((shares > low) & (shares < high)):
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
        points.append(_point(float(share * block.mass), answer))
    return Front((*points, _point(float(high * block.mass), design)))


def _point(most: float, answer: Design) -> FrontPoint:
    saved = answer.saved or Interval(np.nan, np.nan, np.nan)
    return FrontPoint(most, answer.status.name, answer.pendulum, (saved.mean, saved.low, saved.high))


_STATUSES = tuple(DesignStatus.__members__)
"""Names of statuses; their places stand for them in files."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Designs(Printed, Tabular):
    """Answers for n blocks, arrays of shape (n,); NaN where no pendulum is offered."""

    status: np.ndarray
    """Names of `DesignStatus`."""
    mass: np.ndarray
    """kg"""
    length: np.ndarray
    """m"""
    damping_ratio: np.ndarray
    value: np.ndarray
    """Risk measure of the design that is offered."""
    bare: np.ndarray
    """Risk measure of the block without a pendulum."""

    def columns(self) -> dict[str, Any]:
        """A row for every block, with a column for every field."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def __str__(self) -> str:
        return f"Designs for {len(self.status)} blocks: {counted(self.status)}"


def optimise_all(
    scenes: Sequence[Scene] | Sequence[Block],
    *,
    cluster: Cluster | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
    **settings: Any,
) -> Designs:
    """Find a pendulum for every scene, see `tpd.optimise`.

    Args:
        scenes: blocks with their base motion; blocks alone under ground motions.
        cluster: processes or machines; without it the searches run one after the other. A search has
            threads for all cores of its machine: one process a machine is the quickest.
        progress: True for a bar on stderr, or called with (scenes done, of how many).
        settings: of `tpd.optimise`, for every scene.

    Raises:
        ValueError: bad input, for instance no scene.
        RuntimeError: JAX is in 32-bit mode, or the cluster failed.
    """
    checks.require_x64()
    check_where(None, cluster)
    checks.instance("scenes", scenes, Sequence)
    if not scenes:
        raise ValueError("`scenes` must hold at least one scene, but is empty")
    for i, scene in enumerate(scenes):
        # All blocks or all scenes: one set of conditions serves all of them.
        checks.instance(f"scenes[{i}]", scene, Block if isinstance(scenes[0], Block) else Scene)
    if "progress" in settings:
        raise ValueError("`progress` is of one search, and cannot be given for many")
    # An iterator would be used up by the first search.
    if settings.get("limits") is not None:
        settings["limits"] = tuple(settings["limits"])
    shared, n = (tuple(scenes), settings), len(scenes)
    with shown_count(progress, "searching") as report:
        if cluster is None:
            parts = []
            for i in range(n):
                parts.append(_designed(np.array([i]), *shared))
                report(i + 1, n)
            found = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        else:
            # A search takes seconds: each is a chunk of its own, so that none is lost with another one.
            found = cluster.map("designs", _designed, np.arange(n), shared, chunk=1, progress=report)
    status = np.array(_STATUSES)[found.pop("status")]
    return Designs(status=status, **found)


def _designed(which: np.ndarray, scenes: tuple[Any, ...], settings: dict[str, Any]) -> dict[str, np.ndarray]:
    """Answers for some of the scenes; statuses by their codes."""
    rows = []
    for i in map(int, which):
        try:
            found = optimise(scenes[i], **settings)
        except ValueError as error:
            raise ValueError(f"`scenes[{i}]`: {error}") from None
        hung, (value, bare) = found.pendulum, found.risks
        names = "mass", "length", "damping_ratio"
        sizes = {name: np.nan if hung is None else float(getattr(hung, name)) for name in names}
        rows.append({"status": _STATUSES.index(found.status.name), **sizes, "value": value, "bare": bare})
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}
