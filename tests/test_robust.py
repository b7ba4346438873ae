"""Designs for many conditions: what is measured, how it is minimised, and what is said of the answer."""

import dataclasses
import json
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

import tpd
from tests.reference import exact
from tpd.analysis.ensemble import Verdict
from tpd.core.conditions import FACTORS, under
from tpd.design.basins import ReachedObjective
from tpd.design.job import Job
from tpd.design.many_asked import Asked
from tpd.design.many_result import OverStatus
from tpd.design.objective import KINDS, Objective, margins
from tpd.design.result import StartStatus
from tpd.design.search import Search
from tpd.design.sequential import PENALTY, Local, _subproblem, _within_reach, minimise
from tpd.design.verify import Judge
from tpd.report import many as report
from tpd.report.many_page import Shown, over_page

SCENE = tpd.paper_scene()
SPACE = tpd.DesignSpace(mass_ratio=(0.01, 0.2), damping_ratio=(0.05, 0.4))
BAND = tpd.Conditions.band(SCENE, 2.0, 3.5, 5)
SMALL = {"starts": 20, "screening": 64, "steps": 25, "ensemble": tpd.Ensemble(size=64, periods=40)}
GOOD = np.array([[0.15, 0.26, 0.35]])
NAMES = ("mass_ratio", "length_ratio", "damping_ratio")


@pytest.fixture(scope="module")
def objective():
    worst = tpd.Measure.worst()
    return Objective(SCENE.parameters(), BAND, SPACE, worst, tpd.Limits(relative_stroke=0.8, tilt=0.5), False)


@pytest.fixture(scope="module")
def design():
    return tpd.optimise_over(SCENE, BAND, SPACE, **SMALL)


# Conditions and measures


def test_a_product_is_every_one_under_every_other():
    both = tpd.Conditions.band(SCENE, 2.0, 4.0, 2) * tpd.Conditions.amplitudes(0.5, 1.0, 2.0)
    assert len(both) == 6
    np.testing.assert_allclose(both.column("frequency"), [0.8, 0.8, 0.8, 1.6, 1.6, 1.6])
    np.testing.assert_allclose(both.column("amplitude"), [0.5, 1.0, 2.0, 0.5, 1.0, 2.0])
    np.testing.assert_array_equal(both.column("mass"), 1.0)
    assert both.name(1) == "at 1 times the amplitude and 2 Hz"
    assert both.along is None
    assert BAND.along == "frequency"
    assert len(tpd.Conditions()) == 1


def test_what_scatters_is_even_seeded_and_drawn_apart():
    some = tpd.Conditions.scatter(50, 3, friction=0.2)
    more = tpd.Conditions.scatter(50, 3, friction=0.2, length=0.05)
    np.testing.assert_array_equal(some.column("friction"), more.column("friction"))
    assert np.ptp(some.column("friction")) > 0.38
    assert np.abs(more.column("length") - 1.0).max() <= 0.05
    other = tpd.Conditions.scatter(50, 4, friction=0.2)
    assert not np.array_equal(some.column("friction"), other.column("friction"))


@pytest.mark.parametrize(
    ("measure", "expected"),
    [
        (tpd.Measure.worst(), 9.0),
        (tpd.Measure.expected(), 4.5),
        (tpd.Measure.cvar(0.2), 8.5),
        (tpd.Measure.cvar(0.25), (9.0 + 8.0 + 0.5 * 7.0) / 2.5),
        (tpd.Measure.cvar(0.01), 9.0),
    ],
)
def test_measures_are_means_of_the_worst(measure, expected):
    values = np.random.default_rng(0).permutation(10.0 * np.arange(10.0) / 10.0)
    assert measure.of(values[None])[0] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tpd.Conditions.band(SCENE, 3.0, 2.0), "`band` must be an interval low < high"),
        (lambda: tpd.Conditions.band(SCENE, 2.0, 3.0, 1), "`count` must be a whole number, 2 or more"),
        (lambda: tpd.Conditions.amplitudes(), "`factors` must hold at least one number"),
        (lambda: tpd.Conditions.amplitudes(1.0, -1.0), "`factors` must be positive"),
        (lambda: tpd.Conditions.scatter(8, colour=0.1), "what scatters must be of .* but has colour"),
        (lambda: tpd.Conditions.scatter(8, mass=0.7), r"`mass` must be between 0 and 0\.5, but is 0\.7"),
        (lambda: tpd.Measure.cvar(0.0), "`share` must be between"),
        (lambda: tpd.Limits(tilt=-1.0), "`tilt` must be positive"),
        (lambda: tpd.Limits(multiplier=1.5), r"`multiplier` must be between .* but is 1\.5"),
    ],
)
def test_what_makes_no_sense_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


