"""Large batches: computed in chunks that fit the cache of the processor, on all cores, in bounded memory."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from threading import Lock, Thread
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax.extend.core import jaxprs_in_params

from tpd.core import checks
from tpd.core.progress import unreported

CHUNK = 256
"""Number of designs that are computed at once if all of them need the same work. Some hundred arrays of this
length are alive at a time, about one megabyte. More designs at once are not faster, because the arrays leave
the cache."""
UNEVEN = 4
"""Number of designs that are computed at once if their numbers of steps differ, since all wait for the
slowest."""
OPTIONS = (("xla_backend_optimization_level", 1), ("xla_cpu_use_fusion_emitters", False))
"""Options of the compiler for processors. They halve the compilation time, and the code is as fast."""
PIECE = 1, 16
"""Smallest and largest number of elements of one piece of work in `shared`."""
_LOOPS = ("while", "ffi_call")
"""Primitives whose duration depends on the element. A custom call of compiled code counts as a loop as
well."""

AT_ONCE: dict[Callable[[Any], Any], Callable[..., Any]] = {}
"""Functions that compute a whole batch in compiled code, by the function of one element."""
_CHUNKS: dict[Callable[[Any], Any], int] = {}
"""Default chunk sizes of functions that were called without one."""


def in_chunks(
    function: Callable[[Any], Any],
    batch: Any,
    *,
    chunk: checks.Whole | None = None,
    workers: checks.Whole | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Any:
    """Return `function` of every element of `batch`, like `jit(vmap(function))`, but in chunks and on all
    cores.

    Args:
        function: function of one element (a pytree of arrays without the leading axis), pure as for `jit`. It
            is compiled once per function object and chunk size. Keep the object to keep the compiled code.
        batch: pytree of arrays with a common leading axis, of any length above zero. Single numbers belong to
            every element.
        chunk: elements per chunk. The default is 256. For a function with nested loops whose lengths depend
            on the element, such as `steady_state`, it is 4, because all elements of a chunk wait for the
            slowest. Memory beyond inputs and results is proportional to `chunk * workers`, and independent of
            the length of the batch. `symmetric_orbits` has no chunks: compiled code computes its batches.
        workers: number of threads; default the number of cores.
        progress: function of (elements done, total), called after each chunk.

    Returns:
        The same pytree as from `vmap(function)`, with NumPy arrays as leaves.

    Raises:
        ValueError: the batch is empty, its leaves have different lengths, or chunk or workers are below one.

    Example:
        >>> import numpy as np
        >>> import tpd
        >>> tpd.in_chunks(lambda x: x**2, np.array([1.0, 2.0, 3.0]))
        array([1., 4., 9.])
    """
    checks.function("function", function, optional=False)
    checks.function("progress", progress)
    if function in AT_ONCE:
        elements(batch)
        return AT_ONCE[function](batch, workers=workers, progress=progress)
    chunk = _chunk(function, batch) if chunk is None else checks.count("chunk", chunk)
    part_of, length = _parts(batch, chunk)
    compiled = _compiled(function)

    def run(begin: int, end: int) -> int:
        out = compiled(part_of(begin))
        results, structure = jax.tree.flatten(out)
        # The first chunk that ends determines the shapes and types of the results.
        with lock:
            if not wholes:
                wholes.extend(np.empty((length, *x.shape[1:]), x.dtype) for x in results)
                structures.append(structure)
        for whole, part in zip(wholes, results, strict=True):
            whole[begin:end] = np.asarray(part)[: end - begin]
        return end - begin

    wholes: list[np.ndarray] = []
    structures: list[Any] = []
    lock = Lock()
    shared(run, length, workers, progress, piece=(chunk, chunk))
    return jax.tree.unflatten(structures[0], wholes)


def prepare(function: Callable[[Any], Any], batch: Any, *, chunk: int | None = None) -> Thread:
    """Start to compile `function` in a thread, as `in_chunks` will call it. The first call waits for the
    compilation."""
    chunk = _chunk(function, batch) if chunk is None else chunk
    compiled, part = _compiled(function), _parts(batch, chunk)[0](0)
    # Call the function, because only a call leaves the program where the next call finds it.
    return aside(lambda: compiled(part))


def elements(batch: Any) -> tuple[Callable[[Any], Any], int]:
    """Return a function that selects elements of a batch by an index or a slice, and the number of elements.

    Raises:
        ValueError: the batch is empty, or its leaves have different lengths.
    """
    leaves, structure = jax.tree.flatten(batch)
    arrays = [_array(x) for x in leaves]
    lengths = {len(x) for x in arrays if x.ndim}
    if len(lengths) != 1 or 0 in lengths:
        allowed = "arrays of one length above zero"
        raise ValueError(f"`batch` must be {allowed}, but has lengths {sorted(lengths)}")
    return lambda at: jax.tree.unflatten(structure, [x[at] if x.ndim else x for x in arrays]), lengths.pop()


def _array(leaf: Any) -> np.ndarray:
    """Return an array of a batch in the form that JAX uses. Floats have 64 bits, and integers keep their
    type."""
    array, plain = np.asarray(leaf), checks.plain("batch", leaf)
    if array.dtype.kind in "mMOSU":
        raise ValueError(f"`batch` must be arrays of numbers, but has {checks.quote(array)}")
    return np.asarray(plain) if array.dtype.kind == "f" else array


def _parts(batch: Any, chunk: int) -> tuple[Callable[[int], Any], int]:
    """Return a function that selects the chunk from an element on, and the number of elements.

    The last chunk is filled with copies of the last element.
    """
    elements_at, length = elements(batch)

    def part_of(begin: int) -> Any:
        part = elements_at(np.minimum(np.arange(begin, begin + chunk), length - 1))
        return jax.tree.map(lambda x: x if np.ndim(x) else np.broadcast_to(x, chunk), part)

    return part_of, length


def _chunk(function: Callable[[Any], Any], batch: Any) -> int:
    """Return the default chunk size for a function of the elements of a batch."""
    if function not in _CHUNKS:
        part_of, _ = _parts(batch, 1)
        element = jax.tree.map(lambda x: x[0], part_of(0))
        arrays, rest = eqx.partition(element, eqx.is_array)
        traced = eqx.filter_make_jaxpr(lambda x: function(eqx.combine(x, rest)))(arrays)[0]
        _CHUNKS[function] = UNEVEN if _loops(traced.jaxpr) > 1 else CHUNK
    return _CHUNKS[function]


def _loops(jaxpr: Any) -> int:
    """Return how deep loops of unknown length are nested in a traced function."""
    deepest = 0
    for equation in jaxpr.eqns:
        within = [_loops(inner) for inner in jaxprs_in_params(equation.params)]
        deepest = max(deepest, (equation.primitive.name in _LOOPS) + max(within, default=0))
    return deepest


@lru_cache(maxsize=32)
def _compiled(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return jax.jit(jax.vmap(function), compiler_options=dict(_options()))


@lru_cache(maxsize=1)
def _options() -> tuple[tuple[str, Any], ...]:
    usable: list[tuple[str, Any]] = []
    for option in OPTIONS if jax.default_backend() == "cpu" else ():
        # Another version of the compiler may not have this option.
        with contextlib.suppress(jax.errors.JaxRuntimeError):
            jax.jit(lambda: 0.0, compiler_options=dict([option]))()
            usable.append(option)
    return tuple(usable)


def aside(work: Callable[[], object]) -> Thread:
    """Start `work` in a thread of its own, for example to compile something while the other core is busy.

    An error in the thread is dropped: the same work raises it again when its result is needed. The thread is
    not a daemon, so the interpreter waits for it. To stop a thread while XLA compiles would abort the
    process.
    """
    begin = _x64_initializer()

    def run() -> None:
        begin()
        with contextlib.suppress(Exception):
            work()

    thread = Thread(target=run)
    thread.start()
    return thread


def _x64_initializer() -> Callable[[], None]:
    """Return an initialiser that applies the x64 setting of this thread in a worker thread.

    `jax.enable_x64` as a context manager applies only in its own thread, and 32 bits would give wrong numbers
    without an error.
    """
    is_x64 = bool(jax.config.jax_enable_x64)  # type: ignore[attr-defined]

    def begin() -> None:
        if bool(jax.config.jax_enable_x64) != is_x64:  # type: ignore[attr-defined]
            # The context is never exited: the setting ends with the thread.
            jax.enable_x64(is_x64).__enter__()

    return begin


def shared(
    run: Callable[[int, int], int],
    n: int,
    workers: int | None,
    progress: Callable[[int, int], None] | None,
    *,
    piece: tuple[int, int] = PIECE,
) -> None:
    """Distribute all pieces of work over threads, by default over all cores; `piece` bounds their size.

    Raises:
        ValueError: the number of workers is below one.
    """
    cores = (os.cpu_count() or 1) if workers is None else checks.count("workers", workers)
    report = progress or unreported
    # The pieces are small, because some motions take a hundred times as long as others. Each piece writes its
    # own rows, so the order does not matter.
    size = max(piece[0], min(piece[1], -(-n // (4 * cores))))
    firsts, done = range(0, n, size), 0
    threads = max(1, min(cores, len(firsts)))
    pool = ThreadPoolExecutor(threads, initializer=_x64_initializer())
    # A single worker runs in this thread, because memory that new threads free is not reused by others.
    each = pool.map if threads > 1 else map
    try:
        for count in each(run, firsts, (min(first + size, n) for first in firsts)):
            done += count
            report(done, n)
    finally:
        # After an error or Ctrl-C no further piece is started.
        pool.shutdown(cancel_futures=True)
