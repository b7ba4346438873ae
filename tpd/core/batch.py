"""Large batches: in chunks that fit the processor's cache, on all cores, in bounded memory."""

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
"""Designs computed at once where all take the same work. Some hundred arrays of this length are alive at a
time, about one megabyte: more designs at once are no faster, since they leave the cache."""
UNEVEN = 4
"""Designs computed at once where each takes as many steps as it needs and waits for the slowest of them."""
OPTIONS = (("xla_backend_optimization_level", 1), ("xla_cpu_use_fusion_emitters", False))
"""Options of the compiler for processors: it takes half of its time with them, for code that is as fast."""
PIECE = 1, 16
"""Elements of one piece of work in `shared`, at least and at most."""
_LOOPS = ("while", "ffi_call")
"""Primitives that take as long as an element needs; a custom call of compiled code is a loop as well."""

_CHUNKS: dict[Callable[[Any], Any], int] = {}
"""Default chunk sizes of functions that have been called without one."""


def in_chunks(
    function: Callable[[Any], Any],
    batch: Any,
    *,
    chunk: checks.Whole | None = None,
    workers: checks.Whole | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Any:
    """`function` of every element of `batch`: `jit(vmap(function))`, but in chunks and on all cores.

    Args:
        function: of one element (a pytree of arrays without the leading axis), pure as for `jit`.
            Compiled once per function object and chunk size; keep the object to keep the code.
        batch: a pytree of arrays that share their leading axis, of any length above zero; single
            numbers belong to every element.
        chunk: elements per chunk; default 256, but 4 for a function with a loop within a loop, each of
            them as long as the element needs, such as `steady_state`: there all wait for the slowest element.
            Memory beyond inputs and results is proportional to `chunk * workers`, not to the length of the
            batch.
        workers: threads; default the number of cores.
        progress: called with (elements done, of how many) after each chunk.

    Returns:
        The same pytree as `vmap(function)` would give, with NumPy arrays for leaves.

    Raises:
        ValueError: an empty batch, leaves of different lengths, or a chunk or workers below one.
    """
    checks.function("function", function, optional=False)
    checks.function("progress", progress)
    chunk = _chunk(function, batch) if chunk is None else checks.count("chunk", chunk)
    part_of, length = _parts(batch, chunk)
    compiled = _compiled(function)

    def run(begin: int, end: int) -> int:
        out = compiled(part_of(begin))
        results, structure = jax.tree.flatten(out)
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
    """Begin to compile `function` as `in_chunks` will call it, in a thread: the first call waits for it."""
    chunk = _chunk(function, batch) if chunk is None else chunk
    compiled, part = _compiled(function), _parts(batch, chunk)[0](0)
    # Called, not compiled ahead: only a call leaves the program where the next one finds it.
    return aside(lambda: compiled(part))


def elements(batch: Any) -> tuple[Callable[[Any], Any], int]:
    """The elements of a batch at an index or a slice, and how many there are.

    Raises:
        ValueError: an empty batch, or leaves of different lengths.
    """
    leaves, structure = jax.tree.flatten(batch)
    arrays = [_array(x) for x in leaves]
    lengths = {len(x) for x in arrays if x.ndim}
    if len(lengths) != 1 or 0 in lengths:
        raise ValueError(
            f"`batch` must be arrays of one length above zero, but has lengths {sorted(lengths)}"
        )
    return lambda at: jax.tree.unflatten(structure, [x[at] if x.ndim else x for x in arrays]), lengths.pop()


def _array(leaf: Any) -> np.ndarray:
    """An array of a batch as JAX takes it. Floats have 64 bits; whole numbers stay what they are."""
    array, plain = np.asarray(leaf), checks.plain("batch", leaf)
    if array.dtype.kind in "mMOSU":
        raise ValueError(f"`batch` must be arrays of numbers, but has {checks.shown(array)}")
    return np.asarray(plain) if array.dtype.kind == "f" else array


def _parts(batch: Any, chunk: int) -> tuple[Callable[[int], Any], int]:
    """The chunk from some element on, filled up with the last one, and how many elements there are."""
    elements_at, length = elements(batch)

    def part_of(begin: int) -> Any:
        part = elements_at(np.minimum(np.arange(begin, begin + chunk), length - 1))
        return jax.tree.map(lambda x: x if np.ndim(x) else np.broadcast_to(x, chunk), part)

    return part_of, length


def _chunk(function: Callable[[Any], Any], batch: Any) -> int:
    """The default chunk for a function of the elements of a batch."""
    if function not in _CHUNKS:
        part_of, _ = _parts(batch, 1)
        element = jax.tree.map(lambda x: x[0], part_of(0))
        arrays, rest = eqx.partition(element, eqx.is_array)
        traced = eqx.filter_make_jaxpr(lambda x: function(eqx.combine(x, rest)))(arrays)[0]
        _CHUNKS[function] = UNEVEN if _loops(traced.jaxpr) > 1 else CHUNK
    return _CHUNKS[function]


def _loops(jaxpr: Any) -> int:
    """How deep loops of unknown length are nested in a traced function."""
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
    try:
        jax.jit(lambda: 0.0, compiler_options=dict(OPTIONS))()
    except jax.errors.JaxRuntimeError:
        # Another version of the compiler does not know them.
        return ()
    return OPTIONS if jax.default_backend() == "cpu" else ()


def aside(work: Callable[[], object]) -> Thread:
    """Start `work` in a thread of its own, to compile something while the other core is busy.

    An error in it is dropped: the same work fails again, visibly, when its result is needed. The thread is no
    daemon, so the interpreter waits for it: one that is stopped while XLA compiles aborts the process.
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
    """Initialiser that gives a worker thread this thread's x64 setting: `jax.enable_x64` as a context manager
    holds in its own thread only, and 32 bits would give wrong numbers without an error."""
    wide = bool(jax.config.jax_enable_x64)  # type: ignore[attr-defined]

    def begin() -> None:
        if bool(jax.config.jax_enable_x64) != wide:  # type: ignore[attr-defined]
            # Entered and never left: the setting ends with the thread.
            jax.enable_x64(wide).__enter__()

    return begin


def shared(
    run: Callable[[int, int], int],
    n: int,
    workers: int | None,
    progress: Callable[[int, int], None] | None,
    *,
    piece: tuple[int, int] = PIECE,
) -> None:
    """Do all pieces of work on so many threads, by default on all cores; `piece` bounds their size.

    Raises:
        ValueError: workers below one.
    """
    cores = (os.cpu_count() or 1) if workers is None else checks.count("workers", workers)
    report = progress or unreported
    # Small pieces, because some motions take a hundred times as long as others. Each writes rows of its
    # own, so that the order in which they end is no matter.
    size = max(piece[0], min(piece[1], -(-n // (4 * cores))))
    firsts, done = range(0, n, size), 0
    threads = max(1, min(cores, len(firsts)))
    crew = ThreadPoolExecutor(threads, initializer=_x64_initializer())
    # A lone worker needs no thread of its own: memory that new threads free stays with them.
    each = crew.map if threads > 1 else map
    try:
        for count in each(run, firsts, (min(first + size, n) for first in firsts)):
            done += count
            report(done, n)
    finally:
        # After an error or Ctrl-C no further piece is begun.
        crew.shutdown(cancel_futures=True)
