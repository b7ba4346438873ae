"""Descents by optax: the smoothed merit, the ends, and optimisers that a user brings."""

import numpy as np
import optax
import pytest

import tpd
from tests.design.minimax import CB2, half_plane, linearisations
from tpd.design.ends import Linearisation
from tpd.design.methods import OPTIMISERS, descend, minimise, named, smoothed_merit

WORST = tpd.Risk.worst().of
STARTS = np.array([[0.35, 0.8], [0.8, 0.5], [0.5, 0.5], [0.65, 0.45]])


def in_unit_square(problem):
    """A problem over [-3, 3]^2 in shares of these bounds."""

    def evaluate(unit):
        at = problem(6.0 * unit - 3.0)
        return at._replace(slope=6.0 * at.slope, limit_slope=6.0 * at.limit_slope)

    return evaluate


FREE, LIMITED = in_unit_square(linearisations(CB2)), in_unit_square(linearisations(CB2, [half_plane]))


@pytest.mark.parametrize("cap", [1.0, 0.5, 1.0 / 3.0])
def test_the_smoothed_merit_has_these_slopes_and_tends_to_the_risk(cap):
    risk = tpd.Risk.cvar(1.0 / (3.0 * cap))
    at = LIMITED(STARTS)
    sharp = risk.of(at.value) + 10.0 * np.maximum(at.limit[:, 0], 0.0)
    np.testing.assert_allclose(smoothed_merit(at, cap, 1e-7)[0], sharp, atol=1e-5)
    _, slope = smoothed_merit(at, cap, 0.3)
    for i in range(2):
        step = 1e-6 * np.eye(2)[i]
        up, down = (smoothed_merit(LIMITED(STARTS + s * step), cap, 0.3)[0] for s in (1, -1))
        np.testing.assert_allclose(slope[:, i], (up - down) / 2e-6, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("optimiser", OPTIMISERS)
@pytest.mark.parametrize(("problem", "least"), [(FREE, 1.9522245), (LIMITED, 3.125)])
def test_a_known_minimax_is_approached_at_more_cost(optimiser, problem, least):
    found = descend(named(optimiser, 160), problem, STARTS, 1.0, WORST, steps=160)
    surely = minimise(problem, STARTS, 1.0, WORST, steps=40)
    np.testing.assert_allclose(surely.merit, least, rtol=1e-5)
    np.testing.assert_allclose(found.merit, least, rtol=0.01)
    assert np.all(found.merit >= least * (1.0 - 1e-6))
    assert found.evaluations == 4 * 161 > 2 * surely.evaluations
    assert found.path.shape == (161, 4, 2)
    assert np.all(np.diff(found.path_merit, axis=0) <= 0.0)
    assert found.weights[0].shape == (4, 3)


def test_an_optimiser_of_the_user_descends():
    schedule = optax.cosine_decay_schedule(0.03, 160)
    found = descend(optax.chain(optax.clip(1.0), optax.sgd(schedule)), FREE, STARTS, 1.0, WORST, steps=160)
    np.testing.assert_allclose(found.merit, 1.9522245, rtol=0.03)
    assert found.evaluations == 4 * 161


@pytest.mark.parametrize(
    "optimiser",
    [named("adam", 30), named("rmsprop", 30), optax.sgd(0.01, momentum=0.9)],
    ids=["adam", "rmsprop", "sgd"],
)
def test_a_batch_gives_every_start_what_it_gets_alone(optimiser):
    together = descend(optimiser, LIMITED, STARTS, 1.0, WORST, steps=30)
    for i in range(len(STARTS)):
        alone = descend(optimiser, LIMITED, STARTS[i : i + 1], 1.0, WORST, steps=30)
        np.testing.assert_allclose(alone.x[0], together.x[i], rtol=1e-9)
        np.testing.assert_allclose(alone.path_merit[:, 0], together.path_merit[:, i], rtol=1e-9)


@pytest.mark.parametrize(
    "optimiser", [named("adam", 60), named("rmsprop", 60), optax.sgd(0.05)], ids=["adam", "rmsprop", "sgd"]
)
def test_a_start_where_nothing_is_known_goes_back_to_the_best_it_has_seen(optimiser):
    """Beyond x = 0.6 nothing is known, and there the minimum lies. A descent ends at that edge, well below
    its start (8.0), though not at the edge's best place (2.97): nothing leads it along."""
    entered = []

    def holed(unit):
        at = FREE(unit)
        hole = unit[:, 0] > 0.6
        entered.append(hole.any())
        return at._replace(value=np.where(hole[:, None], np.inf, at.value))

    found = descend(optimiser, holed, STARTS[2:3], 1.0, WORST, steps=60)
    assert any(entered), "the descent has been where nothing is known"
    assert not entered[0]
    assert 0.59 < found.x[0, 0] <= 0.6
    assert found.merit[0] < 4.0


def test_progress_counts_every_step_and_starts_are_clipped():
    steps = []
    found = descend(
        named("adam", 5), FREE, np.array([[1.4, -0.2]]), 1.0, WORST, steps=5, after=lambda *e: steps.append(e)
    )
    assert steps == [(i, 5) for i in range(1, 6)]
    np.testing.assert_array_equal(found.path[0], [[1.0, 0.0]])
    assert isinstance(found.local, Linearisation)
