"""Reasons and designs in words."""

from dataclasses import replace

import numpy as np

from tests import designs


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
