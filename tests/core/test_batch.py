"""Batches in chunks, against `vmap` of the whole."""

import re
import subprocess
import sys
import threading

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd import Status, in_chunks
from tpd.core.batch import CHUNK, UNEVEN, aside, prepare, shared
from tpd.core.batch import _chunk as default_chunk

LENGTH = 101
X = np.random.default_rng(3).uniform(0.1, 2.0, size=(LENGTH, 3))


class Answer(eqx.Module):
    value: jax.Array
    status: Status
    parts: dict


def answer(x):
    """A function whose result holds everything that results of the package hold."""
    total = jnp.sum(jnp.sin(x) * jnp.exp(x))
    status = Status.where(total > 5.0, Status.rocking, Status.no_orbit)
    return Answer(
        total, status, {"count": jnp.sum(x > 1.0), "turned": x[::-1] + 1j * x, "large": total > 5.0}
    )


def same(a, b):
    """Whether two results agree bit for bit, in type and shape too."""
    assert jax.tree.structure(a) == jax.tree.structure(b)
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        assert np.asarray(x).dtype == np.asarray(y).dtype
        np.testing.assert_array_equal(x, y)


WHOLE = in_chunks(answer, X, chunk=64, workers=1)


def test_in_chunks_equals_vmap_and_returns_numpy_arrays():
    expected = jax.jit(jax.vmap(answer))(X)
    close(WHOLE, expected)
    assert all(isinstance(x, np.ndarray) for x in jax.tree.leaves(WHOLE))
    assert isinstance(WHOLE.status, Status)
    rocking = np.asarray(WHOLE.status == Status.rocking)
    np.testing.assert_array_equal(rocking, WHOLE.value > 5.0)
    assert 0 < rocking.sum() < LENGTH


def close(a, b):
    """Whether two results agree but for a last digit: vector instructions round it unlike scalar ones."""
    assert jax.tree.structure(a) == jax.tree.structure(b)
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        assert (x.shape, x.dtype) == (y.shape, y.dtype)
        np.testing.assert_allclose(x, y, rtol=1e-15)


@pytest.mark.parametrize(
    "rows", [np.random.default_rng(4).permutation(LENGTH), slice(1), slice(64), slice(65)], ids=str
)
def test_results_do_not_depend_on_order_length_chunk_or_workers(rows):
    expected = jax.tree.map(lambda a: a[rows], WHOLE)
    same(in_chunks(answer, X[rows], chunk=64, workers=5), expected)
    for chunk in (7, LENGTH + 1):
        close(in_chunks(answer, X[rows], chunk=chunk), expected)


def test_a_batch_can_be_a_pytree_with_shared_scalars():
    batch = {"a": X, "b": (np.arange(LENGTH), jnp.asarray(X[:, 0])), "c": 3.0}
    found = in_chunks(lambda t: t["a"].sum() * t["b"][0] + t["c"] * t["b"][1], batch, chunk=7)
    np.testing.assert_allclose(found, X.sum(axis=1) * np.arange(LENGTH) + 3.0 * X[:, 0], rtol=1e-14)


def test_a_function_is_compiled_once_per_chunk_size():
    traced = []

    def watched(x):
        traced.append(x.shape)
        return x * 2.0

    for length in (5, 16, 101):
        reports = []
        in_chunks(watched, X[:length], chunk=16, workers=1, progress=lambda *at, to=reports: to.append(at))
        assert reports == [(min(n, length), length) for n in range(16, length + 16, 16)]
    assert traced == [(3,)]
    in_chunks(watched, X, chunk=32, workers=1)
    assert len(traced) == 2


def collatz(n):
    """Steps to one, with a loop of its own for the halvings."""

    def halved(n):
        return jax.lax.while_loop(lambda n: n % 2 == 0, lambda n: n // 2, n)

    steps = jax.lax.while_loop(lambda c: c[0] > 1, lambda c: (halved(3 * c[0] + 1), c[1] + 1), (halved(n), 0))
    return steps[1]


def test_functions_of_uneven_cost_get_small_chunks():
    told = []
    numbers = np.arange(1, 31)
    found = in_chunks(collatz, numbers, progress=lambda *at: told.append(at[0]))
    np.testing.assert_array_equal(found, in_chunks(collatz, numbers, chunk=1))
    assert told[-1] == 30
    assert np.diff(told).max() == UNEVEN < CHUNK
    assert default_chunk(answer, X) == CHUNK


def test_an_error_of_the_function_is_raised_and_arrays_of_different_lengths_are_rejected():
    with pytest.raises(ZeroDivisionError):
        in_chunks(lambda x: 1 / 0, X, chunk=64)
    for batch, lengths in ((np.zeros((0, 3)), "[0]"), ((np.zeros(3), np.zeros(4)), "[3, 4]"), ((), "[]")):
        sentence = f"`batch` must be arrays of one length above zero, but has lengths {lengths}"
        with pytest.raises(ValueError, match=re.escape(sentence)):
            in_chunks(answer, batch)


def test_every_thread_uses_the_float_type_of_its_caller():
    wide = np.arange(1.0, 400.0) + 1e-9
    exact = in_chunks(third, wide, chunk=64)
    np.testing.assert_allclose(exact, wide / 3.0, rtol=1e-15)
    # What a context manager of JAX sets holds in one thread: here the other way round.
    seen = []
    with jax.enable_x64(False):
        rough = in_chunks(third, wide, chunk=64)
        aside(lambda: seen.append(jax.config.jax_enable_x64)).join()
    assert rough.dtype == np.float32
    assert np.abs(rough / exact - 1.0)[64:].max() > 1e-9
    aside(lambda: seen.append(jax.config.jax_enable_x64)).join()
    assert seen == [False, True]


def third(x):
    return x / 3.0


def test_a_prepared_function_is_not_traced_again():
    traced = []

    def slow(x):
        traced.append(x)
        return jnp.sin(x)

    for _ in range(2):
        prepare(slow, X, chunk=16).join()
        np.testing.assert_allclose(in_chunks(slow, X, chunk=16), np.sin(X), rtol=1e-15)
    assert len(traced) == 1


def test_the_interpreter_waits_for_background_work():
    work = "import time; from tpd.core.batch import aside; aside(lambda: (time.sleep(1), print('done')))"
    ended = subprocess.run(
        [sys.executable, "-c", work + "; raise SystemExit(3)"], capture_output=True, text=True
    )
    assert (ended.returncode, ended.stdout.strip(), ended.stderr) == (3, "done", "")


def interrupt(done, of):
    """Stand for Ctrl-C while the main thread waits."""
    raise KeyboardInterrupt


def test_no_piece_of_work_begins_after_ctrl_c():
    begun, never = [], threading.Event()

    def run(first, last):
        begun.append(first)
        never.wait(0.005)
        return last - first

    with pytest.raises(KeyboardInterrupt):
        shared(run, 2000, 2, interrupt, piece=(1, 1))
    with pytest.raises(ZeroDivisionError):
        shared(lambda first, last: 1 // (first < 20), 100, 2, None)
    # As many as began while the others were handed in.
    assert len(begun) < 1000


@pytest.mark.parametrize("kind", [">f8", "longdouble", int])
def test_a_batch_of_another_type_is_computed_in_64_bit_floats(kind):
    batch = np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(in_chunks(jnp.sin, batch.astype(kind)), in_chunks(jnp.sin, batch))


@pytest.mark.parametrize("workers", [None, 1, 3])
@pytest.mark.parametrize("n", [1, 7, 1000])
def test_every_row_is_computed_once_in_pieces_of_allowed_size(workers, n):
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
