"""Sentences of reasons that depend on the step."""

import pytest

from tpd.design.result import Reason, ReasonKind, Step


@pytest.mark.parametrize(
    ("step", "only"), [(Step.neighbours, ""), (Step.exact, " only"), (Step.ensemble, " only")]
)
def test_shakings_within_a_per_cent_are_counted_with_and_without_the_pendulum(step, only):
    reason = Reason(step=step, kind=ReasonKind.overturns_more, value=2.0, reference=2.0, total=8)
    assert f"in 2 of 8 cases with the pendulum{only}, and in 2 without it{only}" in str(reason)
