"""Calls of compiled code from JAX programs and from Python.

The code runs on the CPU. XLA calls it directly as a custom call. If XLA cannot do that, or if the program
runs on another device, JAX transfers the numbers to the host and back. `vmap` turns a batch into one call.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from threading import Lock
from types import SimpleNamespace
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np

from tpd.compiled import compiling
from tpd.compiled.columns import WIDTH
from tpd.core import jax_setup
from tpd.core.batch import PIECE, shared


def shape(*sizes: Any) -> jax.ShapeDtypeStruct:
    """Return the shape of an array of floats. A size may be a record of compiled code, for all its floats."""
    counts = (size.itemsize // 8 if isinstance(size, np.dtype) else int(size) for size in sizes)
    return jax.ShapeDtypeStruct(tuple(counts), np.float64)


def parts(numbers: Any, record: np.dtype) -> SimpleNamespace:
    """Return the fields of records as attributes of one object.

    `numbers` has records, or floats of shape (..., n) with one record in the last axis. In floats a
    field with complex numbers gets one more axis of length 2, for the real and the imaginary part.
    """
    fields = cast("Any", record.fields)
    if numbers.dtype == record:
        return SimpleNamespace(**{name: numbers[name] for name in fields})
    answer = {}
    for name, (kind, begin) in fields.items():
        # NumPy counts in bytes, and every number of a record has eight of them.
        place = begin // 8
        size = kind.itemsize // 8
        complex_axis = (2,) if kind.base.kind == "c" else ()
        shape = *numbers.shape[:-1], *kind.shape, *complex_axis
        answer[name] = numbers[..., place : place + size].reshape(shape)
    return SimpleNamespace(**answer)


def check_width(rows: Any) -> None:
    """Raise `ValueError` unless the last axis has the ten parameters: compiled code would read beyond it."""
    if np.shape(rows)[-1:] != (WIDTH,):
        raise ValueError(f"parameters must have shape (..., {WIDTH}), but have {np.shape(rows)}")


class Compiled:
    """Entry point to a module with compiled code, which has the attributes `CALL` and `run`."""

    def __init__(self, module: str, target: str) -> None:
        """Store the full name of the module, and the name of its entry point in XLA programs.

        The module is loaded when it is needed.
        """
        self._module, self._target = module, target
        self._lock = Lock()
        self._is_direct: bool | None = None
        self._entry: Any = None

    def entry(self) -> Any:
        """Return the module. It is imported at the first call, because it loads Numba."""
        if self._entry is None:
            compiling.load(self._module)
            self._entry = sys.modules[self._module]
        return self._entry

    def settings(self, task: str, **values: Any) -> list[Any]:
        """Return a row of settings for a task. Settings that are not passed are zero.

        Raises:
            TypeError: there is no setting of that name, which is an error in the package.
        """
        entry = self.entry()
        values["task"] = getattr(entry, task)
        row = [values.pop(name, 0.0) for name in entry.SETTINGS.names]
        if values:
            raise TypeError(f"there are no settings {', '.join(values)}")
        return row

    def is_direct(self) -> bool:
        """Whether XLA can call the code directly. The first call asks XLA, and warns if it cannot."""
        # The lock prevents two threads from registering the entry point at the same time.
        with self._lock:
            if self._is_direct is None:
                address, self._is_direct = self.entry().CALL.address, True
                # Without a CPU device JAX can neither call the code nor call Python.
                jax_setup.cpu()
                try:
                    # XLA refuses code for a version of its interface that it does not support.
                    jax.ffi.register_ffi_target(self._target, jax.ffi.pycapsule(address), platform="cpu")
                except Exception as error:
                    self._is_direct, why = False, f"{type(error).__name__}: {error}"
                    slow = "It calls the code through Python, which is slower"
                    warnings.warn(f"JAX cannot call {self._target} directly ({why}). {slow}", stacklevel=2)
            return self._is_direct

    def on_host(self, shapes: tuple[jax.ShapeDtypeStruct, ...], *operands: Any) -> tuple[np.ndarray, ...]:
        """Compute the results in this process, for operands that are NumPy arrays.

        The first operands are settings and parameters. All operands and results have the same leading batch
        axes, before their own axes.
        """
        run = self.entry().run
        check_width(operands[1])
        wide = [np.asarray(x, dtype=float) for x in operands]
        # The settings are the first operand, with one row for each run.
        settings, *_ = wide
        batch = settings.shape[:-1]
        rows = int(np.prod(batch))
        # The kernel takes contiguous arrays with one leading axis.
        flat = [np.ascontiguousarray(x.reshape(rows, *x.shape[len(batch) :])) for x in wide]
        out = [np.zeros((rows, *s.shape)) for s in shapes]
        if rows:
            run(0, rows, *flat, *out)
        return tuple(x.reshape(*batch, *x.shape[1:]) for x in out)

    def in_threads(
        self,
        n: int,
        workers: int | None,
        progress: Callable[[int, int], None] | None,
        *buffers: np.ndarray,
        piece: tuple[int, int] = PIECE,
    ) -> None:
        """Compute n rows in several threads, and write the results into the buffers.

        Args:
            n: number of rows.
            workers, progress, piece: see `tpd.core.batch.shared`.
            buffers: contiguous arrays, operands before results.
        """
        entry = self.entry()
        check_width(buffers[1])

        def run(first: int, last: int) -> int:
            entry.run(first, last, *buffers)
            return last - first

        shared(run, n, workers, progress, piece=piece)

    def __call__(self, shapes: tuple[jax.ShapeDtypeStruct, ...], *operands: Any) -> Any:
        """Return the results for operands that JAX traces."""
        check_width(operands[1])
        wide = [jnp.asarray(x, dtype=jnp.float64) for x in operands]

        def by_xla(*a: Any) -> Any:
            return jax.ffi.ffi_call(self._target, shapes, vmap_method="broadcast_all")(*a)

        def by_host(*a: Any) -> Any:
            return jax.pure_callback(
                lambda *b: self.on_host(shapes, *b), shapes, *a, vmap_method="broadcast_all"
            )

        if not self.is_direct():
            return by_host(*wide)
        # Without another device a plain custom call makes a smaller XLA program.
        if all(device.platform == "cpu" for device in jax.devices()):
            return by_xla(*wide)
        return jax.lax.platform_dependent(*wide, cpu=by_xla, default=by_host)


RUNS = Compiled("tpd.compiled.run_entry", "tpd_runs")
"""Compiled code of runs, of the linear equations (25) and of the nonlinear equations (4)."""
ORBITS = Compiled("tpd.compiled.orbit_entry", "tpd_symmetric_orbits")
"""Compiled code of the symmetric orbits."""
