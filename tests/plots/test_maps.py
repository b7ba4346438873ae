"""Maps and spectra draw themselves with labelled axes, and are tables."""

import dataclasses

import numpy as np
import pytest
from matplotlib.patheffects import TickedStroke

import tpd
from tpd.answers.spectra import OverturningSpectrum, RockingSpectrum
from tpd.design.optimise import Designs
from tpd.plots.style import new_axes
from tpd.records.intensity import spectral_acceleration

BARE_SPECTRUM = np.array([[0, 1], [2, -1], [3, 0]])
OVERTURNING = OverturningSpectrum(
    tpd.Pulse(kind="one-sine", acceleration=1.0, frequency=1.0),
    np.array([1.0, 2.0]),
    np.array([3.0, 4.0, 5.0]),
    np.stack([BARE_SPECTRUM, BARE_SPECTRUM[:, ::-1]]),
)
ROCKING = RockingSpectrum(np.array([1.0, 2.0, 3.0]), np.array([[0.1, np.inf, np.nan]]))


def test_a_map_draws_each_quantity_and_has_a_row_for_every_design():
    axes = ("frequency", [2.0, 2.5, 3.0]), ("amplitude", [0.01, 0.015])
    design_map = tpd.design_map(tpd.paper_scene(), *axes)
    ax = tpd.plot(design_map, "margin")
    assert ax.figure.axes[1].get_ylabel() == "uplift margin of the resting block (-)"
    # Tilts that differ by a tenth fill the scale of colours.
    tilts = 0.1 + 0.01 * np.linspace(0.0, 1.0, 6).reshape(2, 3)
    alike = dataclasses.replace(design_map, amplitude=tilts, status=np.full((2, 3), "rocking"))
    (low, high) = tpd.plot(alike).collections[0].get_clim()
    assert 0.1 < low < 0.101 < 0.109 < high < 0.11
    one = dataclasses.replace(alike, amplitude=np.full((2, 3), 0.1))
    tpd.plot(one).figure.canvas.draw()
    table = design_map.to_dataframe()
    last = table.iloc[-1]
    assert (len(table), last["frequency"], last["amplitude"]) == (6, 3.0, 0.015)
    np.testing.assert_array_equal(table["amplitude_rad"], design_map.amplitude.ravel())
    np.testing.assert_array_equal(table["uplift_margin"], design_map.margin.ravel())


def test_a_fold_curve_has_ticks_on_the_side_without_orbits():
    p = tpd.Parameters(nu=0.25, mu=0.1, lam=0.8, zeta=0.1, k=0.05, f=0.103, xi=3.5, e=0.9)
    ranges = {"x_range": (0.02, 0.2), "y_range": (0.3, 1.5)}
    curve = tpd.fold_curve(p, "mu", "lam", **ranges)
    ax = tpd.plot(tpd.design_map(p, ("mu", [0.02, 0.1, 0.2]), ("lam", [0.3, 0.9, 1.5])))
    above = ax.get_legend()
    assert tpd.plot(curve, ax=ax) is ax
    assert ax.get_legend() is above
    np.testing.assert_array_equal(ax.lines[-1].get_xydata(), curve.points)

    def tick_angle(drawn):
        (ticks,) = [e for e in drawn.lines[-1].get_path_effects() if isinstance(e, TickedStroke)]
        return ticks._angle

    # From the lower left to the upper right; heavier pendulums, on the right, stop the block.
    assert curve.tangents[0, 0] > 0.0
    assert tick_angle(ax) == -90.0
    turned = dataclasses.replace(curve, points=curve.points[::-1], tangents=-curve.tangents[::-1])
    own = tpd.plot(turned)
    assert tick_angle(own) == 90.0
    assert own.get_xlabel().startswith("mass ratio")


def test_spectra_can_be_plotted_and_tabulated():
    assert [ax.get_title() for ax in tpd.plot(OVERTURNING)] == ["without pendulum", "with pendulum"]
    assert OVERTURNING.to_dataframe().iloc[2].tolist() == [1.0, 4.0, 2, -1]
    drawn = {line.get_label(): line.get_xdata().tolist() for line in tpd.plot(ROCKING).lines}
    assert drawn["without pendulum: overturns"] == [2.0]
    assert drawn["without pendulum: no result"] == [3.0]
    assert ROCKING.to_dataframe().to_dict("list")["period_s"] == [1.0, 2.0, 3.0]
    sizes = dict.fromkeys(
        ("mass", "length", "damping_ratio", "value", "value_without"), np.array([1.0, np.nan])
    )
    found = Designs(status=np.array(["recommended", "not_recommended"]), **sizes)
    assert found.to_dataframe()["status"].tolist() == ["recommended", "not_recommended"]


def test_the_plot_of_a_record_shows_its_peaks_and_spectrum():
    record = tpd.Record(np.sin(2.0 * np.pi * np.arange(201) / 100), 0.01, name="a sine")
    axes = tpd.plot(record)
    assert [ax.get_title(loc="right") for ax in axes[:3]] == ["PGA 0.102 g", "PGV 0.318 m/s", "PGD 0.318 m"]
    labels = ["acceleration (g)", "velocity (m/s)", "displacement (m)"]
    assert [ax.get_ylabel() for ax in axes] == [*labels, "spectral acceleration, 5 % damping (g)"]
    periods, sizes = axes[3].lines[0].get_data()
    assert sizes[20] == pytest.approx(spectral_acceleration(record, periods[20]) / 9.80665)
    own = [new_axes() for _ in range(4)]
    assert list(tpd.plot(record, ax=own)) == own
