"""Corrections of limits by runs: a chimney whose clearance decides, small problems with other limits, and
what the descents are worth."""

import copy
import dataclasses
from functools import partial
from typing import Any

import numpy as np
import pytest

import tpd
from tests.design.test_sizes import LongestRod
from tests.designs import SCENE, SMALL, SPACE, outcomes
from tpd.answers import ensemble
from tpd.cli.new import template
from tpd.core.progress import unreported
from tpd.design.corrections import Corrections
from tpd.design.first_guess import first_guess
from tpd.design.harmonic import SMOOTHED, HarmonicProblem
from tpd.design.optimise import solve_problem
from tpd.design.reasons import DesignStatus
from tpd.design.search import search

EXACT = tpd.Piecewise()
STROKE = (tpd.limits.Stroke(0.5), tpd.limits.Reserve())
FEW = tpd.Descent(searches=2, screening=32, steps=10, corrections=2, polish=20, model=EXACT)


@pytest.fixture(scope="module")
def chimney(tmp_path_factory):
    """The chimney of `tpd new chimney` with its corrections by exact orbits, and its best design."""
    path = tmp_path_factory.mktemp("chimney") / "job.toml"
    path.write_text(template("chimney"), encoding="utf-8")
    job = tpd.Job.read(path)
    settings = job.settings | {"method": tpd.Descent(model=EXACT)}
    problem = HarmonicProblem.of(job.scene, **settings)
    made = problem.improver(first_guess(problem), unreported)
    return made, made.best([])


def more_runs(problem, design, size=1024, seed=4321):
    """Nonlinear runs of a design that no stage of a search uses; None for no pendulum."""
    pendulum = None if design is None else problem.pendulum(design)
    runs = dataclasses.replace(problem.ensemble, size=size, seed=seed)
    return ensemble.outcomes(
        problem.scene,
        pendulum,
        ensemble=runs,
        conditions=problem.conditions,
        equations="nonlinear",
        rtol=1e-6,
    )


def corrected(method=FEW, progress=unreported, guess=None, **given) -> Corrections:
    """Corrections of a small problem."""
    inputs: dict[str, Any] = SMALL | {"limits": STROKE, "method": method} | given
    space = inputs.pop("space", SPACE)
    return HarmonicProblem.of(SCENE, space, **inputs).improver(guess, progress)


def test_the_corrected_design_keeps_the_limits_in_other_runs(chimney):
    """The settled orbits alone promise a longer and heavier pendulum, whose bob touches a wall in most
    runs."""
    made, best = chimney
    problem = made.problem
    share, name = problem.over_limit(best, more_runs(problem, best))
    assert share <= problem.allowed
    orbits = search(made.searched, made.method, 0, guess=made.guess)
    alone = orbits.ends[orbits.order[0]]
    share, name = problem.over_limit(alone, more_runs(problem, alone, size=256))
    assert (share > 0.5, name) == (True, "clearance")
    # The corrected limit is active, so the correction costs no more than it must.
    (i,) = (i for i, x in enumerate(made.designs) if np.array_equal(x, best))
    assert -0.03 < made._excess(i) <= 0.01


def test_the_descents_decide_the_share_of_runs_that_overturn(chimney):
    """Of eight random designs within the limits the best leaves 8.3 % of the runs overturned, and the mean is
    16.0 %. The descents leave 6.0 %, the first guess 9.8 %, and without a pendulum 23.3 % overturn. A search
    without descents would fail here."""
    made, best = chimney
    problem, drawn = made.problem, made.problem.space.sample(np.random.default_rng(0), 512)
    random = []
    for x in drawn[problem.possible(drawn)]:
        runs = more_runs(problem, x)
        if problem.over_limit(x, runs)[0] <= problem.allowed:
            random.append(float(runs.share_overturned.value))
        if len(random) == 8:
            break
    assert len(random) == 8
    share, without = (float(more_runs(problem, x).share_overturned.value) for x in (best, None))
    # The standard error of a share of 6 % of 1024 runs is 0.7 points.
    assert share < min(random) - 0.01, (share, random, without)
    assert share < np.mean(random) - 0.07, (share, random, without)
    assert share < without - 0.15


