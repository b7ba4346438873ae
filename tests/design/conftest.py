"""Designs that several modules look at: each is made once in a session."""

import pytest
from tpd.design.by_runs import PairedRuns

import tpd
from tests import designs
from tpd.design.problem import Problem
from tpd.design.search import search as search_designs
from tpd.scene.conditions import Conditions
from tpd.scene.scene import Harmonic, Scene

SCENE = tpd.paper_scene()
LIGHT = tpd.DesignSpace(mass_ratio=(0.01, 0.1))
ANY_WORTH = tpd.limits.Worth(at_least=0.0, runs=32)
"""Asks for no harm, and for a benefit that is not zero."""
ONE = {
    "conditions": tpd.Conditions.exactly(),
    "worth": ANY_WORTH,
    "method": tpd.Descent(searches=3, steps=4, screening=24),
    "limits": (tpd.limits.Stroke(1.5),),
    "ensemble": tpd.Ensemble(size=32, periods=40, seed=0),
    "seed": 1,
}
"""One condition, a small budget. The best designs from rest are fragile: their neighbours are verified."""
WIDE = tpd.DesignSpace(mass_ratio=(0.01, 0.2), damping_ratio=(0.05, 0.4))
BAND = tpd.Conditions.band(SCENE, 2.0, 3.5, 5)
SEVERAL = {
    "conditions": BAND,
    "limits": tpd.limits.POINT_BOB,
    "worth": ANY_WORTH,
    "method": tpd.Descent(searches=20, screening=64, steps=25, model=tpd.Piecewise()),
    "ensemble": tpd.Ensemble(size=64, periods=40),
}


@pytest.fixture(scope="session")
def one():
    """Design for one condition, on smoothed signs."""
    return tpd.optimise(SCENE, LIGHT, **ONE)


@pytest.fixture(scope="session")
def several():
    """Design for a band of frequencies, on exact orbits."""
    return tpd.optimise(SCENE, WIDE, **SEVERAL)


FEW_STEPS = tpd.Descent(searches=20, screening=48, steps=8, model=tpd.Piecewise())
ORBIT_LIMITS = (tpd.limits.Stroke(0.5), tpd.limits.Reserve(0.05))


@pytest.fixture(scope="session")
def search():
    """Search over the orbits under a band of frequencies; not verified."""
    problem = Problem.of(SCENE, WIDE, conditions=BAND, limits=ORBIT_LIMITS, method=FEW_STEPS)
    return problem.objective, search_designs(problem.objective, FEW_STEPS, 0)


@pytest.fixture(scope="session")
def real():
    """A design whose runs can be followed again: the bob of a chimney, judged by 64 runs."""
    sizes = {"width": 1.3, "height": 10.0, "mass": 16280.0, "radius_of_gyration": 2.92, "cavity_width": 0.9}
    scene = Scene(tpd.Block(**sizes, restitution="housner"), Harmonic(amplitude=0.081, frequency=0.85))
    ratios = {"mass_ratio": 0.03, "length_ratio": 0.1, "damping_ratio": 0.6}
    hung, conditions = scene.pendulum(**ratios), Conditions.around(scene)
    ensemble = tpd.Ensemble(size=64, seed=2)
    verdict, gain = PairedRuns(scene, conditions, ensemble, tpd.limits.Worth(), None).of(hung)
    winner = designs.verified(**ratios, paired=verdict, benefit=gain)
    known = {"scene": scene, "conditions": conditions, "pendulum": hung, "verified": (winner,)}
    return designs.around(worth=tpd.limits.Worth(), **known)
