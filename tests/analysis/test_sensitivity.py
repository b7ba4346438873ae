"""Sensitivities of a design from exact gradients."""

import dataclasses
import logging

import jax
import numpy as np
import pytest

import tpd
from tpd.analysis.sensitivity import elasticities
from tpd.closed_form import uplift

NAMES = ("mu", "lam", "zeta", "nu", "k", "f", "xi")


def test_elasticities_are_those_of_differences():
    p = tpd.paper_scene().parameters(tpd.Pendulum(mass=1.6, length=0.3, damping_ratio=0.1))
    found = elasticities(p)
    assert found.of == "amplitude"
    assert found.value == float(tpd.steady_state(p).amplitude)
    assert set(found.slopes) == set(NAMES)
    for name in NAMES:
        x, h = getattr(p, name), 1e-5
        sizes = [
            float(tpd.steady_state(dataclasses.replace(p, **{name: x * s})).amplitude) for s in (1 - h, 1 + h)
        ]
        assert found.slopes[name] == pytest.approx(np.diff(np.log(sizes))[0] / (2 * h), rel=1e-4, abs=1e-6)


def test_elasticities_of_rest_are_the_margins_and_of_what_is_lost_refused():
    rest = tpd.Scene(tpd.paper_scene().block, tpd.Harmonic(amplitude=0.005, frequency=2.5)).parameters()
    found = elasticities(rest)
    assert found.of == "margin"
    assert set(found.slopes) == {"nu", "k", "f", "xi"}
    h = 1e-6
    more = float(uplift(dataclasses.replace(rest, f=rest.f * (1 + h))).margin)
    assert found.slopes["f"] == pytest.approx(0.01 * (more - found.value) / h, rel=1e-4)
    lost = tpd.Scene(tpd.paper_scene().block, tpd.Harmonic(amplitude=0.05, frequency=2.5)).parameters()
    found = elasticities(lost)
    assert found.slopes == {}
    assert found.refused.startswith("overturned: The tilt grows beyond any return")


def test_a_gradient_after_a_value_has_nothing_to_compile(caplog):
    p = tpd.paper_scene().parameters()
    tpd.steady_state(p)
    with jax.log_compiles(), caplog.at_level(logging.WARNING):
        slope = jax.grad(lambda q: tpd.steady_state(q).amplitude)(jax.tree.map(jax.numpy.asarray, p))
    assert np.isfinite(slope.f)
    assert "_solved" not in caplog.text