# The minimiser


def of_functions(functions, limits=()):
    """`Local` of (value, gradient) pairs of functions of x, (k, 2)."""

    def evaluate(x):
        values = [f(*x.T) for f in functions]
        bounds = [c(*x.T) for c in limits]
        none = np.full((len(x), 1), -1.0), np.zeros((len(x), 1, 2))
        return Local(
            np.stack([v for v, _ in values], axis=1),
            np.stack([np.stack(g, axis=1) for _, g in values], axis=1),
            np.stack([v for v, _ in bounds], axis=1) if bounds else none[0],
            np.stack([np.stack(g, axis=1) for _, g in bounds], axis=1) if bounds else none[1],
        )

    return evaluate


CB2 = of_functions(
    [
        lambda x, y: (x**2 + y**4, (2 * x, 4 * y**3)),
        lambda x, y: ((2 - x) ** 2 + (2 - y) ** 2, (2 * x - 4, 2 * y - 4)),
        lambda x, y: (2 * np.exp(y - x), (-2 * np.exp(y - x), 2 * np.exp(y - x))),
    ]
)
"""Charalambous and Bandler's second problem: its minimax is 1.9522245 at (1.13904, 0.89956)."""


def test_a_known_minimax_is_found_from_everywhere():
    starts = np.array([[-1.0, 2.0], [2.0, 0.0], [0.0, 0.0], [1.0, -0.1]])
    box = {"low": np.full((4, 2), -3.0), "high": np.full((4, 2), 3.0)}
    found = minimise(CB2, starts, 1.0, tpd.Measure.worst().of, radius=0.5, **box)
    np.testing.assert_allclose(found.merit, 1.9522245, rtol=1e-6)
    np.testing.assert_allclose(found.x, [[1.13904, 0.89956]] * 4, atol=1e-3)
    assert np.all(found.stationarity < 1e-2)
    assert not found.open.any()
    assert found.path.shape == (len(found.path_merit), 4, 2)
    assert np.all(np.diff(found.path_merit, axis=0) <= 0.0), "no step is kept that does not help"


def test_a_constraint_and_a_smooth_bottom_are_met():
    bowl = [lambda x, y: ((x - 2) ** 2 + 10 * (y - 1) ** 2, (2 * x - 4, 20 * y - 20))]
    line = [lambda x, y: (x + y - 2.0, (np.ones_like(x), np.ones_like(y)))]
    starts, wide = np.array([[0.0, 0.0]]), {"low": np.full((1, 2), -5.0), "high": np.full((1, 2), 5.0)}
    free = minimise(of_functions(bowl), starts, 1.0, tpd.Measure.worst().of, radius=1.0, **wide)
    np.testing.assert_allclose(free.x, [[2.0, 1.0]], atol=1e-3)
    held = minimise(of_functions(bowl, line), starts, 1.0, tpd.Measure.worst().of, radius=1.0, **wide)
    # Lagrange: x = 2 - 10/11, y = 1 - 1/11.
    np.testing.assert_allclose(held.x, [[2.0 - 10 / 11, 1.0 - 1 / 11]], atol=1e-3)
    assert held.weights[1][0, 0] == pytest.approx(20 / 11, rel=1e-2)


def test_a_curved_limit_is_followed_in_long_steps():
    """Maratos' effect: along a ring to its rightmost point, where every straight step leaves the ring."""

    def ring(sign):
        return lambda x, y: (sign * 50 * (x**2 + y**2 - 1), (sign * 100 * x, sign * 100 * y))

    right = [lambda x, y: (-x, (-np.ones_like(x), np.zeros_like(y)))]
    problem, begin = of_functions(right, [ring(1.0), ring(-1.0)]), np.array([[np.cos(2.5), np.sin(2.5)]])
    wide = {"low": np.full((1, 2), -2.0), "high": np.full((1, 2), 2.0)}
    found = minimise(problem, begin, 1.0, tpd.Measure.worst().of, steps=60, **wide)
    np.testing.assert_allclose(found.x, [[1.0, 0.0]], atol=1e-4)
    assert found.evaluations < 130
    assert not found.open.any()


