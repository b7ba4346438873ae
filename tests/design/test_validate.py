"""Validation: every reason against a design, the runs that decide, and those that are quoted."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.designs import SCENE, SMALL, SPACE, NoisyProblem, outcomes, paired, with_block
from tpd.answers.paired import PairedRuns
from tpd.design.reasons import DesignStatus, ReasonKind
from tpd.design.validate import run_seed, validate
from tpd.limits import Requirements
from tpd.scene.bob import Bob

TILT = {"reduce": "tilt"}
DESIGN = SPACE.unscaled(np.array([0.4, 0.5, 0.4]))


class Scripted(NoisyProblem):
    """Paired runs that are given, the same for all seeds."""

    def paired_runs(self, design, seed, **how):
        self.asked.append(("paired", seed))
        return dataclasses.replace(self.method, worse=self.requirements.worse)


class Twice(Scripted):
    """Two results of paired runs: those that decide and those that are quoted."""

    def paired_runs(self, design, seed, **how):
        return self.method[seed == run_seed(self, 0, 1)]


class Once(Scripted):
    """The same runs decide and are quoted."""

    has_earthquakes = True


def validated(runs: PairedRuns | tuple[PairedRuns, PairedRuns], limits=(), of=Scripted, **given):
    return validate(of(**(NoisyProblem.of(limits=limits).inputs | {"method": runs} | given)), DESIGN)


def kinds(v) -> list[str]:
    return [reason.kind.name for reason in v.reasons]


@pytest.mark.parametrize(
    ("with_it", "without", "requirements", "kind", "numbers"),
    [
        ([0.1] * 20, [0.3] * 20, {}, None, ()),
        ([0.27, 0.29] * 400, [0.3] * 800, {"at_least": 0.05}, None, ()),
        ([0.27, 0.29] * 40, [0.3] * 80, {}, "too_little_benefit", (1.0 - 0.28 / 0.3, 0.1, 0)),
        ([np.inf] * 8 + [0.0] * 32, [0.5] * 39 + [np.inf], TILT, "overturns_more", (8.0, 1.0, 40)),
        ([0.1, 0.6] * 4, [0.6, 0.1] * 3 + [0.9] * 2, {}, "too_little_benefit", None),
        ([0.01] * 50 + [0.1] * 50, [0.0] * 50 + [0.5] * 50, {}, "rests_less", (0.0, 50.0, 100)),
    ],
)
def test_each_reason_states_the_numbers_of_its_runs(with_it, without, requirements, kind, numbers):
    v = validated(paired(with_it, without), requirements=Requirements(**requirements))
    assert kinds(v) == ([] if kind is None else [kind])
    for reason in v.reasons:
        if numbers is None:
            assert reason.low <= 0.0 < reason.reference < reason.value, "it may be chance"
        else:
            assert (reason.value, reason.reference, reason.total) == pytest.approx(numbers)
    assert v.status is (DesignStatus.not_to_be_built if kind is None else DesignStatus.not_recommended)
    assert len(v.refusals) == len(v.reasons)
    assert v.is_harmful is (kind == "overturns_more")


def overturnings(*counts, tilts=(0.2, 0.4), runs=400, **more) -> PairedRuns:
    """Runs of two tilts, of which the first overturn, with the pendulum and without it."""
    run = np.arange(runs)
    return paired(*(np.where(run < n, np.inf, x) for n, x in zip(counts, tilts, strict=True)), **more)


@pytest.mark.parametrize(
    ("with_it", "without", "tilts", "stated", "measure", "refused"),
    [
        # Two alike statues: of one the overturning falls significantly, and of the other the mean tilt alone.
        (150, 220, (0.54, 0.4), None, "overturning", False),
        (210, 220, (0.1, 0.6), None, "overturning", True),
        # By the mean tilt, in which an overturning counts as 1, their verdicts would be the other way round.
        (150, 220, (0.54, 0.4), "tilt", "tilt", True),
        (210, 220, (0.1, 0.6), "tilt", "tilt", False),
        # Below 1 % of the runs the tilt counts, unless a job states otherwise.
        (0, 3, (0.2, 0.4), None, "tilt", False),
        (0, 4, (0.2, 0.4), None, "overturning", True),
        (0, 3, (0.2, 0.4), "overturning", "overturning", True),
        (0, 0, (0.2, 0.4), "overturning", "overturning", True),
    ],
)
def test_the_required_measure_determines_the_verdict(with_it, without, tilts, stated, measure, refused):
    v = validated(
        overturnings(with_it, without, tilts=tilts), requirements=Requirements(reduce=stated, worse=1.0)
    )
    assert v.measure == measure
    assert kinds(v) == ["too_little_benefit"] * refused
    assert all(reason.measure == measure for reason in v.reasons)
    # A summary has the interval that decided, and the verdict is by that one alone.
    gain, _ = v.runs.reduction(measure)
    assert v.runs.summary()["overturning_reduction" if measure == "overturning" else "benefit"] == gain
    assert refused is not bool(gain.low > 0.05)


def test_quoted_runs_use_the_measure_of_the_deciding_runs():
    """Of the runs that are quoted 1 % overturn without the pendulum, and of those that decided slightly
    fewer."""
    runs = overturnings(0, 3), overturnings(0, 4)
    v = validated(runs, of=Twice)
    assert (v.measure, v.reasons, v.runs.first_measure) == ("tilt", (), "overturning")
    assert validated(runs, (tpd.limits.Mass(0.1),), Twice).measure == ""


def test_the_worst_condition_is_stated_and_further_ones_are_counted():
    group = np.arange(40) % 4
    with_it = np.array([0.1, 0.25, 0.4, 0.1])[group] * np.repeat(np.tile([0.98, 1.02], 5), 4)
    runs = paired(with_it, np.array([0.5, 0.2, 0.3, 0.5])[group], group)
    v = validated(runs)
    (reason,) = v.reasons
    assert reason.kind is ReasonKind.worse_condition
    assert (reason.condition, reason.total) == ("condition 2", 2)
    assert (reason.value, reason.reference) == (pytest.approx(0.4), pytest.approx(0.3))
    assert kinds(validated(runs, requirements=Requirements(worse=0.4))) == []


@pytest.mark.parametrize(
    ("allowed", "kind"), [(None, ["exceeds_limit"]), (0.05, []), (0.049, ["exceeds_limit"])]
)
def test_an_allowed_share_of_surviving_runs_can_exceed_a_limit(allowed, kind):
    """Five of the hundred runs that stand swing beyond the limit, and more of those that overturn."""
    swing = np.where(np.arange(110) < 15, 0.6, 0.4)
    with_it = np.where(np.arange(110) < 10, np.inf, 0.1)
    v = validated(
        paired(with_it, [np.inf] * 20 + [0.5] * 90, swing=swing),
        limits=(tpd.limits.Stroke(0.5),),
        requirements=Requirements(wall_contacts=allowed),
    )
    assert kinds(v) == kind
    assert v.over_limit == pytest.approx(0.05)
    for reason in v.reasons:
        assert (reason.limit, reason.value) == ("stroke", pytest.approx(0.05))
    # An angle of the bob is no danger.
    assert not v.is_harmful


def test_wall_contact_in_the_transient_rejects_a_design():
    """The largest angles count for the walls, the settled ones for the stroke."""
    hung = NoisyProblem.of().pendulum(DESIGN)
    body, rod = Bob().built(float(hung.mass), float(hung.length), float(SCENE.gravity))
    radius = float(Bob().radius(body))
    angle = float(np.arcsin((0.5 * SCENE.block.clear_width - radius) / rod))
    # If a wall is touched, an exceeded stroke does not hide it.
    for share, swing, kind in ((0.9, 0.4, []), (1.1, 0.4, ["touches_wall"]), (1.1, 0.6, ["touches_wall"])):
        runs = paired([0.01] * 50, [0.5] * 50, swing=swing, design=DESIGN)
        # Bob and block turn to opposite sides at most.
        way = np.full(50, share * angle - 0.01 * float(SCENE.block.slenderness))
        runs = dataclasses.replace(runs, with_pendulum=dataclasses.replace(runs.with_pendulum, rod_angle=way))
        limits = (tpd.limits.Stroke(0.5), tpd.limits.Clearance())
        v = validated(runs, limits=limits)
        assert kinds(v) == kind
        assert v.is_harmful is bool(kind)
        assert all(reason.limit == "clearance" for reason in v.reasons)


def test_a_verdict_that_depends_on_runs_without_a_result_is_undecided():
    """Forty pairs show a benefit; ten more have no result, and the block might overturn in all of them."""
    v = validated(paired([0.1] * 40 + [np.nan] * 10, [0.3] * 50))
    assert v.status is DesignStatus.undecided
    assert v.refusals == ("10 of 50 runs have no result, and the verdict depends on them",)
    # One such run changes no verdict, whichever way it ends, and neither do ten beside a refusal.
    assert kinds(validated(paired([0.1] * 49 + [np.nan], [0.3] * 50))) == []
    assert kinds(validated(paired([0.5] * 190 + [np.nan] * 10, [0.3] * 200))) == [
        "worse_condition",
        "too_little_benefit",
    ]
    # Where a wall may be touched the run might have touched it.
    limits = (tpd.limits.Stroke(0.5),)
    assert kinds(validated(paired([0.1] * 49 + [np.nan], [0.3] * 50), limits=limits)) == ["undecided"]
    over = paired([0.1] * 48 + [np.nan] * 2, [0.3] * 50, swing=0.6)
    assert kinds(validated(over, limits=limits)) == ["exceeds_limit"]


def test_a_bob_as_built_over_a_limit_is_rejected_despite_runs_without_a_result():
    """A body is wider than a ball of the point's mass: where the bob hardly swings it reaches further, in all
    runs that have an answer."""
    hung = NoisyProblem.of().pendulum(DESIGN)
    body, rod = Bob().built(float(hung.mass), float(hung.length), float(SCENE.gravity))
    point, built = (
        float(Bob().reach(mass, length, 0.02)) for mass, length in ((hung.mass, hung.length), (body, rod))
    )
    assert point < built
    tilt = np.full(50, 0.01)
    tilt[-1] = np.nan
    runs = paired(tilt, [0.5] * 50, swing=0.0175, design=DESIGN)
    scene = with_block(SCENE, cavity_width=point + built)
    for allowed in (0.01, 0.05):
        v = validated(
            runs, (tpd.limits.Clearance(),), scene=scene, requirements=Requirements(wall_contacts=allowed)
        )
        assert kinds(v) == ["touches_wall"]
        assert v.status is DesignStatus.not_recommended


def test_a_bob_as_built_over_the_mass_limit_is_rejected_without_runs():
    hung = NoisyProblem.of().pendulum(DESIGN)
    body, _ = Bob().built(float(hung.mass), float(hung.length), float(SCENE.gravity))
    assert body > float(hung.mass)
    good = paired([0.1] * 40, [0.5] * 40)
    v = validated(good, limits=(tpd.limits.Mass(0.5 * (body + float(hung.mass))),))
    assert kinds(v) == ["breaks_limit"]
    assert v.deciding_runs is v.reported_runs is v.runs is None
    assert np.isnan(v.over_limit)
    assert (v.reasons[0].value, v.reasons[0].reference) == pytest.approx((body, 0.5 * (body + hung.mass)))
    assert kinds(validated(good, limits=(tpd.limits.Mass(1.001 * body),))) == []


def test_more_overturning_from_rest_in_the_linear_model_rejects_a_design():
    class Exact(Scripted):
        def exact(self, design):
            lost, total = (0, self.count) if design is None else (self.seed, self.count)
            status = np.where(np.arange(total) < lost, "overturned", "rocking")
            return type("Motions", (), {"status": status})

    for lost, total, harm in ((8, 8, True), (2, 8, False), (1, 1, True)):
        given = NoisyProblem.of(limits=()).inputs
        given |= {"method": paired([0.1] * 40, [0.5] * 40), "seed": lost, "count": total}
        v = validate(Exact(**given), DESIGN)
        assert kinds(v) == (["overturns_more"] if harm else [])
        assert (v.runs is None) is harm
        thorough = validate(Exact(**given), DESIGN, thorough=True)
        assert thorough.deciding_runs is not None
        assert kinds(thorough) == kinds(v)
        assert (thorough.reported_runs is None) is harm


def test_deciding_and_quoted_runs_are_disjoint():
    problem = NoisyProblem.of()
    found = [validate(problem, DESIGN, attempt, attempt) for attempt in range(3)]
    seeds = [seed for _, seed in problem.asked]
    assert all(v.reasons == () and v.runs is v.reported_runs for v in found)
    assert len(set(seeds)) == len(seeds) == 6
    assert seeds == [run_seed(problem, attempt, part) for attempt in range(3) for part in (0, 1)]
    decided, quoted = found[0].deciding_runs.with_pendulum, found[0].reported_runs.with_pendulum
    # Only the least tilt that a run may have is in both.
    assert len(set(decided.settled_tilt) & set(quoted.settled_tilt)) <= 1
    # Another seed of the problem counts unless the ensemble has one of its own.
    free = [NoisyProblem.of(ensemble=tpd.Ensemble(size=64), seed=seed) for seed in (0, 1)]
    assert run_seed(free[0], 0, 0) != run_seed(free[1], 0, 0)
    assert run_seed(NoisyProblem.of(seed=1), 0, 0) == run_seed(problem, 0, 0)


def test_harm_in_the_quoted_runs_rejects_a_design_and_a_smaller_benefit_does_not():
    """The runs that decided have the benefit; those that are quoted have half of it, or harm."""
    good, less = paired([0.1] * 40, [0.5] * 40), paired([0.4, 0.42] * 400, [0.5] * 800)
    harm = paired([np.inf] * 8 + [0.01] * 32, [0.5] * 40)
    for quoted, expected in ((less, []), (harm, ["overturns_more"])):
        v = validated((good, quoted), of=Twice)
        assert kinds(v) == expected
        assert v.runs is quoted
        assert v.runs.benefit.mean < v.deciding_runs.benefit.mean


def in_earthquakes(count: int = 11, gain: float = 0.3) -> PairedRuns:
    """Four runs of each earthquake, in which the mean tilt falls by about `gain` on average."""
    rng, quakes = np.random.default_rng(1), np.repeat(np.arange(count), 4)
    with_it = 0.5 * (1.0 - gain + 0.25 * rng.standard_normal(count))[quakes]
    return paired(with_it, np.full(4 * count, 0.5), cluster=quakes)


def test_earthquakes_that_decide_are_quoted_with_their_plain_interval():
    v = validated(in_earthquakes(), of=Once)
    assert v.reasons == ()
    assert v.status is DesignStatus.not_to_be_built
    assert NoisyProblem.of().missing == [
        "the search considered only one excitation and assumed a bob without size and no walls"
    ]
    walls = {"limits": (tpd.limits.Clearance(),), "conditions": SMALL["conditions"]}
    assert NoisyProblem.of(**walls).missing == []
    assert v.reported_runs is v.deciding_runs
    assert v.own_runs is v.runs.with_pendulum


@pytest.mark.parametrize("gain", [0.3, 0.0])
def test_too_few_earthquakes_prevent_any_other_status(gain):
    class Few(Once):
        passing_status = DesignStatus.too_few

    v = validated(in_earthquakes(2, gain), of=Few)
    assert kinds(v) == ["too_little_benefit"]
    assert v.status is DesignStatus.too_few


def test_sizes_in_runs_use_the_scattered_block_of_each_run():
    """The walls of a more slender block are nearer, and a longer rod reaches further."""
    problem = NoisyProblem.of(limits=(tpd.limits.Clearance(), tpd.limits.Tilt(0.5)))
    runs = outcomes([0.1, 0.2, np.inf, np.nan], 0.3, design=DESIGN)
    found = problem.sizes_in_runs(DESIGN, runs)
    assert {name: len(x) for name, x in found.items()} == {"clearance": 2, "tilt": 2}
    np.testing.assert_allclose(found["tilt"], [0.2, 0.4])
    hung = problem.pendulum(DESIGN)
    angle = 0.3 + np.array([0.1, 0.2]) * float(SCENE.block.slenderness)
    body, rod = Bob().built(float(hung.mass), float(hung.length), float(SCENE.gravity))
    reach = Bob().reach(body, rod, angle) / (0.5 * float(SCENE.block.clear_width))
    np.testing.assert_allclose(found["clearance"], reach)
    narrow = dataclasses.replace(runs, nu=0.9 * runs.nu)
    np.testing.assert_allclose(problem.sizes_in_runs(DESIGN, narrow)["tilt"], np.array([0.2, 0.4]) / 0.9)
    wider = problem.sizes_in_runs(DESIGN, dataclasses.replace(runs, nu=1.1 * runs.nu))["clearance"]
    np.testing.assert_allclose(wider, reach / 1.1)
    assert problem.over_limit(DESIGN, runs) == (float(np.mean(reach > 1.0)), "clearance")
    none = outcomes([np.inf, np.nan], design=DESIGN)
    assert np.isnan(problem.over_limit(DESIGN, none)[0])
