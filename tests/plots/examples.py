"""Small answers that the pictures show."""

import numpy as np

import tpd
from tpd.answers.response import Response
from tpd.design.as_built import TimeHistory

SCENE = tpd.paper_scene()
PENDULUM = tpd.Pendulum(mass=1.6224, length=0.12, damping_ratio=0.1)
SMALL = {
    "space": tpd.DesignSpace(damping_ratio=0.1),
    "limits": tpd.limits.POINT_BOB,
    "method": tpd.Descent(model=tpd.Piecewise(), searches=2, screening=32, steps=20, corrections=2),
    "ensemble": tpd.Ensemble(size=256),
}
"""Settings of a search that takes seconds."""


def response(*amplitudes, frequency=(2.4, 2.45, 2.6), status="rocking") -> Response:
    """Response with these settled amplitudes (rad)."""
    return Response(
        frequency=np.array(frequency),
        amplitude=np.array(amplitudes),
        swing=np.full(len(amplitudes), 0.1),
        status=np.broadcast_to(np.asarray(status, dtype="<U16"), len(amplitudes)),
    )


def history(with_pendulum: bool, size: float = 0.08, overturns: bool = False) -> TimeHistory:
    """Motion over 9.6 s that grows to an amplitude (rad), or passes a right angle at 2.53 s."""
    time = np.linspace(0.0, 9.6, 24 * 60 + 1)
    tilt = size * np.sin(2.0 * np.pi * 2.5 * time) * (1.0 - np.exp(-time))
    if overturns:
        tilt = np.where(time > 3.0, np.nan, 0.01 * np.exp(2.0 * time))
    bob = 0.3 * np.sin(2.0 * np.pi * 2.5 * time + 1.0)
    return TimeHistory(
        times=time,
        tilt=tilt,
        swing=np.where(np.isfinite(tilt), bob, np.nan) if with_pendulum else None,
        overturned=overturns,
    )


HISTORIES = history(False), history(True, 0.04)