def test_constraints_out_of_reach_are_left_out_and_nothing_else():
    rng, n, d, many = np.random.default_rng(7), 5, 3, 200
    far = rng.normal(size=(4, many)) - 2.2
    local = Local(
        rng.normal(size=(4, n)),
        rng.normal(size=(4, n, d)),
        far,
        rng.normal(size=(4, many, d)),
    )
    box = np.full((4, d), -0.3), np.full((4, d), 0.2)
    curve = np.tile(np.eye(d), (4, 1, 1))
    move, gain, weights = _subproblem(local, curve, box, 1.0, np.zeros(4))
    assert np.any(weights[1] > 1e-3), "one of them holds"
    assert _within_reach(local, box).shape == (4, 64)
    most = far + np.maximum(local.limit_slope * -0.3, local.limit_slope * 0.2).sum(axis=2)
    few = [Local(*(part[[i]] for part in local)) for i in range(4)]
    for i, one in enumerate(few):
        rows = np.flatnonzero(most[i] > -0.5)
        alone = one._replace(limit=one.limit[:, rows], limit_slope=one.limit_slope[:, rows])
        again = _subproblem(alone, curve[[i]], (box[0][[i]], box[1][[i]]), 1.0, np.zeros(1))
        np.testing.assert_allclose(move[i], again[0][0], atol=1e-6)
        assert gain[i] == pytest.approx(again[1][0], rel=1e-6)
        np.testing.assert_allclose(weights[1][i, rows], again[2][1][0], atol=1e-4)


@pytest.mark.parametrize("cap", [1.0, 0.4, 1.0 / 12])
def test_the_subproblem_is_the_linear_programme(cap):
    rng, n, d = np.random.default_rng(5), 12, 3
    local = Local(
        rng.normal(size=(8, n)),
        rng.normal(size=(8, n, d)),
        rng.normal(size=(8, 4)),
        rng.normal(size=(8, 4, d)),
    )
    box = np.full((8, d), -0.3), np.full((8, d), 0.2)
    _, gain, _ = _subproblem(local, np.tile(1e-12 * np.eye(d), (8, 1, 1)), box, cap, np.zeros(8))
    for i in range(8):
        functions = np.hstack([local.slope[i], -np.ones((n, 1)), -np.eye(n), np.zeros((n, 4))])
        limits = np.hstack([local.limit_slope[i], np.zeros((4, 1 + n)), -np.eye(4)])
        answer = linprog(
            np.r_[np.zeros(d), 1.0, cap * np.ones(n), PENALTY * np.ones(4)],
            A_ub=np.vstack([functions, limits]),
            b_ub=-np.r_[local.value[i], local.limit[i]],
            bounds=[(-0.3, 0.2)] * d + [(None, None)] + [(0, None)] * (n + 4),
        )
        assert -gain[i] == pytest.approx(answer.fun, rel=1e-4, abs=1e-4)


# The objective


def test_slopes_are_those_of_differences(objective):
    at, step = objective.local((GOOD - SPACE.bounds[0]) / np.ptp(SPACE.bounds, axis=0)), 1e-5
    unit = (GOOD - SPACE.bounds[0]) / np.ptp(SPACE.bounds, axis=0)
    for i in range(3):
        up, down = (objective.local(unit + s * step * np.eye(3)[i]) for s in (1, -1))
        np.testing.assert_allclose(
            at.slope[..., i], (up.value - down.value) / (2 * step), rtol=1e-5, atol=1e-7
        )
        np.testing.assert_allclose(
            at.limit_slope[..., i], (up.limit - down.limit) / (2 * step), rtol=1e-4, atol=1e-5
        )
    assert len(objective.limit_names()) == at.limit.shape[1]


