"""Answers: the design that comes nearest, and its runs in a changed scene."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.design.verified import Reason, ReasonKind, Step
from tpd.scene.conditions import Conditions


def test_a_quantity_that_is_not_moved_leaves_the_benefit(real):
    design = real
    same = design.saved_under(design.scene, Conditions({"mass": np.array([1.0])}), 10**6)
    assert (same.mean, same.low) == pytest.approx((design.comparison.saved.mean, design.comparison.saved.low))


def test_of_several_refused_designs_the_one_that_misses_least_by_paired_runs_comes_nearest():
    def refused(value, benefit=None, mass=0.1):
        reason = Reason(step=Step.benefit, kind=ReasonKind.strikes, value=value, reference=0.01)
        given = {} if benefit is None else {"benefit": None, "paired": None}
        return designs.verified(mass_ratio=mass, reasons=(reason, reason), **given)

    every = refused(0.02, "none"), refused(0.3), refused(0.1, mass=0.05)
    design = dataclasses.replace(designs.refused(), verified=every)
    assert design.best.mass_ratio == 0.05
    assert design.winner is design.saved is None
    assert design.harmful
    assert design.refusals == (str(design.best.reasons[0]),), "one of a kind"
    assert len(design.turned) == 38, "in the runs that stand"
    assert np.isnan(design.risks[0])
    assert design.swing == 0.0
    assert design.again(seed=7)["seed"] == 7
    with pytest.raises(ValueError, match="`what` must be one of landscape, drawing, benefit"):
        tpd.plot(design, "picture")
