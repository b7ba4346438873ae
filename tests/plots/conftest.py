"""Small real designs, one for each kind of excitation, which all tests of the pictures share."""

import numpy as np
import pytest

import tpd
from tests.plots.examples import SCENE, SMALL


@pytest.fixture(scope="session")
def single():
    """A design for the motion of the scene alone."""
    return tpd.optimise(SCENE, conditions=tpd.Conditions.exactly(), **SMALL)


@pytest.fixture(scope="session")
def band():
    """A design for a band of frequencies, given from the highest to the lowest one."""
    factors = np.array([1.2, 1.1, 1.0, 0.9])
    return tpd.optimise(SCENE, conditions=tpd.Conditions({"frequency": factors}), **SMALL)


@pytest.fixture(scope="session")
def under_pulses():
    """A design for pulses, with cross-fitting."""
    sizes = zip(np.linspace(4.0, 7.0, 8), np.linspace(1.0, 2.5, 8), strict=True)
    pulses = [tpd.Pulse(kind="one-sine", acceleration=a, frequency=f) for a, f in sizes]
    conditions = tpd.Conditions.records(pulses, [1.5, 2.5])
    method, limits = tpd.GroundSearch(designs=16, steps=4), (tpd.limits.Stroke(1.0),)
    return tpd.optimise(SCENE.block, conditions=conditions, limits=limits, method=method)