def test_a_ball_of_steel_keeps_off_the_walls():
    factors = {"mass": [0.9, 1.1], "length": [1.0, 1.02], "slenderness": [1.0, 0.97]}
    scattered = BAND * tpd.Conditions({k: np.array(v) for k, v in factors.items()})
    limits = tpd.Limits(walls=True, offset=0.03, reserve=None)
    objective = Objective.of(SCENE, scattered, SPACE, tpd.Measure.worst(), limits)
    n = len(scattered)
    assert objective.limit_names()[n:] == ["offset"] * n + ["walls"] * n + ["ball"] * n
    told, hung = objective.told(GOOD), SCENE.pendulum(**dict(zip(NAMES, GOOD[0], strict=True)))
    over, slope = objective.limited(told)
    for i in range(n):
        mass, length, slenderness = (scattered.column(name)[i] for name in factors)
        ball = dataclasses.replace(hung, mass=hung.mass * mass).ball_radius
        angle = told.stroke[0, i] + told.tilt[0, i] * SCENE.block.slenderness * slenderness
        reach, room = hung.length * length * np.sin(angle), 0.5 * SCENE.block.width * slenderness
        assert over[0, n + i] == pytest.approx(reach / 0.03 - 1.0)
        assert over[0, 2 * n + i] == pytest.approx((reach + ball) / room - 1.0)
        assert over[0, 3 * n + i] == pytest.approx(ball / (0.5 * hung.length * length) - 1.0)
    for axis in range(3):
        step = 1e-5 * GOOD[0, axis]
        sides = [objective.limited(objective.told(GOOD + s * step * np.eye(3)[axis]))[0] for s in (1, -1)]
        np.testing.assert_allclose(slope[..., axis], (sides[0] - sides[1]) / (2 * step), rtol=1e-4, atol=1e-6)


def test_no_bob_takes_no_room_and_has_a_slope_that_is_a_number():
    limits = tpd.Limits(walls=True, offset=0.03, reserve=None)
    objective = Objective.of(SCENE, BAND, SPACE, tpd.Measure.worst(), limits)
    none = objective.told(np.array([[0.0, 0.26, 0.35]]))
    for part in objective.limited(none):
        assert np.isfinite(part).all()
    assert np.all(objective.room(none.design, none.stroke)["ball"] == 0.0)


def test_nonlinear_equations_are_asked_about_the_room_as_well():
    limits = tpd.Limits(offset=0.02, walls=True)
    objective = Objective.of(SCENE, BAND, SPACE, tpd.Measure.worst(), limits)
    judge = Judge(SCENE, objective, SMALL["ensemble"], False, None)
    stands = np.full(len(BAND), "rocking")
    light = np.array([0.01, 0.26, 0.35])
    assert judge._objections(light, stands, ((1, 0.03, 0.35, "rocking"),)) == ()
    (said,) = judge._objections(light, stands, ((1, 0.06, 0.35, "rocking"),))
    assert said == f"by the nonlinear equations it breaks the limit on offset by 0.036 of it {BAND.name(1)}"
    said = judge._objections(GOOD[0], stands, ((1, 0.03, 0.35, "rocking"),))
    assert len(said) == 2
    assert "the limit on walls by" in said[0]
    assert "the limit on ball by" in said[1]


def test_where_no_design_keeps_to_the_limits_the_nearest_is_told():
    found = tpd.optimise_over(SCENE, BAND, SPACE, limits=tpd.Limits(walls=True), **SMALL)
    assert found.status is OverStatus.none_feasible
    assert set(found.starts) == {StartStatus.infeasible}
    assert found.pendulum is None
    assert "it breaks the limit on" in found.nearest
    # What is told is the design's own, and no end of a search is nearer.
    objective = Objective.of(SCENE, BAND, SPACE, tpd.Measure.worst(), found.limits)
    excess = objective.limited(objective.told(found.ends))[0].max(axis=1)
    assert f" by {excess.min():.2g} of it " in found.nearest.split(", and that")[0]
    assert f"mu {found.ends[np.argmin(excess), 0]:.4g}," in found.nearest
    assert f"nearest to the limits comes {found.nearest}" in report.text(found)
    assert json.loads(report.as_json(found, {}))["limits"]["walls"] is True


def test_a_condition_is_answered_by_its_largest_attracting_orbit_or_by_rest(objective):
    told = objective.told(GOOD)
    for i, factor in enumerate(BAND.column("frequency")):
        motion = dataclasses.replace(SCENE.motion, frequency=SCENE.motion.frequency * factor)
        mass, length, damping = GOOD[0]
        scene = dataclasses.replace(SCENE, motion=motion)
        p = scene.parameters(scene.pendulum(mass_ratio=mass, length_ratio=length, damping_ratio=damping))
        orbits = tpd.symmetric_orbits(p)
        assert KINDS[told.kind[0, i]] == "rocking"
        assert told.tilt[0, i] == pytest.approx(float(orbits.amplitude[0]) / p.nu, rel=1e-10)
        assert told.stroke[0, i] == pytest.approx(float(orbits.stroke[0]), rel=1e-10)
        assert told.margin[0, i] == pytest.approx(float(tpd.uplift(p).margin), rel=1e-10)
    np.testing.assert_allclose(margins(objective, GOOD), told.margin, rtol=1e-12)


