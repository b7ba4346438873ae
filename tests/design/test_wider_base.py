"""The block without a pendulum on wider bases, in the same runs as the pendulum."""

from dataclasses import replace

import numpy as np
import pytest

import tpd
from tests.designs import outcomes, paired, with_block
from tpd.answers.paired import Decision
from tpd.design.wider_base import WiderBase, wider_bases, worth_of

BLOCK = tpd.Block(width=0.7, height=4.0, mass=2210.0)


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
    wider = problem.with_block(problem.scene.block.widened(1.2))
    for before, after in zip(problem.stated_motions, wider.stated_motions, strict=True):
        assert float(after.pga) == pytest.approx(float(before.pga), rel=1e-12)
    assert wider.scene.block.slenderness == pytest.approx(1.2 * problem.scene.block.slenderness)


@pytest.mark.parametrize("kind", ["harmonic", "ground"])
def test_a_base_of_unchanged_width_reproduces_the_runs_without_pendulum(kind, request):
    design = request.getfixturevalue(kind)
    same = design.problem.with_block(design.scene.block.widened(1.0))
    found = same.validation_runs(None, design.runs.with_pendulum.seed)
    for name in ("nu", "tilt", "outcome", "condition"):
        np.testing.assert_array_equal(getattr(found, name), getattr(design.runs.without_pendulum, name))


def test_bases_are_widened_until_one_has_the_effect_of_the_pendulum(harmonic, rejected):
    seen, runs = [], harmonic.runs
    bases = wider_bases(harmonic.problem, runs, "overturning", lambda *reported: seen.append(reported))
    assert seen[0] == ("wider bases", 0, 3)
    assert [base.widening for base in bases] in ([0.05, 0.1, 0.2], [0.2, 0.35], [0.2, 0.35, 0.5])
    worth = worth_of(runs, "overturning", bases)
    # The last base does as well as the pendulum, or is the widest of all.
    assert worth.most == bases[-1].widening
    assert worth.widening <= worth.most or worth.most == 0.5
    overturned = [base.runs.change("overturned") for base in bases]
    assert {x.without_pendulum for x in overturned} == {runs.change("overturned").without_pendulum}
    assert overturned[-1].with_pendulum < overturned[0].with_pendulum
    # Without a pendulum that is offered there is nothing to compare with.
    alone = wider_bases(rejected.problem, rejected.runs)
    assert [base.widening for base in alone] == [0.05, 0.1, 0.2]
    assert worth_of(rejected.runs, "", alone) is None


def test_a_block_near_the_largest_allowed_width_has_fewer_wider_bases(harmonic):
    near = replace(harmonic.problem, scene=with_block(harmonic.scene, height=0.215))
    assert [base.widening for base in wider_bases(near, harmonic.runs)] == [0.05]


def worth(pendulum, without, *wider, measure="overturning", **more):
    """Worth of a pendulum in runs of these tilts over nu, beside bases that are 10, 20, ... % wider."""
    runs = paired(pendulum, without, **more)
    pairs = [replace(runs, with_pendulum=outcomes(tilt)) for tilt in wider]
    return worth_of(runs, measure, [WiderBase(0.1 * i, None, pair) for i, pair in enumerate(pairs, 1)])


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
    decision = Decision("overturning", 0.1)
    assert worth(overturned(15), overturned(40), overturned(30), passed=decision).decided
    assert not by_run.decided
    # Only counted runs matter: the first half overturns in all cases but one.
    half = worth(overturned(15), overturned(40), overturned(30), overturned(10), counted=np.arange(100) < 20)
    assert half.widening == pytest.approx(0.15)
