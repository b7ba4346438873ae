"""Measures without a pendulum; `test_assess` has the period of isolation."""

import numpy as np
import pytest

import tpd
from tests import designs
from tests.designs import SCENE
from tpd.design.alternatives import Alternatives, alternatives
from tpd.design.job import job_of
from tpd.design.optimise import problem_of
from tpd.design.reasons import DesignStatus


@pytest.mark.parametrize("share", [1.0, 0.9])
def test_tie_width_and_isolation_satisfy_moment_equilibrium(share):
    scene = designs.with_block(SCENE, effective_width=share)
    problem = problem_of(scene, conditions=tpd.Conditions.exactly(), limits=())
    alone = problem.at_rest
    found = alternatives(problem)
    # Moments about the corner: the tie pulls at the height 2 b.
    f = alone.peak
    assert found.tie * 0.4 == pytest.approx(16.224 * 9.80665 * (0.2 * f - 0.05 * share - 0.05 * 0.2))
    wide = designs.with_block(scene, width=found.width, cavity_width=None)
    assert wide.uplift == pytest.approx(f)
    # An undamped oscillator passes on 1/(r^2 - 1) at r times its frequency.
    r = found.isolation * 2.5
    assert f / (r**2 - 1.0) == pytest.approx(alone.uplift)
    calm = problem_of(SCENE, conditions=tpd.Conditions.amplitudes(0.5), limits=())
    assert calm.needs_none is DesignStatus.no_uplift
    assert alternatives(calm).tie == 0.0


@pytest.mark.parametrize(
    ("friction", "width", "is_offered"), [(0.5, 1.9, True), (1.01, 1.9, False), (0.5, 2.01, False)]
)
def test_a_base_that_is_too_wide_or_too_rough_is_not_an_alternative(friction, width, is_offered):
    said = str(Alternatives(1e3, width, friction, 1.0, np.array([2.0]), 0.0, 1.0, "as stated"))
    assert ("a base at least" in said) is is_offered
    assert said.endswith("; no base of up to twice the width prevents uplift") is not is_offered


def test_the_sentence_on_alternatives_has_sizes_rounded_up_to_two_digits():
    said = str(Alternatives(1234.0, 1.21, 0.5, 1.0, np.array([1.51, 2.0]), 0.05, 3.0, "as stated"))
    assert said.startswith(
        "at 0.5 g (as stated): a tie at the top for at least 1.3 kN, a base at least 1.3 m wide with a"
    )
    # At an acceleration of 3 m/s^2 the displacement is 3 (2/(2 pi))^2 m.
    assert "with 5 % damping and a period of at least 2 s (displacement 0.31 m) for all 2 motions, or" in said
    assert "or at least 1.8 s (displacement 0.24 m) for half" in said


@pytest.mark.parametrize(
    ("friction", "width", "base"),
    [(0.5, 1.21, ", or a base of 1.3 m,"), (1.01, 1.21, ""), (0.5, 2.01, "")],
)
def test_the_brief_offers_a_base_only_if_it_is_practicable(friction, width, base):
    of = Alternatives(1234.0, width, friction, 1.0, np.array([2.0]), 0.0, 1.0, "as stated")
    at = {0.5: "0.5", 1.01: "1.1"}[friction]
    assert of.brief == f"a top tie for 1.3 kN{base} prevents uplift at {at} g (as stated)"
    assert "top tie for 130 N" in of._replace(tie=123.0).brief


def test_the_level_of_the_alternatives_is_that_of_the_problem_unless_it_is_stated():
    usual, stated = (alternatives(problem_of(job_of(x))) for x in ({}, {"alternatives": {"level": 0.5}}))
    assert usual.friction == pytest.approx(problem_of(job_of({})).at_rest.peak)
    assert (stated.friction, stated.level) == (0.5, "as stated")
    assert stated.tie > usual.tie
    assert stated.width / stated.present == pytest.approx(2.0 * 0.2 * (0.5 - 0.05) / 0.1)
    with pytest.raises(ValueError, match=r"\[alternatives\] `level` must be"):
        job_of({"alternatives": {"level": -0.5}})
