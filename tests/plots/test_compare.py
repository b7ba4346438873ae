"""Pictures that compare a block with and without its pendulum hold the data and their intervals."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.plots.shown import lines
from tpd.plots.compare import plot_benefit


def test_the_plot_of_the_benefit_has_intervals_and_a_row_for_every_group(band, under_pulses):
    for design in (band, under_pulses):
        ax, runs = tpd.plot(design, "benefit"), design.runs
        whole, parts = runs.change("overturned"), design.problem.parts_of(runs)
        around = ax.collections[1].get_segments()[0][:, 0]
        ends = np.array([whole.without_pendulum + whole.low, whole.without_pendulum + whole.high])
        assert around == pytest.approx(np.clip(ends, 0.0, 1.0))
        for i, label in enumerate(("with pendulum", "without pendulum")):
            drawn, case = lines(ax)[label].get_xdata(), (runs.with_pendulum, runs.without_pendulum)[i]
            assert drawn[0] == whole[1 + i]
            shares = [case.of(rows).share_overturned.value for _, rows in parts]
            assert drawn[len(drawn) - len(parts) :] == pytest.approx(shares)
        rows = [t.get_text() for t in ax.get_yticklabels()]
        # Under ground motions there is a row of rest only if a run ends at rest.
        rest = ["at rest at the end"] if runs.cluster is None else []
        if runs.cluster is None:
            assert [name for name, _ in parts] == [
                "sudden start from rest",
                "growth over 10 periods",
                "after a disturbance",
            ]
        assert rows == ["overturned", "tilt, mean", *rest, *(f"overturned, {name}" for name, _ in parts)]
        assert ax.lines[-1].get_ydata() == [len(rest) + 1.5] * 2
    with pytest.raises(ValueError, match="`design` must have validation runs, but has none"):
        plot_benefit(dataclasses.replace(band, validated=()))
