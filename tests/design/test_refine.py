"""Refinement: the best designs by noisy runs, kept clear of walls, on scenes whose answer is known."""

import numpy as np
import pytest

import tpd
from tpd.design.refine import Refinement, Tried, refine
from tpd.design.survey import ON_THE_WAY, Survey

SPACE = tpd.DesignSpace(mass_ratio=(0.01, 0.21), length_ratio=(0.1, 1.1), damping_ratio=(0.05, 0.55))
RUNS = 128


def tilt(unit):
    """Mean tilt, least at (.6, .5, .4) of the space."""
    return 0.2 + 0.5 * np.sum((unit - [0.6, 0.5, 0.4]) ** 2, axis=-1)


def wall(unit):
    """Reach of the middle run over the wall: a hundredth of the runs is beyond where the share is .5."""
    return np.exp(0.4 * (unit[..., 0] - 0.5) - 0.01 * 2.326)


def made(designs, helps=None):
    designs = np.asarray(designs, dtype=float)
    excess = np.zeros(len(designs)) if helps is None else np.where(helps, -0.1, 0.1)
    severity = tilt(SPACE.scaled(designs))[:, None]
    return Survey(
        designs=designs,
        severity=severity,
        bare=np.ones(1),
        excess={ON_THE_WAY: excess},
        equations="nonlinear",
    )


def spread(count, seed=0, low=0.0, high=0.4):
    return SPACE.unscaled(np.random.default_rng(seed).uniform(low, high, (count, 3)))


class Noisy:
    """Runs with a standard deviation of the mean tilt of .03, a tenth of what the designs differ by."""

    def __init__(self, walls=False, noise=0.03, rests=1.0):
        self.rng, self.designs, self.walls, self.noise = np.random.default_rng(1), [], walls, noise
        self.rests = rests

    def __call__(self, design, i):
        assert i == len(self.designs)
        self.designs.append(design)
        unit = SPACE.scaled(design[None])[0]
        reach = wall(unit) * np.exp(0.01 * self.rng.standard_normal(RUNS)) if self.walls else np.zeros(0)
        return Tried(float(tilt(unit) + self.noise * self.rng.standard_normal()), self.rests, reach)


def everything(designs):
    return np.ones(len(designs), dtype=bool)


def refined(run, first=None, still=everything, follow=made, **settings):
    settings = {"strikes": 0.01, "rests": 0.0, "seed": 0, **settings}
    first = made(spread(40)) if first is None else first
    return refine(first, SPACE, run, still, follow, **settings)[0]


def test_the_trend_of_noisy_runs_leads_to_the_optimum():
    run, counts = Noisy(), []
    found = refined(run, progress=lambda *count: counts.append(count))
    best = SPACE.scaled(found.designs[:1])[0]
    tried = SPACE.scaled(np.array(run.designs))
    # The region is where designs help, wider by a fifth on each side: its edge is at .48.
    assert best[0] == pytest.approx(0.48, abs=0.03)
    assert tilt(best) < tilt(tried[: len(tried) - 40]).min() - 0.01
    assert counts[-1] == (len(run.designs), counts[0][1])
    assert len(found.designs) > 40 + 40


def test_designs_keep_clear_of_walls_that_single_designs_show_by_a_run_or_none():
    first = made(spread(40, high=0.7))
    best = SPACE.scaled(refined(Noisy(walls=True), first).designs[:1])[0]
    # Half of the allowed strikes and somewhat more: the edge lies just below .5.
    assert 0.4 < best[0] < 0.5
    free = SPACE.scaled(refined(Noisy(), first).designs[:1])[0]
    assert free[0] > 0.5


def test_what_breaks_a_limit_without_a_run_is_never_followed():
    asked = []

    def follow(designs):
        asked.append(designs)
        return made(designs)

    refined(Noisy(), still=lambda designs: designs[:, 0] < 0.07, follow=follow)
    assert len(asked) > 0
    assert np.concatenate(asked)[:, 0].max() < 0.07
    count = len(asked)
    assert len(refined(Noisy(), still=lambda designs: designs[:, 0] < 0.0, follow=follow).designs) == 40
    assert len(asked) == count, "where none is left nothing is followed"