def test_descents_on_smoothed_and_on_exact_orbits_end_at_the_same_design(chimney):
    made, _ = chimney
    orbits = dataclasses.replace(made.searched, factors=made.laws)
    ends = {}
    for name, model in (("exact", EXACT), ("smoothed", SMOOTHED)):
        found = search(orbits, dataclasses.replace(made.method, model=model), 0, guess=made.guess)
        ends[name] = found.end_values[found.order[0]], found.ends[found.order[0]]
    assert ends["smoothed"][0] == pytest.approx(ends["exact"][0], abs=1e-4)
    # The objective is flat along the limit: the designs differ more than their values.
    np.testing.assert_allclose(ends["smoothed"][1], ends["exact"][1], rtol=0.02)


def test_a_law_passes_through_the_accurate_runs(chimney):
    made, _ = chimney
    i, orbits = len(made.designs) - 1, dataclasses.replace(made.orbits, factors=made.laws)
    assert list(made.laws) == ["stroke", "clearance"]
    # The orbits with these factors have the limited quantity of the runs.
    sizes = orbits.limited(orbits.evaluate(made.designs[i][None]))
    for name, size in made._sizes(i).items():
        (found,) = (s.value.max() for s in sizes if s.name == name)
        assert np.log(found) == pytest.approx(size, abs=0.03)


def test_equivalent_designs_contain_the_design_and_keep_the_limits(chimney):
    made, best = chimney
    low, high = made.equivalent(best)
    assert np.all((low <= best) & (best <= high))
    assert high[2] == pytest.approx(made.problem.space.ends[1, 2])
    # Half a point of overturning: a tenth of the share at the design.
    assert 0.05 < high[0] / low[0] - 1.0 < 1.5


def test_the_table_of_trials_has_all_runs_and_those_within_the_limits_first(chimney):
    made, best = chimney
    trials = made.trials()
    assert len(trials.designs) == len(made.designs) > made.cheap == 1 + 24
    assert np.all(np.diff(trials.feasible.astype(int)) <= 0)
    assert trials.feasible[0]
    assert trials.names == ("stroke", "clearance", "thickness", "depth", "worsening", "reserve")
    assert np.all(trials.sizes[trials.feasible] <= 1.005)
    assert trials.without_pendulum == pytest.approx(made.problem.value_of(made.without))
    assert best.tolist() in trials.designs.tolist()


def test_a_rejected_design_is_followed_by_one_further_inside(chimney):
    """In validation runs the bob is by 3 % nearer to the wall than in the accurate runs."""
    made, first = chimney
    here = copy.copy(made)
    for name in ("designs", "runs", "allowance"):
        setattr(here, name, copy.copy(getattr(made, name)))
    i = max(i for i, x in enumerate(here.designs) if np.array_equal(x, first))
    runs, size = here.runs[i], here._sizes(i)["clearance"]

    def further(factor):
        return dataclasses.replace(runs, rod_angle=factor * runs.rod_angle)

    factor = next(x for x in np.linspace(1.0, 1.3, 301) if here._sizes(i, further(x))["clearance"] > 0.03)
    here.learn(first, further(factor))
    assert here.allowance == {"clearance": pytest.approx(0.03, abs=2e-3)}
    second = here.best([first])
    assert second is not None
    i, here.allowance = max(i for i, x in enumerate(here.designs) if np.array_equal(x, second)), {}
    assert here._sizes(i)["clearance"] < min(size - 0.02, -0.03 + 0.005)
    # A limit that was kept has no allowance.
    assert made.allowance == {}


