"""Compiled code called under JAX's transformations and from the host: the one way for all equations.

The code runs on the host's processor. There XLA calls it directly, as a custom call. For another device, or
where XLA cannot do that, JAX takes the numbers to the host and back. A batch of `vmap` is one call.
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

from tpd.core.batch import PIECE, shared
from tpd.exact import compiling
from tpd.exact.rows import row_of
from tpd.scene.parameters import Parameters

Trial = Callable[[Any], tuple[tuple[jax.ShapeDtypeStruct, ...], tuple[np.ndarray, ...]]]
"""Shapes of the results and operands of a motion that is tried, from the module with the entrance."""


def shape(*sizes: Any) -> jax.ShapeDtypeStruct:
    """Shape of an array of floats."""
    return jax.ShapeDtypeStruct(tuple(int(size) for size in sizes), np.float64)


def numbers_in(record: np.dtype) -> int:
    """How many floats a record of compiled code has."""
    return record.itemsize // 8


def parts(numbers: Any, record: np.dtype) -> Any:
    """Fields of a record of floats, or of a batch of them, by name. The record is an array's last axis.
    Complex numbers have one more axis, of both parts."""
    answer, fields = {}, cast("Any", record.fields)
    for name, (kind, begin) in fields.items():
        place = begin // 8
        size = kind.itemsize // 8
        complex_axis = (2,) if kind.base.kind == "c" else ()
        shape = *numbers.shape[:-1], *kind.shape, *complex_axis
        answer[name] = numbers[..., place : place + size].reshape(shape)
    return SimpleNamespace(**answer)


class Compiled:
    """The entrance `CALL` and `run` of a module with compiled code."""

    def __init__(self, module: str, target: str, of: str, trial: Trial) -> None:
        """Args:
        module: name of the module.
        target: name of the entrance in programs of XLA.
        of: words that say whose motions are computed.
        trial: gives a motion that tells whether XLA is answered as the host is.
        """
        self._module, self._target, self._subject, self._trial = module, target, of, trial
        self._lock = Lock()
        self._is_direct: bool | None = None
        self._entry: Any = None

    def entry(self) -> Any:
        """The module, loaded when it is needed: it loads Numba."""
        if self._entry is None:
            compiling.load(self._module)
            self._entry = sys.modules[self._module]
        return self._entry

    def settings(self, task: str, **values: Any) -> list[Any]:
        """Return a row of settings for a task, given by their names; the others are zero.

        Raises:
            TypeError: a name that is none of a setting, which is an error of the package.
        """
        entry = self.entry()
        values["task"] = getattr(entry, task)
        row = [values.pop(name, 0.0) for name in entry.SETTINGS.names]
        if values:
            raise TypeError(f"there are no settings {', '.join(values)}")
        return row

    def direct(self) -> bool:
        """Whether XLA can call the code: it answers a trial as the call from the host does."""
        # Two threads that ask at once must not both register it.
        with self._lock:
            if self._is_direct is None:
                self._is_direct = self._check_direct_call()
            return self._is_direct

    def _answers(self) -> bool:
        entry, why = self.entry(), "its answer to a trial is wrong"
        try:
            jax.ffi.register_ffi_target(self._target, jax.ffi.pycapsule(entry.CALL.address), platform="cpu")
            shapes, operands = self._trial(self)
            cpu, *_ = jax.local_devices(backend="cpu")
            # The question may come while something is traced.
            with jax.default_device(cpu), jax.ensure_compile_time_eval(), jax.enable_x64(True):
                answer = jax.ffi.ffi_call(self._target, shapes)(*operands)
            reference = self.on_host(shapes, *operands)
            agrees = all(np.array_equal(a, b, equal_nan=True) for a, b in zip(answer, reference, strict=True))
        except Exception as error:
            agrees, why = False, f"{type(error).__name__}: {error}"
        if not agrees:
            warnings.warn(
                f"JAX cannot call the compiled code of {self._of} directly ({why}): it goes through Python, "
                "which takes longer",
                stacklevel=2,
            )
        return agrees

    def on_host(self, shapes: tuple[jax.ShapeDtypeStruct, ...], *operands: Any) -> tuple[np.ndarray, ...]:
        """Results of known operands with any batch shape before their own, computed here."""
        run = self.entry().run
        wide = [np.asarray(x, dtype=float) for x in operands]
        # Settings come first, one row for a motion.
        settings, *_ = wide
        batch = settings.shape[:-1]
        rows = int(np.prod(batch))
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
        """Compute n rows of contiguous buffers, operands before results, on so many threads; see `shared`."""
        entry = self.entry()

        def run(first: int, last: int) -> int:
            entry.run(first, last, *buffers)
            return last - first

        shared(run, n, workers, progress, piece=piece)

    def __call__(self, shapes: tuple[jax.ShapeDtypeStruct, ...], *operands: Any) -> Any:
        """Results of traced operands."""
        wide = [jnp.asarray(x, dtype=jnp.float64) for x in operands]

        def by_xla(*a: Any) -> Any:
            return jax.ffi.ffi_call(self._target, shapes, vmap_method="broadcast_all")(*a)

        def by_host(*a: Any) -> Any:
            return jax.pure_callback(
                lambda *b: self.on_host(shapes, *b), shapes, *a, vmap_method="broadcast_all"
            )

        if not self.direct():
            return by_host(*wide)
        if all(device.platform == "cpu" for device in jax.devices()):
            return by_xla(*wide)
        return jax.lax.platform_dependent(*wide, cpu=by_xla, default=by_host)


_TRIAL = Parameters(nu=0.25, mu=0.1, lam=0.6, zeta=0.1, k=0.05, f=0.4, xi=2.0, rho=0.7, e=0.9)
"""Parameters of the trials that tell whether XLA can call the compiled code."""


def _run_trial(of: Compiled) -> tuple[tuple[jax.ShapeDtypeStruct, ...], tuple[np.ndarray, ...]]:
    """A motion that is followed for one period."""
    settings = np.array(of.settings("SETTLE", periods=1.0, events=100.0, rest_rate=2e-7, rtol=1e-8))
    return (shape(numbers_in(of.entry().SETTLED)),), (settings, row_of(_TRIAL), np.zeros(4), np.zeros(2))


def _orbit_trial(of: Compiled) -> tuple[tuple[jax.ShapeDtypeStruct, ...], tuple[np.ndarray, ...]]:
    """A way from turn to turn: of an orbit, places that mean nothing are left as they were."""
    settings, u = np.array(of.settings("SAMPLE_PATH")), np.array([0.7, 0.3, 0.0])
    return (shape(numbers_in(of.entry().PATH_SAMPLES)),), (settings, row_of(_TRIAL), u)


LINEAR = Compiled("tpd.exact.linear_entry", "tpd_exact", "the linear equations", _run_trial)
"""Entrance to the compiled code of the linear equations."""
NONLINEAR = Compiled("tpd.exact.nonlinear_entry", "tpd_nonlinear", "the nonlinear equations", _run_trial)
"""Entrance to that of the nonlinear equations, which has the tasks `SETTLE` and `GROUND`."""
ORBITS = Compiled("tpd.exact.orbit_entry", "tpd_symmetric_orbits", "symmetric orbits", _orbit_trial)
"""Entrance to that of symmetric orbits."""


def load_compiled() -> None:
    """Load the compiled code of both equations, or compile it where there is none on this machine."""
    LINEAR.is_direct()
    NONLINEAR.entry()