def test_the_torus_margin_vanishes_where_a_pair_of_multipliers_leaves_the_circle():
    """At the least frequency of the band a design without a reserve ends on that edge."""
    edge = np.array([[0.2, 0.24187974, 0.34017006]])
    sides = []
    for factor in (0.99, 1.0, 1.01):
        motion = dataclasses.replace(SCENE.motion, frequency=2.0, amplitude=0.015 * factor)
        p = dataclasses.replace(SCENE, motion=motion).parameters(
            SCENE.pendulum(mass_ratio=edge[0, 0], length_ratio=edge[0, 1], damping_ratio=edge[0, 2])
        )
        orbit = tpd.symmetric_orbits(p)
        sides.append((float(orbit.margins.torus[0]), float(np.abs(orbit.multipliers[0]).max())))
        assert orbit.margins.fold[0] > 1.0
        assert orbit.margins.symmetry[0] > 1.0
    assert sides[0][0] < 0.0 < sides[2][0]
    assert sides[0][1] > 1.0 > sides[2][1]
    assert abs(sides[1][0]) < 1e-3


# The whole


def test_the_answer_is_better_than_anything_screened_and_within_its_limits(design):
    assert design.status is OverStatus.found
    winner = design.winner
    assert winner.value <= design.screened_value.min()
    assert winner.value < design.bare_value
    assert winner.value == pytest.approx(0.273, abs=2e-3), "as with 64 starts and 20 frequencies"
    assert winner.told.stroke.max() <= SPACE.stroke * (1 + 1e-5)
    assert winner.told.reserve.min() >= 0.05 * (1 - 1e-3)
    assert np.all(winner.told.attracts)
    assert not winner.objections
    assert not winner.verdict.harms
    assert "the largest mass ratio, 0.2" in winner.active
    assert winner.stationarity < 0.05
    assert len(design.starts) == 20
    assert StartStatus.converged in design.starts


def test_after_a_refusal_designs_on_the_way_are_judged(monkeypatch):
    looked, against = [], Judge._objections

    def refuses(self, *args):
        looked.append(args)
        return ("not the best one",) if len(looked) == 1 else against(self, *args)

    monkeypatch.setattr(Judge, "_objections", refuses)
    found = tpd.optimise_over(SCENE, BAND, SPACE, **(SMALL | {"starts": 4, "steps": 10}))
    best, *others = found.judged
    assert best.ended
    assert best.objections == ("not the best one",)
    assert best.value == pytest.approx(found.end_values.min(), rel=1e-9)
    assert found.status is OverStatus.found
    assert len(looked) == len(found.judged)
    assert not found.winner.ended
    assert best.value < found.winner.value < found.bare_value
    assert found.winner.told.stroke.max() <= SPACE.stroke * (1 + 1e-5)
    designs = [(j.mass_ratio, j.length_ratio, j.damping_ratio) for j in found.judged]
    assert len(set(designs)) == len(others) + 1
    told = report.text(found)
    assert "a search came through this design" in told
    assert "  not the best one" in told


def test_an_overturning_that_the_bare_block_withstands_is_a_danger(design):
    lost = [(i, np.inf, np.inf, "overturned") for i in (0, 1)]
    winner = dataclasses.replace(
        design.winner,
        nonlinear=(*lost, (2, 0.01, 0.1, "rocking")),
        nonlinear_bare=("rocking", "overturned", ""),
    )
    first, second = report._fallen(design, winner)
    assert first.startswith("DANGER: by the nonlinear equations")
    assert design.conditions.name(0) in first
    assert "and bare it stands" in first
    assert second.endswith(f"{design.conditions.name(1)}, and so it does bare.")


@pytest.mark.parametrize(("worse", "better", "fewer"), [(0, 0, False), (3, 5, False), (0, 19, True)])
def test_that_it_overturns_less_is_shown_by_significantly_fewer_runs(
    design, monkeypatch, worse, better, fewer
):
    monkeypatch.setattr(Verdict, "worse", worse)
    monkeypatch.setattr(Verdict, "better", better)
    winner = dataclasses.replace(design.winner, reached=design.bare_reached)
    assert report._overturns_less(design, winner) is fewer