def test_no_design_is_returned_if_none_can_keep_a_limit():
    here = corrected(limits=(tpd.limits.Stroke(0.01), tpd.limits.Reserve()))
    assert here.best([]) is None
    assert not here.trials().feasible.any()
    problem = dataclasses.replace(here.problem)
    found = solve_problem(problem)
    assert (found.status, found.validated) == (DesignStatus.none_feasible, ())
    assert found.refusals[0].startswith("the design exceeds the limit on stroke: ")


@dataclasses.dataclass(frozen=True)
class Rod(tpd.limits.Limit):
    """Limit of a user on the length, which does not depend on the motion."""

    length: float
    name = "rod"

    def size(self, motion, design, geometry):
        return geometry.rod(design) / self.length


@dataclasses.dataclass(frozen=True)
class Gentle(tpd.limits.Limit):
    """Limit of a user on the settled motion only, which is negative at rest."""

    name = "gentle"

    def size(self, motion, design, geometry):
        return 1.5 * (motion.tilt - 0.1)


@pytest.mark.parametrize(
    ("limits", "names", "count"),
    [
        ((), [], 1),
        (tpd.limits.POINT_BOB, ["stroke"], None),
        ((Rod(0.15), tpd.limits.Stroke(3.0 / 2.0)), ["stroke", "rod"], None),
        ((Gentle(),), ["gentle"], None),
    ],
    ids=["none", "point bob", "of a user", "negative"],
)
def test_only_limits_on_the_motion_of_runs_are_corrected(limits, names, count):
    """Limits on the bob alone and limits on orbits need no run. Without the others one design has accurate
    runs, because nothing is left to correct."""
    here = corrected(limits=limits)
    best = here.best([])
    assert best is not None
    assert set(here.laws) == set(names)
    assert count is None or len(here.designs) - here.cheap == count
    assert np.isfinite(here.trials().sizes).all()
    assert here.problem.possible(best[None])[0] or here._excess(len(here.designs) - 1) > 0.0


class Falling(HarmonicProblem):
    """The block overturns in all runs but one of each design."""

    def trial_runs(self, design, seed, equations="linear"):
        tilt = np.where(np.arange(96) == 0, 0.2, np.inf)
        return outcomes(tilt, 0.1, design=(0.1, 0.6, 0.1) if design is None else design, seed=seed)


def test_a_design_with_which_the_block_does_not_survive_is_not_returned():
    made = HarmonicProblem.of(SCENE, SPACE, **(SMALL | {"limits": STROKE, "method": FEW}))
    here = Falling(**made.inputs).improver(None, unreported)
    assert here.best([]) is None
    # Nothing can be learnt from such runs, so there is no second correction.
    assert len(here.designs) == 24 + 1
    trials = here.trials()
    assert not trials.feasible.any()
    assert here.equivalent(trials.designs[0]) is None


def test_every_stage_reports_its_progress_and_stops_at_ctrl_c():
    events = []
    here = corrected(progress=lambda *event: events.append(event))
    here.best([])
    stages = list(dict.fromkeys(stage for stage, *_ in events))
    assert stages == ["trial runs", "screening", "searching", "correcting"]
    for stage in stages:
        done = [(i, total) for of, i, total in events if of == stage]
        assert all(0 < i <= total for i, total in done)
        assert [i for i, _ in done] == sorted(i for i, _ in done)

    def stop(at, stage, *_):
        if stage == at:
            raise KeyboardInterrupt

    for stage in stages:
        with pytest.raises(KeyboardInterrupt):
            corrected(progress=partial(stop, stage)).best([])


def test_a_limit_that_angles_do_not_change_is_kept_by_rods_that_scatter():
    """On the limit itself half of the rods would be too long."""
    here = corrected(limits=(LongestRod(0.1),), ensemble=tpd.Ensemble(size=512, periods=30, length=0.02))
    design = here.best([])
    runs = more_runs(here.problem, design, 1024, 5)
    assert here.problem.over_limit(design, runs)[0] <= here.problem.allowed


def test_without_corrections_the_first_design_is_only_checked():
    here = corrected(dataclasses.replace(FEW, corrections=0))
    here.best([])
    assert len(here.designs) == 24 + 1
