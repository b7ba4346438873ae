"""Results draw themselves and become data frames of pandas."""

import dataclasses
import sys

import numpy as np
import pytest
from matplotlib.axes import Axes

import tpd
from tests import designs
from tpd.answers.fragility import Curve, Fragility
from tpd.answers.spectra import OverturningSpectrum, RockingSpectrum
from tpd.answers.statistics import fit_lognormal
from tpd.design.many import Designs, Front

SCENE = designs.SCENE
VALUES = np.linspace(1.0, 4.0, 9)


def curve(counts) -> Curve:
    hit = np.arange(4)[:, None] < np.array(counts)
    stripes, total = np.array([1.0, 2.0, 3.0]), np.full(3, 4)
    fit = fit_lognormal(stripes, hit.astype(float), np.arange(4))
    shares = np.array(counts) / 4.0
    return Curve("overturned", shares, np.array(counts), total, np.array([0, 1, 0]), fit, (1.0, 2.0))


FRAGILITY = Fragility(
    "PGA",
    np.array([1.0, 2.0, 3.0]),
    "m/s^2",
    ("a", "b", "c", "d"),
    4,
    {"overturned": curve([0, 2, 4])},
    {"overturned": curve([0, 1, 3])},
    None,
    (np.zeros((4, 3)), None),
    {},
    None,
)
BARE_SPECTRUM = np.array([[0, 1], [2, -1], [3, 0]])
OVERTURNING = OverturningSpectrum(
    tpd.Pulse(kind="one-sine", acceleration=1.0, frequency=1.0),
    np.array([1.0, 2.0]),
    np.array([3.0, 4.0, 5.0]),
    BARE_SPECTRUM,
    BARE_SPECTRUM[:, ::-1],
)
ROCKING = RockingSpectrum(np.array([1.0, 2.0, 3.0]), np.array([0.1, np.inf, np.nan]), None)


@pytest.fixture(scope="module")
def response():
    return tpd.settled_response(SCENE, "frequency", VALUES, pendulum=designs.HUNG)


@pytest.fixture(scope="module")
def branches():
    return tpd.branches(SCENE, "frequency", 2.0, 3.0, samples=12)


@pytest.fixture(scope="module")
def design_map():
    return tpd.design_map(SCENE, ("frequency", [2.0, 2.5, 3.0]), ("amplitude", [0.01, 0.015]))


def test_a_response_draws_itself_beside_that_of_the_bare_block(response):
    above, below = response.plot(designs.response(*np.full(9, 0.1), frequency=VALUES), own=2.5)
    assert [t.get_text() for t in above.get_legend().get_texts()] == ["bare block", "with the pendulum"]
    assert below.get_xlabel() == "frequency of the base motion (Hz)"


def test_a_response_is_a_table_with_the_shares_of_runs_near_each_value(response):
    table = response.to_dataframe()
    names = [
        "frequency",
        "status",
        "amplitude_rad",
        "stroke_rad",
        "share_overturned",
        "share_low",
        "share_high",
    ]
    assert list(table.columns) == names
    np.testing.assert_array_equal(table["amplitude_rad"], response.amplitude)
    assert np.all((table["share_low"] <= table["share_overturned"]) & (table["share_high"] <= 1.0))
    few = dataclasses.replace(response, overturning=None)
    assert list(few.to_dataframe().columns) == names[:4]


def test_a_part_of_a_response_keeps_its_shares(response):
    part = response.between(1.5, 2.5)
    at = (VALUES >= 1.5) & (VALUES <= 2.5)
    assert part.frequency.tolist() == VALUES[at].tolist()
    np.testing.assert_array_equal(part.overturning, response.overturning[:, at])
    assert part.status.tolist() == response.status[at].tolist()


def test_shares_are_those_of_runs_from_rest_near_each_value():
    """At the lowest frequencies the paper's block rests, at the strong ones next to its own it overturns."""
    strong = dataclasses.replace(SCENE, motion=tpd.Harmonic(amplitude=0.06, frequency=2.5))
    share, low, high = tpd.settled_response(strong, "frequency", np.linspace(0.2, 2.0, 10)).overturning
    assert (share[0], share[-1]) == (0.0, 1.0)
    assert high[0] < 0.25
    assert low[-1] > 0.75
    assert tpd.settled_response(strong, "frequency", [1.0, 2.0]).overturning is None


def test_branches_draw_themselves_and_have_a_row_for_every_orbit(branches):
    (ax,) = branches.plot()
    assert "bare block" in {t.get_text() for t in ax.get_legend().get_texts()}
    table = branches.to_dataframe()
    s = branches.sweep
    assert len(table) == sum(len(s.line(i)[0]) for i in range(s.branches)) > 0
    assert list(table.columns) == [
        "branch",
        "frequency",
        "status",
        "amplitude_rad",
        "stroke_rad",
        "phase_rad",
    ]
    i, j = s.line(0)
    np.testing.assert_array_equal(table["amplitude_rad"][table["branch"] == 0], s.amplitude[i, j])


def test_a_map_draws_each_quantity_and_has_a_row_for_every_design(design_map):
    ax = design_map.plot("margin")
    assert ax.figure.axes[1].get_ylabel() == "uplift margin of the resting block (-)"
    table = design_map.to_dataframe()
    last = table.iloc[-1]
    assert (len(table), last["frequency"], last["amplitude"]) == (6, 3.0, 0.015)
    np.testing.assert_array_equal(table["amplitude_rad"], design_map.amplitude.ravel())
    np.testing.assert_array_equal(table["uplift_margin"], design_map.margin.ravel())


def test_a_fragility_draws_a_state_and_has_a_row_for_every_stripe():
    ax = FRAGILITY.plot()
    assert ax.get_xlabel() == "PGA (m/s^2)"
    with pytest.raises(ValueError, match="`state` must be one of overturned, but is 'half'"):
        FRAGILITY.plot("half")
    table = FRAGILITY.to_dataframe()
    assert table["case"].tolist() == ["bare"] * 3 + ["hung"] * 3
    assert table["stripe"].tolist() == [1.0, 2.0, 3.0] * 2
    assert table["counts"].tolist() == [0, 2, 4, 0, 1, 3]
    assert table["undecided"].tolist() == [0, 1, 0] * 2
    assert set(table["state"]) == {"overturned"}


def test_spectra_draw_themselves_and_are_tables():
    bare, hung = OVERTURNING.plot()
    assert (bare.get_title(), hung.get_title()) == ("bare block", "with the pendulum")
    table = OVERTURNING.to_dataframe()
    assert table.iloc[2].tolist() == [1.0, 4.0, 2, -1]
    assert isinstance(ROCKING.plot(), Axes)
    assert ROCKING.to_dataframe().to_dict("list")["period_s"] == [1.0, 2.0, 3.0]
    assert list(ROCKING.to_dataframe().columns) == ["period_s", "bare"]


def test_many_designs_and_fronts():
    one = np.array([1.0, np.nan])
    found = Designs(
        status=np.array(["found", "refused"]), mass=one, length=one, damping_ratio=one, value=one, bare=one
    )
    assert found.to_dataframe()["status"].tolist() == ["found", "refused"]
    assert Front(designs.front()).plot().get_xlabel() == "mass of the bob (kg)"


def test_options_that_do_not_exist_are_refused(response):
    with pytest.raises(TypeError, match="unexpected keyword argument 'axis'"):
        response.plot(axis=None)


def test_without_pandas_a_table_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        ImportError, match=r"`to_dataframe` needs pandas, which is not installed: `pip install tpd\[pandas\]`"
    ):
        ROCKING.to_dataframe()
