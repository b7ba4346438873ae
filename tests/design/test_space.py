"""Design space: fixed values, values in SI units, shares of the bounds, and distances between designs."""

import numpy as np
import pytest

import tpd


@pytest.mark.parametrize("fixed", [(), (0,), (1,), (2,), (0, 1), (0, 2), (1, 2)])
def test_a_fixed_value_is_not_a_variable_of_the_search(fixed):
    names, ends = (
        ("mass_ratio", "length_ratio", "damping_ratio"),
        np.array([[0.02, 0.3, 0.05], [0.2, 1.5, 0.4]]),
    )
    given = {name: ends[0, i] if i in fixed else tuple(ends[:, i]) for i, name in enumerate(names)}
    space, free = tpd.DesignSpace(**given), [i for i in range(3) if i not in fixed]
    assert space.names == tuple(("mu", "lam", "zeta")[i] for i in free)
    np.testing.assert_array_equal(space.bounds, ends[:, free])
    units = np.array([[0.0] * len(free), [1.0] * len(free)])
    designs = space.unscaled(units)
    expected = np.where(np.isin(range(3), fixed), ends[0], ends)
    np.testing.assert_allclose(designs, expected, rtol=1e-15)
    np.testing.assert_allclose(space.scaled(designs), units, atol=1e-15)


def test_masses_in_kg_and_lengths_in_m_become_ratios_of_the_block():
    block = tpd.Block(width=1.0, height=5.0, mass=2000.0)
    space = tpd.DesignSpace(mass=(100.0, 500.0), length=1.0)
    assert space.of(block) == tpd.DesignSpace(mass_ratio=(0.05, 0.25), length_ratio=0.4)
    assert tpd.DesignSpace(mass=500.0).of(block) == tpd.DesignSpace(mass_ratio=0.25)
    whole = tpd.DesignSpace(mass=(1.0, 2000.0), length=(0.1, 5.0)).of(block)
    assert whole == tpd.DesignSpace(mass_ratio=(0.0005, 1.0), length_ratio=(0.04, 2.0))
    assert tpd.DesignSpace().of(block) == tpd.DesignSpace()
    for bad, message in (
        ({"mass": (100.0, 2001.0)}, "`mass` must be between 0 and 2000 kg in this block, but is 2001"),
        ({"length": 5.1}, "`length` must be between 0.0025 and 5 m in this block, but is 5.1"),
    ):
        with pytest.raises(ValueError, match=f"^{message}$"):
            tpd.DesignSpace(**bad).of(block)
    with pytest.raises(
        ValueError, match=r"in kg or m has no ratios without a block: use `space.of\(block\)`"
    ):
        _ = space.bounds


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ({"mass_ratio": (0.2, 0.1)}, "`mass_ratio` must be an interval low < high"),
        ({"length_ratio": (0.1, 0.1)}, "`length_ratio` must be an interval"),
        ({"mass": 500.0, "mass_ratio": 0.1}, "`mass` and `mass_ratio` state the same"),
        ({"length": (0.1, 0.5), "length_ratio": 0.1}, "`length` and `length_ratio` state"),
        ({"mass_ratio": 0.0}, "`mass_ratio` must be positive"),
        ({"mass": (500.0, 200.0)}, "`mass` must be an interval low < high"),
        (
            {"mass": 1.0, "length": 1.0, "damping_ratio": 0.1},
            "a search needs two bounds for mass, length or damping",
        ),
    ],
)
def test_invalid_bounds_are_rejected(bounds, message):
    with pytest.raises(ValueError, match=message):
        tpd.DesignSpace(**bounds)
