"""Pictures of a design hold the data, with labelled axes that begin at zero."""

import dataclasses

import numpy as np
import pytest

from tests import designs
from tpd.core.conditions import Conditions
from tpd.design.criteria import Reserve
from tpd.plot.conditions import plot_conditions
from tpd.plot.front import plot_front
from tpd.plot.histories import plot_histories
from tpd.plot.response import plot_response
from tpd.plot.search import plot_search
from tpd.plot.style import new_axes


def lines(ax) -> dict:
    return {line.get_label(): line for line in ax.lines}


def legend(ax) -> set[str]:
    return {t.get_text() for t in ax.get_legend().get_texts()}


def assert_begins_at_zero(ax):
    low, high = ax.get_ylim()
    assert -0.05 * high <= low <= 0.0


def test_the_response_compares_two_curves_that_differ_in_grey_as_well():
    study = designs.study()
    ax = plot_response(study.responses, 2.5)
    bare, hung = (lines(ax)[label] for label in ("bare block", "with the pendulum"))
    assert bare.get_marker() != hung.get_marker()
    assert bare.get_linestyle() != hung.get_linestyle()
    known = study.responses[0].status == "rocking"
    assert bare.get_ydata()[known] == pytest.approx(study.responses[0].amplitude[known])
    assert np.isnan(bare.get_ydata()[~known]).all()
    lost = lines(ax)["bare block: overturns from rest"]
    assert lost.get_xdata() == pytest.approx(study.responses[0].frequency[~known])
    assert "with the pendulum: overturns from rest" not in lines(ax)
    assert_begins_at_zero(ax)
    assert ax.get_xlabel() == "frequency of the base motion (Hz)"
    assert "(rad)" in ax.get_ylabel()


def test_overturning_is_marked_at_the_toppling_tilt_and_differs_in_grey():
    status = ["overturned", "rocking", "overturned"]
    bare, hung = (designs.response(np.inf, 0.02, np.inf, status=status) for _ in range(2))
    ax = plot_response((bare, hung), 2.5, toppling=(0.25, 0.23))
    drawn = lines(ax)
    marks = [drawn[f"{name}: overturns from rest"] for name in ("bare block", "with the pendulum")]
    for mark, level in zip(marks, (0.25, 0.23), strict=True):
        assert mark.get_xdata() == pytest.approx([2.4, 2.6])
        assert mark.get_ydata() == pytest.approx([level] * 2)
    assert marks[0].get_marker() != marks[1].get_marker()
    for empty in (marks[0], drawn["bare block"]):
        assert empty.get_markerfacecolor() == "white"
    for filled in (marks[1], drawn["with the pendulum"]):
        assert filled.get_markerfacecolor() != "white"
    low, high = ax.get_ylim()
    assert low == 0.0
    assert high > 0.25
    (degrees,) = ax.child_axes
    assert degrees.get_ylabel() == "degrees"
    ax.figure.canvas.draw()
    assert degrees.get_ylim() == pytest.approx(np.degrees(ax.get_ylim()))


def test_a_response_that_does_not_settle_is_marked():
    status = ["rocking", "aperiodic", "rocking"]
    ax = plot_response((designs.response(0.01, 0.02, 0.01, status=status),), 2.5)
    assert lines(ax)["bare block: not settled"].get_xdata() == pytest.approx([2.45])


def test_conditions_are_drawn_in_order_and_in_si_units():
    design = designs.band()
    shuffled = np.array([3, 1, 7, 0, 5, 2, 6, 4])
    ax, below = plot_conditions(design)
    frequency = lines(ax)["with the pendulum"].get_xdata()
    assert frequency == pytest.approx(np.geomspace(1.5, 4.0, 8))
    assert lines(ax)["with the pendulum"].get_ydata() == pytest.approx(0.25 * np.linspace(0.3, 0.0, 8))
    assert lines(ax)["bare block: overturns from rest"].get_xdata() == pytest.approx([1.5])
    assert lines(below)["bob"].get_ydata() == pytest.approx(np.linspace(0.45, 0.1, 8))
    assert below.get_xlabel() == "frequency of the base motion (Hz)"
    assert_begins_at_zero(ax)
    factors = {"frequency": design.conditions.column("frequency")[shuffled]}
    e = design.winner.evaluation
    winner = dataclasses.replace(design.winner, evaluation=e._replace(tilt=e.tilt[:, shuffled]))
    mixed = dataclasses.replace(design, conditions=Conditions(factors), verified=(winner,))
    assert lines(plot_conditions(mixed)[0])["with the pendulum"].get_xdata() == pytest.approx(frequency)


