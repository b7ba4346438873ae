"""Pictures that compare a block with and without its pendulum hold the data and their intervals."""

import dataclasses

import numpy as np
import pytest
from tpd.design.many import Front

import tpd
from tests import designs
from tests.plots.shown import legend, lines
from tpd.answers.fragility import Curve, Fragility
from tpd.answers.statistics import fit_lognormal
from tpd.design.criteria import Reserve
from tpd.plots.compare import plot_benefit, plot_conditions, plot_front
from tpd.plots.style import new_axes
from tpd.scene.conditions import Conditions


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
    low, high = ax.get_ylim()
    assert -0.05 * high <= low <= 0.0
    factors = {"frequency": design.conditions.column("frequency")[shuffled]}
    e = design.winner.evaluation
    winner = dataclasses.replace(design.winner, evaluation=e._replace(tilt=e.tilt[:, shuffled]))
    mixed = dataclasses.replace(design, conditions=Conditions(factors), verified=(winner,))
    assert lines(plot_conditions(mixed)[0])["with the pendulum"].get_xdata() == pytest.approx(frequency)


def test_a_refused_design_is_labelled_as_such_and_without_a_limit_there_is_no_line_for_it():
    design = designs.band(limits=(Reserve(),))
    ax, below = plot_conditions(dataclasses.replace(design, pendulum=None, verified=design.verified[:1]))
    assert "best found, not offered" in lines(ax)
    assert "with the pendulum" not in lines(ax)
    assert "stroke limit" not in lines(below)
    assert all(np.isfinite(line.get_ydata()).all() for line in below.lines)
    _, empty = plot_conditions(dataclasses.replace(design, pendulum=None, verified=()))
    assert empty.get_legend() is None


def test_conditions_of_the_pendulum_are_in_si_units_where_there_is_one():
    factors = {"length": np.linspace(0.9, 1.1, 8)}
    _, below = plot_conditions(designs.band(conditions=Conditions(factors)))
    assert below.get_xlabel() == "length of the pendulum (m)"
    assert lines(below)["bob"].get_xdata() == pytest.approx(0.12 * factors["length"])
    with pytest.raises(ValueError, match="must have conditions that differ in one quantity"):
        plot_conditions(designs.single())


def test_the_benefit_has_intervals_of_the_differences():
    ax = plot_benefit(designs.single())
    (mean,) = (x for x in designs.single().best.benefit.changes if x.name == "mean severity")
    around = ax.collections[1].get_segments()[0][:, 0]
    assert around == pytest.approx([mean.without + mean.low, mean.without + mean.high])
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
    own = new_axes()
    assert plot_front(designs.front(), own) is own
    assert tpd.plot(Front(designs.front())).get_xlabel() == "mass of the bob (kg)"


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
    *({"overturned": curve(counts)} for counts in ([0, 2, 4], [0, 1, 3])),
    None,
    (np.zeros((4, 3)), None),
    {},
    None,
)


def test_a_fragility_draws_a_state_and_has_a_row_for_every_stripe():
    ax = tpd.plot(FRAGILITY)
    assert ax.get_xlabel() == "PGA (m/s^2)"
    with pytest.raises(ValueError, match="`state` must be one of overturned, but is 'half'"):
        tpd.plot(FRAGILITY, "half")
    table = FRAGILITY.to_dataframe()
    assert table["case"].tolist() == ["bare"] * 3 + ["hung"] * 3
    assert table["stripe"].tolist() == [1.0, 2.0, 3.0] * 2
    assert table["counts"].tolist() == [0, 2, 4, 0, 1, 3]
    assert table["undecided"].tolist() == [0, 1, 0] * 2
    assert set(table["state"]) == {"overturned"}
