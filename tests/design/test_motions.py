"""Exact motions from rest: as followed, polished, and where the block overturns."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.design.conftest import BAND, SCENE
from tests.design.test_objective import GOOD
from tpd.design.verify import motions_from_rest, polished
from tpd.scene.parameters import as_arrays
from tpd.scene.status import SETTLED

P = as_arrays(SCENE.parameters())


@pytest.fixture(scope="module")
def motions():
    return motions_from_rest(P, GOOD[0], BAND, 100)


def test_motions_are_those_of_the_steady_state(motions):
    sharp = polished(P, GOOD[0], BAND, motions)
    for i, factor in enumerate(BAND.column("frequency")):
        motion = dataclasses.replace(SCENE.motion, frequency=SCENE.motion.frequency * factor)
        scene = dataclasses.replace(SCENE, motion=motion)
        hung = scene.pendulum(mass_ratio=GOOD[0, 0], length_ratio=GOOD[0, 1], damping_ratio=GOOD[0, 2])
        s = tpd.steady_state(scene.parameters(hung))
        assert sharp.status[i] == tpd.status_name(s.status)
        assert sharp.amplitude[i] == pytest.approx(float(s.amplitude), rel=1e-12)
        assert sharp.stroke[i] == pytest.approx(float(s.stroke), rel=1e-12)
        assert sharp.multiplier[i] == pytest.approx(float(s.multiplier), rel=1e-9, nan_ok=True)
    settled = np.isin(sharp.status, SETTLED)
    np.testing.assert_allclose(motions.amplitude[settled], sharp.amplitude[settled], rtol=1e-4)
    assert np.all(motions.peak >= 0.999 * motions.amplitude)
    assert np.isnan(motions.multiplier).all()


def test_many_conditions_are_not_polished():
    many = tpd.Conditions.scatter(33, friction=0.1)
    motions = motions_from_rest(P, GOOD[0], many, 40)
    assert polished(P, GOOD[0], many, motions) is motions


def test_an_overturning_block_has_no_amplitude():
    hard = tpd.Conditions.amplitudes(1.0, 6.0)
    motions = motions_from_rest(P, np.array([0.0, 0.3, 0.1]), hard, 100)
    for m in (motions, polished(P, np.array([0.0, 0.3, 0.1]), hard, motions)):
        assert m.status.tolist() == ["rocking", "overturned"]
        assert m.amplitude[0] == pytest.approx(0.0833335, abs=1e-4)
        assert m.amplitude[1] == m.stroke[1] == m.peak[1] == np.inf
