"""The descents by optax: what they minimise, where they end, and how they are asked for."""

import numpy as np
import pytest

import tpd
from tpd.design.first_order import _smooth, descend
from tpd.design.job import build
from tpd.design.many_asked import METHODS
from tpd.design.sequential import Local, minimise

WORST = tpd.Measure.worst().of
STARTS = np.array([[0.35, 0.8], [0.8, 0.5], [0.5, 0.5], [0.65, 0.45]])


def local(unit):
    """Charalambous and Bandler's second problem over [-3, 3]^2: its minimax is 1.9522245 at
    (1.13904, 0.89956); with x + y <= 1.5 it is 3.125 at (0.75, 0.75), as a fine grid says."""
    x, y = (6.0 * unit - 3.0).T
    wave = 2.0 * np.exp(y - x)
    value = np.stack([x**2 + y**4, (2 - x) ** 2 + (2 - y) ** 2, wave], axis=1)
    slope = np.stack([[2 * x, 4 * y**3], [2 * x - 4, 2 * y - 4], [-wave, wave]]).transpose(2, 0, 1)
    limit = np.full((len(unit), 1), -1.0)
    return Local(value, 6.0 * slope, limit, np.zeros((len(unit), 1, 2)))


def limited(unit):
    at = local(unit)
    return at._replace(
        limit=(6.0 * unit - 3.0).sum(axis=1, keepdims=True) - 1.5, limit_slope=np.full((len(unit), 1, 2), 6.0)
    )


@pytest.mark.parametrize("cap", [1.0, 0.5, 1.0 / 3.0])
def test_the_smoothed_merit_has_these_slopes_and_tends_to_the_measure(cap):
    share = 1.0 / (3.0 * cap)
    measure = tpd.Measure.cvar(share)
    np.testing.assert_allclose(
        _smooth(limited(STARTS), cap, 1e-7)[0],
        measure.of(local(STARTS).value) + 10.0 * np.maximum(limited(STARTS).limit[:, 0], 0.0),
        atol=1e-5,
    )
    _, slope = _smooth(limited(STARTS), cap, 0.3)
    for i in range(2):
        step = 1e-6 * np.eye(2)[i]
        up, down = (_smooth(limited(STARTS + s * step), cap, 0.3)[0] for s in (1, -1))
        np.testing.assert_allclose(slope[:, i], (up - down) / 2e-6, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("method", ["adam", "lbfgs"])
@pytest.mark.parametrize(("problem", "least"), [(local, 1.9522245), (limited, 3.125)])
def test_a_known_minimax_is_approached_at_more_cost(method, problem, least):
    found = descend(method, problem, STARTS, 1.0, WORST, steps=160)
    surely = minimise(problem, STARTS, 1.0, WORST, steps=40)
    np.testing.assert_allclose(surely.merit, least, rtol=1e-5)
    np.testing.assert_allclose(found.merit, least, rtol=0.01)
    assert np.all(found.merit >= least * (1.0 - 1e-6))
    assert found.evaluations == 4 * 161 > 2 * surely.evaluations
    assert found.path.shape == (161, 4, 2)
    assert np.all(np.diff(found.path_merit, axis=0) <= 0.0)
    assert found.weights[0].shape == (4, 3)


@pytest.mark.parametrize("method", ["adam", "lbfgs"])
def test_a_batch_gives_every_start_what_it_gets_alone(method):
    together = descend(method, limited, STARTS, 1.0, WORST, steps=30)
    for i in range(len(STARTS)):
        alone = descend(method, limited, STARTS[i : i + 1], 1.0, WORST, steps=30)
        np.testing.assert_allclose(alone.x[0], together.x[i], rtol=1e-9)
        np.testing.assert_allclose(alone.path_merit[:, 0], together.path_merit[:, i], rtol=1e-9)


def test_a_start_where_nothing_is_known_goes_back_to_the_best_it_has_seen():
    """Beyond x = 0.6 nothing is known, and there the minimum lies. Both descents end at that edge, well
    below their start (8.0), though not at the edge's best place (2.97): nothing leads them along it."""
    entered = []

    def holed(unit):
        at = local(unit)
        hole = unit[:, 0] > 0.6
        entered.append(hole.any())
        return at._replace(value=np.where(hole[:, None], np.inf, at.value))

    for method in ("adam", "lbfgs"):
        entered.clear()
        found = descend(method, holed, STARTS[2:3], 1.0, WORST, steps=60)
        assert any(entered), "the descent has been where nothing is known"
        assert not entered[0]
        assert 0.5999 < found.x[0, 0] <= 0.6
        assert found.merit[0] < 4.0


def test_settings_of_a_search_over_conditions_are_the_files():
    band = {"conditions": {"band": [2.0, 3.0]}}
    given = build(band | {"search": {"starts": 5, "steps": 7, "screening": 9, "method": "adam"}}).search
    assert (given.starts, given.steps, given.screening, given.method) == (5, 7, 9, "adam")
    plain = build(band).search
    assert (plain.starts, plain.steps, plain.screening, plain.method) == (64, 40, 512, METHODS[0])
    assert build(band | {"search": {"tolerance": 0.1}}).search.tolerance is None
    with pytest.raises(ValueError, match=r"`search\.method` goes with conditions"):
        build({"search": {"method": "adam"}})
    with pytest.raises(ValueError, match="`method` must be one of sequential, adam, lbfgs, but is 'newton'"):
        tpd.optimise_over(tpd.paper_scene(), tpd.Conditions(), method="newton")
