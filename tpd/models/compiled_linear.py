"""The linear equations (25) by compiled scalar code: the exact motions of `Piecewise`, one after another.

A program of XLA executes a loop over many small numbers slowly, and takes long to compile. The code here is
compiled once for a machine and stored. Under `jit`, `vmap` and derivatives it is an XLA custom call with
derivatives of its own; on the host, `settle_all` follows batches on all cores. `Piecewise` has the same
motions as programs of JAX, for other devices.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import lru_cache, partial
from threading import Lock
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tpd.core import programs
from tpd.core.parameters import Parameters, State
from tpd.core.status import Status
from tpd.exact.contact import Mode
from tpd.exact.derivatives import once
from tpd.models import compiling
from tpd.models.base import Cycle, Settled

_TARGET = "tpd_linear_events"
_asking = Lock()


def usable() -> bool:
    """Whether the compiled code is there and answers a trial as a frame of XLA's should be answered."""
    # Two threads that ask at once must not both register it.
    with _asking:
        return _usable()


def _load() -> None:
    if not usable():
        raise RuntimeError("the compiled code of the linear equations cannot be used")


programs.CALLED[_TARGET] = _load


@lru_cache(maxsize=1)
def _usable() -> bool:
    try:
        compiling.load("tpd.models.exact_entry")
        from tpd.models import exact_entry

        jax.ffi.register_ffi_target(_TARGET, jax.ffi.pycapsule(exact_entry.CALL.address), platform="cpu")
        cpu = jax.local_devices(backend="cpu")[0]
        with jax.default_device(cpu), jax.ensure_compile_time_eval():
            works = _trial(exact_entry)
    except Exception as error:
        works, why = False, f"{type(error).__name__}: {error}"
    else:
        why = "its answer to a trial is wrong"
    if not works:
        warnings.warn(
            f"the compiled code of the linear equations cannot be used ({why}); programs of JAX take its "
            "place, which compile and run longer",
            stacklevel=2,
        )
    return works


def _trial(entry: Any) -> bool:
    """Whether a custom call and a call from the host give the same answer."""
    x = np.array([[0.25, 0.1, 0.6, 0.1, 0.05, 0.4, 2.0, 0.7, 0.9]])
    settings = np.array([entry.settings(task=entry.SETTLE, periods=1.0, events=100.0, rest_rate=2e-7)])
    operands = settings, x, np.zeros((1, 4)), np.zeros((1, 2))
    out, counts = np.empty((1, entry.FLOATS)), np.empty((1, entry.WHOLES))
    entry.run(0, 1, *operands, out, counts)
    with jax.enable_x64(True):
        found = jax.ffi.ffi_call(_TARGET, (_shape(1, entry.FLOATS), _shape(1, entry.WHOLES)))(*operands)
    return all(np.array_equal(a, b) for a, b in zip(found, (out, counts), strict=True))


def _shape(*sizes: Any) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct(tuple(int(size) for size in sizes), np.float64)


def on_platform(kernel: Callable[..., Any], program: Callable[..., Any], *operands: Any) -> Any:
    """`kernel` of the operands where the processor is the device, `program` elsewhere."""
    if not usable():
        return program(*operands)
    if all(device.platform == "cpu" for device in jax.devices()):
        return kernel(*operands)
    return jax.lax.platform_dependent(*operands, cpu=kernel, default=program)


def packed(p: Parameters) -> Float[Array, "9"]:
    """Parameters as the compiled code takes them, with inertia and velocity ratios of their own."""
    numbers = (p.nu, p.mu, p.lam, p.zeta, p.k, p.f, p.xi, p.inertia_ratio, p.velocity_ratio)
    return jnp.stack([jnp.asarray(x, dtype=jnp.float64) for x in numbers])


def _called(shapes: tuple[jax.ShapeDtypeStruct, ...], *operands: Any) -> Any:
    """Results of the custom call; a batch is a loop in compiled code."""
    wide = [jnp.asarray(x, dtype=jnp.float64) for x in operands]
    return jax.ffi.ffi_call(_TARGET, shapes, vmap_method="broadcast_all")(*wide)


def _settings(**values: Any) -> Array:
    """A row of settings, see `tpd.models.exact_entry.FIELDS`."""
    from tpd.models import exact_entry as entry

    return jnp.stack([jnp.asarray(x, dtype=jnp.float64) for x in entry.settings(**values)])


def _changed(settings: Array, name: str, value: float) -> Array:
    """A row of settings with another value."""
    from tpd.models import exact_entry as entry

    return settings.at[entry.FIELDS.index(name)].set(value)


def _mode_of(numbers: Array) -> Mode:
    return Mode(numbers[0].astype(int), numbers[1], numbers[2])


