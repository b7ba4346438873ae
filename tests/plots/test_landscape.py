"""The landscape of a search is the trend of what was followed, with the edges of the limits."""

import dataclasses

import numpy as np
import pytest
from matplotlib.colors import to_hex

import tpd
from tests import designs
from tests.plots.shown import legend, lines, words
from tpd.plots import landscape
from tpd.plots.style import ORANGE
from tpd.scene.conditions import Conditions


@pytest.mark.parametrize("case", [designs.single, designs.around, designs.refused])
def test_one_landscape_serves_all_designs(case):
    design = case()
    ax, offered = tpd.plot(design), design.winner is not None
    said = legend(ax)
    assert "ways of the descents" in said
    assert ("answer" in said, "best found, not offered" in said) == (offered, not offered)
    assert ("refused" in said) is any(v.reasons for v in design.verified)
    star = lines(ax)["answer" if offered else "best found, not offered"]
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
    ax = tpd.plot(design)
    edge = next(c for c in ax.collections if [to_hex(e) for e in c.get_edgecolor()] == [ORANGE])
    points = np.concatenate([path.vertices for path in edge.get_paths()])
    assert points[:, 1] == pytest.approx(0.8, abs=1e-3)
    assert np.ptp(points[:, 0]) == pytest.approx(np.ptp(design.space.mass_ratio), rel=0.01)
    assert "stroke" in words(ax.texts)
    unit = design.space.scaled(np.array([[0.05, 0.7, 0.1], [0.15, 1.2, 0.1]]))
    seen = landscape._seen(design)
    assert landscape._Smoother(seen.at, unit)(seen.tilt) == pytest.approx([0.2, 0.4], abs=1e-3)


@pytest.mark.parametrize("count", [1, 400])
def test_few_designs_and_a_field_without_slope_are_drawn(count):
    design = surveyed(lambda x: 1.0 + 0.0 * x[:, 0], lambda x: np.where(x[:, 1] > 0.5, np.nan, np.inf))
    few = dataclasses.replace(design, surveys=(design.surveys[0].at(np.arange(count)),))
    ax = tpd.plot(few)
    ax.figure.canvas.draw()
    # All of them break the limit: all is hatched.
    (beyond,) = (c for c in ax.collections if getattr(c, "hatches", None) == ["//"])
    assert np.ptp(beyond.get_paths()[0].vertices[:, 1]) == pytest.approx(np.ptp(design.space.length_ratio))
    unit = few.space.scaled(np.array([[0.05, 0.7, 0.1], [0.15, 1.2, 0.1]]))
    seen = landscape._seen(few)
    assert landscape._Smoother(seen.at, unit)(seen.tilt) == pytest.approx([1.0, 1.0], abs=1e-6)


def test_the_landscape_shows_where_a_block_stays_at_rest():
    design = surveyed(lambda x: x[:, 0], lambda x: 0.0 * x[:, 1] - 0.5)
    assert "stays at rest" in words(tpd.plot(design).texts)
    gentle = dataclasses.replace(design, conditions=Conditions.amplitudes(0.01))
    assert "stays at rest" not in words(tpd.plot(gentle).texts)
