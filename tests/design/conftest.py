"""Designs that several modules look at: each is made once in a session."""

import pytest

import tpd
from tests import designs
from tpd.design.harmonic import HarmonicProblem
from tpd.design.search import search as search_designs

SCENE = tpd.paper_scene()
WIDE = tpd.DesignSpace(mass_ratio=(0.01, 0.2), damping_ratio=(0.05, 0.4))
BAND = tpd.Conditions.band(SCENE, 2.0, 3.5, 5)
FEW_STEPS = tpd.Descent(searches=20, screening=48, steps=8, model=tpd.Piecewise())
ORBIT_LIMITS = (tpd.limits.Stroke(0.5), tpd.limits.Reserve(0.05))


@pytest.fixture(scope="session")
def search():
    """Search over the orbits under a band of frequencies; not validated."""
    given = {"conditions": BAND, "limits": ORBIT_LIMITS, "method": FEW_STEPS}
    given |= {"objective": tpd.limits.SteadyTilt(), "risk": tpd.Risk.worst()}
    problem = HarmonicProblem.of(SCENE, WIDE, **given)
    return problem.orbits, search_designs(problem.orbits, FEW_STEPS, 0)


@pytest.fixture(scope="session")
def harmonic():
    """A recommended pendulum under harmonic excitation."""
    return designs.harmonic_design()


@pytest.fixture(scope="session")
def rejected():
    """A problem under harmonic excitation that requires too large a benefit."""
    return designs.rejected_design()


@pytest.fixture(scope="session")
def ground():
    """A pendulum under ground motions."""
    return designs.ground_design()
