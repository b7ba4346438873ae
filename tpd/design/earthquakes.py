"""Outcomes of a design, which was sought for a harmonic, under recorded ground motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tpd.analysis.ground_batch import Progress, follow_scaled
from tpd.analysis.transient import FREE
from tpd.core.ground_motion import GroundMotion
from tpd.design.result import HarmonicDesign


@dataclass(frozen=True, kw_only=True)
class Earthquakes:
    """Outcomes under records at their own size, bare and with the pendulum, arrays of shape (records,): tilts
    are of the linear equations, NaN where they have no answer."""

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
    """Largest angle between rod and block, rad, by the nonlinear equations: it sizes the room. Infinite after
    an overturning, NaN where nothing is known."""
    linear_relative: np.ndarray | None
    """This angle by the linear equations."""
    nonlinear: tuple[np.ndarray, np.ndarray | None]
    """Whether the nonlinear equations overturn the block, bare and with the pendulum."""
    unknown: tuple[np.ndarray, np.ndarray | None]
    """Whether the nonlinear equations have no answer, bare and with the pendulum."""

    @property
    def undecided(self) -> tuple[int, int]:
        """Runs without an answer by the linear and by the nonlinear equations, bare and hung together."""
        linear = sum(int(np.isnan(x).sum()) for x in (self.bare, self.hung) if x is not None)
        return linear, sum(int(x.sum()) for x in self.unknown if x is not None)

    @property
    def overturned(self) -> tuple[int, int | None]:
        """Records that overturn the bare block, and the block with the pendulum."""
        return int(np.isinf(self.bare).sum()), None if self.hung is None else int(np.isinf(self.hung).sum())


def shaken(
    design: HarmonicDesign,
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
    fallen, unknown = [o.overturned[:, 0] for o in checked], [o.undecided[:, 0] for o in checked]
    angles = [np.where(o.undecided, np.nan, o.relative)[:, 0] for o in (exact[-1], checked[-1])]
    return Earthquakes(
        sources=tuple(sources),
        names=tuple(getattr(m, "name", "") or f"motion {i + 1}" for i, m in enumerate(motions)),
        pga=np.array([float(m.pga) for m in motions]),
        bare=tilts[0],
        hung=None if hung is None else tilts[1],
        relative=None if hung is None else angles[1],
        linear_relative=None if hung is None else angles[0],
        nonlinear=(fallen[0], None if hung is None else fallen[1]),
        unknown=(unknown[0], None if hung is None else unknown[1]),
    )
