"""Pictures of a design hold the data, with labelled axes that begin at zero."""

import dataclasses

import numpy as np
import pytest
from matplotlib.colors import to_hex

import tpd
from tests import designs
from tpd.answers.shaking_history import ShakingHistory
from tpd.design.criteria import Reserve
from tpd.plot import landscape
from tpd.plot.compare import plot_benefit, plot_conditions, plot_front
from tpd.plot.motion import plot_motions
from tpd.plot.response import plot_response
from tpd.plot.style import ORANGE, new_axes
from tpd.scene.conditions import Conditions


def lines(ax) -> dict:
    return {line.get_label(): line for line in ax.lines}


def legend(ax) -> set[str]:
    return {t.get_text() for t in ax.get_legend().get_texts()}


def assert_begins_at_zero(ax):
    low, high = ax.get_ylim()
    assert -0.05 * high <= low <= 0.0


def near(ax, marker: str) -> list:
    """Lines of one marker that hold anything."""
    return [line for line in ax.lines if line.get_marker() == marker and len(line.get_xdata())]


def test_the_response_compares_two_curves_that_differ_in_grey_as_well():
    study = designs.study()
    (ax,) = plot_response(study.responses, 2.5)
    bare, hung = (lines(ax)[label] for label in ("bare block", "with the pendulum"))
    assert bare.get_marker() != hung.get_marker()
    assert bare.get_linestyle() != hung.get_linestyle()
    known = study.responses[0].status == "rocking"
    assert bare.get_ydata()[known] == pytest.approx(study.responses[0].amplitude[known])
    assert np.isnan(bare.get_ydata()[~known]).all()
    (lost,) = near(ax, "^")
    assert lost.get_xdata() == pytest.approx(study.responses[0].frequency[~known])
    assert not near(ax, "x")
    assert_begins_at_zero(ax)
    assert ax.get_xlabel() == "frequency of the base motion (Hz)"
    assert "(rad)" in ax.get_ylabel()


def test_overturning_is_marked_above_all_amplitudes_and_differs_in_grey():
    status = ["overturned", "rocking", "overturned"]
    bare, hung = (designs.response(np.inf, 0.02, np.inf, status=status) for _ in range(2))
    (ax,) = plot_response((bare, hung), 2.5)
    for marker, level in (("^", 0.027), ("x", 0.95 * 0.027)):
        (mark,) = near(ax, marker)
        assert mark.get_xdata() == pytest.approx([2.4, 2.6])
        assert mark.get_ydata() == pytest.approx([level] * 2)
    drawn = lines(ax)
    assert drawn["bare block"].get_markerfacecolor() == "white"
    assert drawn["with the pendulum"].get_markerfacecolor() != "white"
    low, high = ax.get_ylim()
    assert low == 0.0
    assert high > 0.027
    (degrees,) = ax.child_axes
    assert degrees.get_ylabel() == "degrees"
    ax.figure.canvas.draw()
    assert degrees.get_ylim() == pytest.approx(np.degrees(ax.get_ylim()))


def test_shares_of_runs_that_overturn_stand_below_the_amplitudes():
    values = np.array([[0.1, 0.5, 0.9], [0.0, 0.3, 0.7], [0.3, 0.7, 1.0]])
    response = dataclasses.replace(designs.response(0.1, 0.2, 0.3), overturning=values)
    above, below = plot_response((response,))
    (line,) = below.lines
    assert line.get_ydata().tolist() == [0.1, 0.5, 0.9]
    corners = below.collections[0].get_paths()[0].vertices[:, 1]
    assert (corners.min(), corners.max()) == (0.0, 1.0)
    assert below.get_ylabel() == "share that overturns (-)"
    assert not above.texts
    assert len(plot_response((response,), axes=new_axes())) == 1


def test_a_response_that_does_not_settle_is_marked():
    status = ["rocking", "aperiodic", "rocking"]
    (ax,) = plot_response((designs.response(0.01, 0.02, 0.01, status=status),), 2.5)
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


@pytest.mark.parametrize("case", [designs.single, designs.around, designs.refused])
def test_one_landscape_serves_all_designs(case):
    design = case()
    ax = design.plot()
    said = legend(ax)
    assert "ways of the descents" in said
    assert ("answer" in said) is (design.winner is not None)
    assert ("best found, not offered" in said) is (design.winner is None)
    assert ("refused" in said) is any(v.reasons for v in design.verified)
    star = lines(ax)["answer" if design.winner is not None else "best found, not offered"]
    assert (star.get_xdata()[0], star.get_ydata()[0]) == (0.1, 0.6)
    assert ax.get_xlabel() == r"mass ratio $\mu$ = m/M (-)"
    assert ax.figure.axes[-1].get_ylabel().endswith("at ζ = 0.1 (-)")


def surveyed(tilt, excess):
    """A design whose survey of 400 designs has tilts and excesses that are functions of them."""
    design = designs.single()
    u = np.random.default_rng(1).random((400, len(design.space.names)))
    x = design.space.unscaled(u)
    survey = dataclasses.replace(
        designs.survey("linear", 1),
        designs=x,
        severity=tilt(x)[:, None],
        bare=np.array([0.6]),
        excess={"stroke": excess(x)},
    )
    return dataclasses.replace(design, surveys=(survey,))


