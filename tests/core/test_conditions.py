"""Conditions: bands, amplitudes, scatter, their products, samples and labels."""

import numpy as np
import pytest

import tpd
from tpd.core.conditions import FACTORS

SCENE = tpd.paper_scene()
BAND = tpd.Conditions.band(SCENE, 2.0, 3.5, 5)


def test_a_product_is_every_one_under_every_other():
    both = tpd.Conditions.band(SCENE, 2.0, 4.0, 2) * tpd.Conditions.amplitudes(0.5, 1.0, 2.0)
    assert len(both) == 6
    np.testing.assert_allclose(both.column("frequency"), [0.8, 0.8, 0.8, 1.6, 1.6, 1.6])
    np.testing.assert_allclose(both.column("amplitude"), [0.5, 1.0, 2.0, 0.5, 1.0, 2.0])
    np.testing.assert_array_equal(both.column("mass"), 1.0)
    assert both.label(1) == "1 times the amplitude and 2 Hz"
    assert both.axis is None
    assert BAND.axis == "frequency"
    assert len(both.description) == 2


def test_no_condition_is_the_scenes_own_shaking():
    assert len(tpd.Conditions()) == 1
    assert tpd.Conditions().label(0) == "the scene's own shaking"
    assert tpd.Conditions().axis is None
    np.testing.assert_array_equal(tpd.Conditions().factor_rows(), np.ones((1, 7)))


def test_what_scatters_is_even_seeded_and_drawn_apart():
    some = tpd.Conditions.scatter(50, 3, friction=0.2)
    more = tpd.Conditions.scatter(50, 3, friction=0.2, length=0.05)
    np.testing.assert_array_equal(some.column("friction"), more.column("friction"))
    assert np.ptp(some.column("friction")) > 0.38
    assert np.abs(more.column("length") - 1.0).max() <= 0.05
    other = tpd.Conditions.scatter(50, 4, friction=0.2)
    assert not np.array_equal(some.column("friction"), other.column("friction"))


def test_a_sample_of_conditions_has_the_corners_and_is_seeded():
    band = tpd.Conditions.band(SCENE, 2.0, 3.0, 64)
    both = band * tpd.Conditions.amplitudes(0.8, 1.2)
    some = both.subset(64, 1)
    assert len(some) == 64
    assert some.units == both.units
    rows = [tuple(r) for r in np.asarray(some.factor_rows())]
    assert len(set(rows)) == 64
    assert set(rows) < {tuple(r) for r in np.asarray(both.factor_rows())}
    for frequency in band.column("frequency")[[0, -1]]:
        at = some.column("frequency") == frequency
        assert set(some.column("amplitude")[at]) == {0.8, 1.2}
    # Neither amplitude has the one half of the band alone.
    low = some.column("frequency") < 1.0
    for amplitude in (0.8, 1.2):
        assert 0.25 < np.mean(low[some.column("amplitude") == amplitude]) < 0.75
    assert rows == [tuple(r) for r in np.asarray(both.subset(64, 1).factor_rows())]
    assert rows != [tuple(r) for r in np.asarray(both.subset(64, 2).factor_rows())]
    assert band.subset(64) is band
    many = tpd.Conditions.scatter(200, 0, **dict.fromkeys(FACTORS, 0.1)).subset(64)
    assert len({tuple(r) for r in np.asarray(many.factor_rows())}) == 64


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tpd.Conditions.band(SCENE, 3.0, 2.0), "`band` must be an interval low < high"),
        (lambda: tpd.Conditions.band(SCENE, 2.0, 3.0, 1), "`count` must be a whole number, 2 or more"),
        (lambda: tpd.Conditions.amplitudes(), "`factors` must hold at least one number"),
        (lambda: tpd.Conditions.amplitudes(1.0, -1.0), "`factors` must be positive"),
        (lambda: tpd.Conditions.scatter(8, colour=0.1), "what scatters must be of .* but has colour"),
        (lambda: tpd.Conditions.scatter(8, mass=0.7), r"`mass` must be between 0 and 0\.5, but is 0\.7"),
    ],
)
def test_what_makes_no_sense_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
