"""A design by all models: the answer of each, and what the nonlinear model objects to."""

import numpy as np
import pytest

import tpd
from tests import reference
from tpd import Pendulum, check, paper_scene, status_name, steady_state
from tpd.answers.compare_models import MODELS, objections
from tpd.scene.parameters import as_arrays

PENDULUM = Pendulum(mass=3.2448, length=0.2, damping_ratio=0.1)


def test_a_check_has_every_requested_model_and_the_nonlinear_one():
    calls = []
    quick = ("uplift", "exact")
    found = check(
        paper_scene(), PENDULUM, swing_limit=0.5, models=quick, progress=lambda *at: calls.append(at)
    )
    assert [r.name for r in found.models] == ["uplift", "exact", "nonlinear"]
    assert calls == [("checking", i, 3) for i in (1, 2, 3)]
    p = paper_scene().parameters(PENDULUM)
    exact = steady_state(p)
    assert found.models[1].amplitude == float(exact.amplitude)
    assert found.models[1].status == status_name(exact.status) == "rest"
    # The nonlinear model adds what is of second order in the bob's swing.
    assert found.top.status == "rest"
    settled = reference.settled(tpd.Terms.nonlinear, as_arrays(p), np.zeros(4))
    assert found.top.swing == pytest.approx(float(settled.settled_swing), rel=1e-6)
    assert found.top.swing != pytest.approx(float(exact.swing), rel=1e-4)
    assert found.objections == ()
    assert all(r.seconds > 0 and r.neglects for r in found.models)
    *others, last, meaning = found.table().splitlines()
    assert len(others) == 3
    assert last.startswith("nonlinear")
    assert meaning.startswith("Amplitude and swing are the largest tilt and bob angle (rad)")
    assert "nothing of equations (4)" in last
    assert str(found) == f"{found.table()}\nno objection by the nonlinear model"
    # Dimensionless parameters stand for the scene and its pendulum.
    same = check(p, swing_limit=0.5, models=("exact",))
    assert same.top.amplitude == found.top.amplitude
    assert same.without == pytest.approx(found.without, rel=1e-6)


def test_a_violated_assumption_is_reported():
    scene = paper_scene()
    resonant = scene.pendulum(mass_ratio=0.1, length_ratio=0.20964589, damping_ratio=0.1)
    found = check(scene, resonant, swing_limit=1.5, models=("exact",))
    assert found.models[0].status == "rocking"
    assert found.objections == ("by the nonlinear model the motion ends overturned",)
    assert str(found).endswith("objection: by the nonlinear model the motion ends overturned")


@pytest.mark.parametrize(
    ("motion", "objection"),
    [
        ((0.05, 0.4, "rocking"), ""),
        ((0.0, 0.4, "rest"), ""),
        ((0.05, 0.6, "rocking"), "the swing is 0.6 rad, above 0.5"),
        ((0.09, 0.4, "rocking"), "the block rocks 0.09 rad, and 0.08 without the pendulum"),
        ((np.inf, np.inf, "overturned"), "the motion ends overturned"),
    ],
)
def test_each_violated_assumption_gives_one_objection(motion, objection):
    found = objections(*motion, 0.5, 0.08)
    assert len(found) == bool(objection)
    assert objection in "".join(found)


def test_invalid_models_and_swing_limits_are_rejected():
    with pytest.raises(ValueError, match="`swing_limit` must be positive and finite, but is 0"):
        check(paper_scene(), None, swing_limit=0.0)
    for wrong in (np.array([0.1, 0.2]), np.zeros(0)):
        with pytest.raises(ValueError, match="`swing_limit` must be a single number, but is"):
            check(paper_scene(), None, swing_limit=wrong)
    with pytest.raises(ValueError, match=r"`models` must be one of uplift, .* but is 'guess'"):
        check(paper_scene(), None, models=("guess",))
    assert MODELS[0] == "uplift"
    assert MODELS[-1] == "nonlinear"