def test_the_report_says_it(design):
    text = report.text(design)
    assert text.startswith("A pendulum was found")
    assert "worst tilt" in text
    assert "ensemble of 64 runs, seed 0" in text
    held = json.loads(report.as_json(design, {}))
    assert held["status"] == "found"
    assert held["judged"][-1]["tilt"] == pytest.approx(design.winner.told.tilt[0].tolist())
    names = ["conditions.png", "search.png", "drawing.png", "animation.gif"]
    pictures = dict(report.pictures(design))
    assert list(pictures) == names
    html = over_page(Shown(design, Job(), None, pictures, None, Path("somewhere")))
    assert html.count("<img") == 4
    assert html.index("Before anything else") < html.index("The answer") < html.index("Under every condition")
    refused = dataclasses.replace(
        design, status=OverStatus.refused, pendulum=None,
        judged=(dataclasses.replace(design.winner, objections=("it overturns",)),),
    )  # fmt: skip
    assert report.text(refused).startswith("NO DESIGN TO OFFER")
    assert "  it overturns" in report.text(refused)
    assert not report.is_sound(refused)


def test_an_interrupted_search_goes_on_and_comes_to_the_same(design, tmp_path):
    place, told = tmp_path / "unfinished.npz", []

    def stop(stage, done, total):
        told.append((stage, done))
        if stage == "searching" and done > total / 2:
            raise KeyboardInterrupt

    cut = tpd.optimise_over(SCENE, BAND, SPACE, checkpoint=place, progress=stop, **SMALL)
    assert cut.status is OverStatus.interrupted
    assert cut.starts.count(StartStatus.interrupted) == 4
    assert cut.winner is not None, "the best of the group that had ended"
    told.clear()
    whole = tpd.optimise_over(
        SCENE, BAND, SPACE, checkpoint=place, progress=lambda *e: told.append(e[:2]), **SMALL
    )
    assert ("searching", 1) not in told, "what had ended is not done again"
    np.testing.assert_array_equal(whole.ends, design.ends)
    assert whole.winner.value == design.winner.value
    with pytest.raises(ValueError, match="holds searches of another problem"):
        tpd.optimise_over(SCENE, BAND, SPACE, checkpoint=place, seed=1, **SMALL)
    with pytest.raises(ValueError, match="holds searches of another problem"):
        tpd.optimise_over(SCENE, BAND, SPACE, checkpoint=place, method="adam", **SMALL)
    place.write_bytes(b"not a file of arrays")
    with pytest.raises(ValueError, match="it holds no finished searches"):
        tpd.optimise_over(SCENE, BAND, SPACE, checkpoint=place, **SMALL)


def test_an_interruption_before_anything_is_known_is_told_without_a_picture_of_it():
    def stop(*_):
        raise KeyboardInterrupt

    cut = tpd.optimise_over(SCENE, BAND, SPACE, progress=stop, **SMALL)
    assert cut.status is OverStatus.interrupted
    assert cut.starts == (StartStatus.interrupted,) * SMALL["starts"]
    assert [name for name, _ in report.pictures(cut)] == ["conditions.png"]
    assert report.text(cut).startswith("INTERRUPTED")


