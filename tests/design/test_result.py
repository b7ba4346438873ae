"""Answers: the design that comes nearest, and its runs in a changed scene."""

import dataclasses

import numpy as np
import pytest
from tpd.design.verified import Reason, ReasonKind, Step

import tpd
from tests import designs
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


def test_a_design_prints_its_verdict_pendulum_benefit_and_reasons_in_at_most_twelve_lines():
    design = designs.around()
    said = str(design).splitlines()
    assert repr(design) == str(design)
    assert " ".join(said).startswith("A PENDULUM WAS FOUND: over runs by the nonlinear equations")
    assert any(line.startswith("pendulum: ") and "damping ratio" in line for line in said)
    assert f"reduction of the mean tilt (95 % interval): {design.saved.words()}" in said
    refused = designs.refused()
    assert "reason: " + refused.refusals[0][:60] in str(refused)
    reasons = [
        Reason(step=Step.exact, kind=kind, value=0.02, reference=0.01, limit="stroke") for kind in ReasonKind
    ]
    many = dataclasses.replace(refused, verified=(designs.verified(reasons=tuple(reasons)),))
    assert len(many.refusals) > 5
    lines = str(many).splitlines()
    assert len(lines) == 12
    assert lines[-1] == "more: see `refusals`"