def test_the_landscape_is_the_trend_of_what_was_followed_and_its_edges_are_those_of_the_limits():
    design = surveyed(lambda x: 0.1 + 2.0 * x[:, 0], lambda x: np.exp(x[:, 1] - 0.8) - 1.0)
    ax = design.plot()
    edge = next(c for c in ax.collections if [to_hex(e) for e in c.get_edgecolor()] == [ORANGE])
    points = np.concatenate([path.vertices for path in edge.get_paths()])
    assert points[:, 1] == pytest.approx(0.8, abs=1e-3)
    assert np.ptp(points[:, 0]) == pytest.approx(np.ptp(design.space.mass_ratio), rel=0.01)
    assert "stroke" in {t.get_text() for t in ax.texts}
    unit = design.space.scaled(np.array([[0.05, 0.7, 0.1], [0.15, 1.2, 0.1]]))
    seen = landscape._seen(design)
    assert landscape._Smoother(seen.at, unit)(seen.tilt) == pytest.approx([0.2, 0.4], abs=1e-3)


@pytest.mark.parametrize("count", [1, 2, 400])
def test_few_designs_and_a_field_without_slope_are_drawn(count):
    design = surveyed(lambda x: 1.0 + 0.0 * x[:, 0], lambda x: np.where(x[:, 1] > 0.5, np.nan, np.inf))
    few = dataclasses.replace(design, surveys=(design.surveys[0].at(np.arange(count)),))
    ax = few.plot()
    ax.figure.canvas.draw()
    # All of them break the limit: all is hatched.
    (beyond,) = (c for c in ax.collections if getattr(c, "hatches", None) == ["//"])
    assert np.ptp(beyond.get_paths()[0].vertices[:, 1]) == pytest.approx(np.ptp(design.space.length_ratio))
    unit = few.space.scaled(np.array([[0.05, 0.7, 0.1], [0.15, 1.2, 0.1]]))
    seen = landscape._seen(few)
    assert landscape._Smoother(seen.at, unit)(seen.tilt) == pytest.approx([1.0, 1.0], abs=1e-6)


def test_the_landscape_shows_where_a_block_stays_at_rest():
    design = surveyed(lambda x: x[:, 0], lambda x: 0.0 * x[:, 1] - 0.5)
    assert {t.get_text() for t in design.plot().texts} >= {"stays at rest"}
    gentle = dataclasses.replace(design, conditions=Conditions.amplitudes(0.01))
    assert "stays at rest" not in {t.get_text() for t in gentle.plot().texts}


def test_motions_share_their_axes_and_end_where_the_block_overturns():
    study = designs.study()
    tilt, rod = plot_motions(study.histories, 0.25, stroke_limit=0.5)
    assert legend(tilt) == {"bare block", "with the pendulum"}
    assert legend(rod) == {"limit on the settled stroke"}
    assert lines(tilt)["bare block"].get_ydata() == pytest.approx(study.histories[0].tilt)
    assert np.sum([line.get_ydata()[0] == 0.5 for line in rod.lines]) == 1
    (alone,) = plot_motions((designs.history(False, lost=True),), 0.25)
    assert "overturns" in [t.get_text() for t in alone.texts]
    assert np.nanmax(np.abs(lines(alone)["bare block"].get_ydata())) < 0.5
    assert alone.get_xlim()[1] == pytest.approx(9.6)


def test_motions_under_a_record_have_the_base_above_and_the_friction_below():
    time, one = np.linspace(0.0, 1.0, 11), np.ones(11)
    values = {"times": time, "base": one, "tilt": 0.01 * one, "horizontal": -one, "vertical": 4.0 * one}
    rest = {"impacts": np.zeros((0, 2)), "rocking": one > 0.0, "status": tpd.Status.rest}
    bare = ShakingHistory(swing=None, **values, **rest)
    base, tilt, friction = plot_motions((bare,), 0.25)
    assert base.lines[0].get_ydata().tolist() == one.tolist()
    assert friction.lines[0].get_ydata() == pytest.approx(0.25 * one)
    assert legend(tilt) == {"bare block"}
    assert len(plot_motions((bare, dataclasses.replace(bare, swing=0.1 * one)), 0.25)) == 4


def test_the_benefit_has_intervals_of_the_differences():
    ax = plot_benefit(designs.single())
    changes = {change.name: change for change in designs.single().best.benefit.changes}
    mean = changes["mean severity"]
    _, around = ax.collections
    assert around.get_segments()[0][:, 0] == pytest.approx(
        [mean.without + mean.low, mean.without + mean.high]
    )
    assert lines(ax)["bare block"].get_xdata()[0] == pytest.approx(mean.without)
    assert lines(ax)["with the pendulum"].get_xdata()[0] == pytest.approx(mean.with_it)
    with pytest.raises(ValueError, match="must have a design with paired runs"):
        plot_benefit(designs.refused())


def test_the_front_has_every_answer_and_where_none_is_offered():
    ax = plot_front(designs.front())
    assert legend(ax) == {"offered", "answer", "none is offered up to here"}
    assert ax.get_ylim()[0] == 0.0
    assert lines(ax)["answer"].get_xydata().tolist() == [[1.6224, 50.0]]
    assert lines(ax)["none is offered up to here"].get_xydata().tolist() == [[0.8112, 0.0]]


def test_pictures_are_drawn_into_given_axes():
    ax = new_axes()
    assert designs.single().plot(ax=ax) is ax
    assert plot_front(designs.front(), new_axes()).figure is not ax.figure
    assert plot_response(designs.study().responses, 2.5, axes=ax)[0] is ax


def test_without_a_stroke_limit_there_is_no_line_for_it():
    _, below = plot_conditions(designs.band(limits=(Reserve(),)))
    assert "stroke limit" not in lines(below)
    assert all(np.isfinite(line.get_ydata()).all() for line in below.lines)
    _, empty = plot_conditions(designs.band(limits=(Reserve(),), pendulum=None, verified=()))
    assert empty.get_legend() is None
    _, rod = plot_motions(designs.study().histories, 0.25)
    assert rod.get_legend() is None
