"""Design spaces: bounds, names, shares of the bounds."""

import numpy as np
import pytest

import tpd


def test_damping_is_searched_only_when_asked_for():
    assert tpd.DesignSpace().names == ("mu", "lam")
    wide = tpd.DesignSpace(damping_ratio=(0.05, 0.3))
    assert wide.names == ("mu", "lam", "zeta")
    np.testing.assert_array_equal(wide.bounds, [[0.01, 0.1, 0.05], [0.2, 1.5, 0.3]])


@pytest.mark.parametrize("damping", [0.1, (0.05, 0.3)])
def test_shares_of_the_bounds_and_back(damping):
    space = tpd.DesignSpace(damping_ratio=damping)
    unit = np.random.default_rng(0).random((7, len(space.names)))
    designs = space.unscaled(unit)
    assert designs.shape == (7, 3)
    np.testing.assert_allclose(space.scaled(designs), unit, atol=1e-14)
    low, high = space.unscaled(np.array([[0.0] * len(space.names), [1.0] * len(space.names)]))
    assert low[:2].tolist() == [0.01, 0.1]
    assert high[:2].tolist() == [0.2, 1.5]
    if damping == 0.1:
        assert set(designs[:, 2]) == {0.1}


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"mass_ratio": (0.2, 0.1)}, "`mass_ratio` must be an interval low < high"),
        ({"length_ratio": (0.1, 0.1)}, "`length_ratio` must be an interval"),
        ({"length_ratio": (0.1, 3.0)}, "within 0.001 to 2"),
        ({"mass_ratio": (float("nan"), 0.1)}, "`mass_ratio` must be an interval"),
        ({"damping_ratio": -0.1}, "`damping_ratio` must be between 0 and 2"),
    ],
)
def test_bad_spaces_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        tpd.DesignSpace(**wrong)
