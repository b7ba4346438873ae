"""Parameters, body, limits and uplift of the page are those of the package."""

from dataclasses import replace

import numpy as np
import pytest

import tpd
from tests.browser.node import needs_node, run
from tpd.design.geometry import Geometry
from tpd.design.optimise import problem_of
from tpd.design.sizes import Evaluation, evaluate_sizes
from tpd.explore.content import block_numbers, content
from tpd.scene.conditions import Conditions
from tpd.scene.impacts import housner
from tpd.theory.no_uplift import uplift

CHIMNEY = tpd.Block(width=1.3, height=10.0, mass=16280.0, radius_of_gyration=2.92, cavity_width=0.9)
SCENE = tpd.Scene(CHIMNEY, tpd.Harmonic(amplitude=0.081, frequency=0.85))
ALL = (
    tpd.limits.Stroke(0.4),
    tpd.limits.RelativeStroke(0.5),
    tpd.limits.Tilt(0.3),
    tpd.limits.Mass(700.0),
    tpd.limits.Offset(0.3),
    tpd.limits.Worsening(0.05),
)
PENDULUMS = [(600.0, 0.55, 0.6), (120.0, 2.1, 0.1), (1500.0, 0.3, 0.0), (1500.0, 0.15, 0.2)]
"""Mass, length and damping ratio; no ball of steel swings as the last one does."""


def block(bob: tpd.limits.Bob | None = None) -> dict:
    """Block, gravity and bob as the page has them."""
    clearance = tpd.limits.Clearance(tpd.limits.Bob() if bob is None else bob)
    return block_numbers(problem_of(SCENE, limits=(*ALL, clearance)))


def named(pendulum) -> dict[str, float]:
    return dict(zip(("mass", "length", "damping"), pendulum, strict=True))


@needs_node
@pytest.mark.parametrize("pendulum", [None, *PENDULUMS[:2]])
def test_parameters_and_uplift_margin_equal_the_package(pendulum):
    names = ("mass", "length", "damping_ratio")
    expected = SCENE.parameters(pendulum and tpd.Pendulum(**dict(zip(names, pendulum, strict=True))))
    inputs = [block(), {"amplitude": 0.081, "frequency": 0.85}, pendulum and named(pendulum)]
    function = "(x) => { const p = parameters(...x); return [p, atRest(p)]; }"
    p, rest = run("pendulum", "parameters, atRest", function, inputs)
    for name in ("nu", "mu", "k", "f", "xi", "rho"):
        assert p[name] == pytest.approx(float(getattr(expected, name)), rel=1e-12), name
    if pendulum is not None:
        assert (p["lam"], p["zeta"]) == pytest.approx((float(expected.lam), float(expected.zeta)), rel=1e-12)
    assert p["e"] == pytest.approx(float(housner(expected.nu, expected.rho, expected.mu)), rel=1e-12)
    assert rest["margin"] == pytest.approx(float(uplift(expected).margin), rel=1e-9)
    assert rest["swing"] == pytest.approx(float(uplift(expected).swing), rel=1e-12)


@needs_node
@pytest.mark.parametrize(
    "bob", [tpd.limits.Bob(), tpd.limits.Bob(shape="cylinder", aspect=1.5, density=2400.0)]
)
@pytest.mark.parametrize("pendulum", PENDULUMS)
def test_limits_on_the_page_equal_those_of_the_search(pendulum, bob):
    limits = (*ALL, tpd.limits.Clearance(bob))
    tilt, swing, without = 0.2, 0.35, 0.24
    geometry = Geometry.of(SCENE, Conditions.exactly(), bob)
    geometry = replace(geometry, tilt_without_pendulum=without)
    design = np.array([[pendulum[0] / 16280.0, pendulum[1] / 5.0, pendulum[2]]])
    at = Evaluation.blank(1, 1)._replace(
        tilt=np.full((1, 1), tilt), swing=np.full((1, 1), swing), design=design
    )
    expected = {s.name: float(s.value[0, 0]) for s in evaluate_sizes(limits, at, geometry)}
    values = {limit.name: next(iter(vars(limit).values())) for limit in ALL} | {"clearance": True}
    motion = {"tilt": tilt, "swing": swing, "without": without}
    shares = run(
        "pendulum", "limitShares", "(x) => limitShares(...x)", [block(bob), values, named(pendulum), motion]
    )
    found = {share["name"]: share["share"] for share in shares}
    assert found.keys() == expected.keys()
    for name, share in found.items():
        assert share == pytest.approx(expected[name], rel=1e-9), name


@needs_node
def test_without_a_steady_state_only_limits_on_the_bob_at_rest_apply():
    values = {"stroke": 0.4, "clearance": True, "mass": 700.0}
    inputs = [block(), values, named(PENDULUMS[0]), None]
    shares = run("pendulum", "limitShares", "(x) => limitShares(...x)", inputs)
    assert [share["name"] for share in shares] == ["mass", "thickness", "depth", "clearance"]


def test_the_content_of_the_page_has_the_block_of_these_tests():
    made = content(SCENE)["scene"]
    assert made == block()
