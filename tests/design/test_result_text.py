"""Reasons and designs in words."""

from dataclasses import replace

import numpy as np
import pytest

from tests import designs
from tpd.design.reasons import Reason, ReasonKind, Step


@pytest.mark.parametrize(
    ("step", "only"), [(Step.neighbours, ""), (Step.exact, " only"), (Step.ensemble, " only")]
)
def test_shakings_within_a_per_cent_are_counted_with_and_without_the_pendulum(step, only):
    reason = Reason(step=step, kind=ReasonKind.overturns_more, value=2.0, reference=2.0, total=8)
    assert f"in 2 of 8 cases with the pendulum{only}, and in 2 without it{only}" in str(reason)


def test_printed_design_says_where_the_bare_block_overturns():
    bare = designs.single().bare
    lost = replace(bare, exact=replace(bare.exact, amplitude=np.array([np.inf])))
    text = str(designs.single(bare=lost))
    assert "overturned without" in text
    assert "inf" not in text


def test_printed_design_for_several_conditions_has_the_value():
    design = designs.band()
    assert f"value       {design.winner.value:.4g}, {design.bare.value:.4g} without: worst tilt" in str(
        design
    )
    assert "value" not in str(designs.single())