def test_of_many_conditions_a_sample_is_searched_under_first(monkeypatch, tmp_path):
    many = tpd.Conditions.scatter(10, friction=0.2, length=0.05, frequency=0.1)
    settings = SMALL | {"starts": 8, "screening": 32}
    whole = tpd.optimise_over(SCENE, many, SPACE, **settings)
    monkeypatch.setattr("tpd.design.many._MANY", 10)
    monkeypatch.setattr("tpd.design.many._SAMPLED", 5)
    place, stages = tmp_path / "unfinished.npz", []

    def stop(stage, done, total):
        stages.append(stage)
        if stages.count("searching") == 2:
            raise KeyboardInterrupt

    def stop_in_the_second_group(stage, done, total):
        if stage == "searching" and done > total / 2:
            raise KeyboardInterrupt

    cut = tpd.optimise_over(SCENE, many, SPACE, checkpoint=place, progress=stop, **settings)
    assert cut.status is OverStatus.interrupted
    assert cut.starts == (StartStatus.interrupted,) * 8
    more = settings | {"starts": 20, "screening": 64}
    late = tpd.optimise_over(SCENE, many, SPACE, progress=stop_in_the_second_group, **more)
    assert late.status is OverStatus.interrupted
    assert set(late.starts) == {StartStatus.interrupted}
    assert late.winner.told.merit.shape == (1, 10)
    assert late.searched.endswith("not all finished under all of them")
    descend = Search._descend

    def stop_while_finishing(self, *args):
        if len(self.objective.conditions) == 10:
            raise KeyboardInterrupt
        return descend(self, *args)

    with monkeypatch.context() as patch:
        patch.setattr(Search, "_descend", stop_while_finishing)
        last = tpd.optimise_over(SCENE, many, SPACE, **settings)
    assert last.status is OverStatus.interrupted
    assert last.searched.endswith("not all finished under all of them")
    assert set(last.starts) == {StartStatus.interrupted}
    assert len(last.ends) == len(last.starts) > 0, "what the sample had found is kept"
    assert last.winner is not None or "it breaks the limit on" in last.nearest
    first = tpd.optimise_over(SCENE, many, SPACE, checkpoint=place, **settings)
    assert (
        first.searched
        == f"8 starts under 5 of the 10 conditions, {len(first.ends)} finished under all of them"
    )
    assert first.winner.told.merit.shape == (1, 10)
    assert first.winner.value == pytest.approx(whole.winner.value, rel=1e-3)
    assert first.searched in report.text(first)
    stages.clear()
    again = tpd.optimise_over(
        SCENE, many, SPACE, checkpoint=place, progress=lambda *e: stages.append(e[0]), **settings
    )
    assert "searching" not in stages, "what had ended is not done again"
    np.testing.assert_array_equal(again.ends, first.ends)


def test_a_sample_of_conditions_has_the_corners_and_is_seeded():
    band = tpd.Conditions.band(SCENE, 2.0, 3.0, 64)
    both = band * tpd.Conditions.amplitudes(0.8, 1.2)
    some = both.some(64, 1)
    assert len(some) == 64
    assert some.units == both.units
    rows = [tuple(r) for r in np.asarray(some.rows())]
    assert len(set(rows)) == 64
    assert set(rows) < {tuple(r) for r in np.asarray(both.rows())}
    for frequency in band.column("frequency")[[0, -1]]:
        at = some.column("frequency") == frequency
        assert set(some.column("amplitude")[at]) == {0.8, 1.2}
    # Neither amplitude has the one half of the band alone.
    low = some.column("frequency") < 1.0
    for amplitude in (0.8, 1.2):
        assert 0.25 < np.mean(low[some.column("amplitude") == amplitude]) < 0.75
    assert rows == [tuple(r) for r in np.asarray(both.some(64, 1).rows())]
    assert rows != [tuple(r) for r in np.asarray(both.some(64, 2).rows())]
    assert band.some(64) is band
    many = tpd.Conditions.scatter(200, 0, **dict.fromkeys(FACTORS, 0.1)).some(64)
    assert len({tuple(r) for r in np.asarray(many.rows())}) == 64


@pytest.mark.parametrize("method", ["adam", "lbfgs"])
def test_optax_comes_near_the_same_answer(design, method):
    other = tpd.optimise_over(SCENE, BAND, SPACE, method=method, **(SMALL | {"starts": 8, "steps": 60}))
    assert other.settings["method"] == method
    assert np.all(other.end_values >= design.winner.value * (1.0 - 1e-6))
    assert other.end_values.min() < 1.1 * design.winner.value
    assert other.winner.told.stroke.max() <= SPACE.stroke * (1 + 1e-5)


def test_a_mass_limit_narrows_the_space():
    with pytest.raises(ValueError, match=r"`mass` must be above the least bob .* but is 0\.1 kg"):
        tpd.optimise_over(SCENE, BAND, SPACE, limits=tpd.Limits(mass=0.1), **SMALL)


def test_the_front_falls_with_the_mass():
    front = tpd.pareto(SCENE, BAND, SPACE, points=4, starts=4, screening=64, steps=15)
    assert np.all(np.diff(front.mass_ratio) > 0)
    assert np.all(np.diff(front.value) <= 0)
    assert np.all(front.design[:, 0] <= front.mass_ratio * (1 + 1e-9))


# Files


