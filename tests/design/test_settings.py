"""Settings of the search: what is rejected, and plain values."""

import optax
import pytest

import tpd


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tpd.Descent(screening=-1), "`screening` must be a whole number, 1 or more, but is -1"),
        (lambda: tpd.GroundSearch(designs=-1), "`designs` must be a whole number, 4 or more, but is -1"),
        (lambda: tpd.Descent(steps=0), "`steps` must be a whole number, 1 or more, but is 0"),
        (lambda: tpd.Descent(corrections=-1), "`corrections` must be a whole number, 0 or more, but is -1"),
        (lambda: tpd.Descent(polish=1.5), "`polish` must be a whole number, 0 or more, but is 1.5"),
        (lambda: tpd.Descent("adan"), "`optimiser` must be one of newton, adam, but is"),
        (lambda: tpd.Descent(3), "`optimiser` must be a transformation of optax, or one of newton, adam"),
        (lambda: tpd.Descent(model="sharp"), "`model` must be one of smoothed, piecewise"),
        (lambda: tpd.Descent(optax.lbfgs()), "`optimiser` must make its steps from gradients alone"),
    ],
)
def test_settings_out_of_range_are_rejected(make, message):
    with pytest.raises(ValueError, match=message):
        make()
