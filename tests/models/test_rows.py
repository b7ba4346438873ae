"""Work shared among threads: every row once, in pieces within their bounds, and what fails is not lost."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import box, parameters
from tpd import Piecewise
from tpd.core.batch import shared
from tpd.models.rows import settle_all


@pytest.mark.parametrize("workers", [None, 1, 3])
@pytest.mark.parametrize("n", [1, 7, 1000])
def test_every_row_is_done_once_in_pieces_within_their_bounds(workers, n):
    done, pieces, calls = np.zeros(n, int), [], []

    def run(first, last):
        done[first:last] += 1
        pieces.append(last - first)
        return last - first

    shared(run, n, workers, lambda *counts: calls.append(counts), piece=(2, 50))
    assert np.all(done == 1)
    assert max(pieces) <= 50 or len(pieces) == 1
    assert sorted(pieces)[1:] == [] or min(sorted(pieces)[1:]) >= 2
    assert calls[-1] == (n, n)
    assert [c for c, _ in calls] == sorted(c for c, _ in calls)


def test_an_error_in_a_thread_is_raised():
    def run(first, last):
        if first > 20:
            raise OSError("no more")
        return last - first

    with pytest.raises(OSError, match="no more"):
        shared(run, 100, 2, None)


# Many motions of the linear equations at once: each what it is alone, on any number of threads.


def test_results_depend_neither_on_the_threads_nor_on_the_batch():
    x, y = box(40, seed=11)
    calls, model = [], Piecewise(max_periods=60)
    alone = settle_all(parameters(x.T), y, model=model, workers=1, progress=lambda *done: calls.append(done))
    assert calls[-1] == (40, 40)
    other = settle_all(parameters(x.T), y, model=model, workers=2)
    for one, two in zip(jax.tree.leaves(alone), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(one, two)
    many = jax.jit(jax.vmap(lambda x, y: model.settle(parameters(x), y).y))(x, y)
    np.testing.assert_array_equal(many, alone.y)
    for i in (0, 7):
        each = model.settle(parameters(x[i]), jnp.asarray(y[i]))
        np.testing.assert_array_equal(each.y, alone.y[i])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"y0": np.zeros((0, 4))}, r"`y0` \(n, 4\)"),
        ({"ramp": np.zeros(3)}, r"must have shape \(n,\)"),
        ({"ramp": -1.0}, "`ramp` must be zero or positive, and finite"),
        ({"begin": 20.0}, "`begin` must lie within the first forcing period, but is"),
        ({"workers": 0}, "`workers` must be a whole number, 1 or more, but is 0"),
    ],
)
def test_bad_input_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        settle_all(parameters(box(1, 1)[0][0]), **({"y0": np.zeros((2, 4))} | wrong))
