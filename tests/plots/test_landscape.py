"""The landscape of a search is the trend of its trials, with the edges of the limits."""

import dataclasses

import numpy as np
import pytest
from matplotlib.colors import to_hex

import tpd
from tests.plots.shown import legend, lines
from tpd.design.reasons import DesignStatus, Reason, ReasonKind
from tpd.design.trend import fit
from tpd.plots.style import LABELS, ORANGE


@pytest.mark.parametrize("case", ["single", "band", "under_pulses"])
def test_the_landscape_of_every_design_shows_its_trials_and_best_design(case, request):
    design = request.getfixturevalue(case)
    ax, recommended = tpd.plot(design), design.pendulum is not None
    shown = legend(ax)
    descends = case != "under_pulses"
    assert ({"descents", "corrections by runs"} <= shown) is descends
    assert ("rejected by the validation" in shown) is (
        any(v.reasons for v in design.validated) and not descends
    )
    star = lines(ax)["design" if recommended else "best design, not recommended"]
    assert (star.get_xdata()[0], star.get_ydata()[0]) == tuple(design.nearest[:2])
    if descends:
        np.testing.assert_array_equal(lines(ax)["descents"].get_xydata(), design.search.paths[0][:, :2])
        corrected = lines(ax)["corrections by runs"].get_xydata()
        np.testing.assert_array_equal(corrected, design.search.corrected[:, :2])
    else:
        assert lines(ax)["trial designs"].get_xydata() == pytest.approx(design.trials.designs[:, :2])
    assert ax.get_xlabel() == r"mass ratio $\mu$ = m/M (-)"
    assert ax.figure.axes[-1].get_ylabel().endswith(f"at ζ = {design.nearest[2]:.2g} (-)")


def changed(design, tilt, size, count=60):
    """A design whose trials have tilts and a stroke over its limit that are functions of the design."""
    u = np.random.default_rng(1).random((count, len(design.space.names)))
    x = design.space.unscaled(u)
    at = design.space.logarithms(x)
    trials = dataclasses.replace(
        design.trials,
        designs=x,
        names=("stroke",),
        sizes=size(x)[:, None],
        limits={"stroke": fit(at, np.log(size(x)))},
        undecided=np.arange(count) % 2,
        risk=fit(at, tilt(x)),
    )
    problem = dataclasses.replace(design.problem, limits=(tpd.limits.Stroke(0.5),))
    # Without descents the landscape is that of a search under ground motions.
    return dataclasses.replace(design, problem=problem, trials=trials, search=None)


def test_the_landscape_is_grey_if_the_trials_do_not_determine_the_trend(single):
    assert "trend not known" not in legend(tpd.plot(changed(single, lambda x: x[:, 0], lambda x: x[:, 1])))
    # The tilt of light bobs varies fast, which says nothing about heavy ones.
    x = single.space.unscaled(np.random.default_rng(2).random((60, 2)) * [0.4, 1.0])
    tilt = fit(single.space.logarithms(x), np.sin(900.0 * x[:, 0]))
    trials = dataclasses.replace(single.trials, risk=tilt)
    best = dataclasses.replace(single.best, reasons=(Reason(kind=ReasonKind.undecided),))
    trials = dataclasses.replace(trials, undecided=np.ones_like(single.trials.undecided))
    none = {"status": DesignStatus.not_recommended, "validated": (best, best)}
    ax = tpd.plot(dataclasses.replace(single, trials=trials, search=None, **none))
    # These are the longest labels of a legend.
    assert legend(ax) >= {"trend not known", "rejected by the validation", "best design, not recommended"}


def test_a_limit_that_needs_no_run_has_an_exact_edge(single):
    most = 0.5 * single.scene.block.mass * sum(single.space.mass_ratio)
    problem = dataclasses.replace(single.problem, limits=(tpd.limits.Mass(most),))
    ax = tpd.plot(dataclasses.replace(single, problem=problem))
    edge = next(c for c in ax.collections if [to_hex(e) for e in c.get_edgecolor()] == [ORANGE])
    points = np.concatenate([path.vertices for path in edge.get_paths()])
    # A shorter rod is none that a ball could swing on: there the mass is that of the point.
    points = points[points[:, 1] > 0.5]
    designs = np.column_stack([points, np.full(len(points), 0.1)])
    # Between the points of the grid the logarithm of a size is interpolated.
    assert problem.fixed_sizes(designs)["mass"] == pytest.approx(1.0, abs=1e-2)


def test_a_design_without_trials_has_no_landscape(single):
    rest = dataclasses.replace(single, status=DesignStatus.no_uplift, validated=(), trials=None, search=None)
    with pytest.raises(ValueError, match="must have descents or a trend of trial runs, but has neither"):
        tpd.plot(rest)


def test_a_fixed_value_has_no_axis_in_the_landscape(single):
    space = tpd.DesignSpace(length_ratio=0.6, damping_ratio=0.1)
    problem = dataclasses.replace(single.problem, space=space, limits=(tpd.limits.Stroke(0.5),))
    u = np.random.default_rng(1).random((40, 1))
    x = problem.space.unscaled(u)
    at, tilt = problem.space.logarithms(x), 0.2 + x[:, 0]
    given = {"designs": x, "value": tilt, "risk": fit(at, tilt), "names": ("stroke",)}
    given |= {"sizes": np.exp(u[:, :1] - 0.5), "undecided": np.zeros(40, int)}
    given |= {"limits": {"stroke": fit(at, u[:, 0] - 0.5)}}
    trials = dataclasses.replace(single.trials, **given)
    best = dataclasses.replace(single.validated[-1], design=x[0])
    ax = tpd.plot(dataclasses.replace(single, problem=problem, trials=trials, validated=(best,), search=None))
    shown = lines(ax)["trial designs"].get_xydata()
    np.testing.assert_allclose(shown, np.column_stack([x[:, 0], tilt]))
    assert ax.get_xlabel() == LABELS["mu"]
    trend = lines(ax)["design"].get_xydata()[0]
    assert trend == pytest.approx([x[0, 0], tilt[0]], abs=0.02)
    assert "exceeds a limit" in legend(ax)