def _status_of(number: Array) -> Status:
    from tpd.exact.repetition import STATUSES

    every = [getattr(Status, name) for name in STATUSES]
    return jax.tree.map(lambda *x: jnp.stack(x)[number.astype(int)], *every)


def settle(
    p: Parameters, y0: State, periods: int, max_events: int, tolerance: float, rest_rate: float
) -> Settled:
    """Follow the motion from `y0` at tau = 0 until it repeats, rests or is lost; not differentiable."""
    from tpd.models import exact_entry as entry

    limits = {"periods": periods, "events": max_events, "tolerance": tolerance, "rest_rate": rest_rate}
    s = _settings(task=entry.SETTLE, **limits)
    x, y = jax.lax.stop_gradient(packed(p)), jax.lax.stop_gradient(y0)
    out, counts = _called((_shape(entry.FLOATS), _shape(entry.WHOLES)), s, x, y, jnp.zeros(2))
    status, own, elapsed = _status_of(counts[0]), counts[1].astype(int), counts[2].astype(int)
    sizes, peaks = (out[4], out[5]), (out[6], out[7])
    return Settled(out[:4], _mode_of(out[8:]), own, *sizes, status, elapsed, *peaks)


@jax.custom_jvp
def _cycle(x: Array, y: Array, mode: Array, settings: Array) -> Array:
    """The results of one run along a motion's periods."""
    return _cycle_from(13.0, x, y, mode, settings)[0]


def _cycle_from(first: float, x: Array, y: Array, mode: Array, settings: Array) -> Any:
    from tpd.models import exact_entry as entry

    # Value alone, or with all directions: derivatives are computed where they are asked for only.
    s = _changed(settings, "first", first)
    return _called((_shape(entry.CYCLE_OUT), _shape(entry.CYCLE_SIZES, entry.INPUTS)), s, x, y, mode)


_cycle_with_slopes = once(partial(_cycle_from, 0.0))


@_cycle.defjvp
def _cycle_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    out, by = _cycle_with_slopes(*primals)
    moved = by @ jnp.concatenate([tangents[0], tangents[1]])
    return out, jnp.concatenate([moved, jnp.zeros(out.size - moved.size)])


def cycle(p: Parameters, settled: Settled, y: State, max_events: int, rest_rate: float) -> Cycle:
    """Run the orbit's periods from `y`; derivatives pass through every event."""
    from tpd.models import exact_entry as entry

    m = settled.memory
    s = _settings(task=entry.CYCLE, periods=settled.periods, events=max_events, rest_rate=rest_rate)
    mode = jnp.stack([jnp.asarray(v, dtype=jnp.float64) for v in (m.kind, m.tilt_sign, m.rate_sign)])
    out = _cycle(packed(p), y, mode, s)
    still = jax.lax.stop_gradient(out)
    return Cycle(out[:4], out[4], out[5], _mode_of(still[6:9]), still[9], still[10], still[11] != 0.0)


@jax.custom_jvp
def _trajectory(x: Array, y: Array, times: Array, settings: Array) -> tuple[Array, Array]:
    """States at all times, and the status."""
    out, status, _ = _trajectory_from(0.0, x, y, times, settings)
    return out[:, :4], status


def _trajectory_from(slopes: float, x: Array, y: Array, times: Array, settings: Array) -> Any:
    from tpd.models import exact_entry as entry

    n = times.size
    shapes = _shape(n, 8), _shape(1), _shape(n if slopes else 1, 4, entry.INPUTS + 1)
    return _called(shapes, _changed(settings, "slopes", slopes), x, y, times)


_trajectory_with_slopes = once(partial(_trajectory_from, 1.0))


@_trajectory.defjvp
def _trajectory_jvp(primals: tuple, tangents: tuple) -> tuple:
    out, status, by = _trajectory_with_slopes(*primals)
    x, y, times, _ = tangents
    moved = by @ jnp.concatenate([x, y, times[:1]])
    # The first time moves the beginning of the motion, and no state at it.
    rates = jnp.where(jnp.isfinite(out[:, 4:]), out[:, 4:], 0.0)
    later = rates * times.at[0].set(0.0)[:, None]
    return (out[:, :4], status), (moved + later, jnp.zeros_like(status))


def trajectory(
    p: Parameters, y0: State, times: Float[Array, "times"], max_events: int, rest_rate: float
) -> tuple[Float[Array, "times 4"], Status]:
    """The states at `times`, from `y0` at `times[0]`."""
    from tpd.models import exact_entry as entry

    s = _settings(task=entry.TRAJECTORY, periods=times.size, events=max_events, rest_rate=rest_rate)
    ys, status = _trajectory(packed(p), y0, times, s)
    return ys, _status_of(jax.lax.stop_gradient(status)[0])


def load_compiled() -> None:
    """Load the compiled code of both equations, or compile it where there is none on this machine."""
    usable()
    compiling.load("tpd.models.nonlinear_settling")
