"""Pictures that compare a block with and without its pendulum hold the data and their intervals."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.plots.examples import FRONT
from tests.plots.shown import legend, lines
from tpd.plots.compare import plot_benefit, plot_conditions, plot_front
from tpd.plots.style import new_axes


def test_conditions_are_drawn_in_order_and_in_si_units(band):
    ax, below = plot_conditions(band)
    exact, drawn = band.best.exact, lines(ax)["with pendulum"]
    # The fixture gives the highest frequency first.
    assert drawn.get_xdata() == pytest.approx([2.25, 2.5, 2.75, 3.0])
    nu = band.scene.block.slenderness
    assert drawn.get_ydata() == pytest.approx(nu * exact.orbits.tilt[0, ::-1])
    without = band.problem.without_pendulum.orbits
    known = np.where(without.attracts[0], nu * without.tilt[0], np.nan)[::-1]
    assert lines(ax)["without pendulum"].get_ydata() == pytest.approx(known, nan_ok=True)
    assert lines(below)["bob"].get_ydata() == pytest.approx(exact.orbits.swing[0, ::-1])
    assert below.get_xlabel() == "frequency of the excitation (Hz)"
    low, high = ax.get_ylim()
    assert -0.05 * high <= low <= 0.0


def test_the_plot_of_the_benefit_has_intervals_and_a_row_for_every_group(band, under_pulses):
    for design in (band, under_pulses):
        ax, runs = tpd.plot(design, "benefit"), design.runs
        mean, order = runs.change("mean tilt"), np.argsort(design.conditions.column("frequency"))
        around = ax.collections[1].get_segments()[0][:, 0]
        ends = np.array([mean.without_pendulum + mean.low, mean.without_pendulum + mean.high])
        assert around == pytest.approx(np.clip(ends, 0.0, 1.0))
        order = order if runs.cluster is None else np.arange(len(runs.labels))
        # The kinds of start follow the conditions.
        parts = [runs.parts[i] for i in (*order, *range(len(order), len(runs.parts)))]
        # A single part would repeat the mean of all runs.
        parts = parts if len(parts) > 1 else []
        for i, label in enumerate(("with pendulum", "without pendulum")):
            drawn = lines(ax)[label].get_xdata()
            assert drawn[0] == mean[1 + i]
            assert drawn[len(drawn) - len(parts) :] == pytest.approx([part[2 + i] for part in parts])
        rows = [t.get_text() for t in ax.get_yticklabels()]
        # Under ground motions there is a row of rest only if a run ends at rest.
        rest = ["at rest at the end"] if runs.cluster is None else []
        assert rows[2:] == ["overturned", *rest, *(f"tilt, {part.label}" for part in parts)]
        assert ax.lines[-1].get_ydata() == [len(rest) + 2.5] * 2
    with pytest.raises(ValueError, match="`design` must have validation runs, but has none"):
        plot_benefit(dataclasses.replace(band, validated=()))


def test_the_plot_of_a_front_shows_every_design_and_the_rejected_masses():
    ax = plot_front(FRONT)
    assert legend(ax) == {"recommended", "largest reduction", "none recommended up to this mass"}
    assert ax.get_ylim()[0] == 0.0
    assert lines(ax)["largest reduction"].get_xydata().tolist() == [[1.6224, 50.0]]
    assert lines(ax)["none recommended up to this mass"].get_xydata().tolist() == [[0.8112, 0.0]]
    own = new_axes()
    assert plot_front(FRONT, own) is own
    assert tpd.plot(FRONT).get_xlabel() == "mass of the bob (kg)"
