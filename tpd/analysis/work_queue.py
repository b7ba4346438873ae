"""Following many motions by events, so that none waits for another.

In a batch every loop runs until the slowest motion is through, and one that rattles takes a hundred
times the events of its neighbours. So the loop stops every few periods; motions that are done make
room for new ones, and the last few go on in a smaller batch.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import lru_cache
from threading import Lock
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from tpd.core import checks, threads
from tpd.core.parameters import Parameters
from tpd.models.base import Settled
from tpd.models.piecewise import Lane, Piecewise

LANES = (256, 16)
"""Motions followed at once, and of these the last few."""
_FEW = 4
"""Times the smaller size that are still followed in it alone."""
_ROUNDS = 12
"""Looks at the ends of periods before the loop stops to make room."""


def settle_all(
    p: Parameters,
    y0: Any,
    *,
    begin: Any = 0.0,
    ramp: Any = 0.0,
    model: Piecewise | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Settled:
    """`model.settle` of every element of a batch, in bounded memory and on all cores.

    Args:
        p: parameters, of shape (n,) or single numbers for all.
        y0: starts, shape (n, 4).
        begin: dimensionless times at which the shaking and the motion begin, within the first forcing
            period; shape (n,) or one for all. The default is tau = 0.
        ramp: forcing periods over which the shaking grows linearly to its full size, counted from tau = 0
            also for motions that begin later; shape (n,) or one for all. The default is sudden.
        model: default `Piecewise()`; its `max_periods` bounds each motion.
        workers: threads; default the number of cores.
        progress: called with (motions done, of how many) now and then.

    Returns:
        A `Settled` with NumPy leaves of leading axis n, in the order of the batch.

    Raises:
        ValueError: an empty batch, leaves of different lengths, or workers below one.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    model = Piecewise() if model is None else model
    if workers is not None:
        checks.count("workers", workers)
    starts, batch = _checked(p, y0, begin, ramp)
    n = len(starts)
    cores = min((os.cpu_count() or 1) if workers is None else workers, max(1, n // LANES[-1]))
    # Neighbours in a batch are often alike: dealt out like cards, the cores get equal work.
    shares = [np.arange(i, n, cores) for i in range(cores)]
    done = [0] * cores

    def run(i: int) -> Any:
        def report(count: int) -> None:
            done[i] = count
            if progress is not None:
                progress(sum(done), n)

        share = shares[i]
        p, begin, ramp = jax.tree.map(lambda x: x[share], batch)
        return _Pool(model, p, (starts[share], begin, ramp)).run(report)

    first = jax.tree.map(lambda x: x[:1], (batch[0], starts, *batch[1:]))
    with threads.cores(cores) as crew:
        _prepared(crew, model, -(-n // cores), first)
        parts = list(crew.map(run, range(cores)))
    # The cores finish in any order; the answer is in the order of the batch.
    order = np.argsort(np.concatenate(shares), kind="stable")
    return jax.tree.map(lambda *x: np.concatenate(x)[order], *parts)


def _checked(p: Parameters, y0: Any, begin: Any, ramp: Any) -> tuple[np.ndarray, tuple]:
    """The starts, and parameters, beginnings and ramps of shape (n,)."""
    starts = np.asarray(y0, dtype=float)
    n = len(starts)
    shapes = sorted({np.shape(x) for x in jax.tree.leaves((p, begin, ramp))} - {()})
    if starts.shape != (n, 4) or n == 0 or shapes not in ([], [(n,)]):
        raise ValueError(
            f"`p`, `begin` and `ramp` must have shape (n,) and `y0` (n, 4), but have {shapes} and "
            f"{starts.shape}"
        )
    # Motions under steady shaking alone are followed by quicker code.
    ramp = ramp if np.any(np.asarray(ramp) != 0.0) else None
    return starts, jax.tree.map(lambda x: np.broadcast_to(np.asarray(x, dtype=float), n), (p, begin, ramp))


def prepare(p: Parameters, n: int, model: Piecewise, *, growing: bool = False) -> None:
    """Compile what `settle_all` of n motions will need, some of them under growing shaking or none;
    `p` holds plain numbers."""
    count = os.cpu_count() or 1
    share = -(-n // min(count, max(1, n // LANES[-1])))
    p, begin, ramp = jax.tree.map(lambda x: np.full(1, float(x)), (p, 0.0, 0.0 if growing else None))
    with threads.cores(count) as crew:
        _prepared(crew, model, share, (p, np.zeros((1, 4)), begin, ramp))


def _prepared(crew: ThreadPoolExecutor, model: Piecewise, share: int, first: tuple) -> None:
    """Compile both sizes at once, rather than either on every core."""
    code = _code(replace(model, max_periods=1))
    list(crew.map(lambda size: code.prepare(size, *first), _sizes(share)))


class _Pool:
    """The motions of one core: those on their way, those still to begin, those done."""

    def __init__(self, model: Piecewise, p: Parameters, starts: tuple[np.ndarray | None, ...]) -> None:
        self.model, self.p, self.starts = model, p, starts
        # How long a motion is followed at most is no matter of compiling.
        self.code = _code(replace(model, max_periods=1))
        self.results: list[tuple[np.ndarray, Any]] = []

    def run(self, report: Callable[[int], None]) -> Any:
        """Follow all of them: their `Settled` in order."""
        waiting, n = 0, len(jax.tree.leaves(self.starts)[0])
        size = _sizes(n)[0]
        index = np.full(size, -1)
        lanes: Any = None
        finished = 0
        while finished < n:
            room = np.flatnonzero(index < 0)[: n - waiting]
            index[room] = np.arange(waiting, waiting + len(room))
            waiting += len(room)
            lanes = self._fill(lanes, index, room)
            # Nothing is left to begin and few motions are on their way: in the large batch each round would
            # cost as much as for all of them. The places in use come first in a stable sort.
            if waiting == n and size > LANES[-1] and np.sum(index >= 0) <= LANES[-1]:
                size = LANES[-1]
                keep = np.argsort(index < 0, kind="stable")[:size]
                index, lanes = index[keep], jax.tree.map(lambda x, k=keep: x[k], lanes)
            lanes, over, settled = self.code.go(
                self._parameters(index), lanes, jnp.asarray(self.model.max_periods)
            )
            ready = np.flatnonzero(np.asarray(over) & (index >= 0))
            if len(ready):
                rows = jax.tree.map(lambda x, r=ready: np.asarray(x)[r], settled)
                self.results.append((index[ready], rows))
                finished += len(ready)
                index[ready] = -1
                report(finished)
        order = np.argsort(np.concatenate([i for i, _ in self.results]))
        rows = [r for _, r in self.results]
        return jax.tree.map(lambda *x: np.concatenate(x)[order], *rows)

    def _parameters(self, index: np.ndarray) -> Parameters:
        rows = np.maximum(index, 0)
        return jax.tree.map(lambda x: jnp.asarray(x[rows]), self.p)

    def _fill(self, lanes: Any, index: np.ndarray, room: np.ndarray) -> Any:
        """New motions in the places `room`. A place that stays empty keeps a motion that is done."""
        if lanes is not None and not len(room):
            return lanes
        rows = np.maximum(index, 0)
        begun = jax.tree.map(lambda x: jnp.asarray(x[rows]), self.starts)
        fresh = self.code.begin(self._parameters(index), *begun)
        if lanes is None:
            return fresh
        new = np.zeros(len(index), bool)
        new[room] = True
        return _merge(jnp.asarray(new), fresh, lanes)


@jax.jit
def _merge(new: jax.Array, fresh: Any, old: Any) -> Any:
    def choose(a: jax.Array, b: jax.Array) -> jax.Array:
        return jnp.where(new.reshape(new.shape + (1,) * (a.ndim - 1)), a, b)

    return jax.tree.map(choose, fresh, old)


def _sizes(n: int) -> tuple[int, ...]:
    """Sizes of the batches in which n motions are followed, in order."""
    return LANES if n > _FEW * LANES[-1] else LANES[-1:]


class _Code:
    """Compiled functions of a model, for either size."""

    def __init__(self, model: Piecewise) -> None:
        def lane(p: Parameters, *start: Any) -> Lane:
            return _strong(model.lane(p, *start))

        def go(p: Parameters, lane: Lane, periods: jax.Array) -> tuple[Lane, Any, Settled]:
            lane = model.follow(p, lane, periods, _ROUNDS)
            over = lane.record.done | (lane.record.elapsed >= periods)
            return _strong((lane, over, lane.record.settled()))

        self.begin = eqx.filter_jit(jax.vmap(lane))
        self.go = eqx.filter_jit(jax.vmap(go, in_axes=(0, 0, None)))
        self.ready: set[tuple[int, bool]] = set()
        self.locks: dict[tuple[int, bool], Lock] = {}

    def prepare(self, size: int, p: Parameters, *start: Any) -> None:
        """Compile for a batch of this size, by a motion that is followed over no period."""
        kind = size, start[-1] is None
        with self.locks.setdefault(kind, Lock()):
            if kind in self.ready:
                return
            p, start = jax.tree.map(lambda x: jnp.repeat(jnp.asarray(x), size, axis=0), (p, start))
            lanes = self.begin(p, *start)
            self.go(p, _merge(jnp.zeros(size, bool), lanes, lanes), jnp.asarray(0))
            self.ready.add(kind)


_code = lru_cache(maxsize=8)(_Code)


def _strong(tree: Any) -> Any:
    """Give the numbers of a pytree types that do not give way to others."""
    # JAX compiles anew for a weak type. What a loop returns may be weakly typed where its start was not, and
    # every function here is to be compiled once.
    return jax.tree.map(lambda x: jnp.asarray(x, dtype=jnp.asarray(x).dtype), tree)