def test_a_refused_design_is_labelled_as_such():
    design = designs.band()
    ax, _ = plot_conditions(dataclasses.replace(design, pendulum=None, verified=design.verified[:1]))
    assert "best found, not offered" in lines(ax)
    assert "with the pendulum" not in lines(ax)


def test_conditions_of_the_pendulum_are_in_si_units_where_there_is_one():
    factors = {"length": np.linspace(0.9, 1.1, 8)}
    _, below = plot_conditions(designs.band(conditions=Conditions(factors)))
    assert below.get_xlabel() == "length of the pendulum (m)"
    assert lines(below)["bob"].get_xdata() == pytest.approx(0.12 * factors["length"])
    with pytest.raises(ValueError, match="must have conditions that differ in one quantity"):
        plot_conditions(designs.single())


@pytest.mark.parametrize("case", [designs.single, designs.band, designs.refused])
def test_one_picture_of_the_search_serves_all_designs(case):
    design, study = case(), designs.study()
    ax = plot_search(design, study.region)
    said = legend(ax)
    assert {
        "search paths",
        "ends of searches",
        "beyond a limit",
        "no uplift once the bob has settled",
    } <= said
    assert ("answer" in said) is (design.winner is not None)
    assert ("refused" in said) is any(v.reasons for v in design.verified)
    search = design.search
    drawn = sum(len(c.get_offsets()) for c in ax.collections if len(c.get_offsets()) > 1)
    assert drawn == len(search.screened)
    if design.winner is not None:
        (star,) = (line for line in ax.lines if line.get_label() == "answer")
        assert (star.get_xdata()[0], star.get_ydata()[0]) == (0.1, 0.6)
    bar = ax.figure.axes[-1]
    assert bar.get_ylim()[0] == 0.0


def test_histories_of_tilts_share_their_scale_and_end_where_the_block_overturns():
    study = designs.study()
    axes = plot_histories(study.histories, 0.25, 0.5)
    assert len(axes) == 3
    assert axes[0].get_ylim() == axes[1].get_ylim()
    assert legend(axes[0]) == {"exact", "smoothed", "stroke limit (settled)"}
    (alone,) = plot_histories((designs.history(False, lost=True),), 0.25)
    assert [t.get_text() for t in alone.texts] == ["overturns"]
    assert np.nanmax(np.abs(lines(alone)["exact"].get_ydata())) < 0.5
    assert alone.get_xlim()[1] > 9.6


def test_the_front_has_every_answer_and_where_none_is_offered():
    ax = plot_front(designs.front())
    assert legend(ax) == {"offered", "answer", "none is offered up to here"}
    assert ax.get_ylim()[0] == 0.0
    assert lines(ax)["answer"].get_xydata().tolist() == [[1.6224, 50.0]]
    assert lines(ax)["none is offered up to here"].get_xydata().tolist() == [[0.8112, 0.0]]


def test_pictures_are_drawn_into_given_axes():
    ax = new_axes()
    assert plot_search(designs.single(), None, ax) is ax
    assert plot_front(designs.front(), new_axes()).figure is not ax.figure
    assert plot_response(designs.study().responses, 2.5, ax) is ax


def test_without_a_stroke_limit_there_is_no_line_for_it():
    _, below = plot_conditions(designs.band(limits=(Reserve(),)))
    assert "stroke limit" not in lines(below)
    assert all(np.isfinite(line.get_ydata()).all() for line in below.lines)
    _, empty = plot_conditions(designs.band(limits=(Reserve(),), pendulum=None, verified=()))
    assert empty.get_legend() is None
    axes = plot_histories(designs.study().histories, 0.25)
    assert legend(axes[0]) == {"exact", "smoothed"}
