"""Records and blocks of the tests of designs on ground motions."""

from __future__ import annotations

import numpy as np
import pytest

import tpd
from tpd.design.ground.objective import GroundObjective

BLOCK = tpd.Block(width=0.9, height=5.4, mass=8000.0, restitution=0.93, cavity_width=0.9)
LIMITS = (tpd.limits.Stroke(), tpd.limits.Room())


def noise(seed: int, event: str = "", n: int = 300) -> tpd.Record:
    """A record of filtered noise under an envelope, its peak 1 m/s^2."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * 0.02
    white = np.convolve(rng.standard_normal(n + 30), np.hanning(31), "valid")[:n]
    a = white * np.sin(np.pi * t / t[-1]) ** 2
    return tpd.Record(a / np.max(np.abs(a)), 0.02, name=f"noise {seed}", event=event)


@pytest.fixture(scope="session")
def records() -> list[tpd.Record]:
    """Two records of each of ten earthquakes."""
    return [noise(seed, f"event {seed // 2}") for seed in range(20)]


@pytest.fixture(scope="session")
def objective(records) -> GroundObjective:
    """Of runs of which some overturn."""
    conditions = tpd.Conditions.records(records[:4], (1.3, 2.0, 5.0))
    return GroundObjective(BLOCK, conditions, LIMITS, 0.1)