def test_what_does_not_help_from_rest_comes_last_however_good_its_runs():
    def follow(designs):
        return made(designs, SPACE.scaled(designs)[:, 0] < 0.3)

    first = spread(40)
    found = refined(Noisy(), made(first, SPACE.scaled(first)[:, 0] < 0.3), follow=follow)
    helps = found.helps
    assert helps[0]
    assert np.all(np.diff(helps.astype(int)) <= 0)
    assert SPACE.scaled(found.designs[:1])[0, 0] < 0.3


def test_runs_without_an_answer_say_nothing():
    first = made(spread(40))
    run = Noisy()
    none = made(first.designs, np.zeros(40, bool))
    assert refined(run, none) is none
    assert run.designs == [], "none where nothing helps"
    found = refined(lambda design, i: Tried(np.nan, 0.0, np.zeros(0)), first)
    assert {tuple(x) for x in first.designs} == {tuple(x) for x in found.designs}
    half = Noisy()
    found = refined(
        lambda design, i: half(design, i) if i % 2 == 0 else half(design, i)._replace(severity=np.nan)
    )
    assert tilt(SPACE.scaled(found.designs[:1])[0]) < 0.25


def test_where_the_bare_block_rests_more_often_designs_give_way():
    here, designs = Refinement(SPACE, spread(10), everything, strikes=0.01, rests=0.5, seed=0), spread(30)
    rests, severity = SPACE.scaled(designs)[:, 0] / 0.4, tilt(SPACE.scaled(designs))
    here.add(made(designs), [Tried(*x, np.zeros(0)) for x in zip(severity, rests, strict=True)])
    keeps = here.keeps(here.scaled(designs)) > 0.5
    assert np.mean(keeps == (rests > 0.5)) > 0.9
    ranked = here.rank(here.scaled(designs))
    assert rests[ranked[0]] > 0.45


def test_a_design_in_which_nothing_stands_has_no_reach():
    here, designs = Refinement(SPACE, spread(10), everything, strikes=0.01, rests=0.0, seed=0), spread(12)
    run = Noisy(walls=True)
    tried = [run(d, i) for i, d in enumerate(designs)]
    tried[3] = Tried(1.0, 0.0, np.zeros(0))
    here.add(made(designs), tried)
    assert set(here.limits) == {"walls"}
    assert len(here.limits["walls"].seen.value) == 11
    assert here.next(0, False).shape[1] == 3


@pytest.mark.parametrize(("damping", "count"), [((0.05, 0.55), 1), (0.3, 2)])
def test_from_one_design_that_helps_the_search_still_goes_on(damping, count):
    space = tpd.DesignSpace(mass_ratio=(0.01, 0.21), length_ratio=(0.1, 1.1), damping_ratio=damping)
    first, run = made(space.unscaled(space.scaled(spread(count)))), Noisy()
    found, _ = refine(first, space, run, everything, made, 0.0, 0.0, 0)
    tried = space.scaled(np.array(run.designs))
    assert len(tried) > 8
    assert np.ptp(tried, axis=0).min() > 0.02
    assert tilt(SPACE.scaled(found.designs[:1])[0]) < tilt(SPACE.scaled(first.designs)).min()


def test_a_design_that_was_tried_is_learnt_of_again():
    here, designs = Refinement(SPACE, spread(10), everything, strikes=0.01, rests=0.0, seed=0), spread(12)
    run = Noisy(walls=True)
    here.add(made(designs), [run(d, i) for i, d in enumerate(designs)])
    found = made(designs)
    first = here.order(found)[0]
    for _ in range(3):
        here.add(found.at(np.array([first])), [Tried(0.9, 0.0, np.full(40, 1.5))])
    assert here.order(found)[0] != first
    assert sorted(here.order(found)) == list(range(12))
