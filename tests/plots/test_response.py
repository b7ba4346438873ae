"""Pictures of motions over time and over frequency hold the data and differ in grey."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.plots import examples
from tests.plots.shown import legend, lines
from tpd.answers.motion_history import MotionHistory
from tpd.plots.response import plot_motions, plot_response
from tpd.plots.style import new_axes

SCENE = examples.SCENE
VALUES = np.linspace(1.0, 4.0, 9)


def near(ax, marker: str):
    """The one line of a marker that holds anything."""
    (line,) = (x for x in ax.lines if x.get_marker() == marker and len(x.get_xdata()))
    return line


def test_the_response_plot_separates_overturned_and_unsettled_frequencies():
    status = ["overturned", "rocking", "aperiodic"]
    without_it, with_it = (examples.response(np.inf, 0.02, 0.01, status=status) for _ in range(2))
    (ax,) = plot_response((without_it, with_it), 2.5)
    for marker, level in (("^", 0.027), ("x", 0.95 * 0.027)):
        mark = near(ax, marker)
        assert (mark.get_xdata(), mark.get_ydata()) == (pytest.approx([2.4]), pytest.approx([level]))
    drawn = lines(ax)
    assert drawn["without pendulum: not settled"].get_xdata() == pytest.approx([2.6])
    without_it, with_it = drawn["without pendulum"], drawn["with pendulum"]
    # In grey as well.
    for look in ("marker", "linestyle", "markerfacecolor"):
        assert getattr(without_it, f"get_{look}")() != getattr(with_it, f"get_{look}")()
    assert without_it.get_ydata() == pytest.approx([np.nan, 0.02, np.nan], nan_ok=True)
    low, high = ax.get_ylim()
    assert low == 0.0
    assert high > 0.027
    assert ax.get_xlabel() == "frequency of the excitation (Hz)"
    assert "(rad)" in ax.get_ylabel()


def test_shares_of_overturned_runs_are_drawn_below_the_amplitudes():
    # A run that has no result does not count.
    runs = np.array([[1.0, 1.01, 2.0, 2.05, 2.11, 4.0], [1.0, 0.0, 1.0, 1.0, 0.0, np.nan]])
    shown = examples.response(0.1, 0.2, 0.3, frequency=(1.0, 2.0, 4.0))
    response = dataclasses.replace(shown, runs=runs)
    above, below = plot_response((response,))
    (line,) = below.lines
    np.testing.assert_array_equal(line.get_ydata(), [0.5, 1.0, np.nan])
    corners = below.collections[0].get_paths()[0].vertices[:, 1]
    assert (corners.min(), corners.max()) == (0.0, 1.0)
    assert below.get_ylabel() == "share that overturns,\nruns within 5 % (-)"
    assert not above.texts
    assert len(plot_response((response,), axes=new_axes())) == 1


def test_time_histories_share_their_axes_and_end_at_overturning():
    histories = examples.HISTORIES
    tilt, rod = plot_motions(histories, 0.25, stroke_limit=0.5)
    assert legend(tilt) == {"without pendulum", "with pendulum"}
    assert legend(rod) == {"stroke limit, settled motion"}
    assert lines(tilt)["without pendulum"].get_ydata() == pytest.approx(histories[0].tilt)
    assert np.sum([line.get_ydata()[0] == 0.5 for line in rod.lines]) == 1
    (alone,) = plot_motions((examples.history(False, overturns=True),), 0.25)
    assert "overturns" in [t.get_text() for t in alone.texts]
    assert np.nanmax(np.abs(lines(alone)["without pendulum"].get_ydata())) < 0.5
    assert alone.get_xlim()[1] == pytest.approx(9.6)
    # Without a limit on the stroke there is no line for it.
    assert plot_motions(histories, 0.25)[1].get_legend() is None


def test_time_histories_under_a_record_show_base_and_needed_friction():
    time, one = np.linspace(0.0, 1.0, 11), np.ones(11)
    values = {"times": time, "base": one, "tilt": 0.01 * one, "horizontal": -one, "vertical": 4.0 * one}
    rest = {"impacts": np.zeros((0, 2)), "rocking": one > 0.0, "status": tpd.Status.rest}
    without_it = MotionHistory(swing=None, **values, **rest)
    base, tilt, friction = plot_motions((without_it,), 0.25)
    assert base.lines[0].get_ydata().tolist() == one.tolist()
    assert friction.lines[0].get_ydata() == pytest.approx(0.25 * one)
    assert legend(tilt) == {"without pendulum"}
    assert len(plot_motions((without_it, dataclasses.replace(without_it, swing=0.1 * one)), 0.25)) == 4
    # The outcome makes the mark: neither a row without a result nor a large tilt that comes back.
    for tilts, status, marked in (
        (np.where(time > 0.95, np.nan, 0.01), tpd.Status.rocked, False),
        (np.where(time > 0.95, np.nan, 0.01), tpd.Status.event_bound, False),
        (np.where(time == 0.5, 0.55, 0.01), tpd.Status.rocked, False),
        (np.where(time == 0.5, 0.55, 0.01), tpd.Status.overturned, True),
        (0.01 * one, tpd.Status.overturned, True),
    ):
        _, tilt, _ = plot_motions((dataclasses.replace(without_it, tilt=tilts, status=status),), 0.25)
        assert ("overturns" in [t.get_text() for t in tilt.texts]) is marked
        drawn = lines(tilt)["without pendulum"].get_ydata()
        assert np.isfinite(drawn).sum() == (5 if marked and tilts[5] > 0.5 else np.isfinite(tilts).sum())


def test_a_response_can_be_plotted_and_tabulated_with_shares():
    response = tpd.settled_response(SCENE, "frequency", VALUES, pendulum=examples.PENDULUM)
    above, below = tpd.plot(response, without=examples.response(*np.full(9, 0.1), frequency=VALUES), own=2.5)
    assert legend(above) == {"without pendulum", "with pendulum"}
    assert below.get_xlabel() == "frequency of the excitation (Hz)"
    with pytest.raises(TypeError, match="unexpected keyword argument 'axis'"):
        tpd.plot(response, axis=None)
    table = response.to_dataframe()
    names = ["frequency", "status", "amplitude_rad", "swing_rad"]
    assert list(table.columns) == [*names, "share_overturned", "share_low", "share_high"]
    np.testing.assert_array_equal(table["amplitude_rad"], response.amplitude)
    assert np.all((table["share_low"] <= table["share_overturned"]) & (table["share_high"] <= 1.0))
    assert list(dataclasses.replace(response, runs=None).to_dataframe().columns) == names
    # A part of it keeps its shares.
    part, at = response.between(1.5, 2.5), (VALUES >= 1.5) & (VALUES <= 2.5)
    assert part.frequency.tolist() == VALUES[at].tolist()
    np.testing.assert_array_equal(part.overturning, response.overturning[:, at])


def test_shares_of_a_response_count_runs_from_rest_near_each_value():
    """At the lowest frequencies the paper's block rests, at the strong ones next to its own it overturns."""
    strong = dataclasses.replace(SCENE, excitation=tpd.Harmonic(amplitude=0.06, frequency=2.5))
    response = tpd.settled_response(strong, "frequency", np.linspace(0.2, 2.0, 10))
    share, low, high = response.overturning
    assert (share[0], share[-1]) == (0.0, 1.0)
    assert high[0] < 0.25
    assert low[-1] > 0.75
    # A response over other frequencies counts the same runs near a frequency that both have.
    (at, *_) = np.flatnonzero((share > 0.0) & (share < 1.0))
    other = tpd.settled_response(strong, "frequency", [response.frequency[at], 3.0])
    np.testing.assert_array_equal(other.overturning[:, 0], response.overturning[:, at])
    ends = response.frequency[at], 1.95
    assert other.share_overturned(*ends) == response.share_overturned(*ends)
    assert tpd.settled_response(strong, "amplitude", [0.01, 0.02]).runs is None


def test_branches_can_be_plotted_and_have_a_row_for_every_orbit():
    branches = tpd.branches(SCENE, "frequency", 2.0, 3.0, samples=12)
    (ax,) = tpd.plot(branches)
    assert "without pendulum" in legend(ax)
    table, s = branches.to_dataframe(), branches.sweep
    assert len(table) == sum(len(s.line(i)[0]) for i in range(s.branches)) > 0
    sizes = ["amplitude_rad", "swing_rad", "phase_rad"]
    assert list(table.columns) == ["branch", "frequency", "status", *sizes]
    np.testing.assert_array_equal(table["amplitude_rad"][table["branch"] == 0], s.amplitude[s.line(0)])
