"""Many starts at once: the pool that follows them, and the motions that they reach."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import BARE, HUNG, parameters
from tests.reference import exact as solve
from tpd import Parameters, Starts, Status, attractors
from tpd.models.piecewise import Piecewise
from tpd.models.rows import settle_all
from tpd.models.settling import scale_of
from tpd.scene.parameters import as_arrays

BARE_BLOCK = parameters(BARE[1].x)
"""Rests, rocks or overturns, as it starts."""


def columns(x):
    return as_arrays(parameters(list(x.T)))


@pytest.fixture(scope="module")
def crowd():
    """Designs around the known ones and all over the place, starts for them, and what they settle into."""
    rng = np.random.default_rng(7)
    low = np.array([0.03, 0.0, 0.02, 0.0, 0.0, 0.0, 0.3, 0.0])
    high = np.array([0.5, 1.0, 2.0, 1.0, 0.3, 1.0, 12.0, 1.0])
    x = low + (high - low) * rng.random((400, 8))
    x[:200, :7] = np.array([HUNG[i % 4].x for i in range(200)]) * rng.uniform(0.95, 1.05, (200, 7))
    x[:200, 7] = 1.0
    x[:, 0] = np.minimum(x[:, 0], 0.5)
    y0 = rng.uniform(-0.1, 0.1, (400, 4))
    return x, y0, settle_all(columns(x), y0)


def assert_equal_leaves(a, b):
    for one, other in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        np.testing.assert_array_equal(one, other)


def test_settled_motions_depend_on_neither_order_nor_workers(crowd):
    x, y0, together = crowd
    order = np.random.default_rng(3).permutation(len(x))
    shuffled = settle_all(columns(x[order]), y0[order], workers=1)
    assert_equal_leaves(jax.tree.map(lambda leaf: leaf[order], together), shuffled)


def test_settled_motions_do_not_depend_on_the_size_of_the_batch(crowd):
    x, y0, together = crowd
    few = settle_all(columns(x[190:203]), y0[190:203])
    assert_equal_leaves(jax.tree.map(lambda leaf: leaf[190:203], together), few)


def test_a_batch_settles_as_each_of_its_members_does(crowd):
    x, y0, together = crowd
    for i in (*range(6), *range(200, 230)):
        alone = solve(x[i], y0[i])
        # The pool stops where the motion has repeated to 1e-6, and slow decay has further to go.
        if alone.status in ("rocking", "sticking"):
            assert together.amplitude[i] == pytest.approx(alone.amplitude, abs=1e-3 * x[i, 0])
            assert np.max(np.abs(together.y[i] - alone.steady.state) / scale_of(parameters(x[i]))) < 1e-3
        elif alone.status in ("rest", "overturned"):
            assert (together.status == getattr(Status, alone.status))[i]


def test_single_numbers_belong_to_every_start(crowd):
    _, y0, _ = crowd
    one = settle_all(BARE_BLOCK, y0[:8])
    each = settle_all(jax.tree.map(lambda v: np.full(8, v), BARE_BLOCK), y0[:8])
    assert_equal_leaves(one, each)


@pytest.mark.parametrize(
    ("p", "y0", "shapes"),
    [
        (BARE_BLOCK, np.zeros((0, 4)), r"\[\] and \(0, 4\)"),
        (BARE_BLOCK, np.zeros((3, 2)), r"\[\] and \(3, 2\)"),
        (columns(np.array([HUNG[0].x] * 2)), np.zeros((3, 4)), r"\[\(2,\)\] and \(3, 4\)"),
    ],
)
def test_batches_of_other_shapes_are_refused(p, y0, shapes):
    with pytest.raises(
        ValueError,
        match=rf"`p`, `begin` and `ramp` must have shape \(n,\) and `y0` \(n, 4\), but have {shapes}",
    ):
        settle_all(p, y0)


def test_progress_is_told_to_the_end(crowd):
    seen = []
    settle_all(BARE_BLOCK, crowd[1][:20], workers=1, progress=lambda done, n: seen.append((done, n)))
    assert seen[-1] == (20, 20)
    assert sorted(seen) == seen


# Attractors


@pytest.fixture(scope="module")
def bare():
    return attractors(BARE_BLOCK)


def test_a_bare_block_rocks_rests_or_overturns(bare):
    assert {a.status for a in bare} == {"rocking", "rest", "overturned"}
    assert sum(a.share for a in bare) == pytest.approx(1.0)
    assert sorted(i for a in bare for i in a.starts) == list(range(64))
    shares = [a.share for a in bare]
    assert shares == sorted(shares, reverse=True)


def test_an_attractor_prints_on_one_line(bare):
    rocking = next(a for a in bare if a.status == "rocking")
    lost = next(a for a in bare if a.status == "overturned")
    assert str(lost) == repr(lost) == f"overturned: {lost.share:.1%} of the starts"
    kind = "symmetric, 1 period, amplitude 0.06372 rad, stroke"
    assert str(rocking).startswith(f"rocking: {rocking.share:.1%} of the starts, {kind}")


def test_an_attractor_is_the_steady_state_of_its_starts(bare):
    states = Starts().states(BARE_BLOCK.nu)
    for found in bare:
        for i in found.starts[:3]:
            alone = solve(BARE[1].x, states[i])
            assert alone.status == found.status
            assert alone.steady.amplitude == pytest.approx(float(found.steady.amplitude), rel=1e-9)
    rocking = next(a for a in bare if a.status == "rocking")
    assert rocking.steady.amplitude == pytest.approx(BARE[1].amplitude, abs=BARE[1].amplitude_atol)
    assert rocking.symmetric
    assert rocking.periods == 1


def test_the_same_seed_gives_the_same_answer_and_another_nearly(bare):
    again = attractors(BARE_BLOCK)
    assert [(a.status, a.starts) for a in again] == [(a.status, a.starts) for a in bare]
    other = {a.status: a.share for a in attractors(BARE_BLOCK, starts=Starts(seed=1))}
    for a in bare:
        spread = np.sqrt(a.share * (1.0 - a.share) / 64)
        assert abs(other[a.status] - a.share) < 5.0 * spread


def test_mirror_images_are_one_motion_and_periods_are_told_apart():
    # Period three, which lives beside others.
    found = attractors(parameters((0.16, 0.11, 0.18, 0.1, 0.03, 0.32, 4.5)))
    assert any(a.periods == 3 for a in found)
    seen = [
        (a.status, a.periods, round(float(a.steady.amplitude), 4)) for a in found if a.status == "rocking"
    ]
    assert len(seen) == len(set(seen))


def test_chaos_is_told_from_slow_decay_and_shares_add_up():
    # With so small a tolerance the decay is followed, and not cut short by Newton's method.
    chaotic, slow = (
        attractors(parameters(x), starts=Starts(size=6), model=model)
        for x, model in (
            ((0.321, 0.205, 0.096, 0.047, 0.087, 0.347, 2.803), Piecewise()),
            ((0.269, 0.445, 1.989, 0.098, 0.004, 0.387, 4.151), Piecewise(tolerance=1e-11)),
        )
    )
    for found in (chaotic, slow):
        assert sorted(i for a in found for i in a.starts) == list(range(6))
    first = next(a for a in chaotic if a.status == "aperiodic")
    assert float(first.steady.lyapunov) > 0.1
    assert "aperiodic" not in {a.status for a in slow}
    assert "not_settled" in {a.status for a in slow}


def test_starts_are_seeded_spread_and_begin_at_rest():
    starts = Starts(size=16, seed=5, tilt=0.5, tilt_rate=0.4, swing=0.3, swing_rate=0.2)
    states = starts.states(0.2)
    assert states.shape == (16, 4)
    np.testing.assert_array_equal(states[0], 0.0)
    np.testing.assert_array_equal(states, starts.states(0.2))
    assert np.all(np.abs(states) <= [0.1, 0.3, 0.08, 0.2])
    # One in each sixteenth of every range, but for the one at rest.
    cells = np.floor((states[1:] / [0.1, 0.3, 0.08, 0.2] + 1.0) * 8.0)
    assert all(len(set(column)) == 15 for column in cells.T)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"size": 0}, "`size` must be a whole number, 1 or more, but is 0"),
        ({"tilt": -0.1}, r"`tilt` must be zero or positive, and finite, but is -0\.1"),
    ],
)
def test_starts_that_make_no_sense_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        Starts(**wrong)


def test_an_attractor_has_the_gradient_of_its_orbit(bare):
    rocking = next(a for a in bare if a.status == "rocking")
    state = jnp.asarray(Starts().states(BARE_BLOCK.nu)[rocking.starts[0]])
    assert isinstance(BARE_BLOCK, Parameters)
    slopes = solve(BARE[1].x, state).slopes[0]
    known = np.array(BARE[1].gradient)
    np.testing.assert_allclose(slopes[[0, 4, 5, 6]], known[[0, 4, 5, 6]], atol=BARE[1].gradient_atol)