def test_tables_are_read_and_written_back():
    given = {
        "conditions": {"band": [2.0, 3.5], "frequencies": 7, "measure": "cvar", "share": 0.2},
        "scatter": {"friction": 0.2},
        "limits": {"tilt": 0.4},
    }
    asked = Asked.of(given)
    assert len(asked.conditions(SCENE, 0)) == 7 * 64
    assert asked.measure.share == 0.2
    assert Asked.of(asked.tables()) == asked
    assert Asked.of({}) is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"conditions": {"bands": [1.0, 2.0]}}, r"unknown key `bands` in \[conditions\]"),
        ({"conditions": {"band": 2.0}}, "`band` must be two frequencies, but has 1"),
        (
            {"conditions": {"measure": "best"}},
            "`measure` must be one of worst, .* but is 'best'",
        ),
        (
            {"conditions": {"frequencies": 2.5}},
            "`conditions.frequencies` must be a whole number",
        ),
        ({"conditions": {"from_rest": 1}}, "`conditions.from_rest` must be true or false, but is 1"),
        ({"scatter": {"friction": 0.9}}, r"`scatter.friction` must be between 0 and 0\.5, but is 0\.9"),
        ({"limits": {"tilt": "much"}}, "`limits.tilt` must be a number, but is 'much'"),
        ({"scatter": 3}, "`scatter` must be a table, but is 3"),
        ({"limits": {"mass": 500.0}}, r"\[limits\] goes with conditions"),
    ],
)
def test_tables_that_make_no_sense_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        Asked.of(given)


# What starts reach


REACHED = {"starts": 8, "screening": 32, "steps": 6, "ensemble": tpd.Ensemble(size=32, periods=60)}


@pytest.fixture(scope="module")
def reaching(objective):
    """Over what eight starts reach, the worst and the mean: one rests, two overturn, the others rock."""
    gentle = tpd.Conditions.band(SCENE, 2.2, 2.8, 2) * tpd.Conditions.amplitudes(0.85)
    few = dataclasses.replace(objective, conditions=gentle)
    starts = tpd.Starts(size=8, seed=1, tilt=0.5, tilt_rate=0.2)
    return [ReachedObjective(**vars(few), starts=starts, by_share=b, periods=500) for b in (False, True)]


def test_what_starts_reach_is_what_each_of_them_settles_into(reaching):
    worst, mean = (o.told(GOOD) for o in reaching)
    for i, factors in enumerate(reaching[0].conditions.rows()):
        q = under(SCENE.parameters(), jnp.asarray(GOOD[0]), factors)
        states = reaching[0].starts.states(float(q.nu))
        margin, merits = float(tpd.uplift(q).margin), []
        for y0 in states:
            end = exact([q.nu, q.mu, q.lam, q.zeta, q.k, q.f, q.xi], y0)
            lost = end.status == "overturned"
            merits.append(
                2.0 - margin if lost else -margin if end.status == "rest" else end.amplitude / float(q.nu)
            )
        assert worst.merit[0, i] == pytest.approx(max(merits), rel=1e-9)
        assert mean.merit[0, i] == pytest.approx(np.mean(merits), rel=1e-9)


def test_slopes_over_what_starts_reach_are_those_of_differences(reaching):
    for objective in reaching:
        told = objective.told(GOOD)
        for axis in range(3):
            step = 1e-4 * GOOD[0, axis]
            moved = GOOD.repeat(2, axis=0)
            moved[:, axis] += [-step, step]
            sides = objective.told(moved)
            for size, slope in ((sides.merit, told.merit_slope), (sides.stroke, told.stroke_slope)):
                expected = (size[1] - size[0]) / (2.0 * step)
                np.testing.assert_allclose(slope[0, :, axis], expected, rtol=1e-5, atol=1e-7)


def test_a_search_is_finished_over_what_starts_reach():
    starts = tpd.Starts(size=6, seed=2)
    told = []
    design = tpd.optimise_over(
        SCENE,
        tpd.Conditions.band(SCENE, 2.2, 3.2, 2),
        SPACE,
        reached=starts,
        by_share=True,
        progress=lambda *e: told.append(e[0]),
        **REACHED,
    )
    assert design.reached is starts
    assert design.by_share
    assert np.isfinite(design.end_values).any()
    assert design.status in (OverStatus.found, OverStatus.refused)
    assert "the mean over the starts" in report.notes(design)[-1]
    with pytest.raises(ValueError, match="`from_rest` and `reached` exclude each other"):
        tpd.optimise_over(SCENE, BAND, SPACE, from_rest=True, reached=starts, **REACHED)
