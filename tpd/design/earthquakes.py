"""Outcomes of a design, which was sought for a harmonic, under recorded ground motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tpd.analysis.ground_batch import Progress, follow_scaled
from tpd.analysis.transient import FREE
from tpd.core.ground_motion import GroundMotion
from tpd.design.result import Design


@dataclass(frozen=True, kw_only=True)
class Earthquakes:
    """Outcomes under records at their own size, bare and with the pendulum; arrays of shape (records,)."""

    sources: tuple[str, ...]
    """Files, folders and sets that the records come from."""
    names: tuple[str, ...]
    pga: np.ndarray
    """Largest acceleration of the ground, m/s^2."""
    bare: np.ndarray
    """Largest tilt over the slenderness; infinite after an overturning."""
    hung: np.ndarray | None
    """Largest tilt over the slenderness with the pendulum; None without one."""
    relative: np.ndarray | None
    """Largest angle between rod and block, rad."""
    nonlinear: tuple[np.ndarray, np.ndarray | None]
    """Whether the nonlinear equations overturn the block, bare and with the pendulum."""

    @property
    def overturned(self) -> tuple[int, int | None]:
        """Records that overturn the bare block, and the block with the pendulum."""
        return int(np.isinf(self.bare).sum()), None if self.hung is None else int(np.isinf(self.hung).sum())


def shaken(
    design: Design,
    motions: Sequence[GroundMotion],
    sources: Sequence[str] = (),
    progress: Progress | None = None,
) -> Earthquakes:
    """Follow the block of a design through records at their own size, bare and with the pendulum.

    Args:
        design: the answer of `optimise`.
        motions: records or pulses.
        sources: where they come from, for the report.
        progress: called with the motions done and in all.
    """
    scene, hung = design.scene, design.pendulum
    cases = (None,) if hung is None else (None, hung)
    ones, nu = np.ones((len(motions), 1)), float(scene.block.slenderness)
    exact, checked = [], []
    for pendulum in cases:
        # The linear equations are exact between the samples; the nonlinear ones check their verdict.
        for into, nonlinear in ((exact, False), (checked, True)):
            found = follow_scaled(
                scene.block,
                pendulum,
                motions,
                ones,
                gravity=float(scene.gravity),
                free=FREE,
                nonlinear=nonlinear,
                progress=progress,
            )
            into.append(found)
    tilts = [np.where(o.undecided, np.nan, o.tilt)[:, 0] / nu for o in exact]
    fallen = [o.overturned[:, 0] for o in checked]
    return Earthquakes(
        sources=tuple(sources),
        names=tuple(getattr(m, "name", "") or f"motion {i + 1}" for i, m in enumerate(motions)),
        pga=np.array([float(m.pga) for m in motions]),
        bare=tilts[0],
        hung=None if hung is None else tilts[1],
        relative=None if hung is None else exact[1].relative[:, 0],
        nonlinear=(fallen[0], None if hung is None else fallen[1]),
    )
