"""Settled amplitude against frequency, by the exact solution from rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import jax
import numpy as np

from tpd.models.piecewise import Piecewise
from tpd.parameters import as_arrays
from tpd.scene import Pendulum, Scene
from tpd.search import Progress
from tpd.status import status_name
from tpd.steady import steady_state


@dataclass(frozen=True, kw_only=True)
class Response:
    """One curve: arrays over frequency."""

    frequency: np.ndarray
    """Hz"""
    amplitude: np.ndarray
    """Settled |phi| from rest, rad; infinite where the block overturns."""
    stroke: np.ndarray
    """Settled |psi|, rad."""
    status: np.ndarray
    """Names of the steady states' statuses."""


def frequency_response(
    scene: Scene,
    pendulum: Pendulum | None,
    frequencies: np.ndarray,
    *,
    progress: Progress | None = None,
) -> Response:
    """The settled motion at each frequency (Hz) of the scene's base amplitude, from rest."""
    amplitude, stroke, status = [], [], []
    for i, frequency in enumerate(frequencies):
        moved = replace(scene, motion=replace(scene.motion, frequency=float(frequency)))
        s = jax.block_until_ready(steady_state(as_arrays(moved.parameters(pendulum)), model=Piecewise()))
        amplitude.append(float(s.amplitude))
        stroke.append(float(s.stroke))
        status.append(status_name(s.status))
        if progress is not None:
            progress("responding", i + 1, len(frequencies))
    return Response(
        frequency=np.asarray(frequencies),
        amplitude=np.array(amplitude),
        stroke=np.array(stroke),
        status=np.array(status, dtype=str),
    )
