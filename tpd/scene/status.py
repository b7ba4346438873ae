"""Statuses: named outcomes of a motion, with a message that says what happened and what to do."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from tpd.core import checks


class Status(eqx.Enumeration):
    """Outcome of a computation. `Status[s]` is the message of a status, and `status_name(s)` is its name.

    Example:
        >>> import tpd
        >>> tpd.Status[tpd.Status.rest]
        'The block settles at rest on its base and does not rock.'
    """

    rocking = "The block settles into periodic rocking."
    sticking = (
        "The block settles into periodic rocking. During a part of every period it does not move, because "
        "of friction or because it stands on its base."
    )
    rest = "The block settles at rest on its base and does not rock."
    held = (
        "Friction holds the block at a constant tilt, and it does not rock. The amplitude is this tilt. It "
        "depends on the initial state and has no gradient. Start from another state, or reduce the friction."
    )
    overturned = (
        "The block overturns: its tilt grows beyond the point of return. "
        "Change the pendulum, or start from another state."
    )
    aperiodic = (
        "The motion does not repeat, and motions from neighbouring initial states separate exponentially. "
        "The amplitude is the largest over many periods and has no gradient. Evaluate the design with an "
        "ensemble of runs, or add hinge damping."
    )
    not_settled = (
        "The motion did not become periodic within `max_periods` (slow decay). "
        "The amplitude is the largest of the last periods and has no gradient. "
        "Increase `max_periods`, or add hinge damping."
    )
    unstable = (
        "The motion is periodic but does not attract: a small disturbance leads away from it. "
        "Start from another state."
    )
    neutral = (
        "The motion is periodic, but it neither attracts nor repels, because it loses no energy (no "
        "friction, no impact loss, and no hinge damping that acts on the block). Add one of these losses."
    )
    near_fold = (
        "The periodic motion is close to a fold, where it merges with an unstable motion and disappears. Its "
        "gradient is unbounded there and is not returned. Move the parameters away from the fold."
    )
    grazing = (
        "The periodic motion only just reaches an impact, a turning point or sticking. The amplitude has a "
        "kink there, and no gradient is returned. Change a parameter slightly."
    )
    event_bound = (
        "There are more events in one period than `max_events` allows (endless rattling), or more solver "
        "steps than `max_steps` (the smoothing of the signs is too sharp). The amplitude is the largest of "
        "the last periods and has no gradient. Increase the bound."
    )
    failed = (
        "The result is not finite (resonance without damping, or a singular limit "
        "such as a length ratio near zero). Change the parameters."
    )
    no_orbit = "There is no such periodic motion. Run a simulation to see the motion of the block."
    stood = "The block stays on its base: the excitation does not lift it."
    rocked = "The block rocks during the excitation and does not overturn."
    inexact = (
        "From the same initial state, the model with smoothed signs settles into another motion than the "
        "exact model, or its amplitude differs by more than 5 %. Amplitude and gradient are those of the "
        "smoothed motion. Change the model to `Piecewise()`, or with nonlinear terms to `Nonlinear()`."
    )
    not_known = (
        "There is no symmetric orbit, and the block lifts from rest. Whether there is a periodic motion of "
        "another kind is not known. Run a simulation to see the motion of the block."
    )
    # Arrays and files contain the number of a status, its index among the names. New statuses must come last.
    __names__ = tuple(name for name in vars() if not name.startswith("_"))


MOVING = (Status.rocking, Status.sticking)
"""Statuses of attracting periodic motions in which the block rocks."""
SETTLED = (*MOVING, Status.rest)
"""Statuses of attracting motions, with an amplitude and its gradient."""
NOT_ATTRACTING = (Status.unstable, Status.neutral, Status.near_fold, Status.grazing)
"""Statuses of periodic motions that do not attract, or for which this is not known."""
STANDING = (Status.stood, Status.rocked)
"""Statuses of a block that has not overturned under a ground motion."""
UNANSWERED = (Status.event_bound, Status.failed)
"""Statuses of runs without a result. They are counted separately: the block neither overturns nor stands."""


def status_name(status: Status) -> str:
    """Return the name of one status, such as "rocking"; not for batched or traced statuses.

    Example:
        >>> import tpd
        >>> tpd.status_name(tpd.Status.rest)
        'rest'
    """
    checks.instance("status", status, type(Status.rest))
    return str(names_of(status))


def names_of(status: Any) -> np.ndarray:
    """Return the names of statuses or of their numbers as an array of strings, see `code_of`; not traced."""
    return np.asarray(np.array(Status.__names__)[np.asarray(code_of(status))])


def code_of(status: Any) -> Any:
    """Return the numbers of a status, of a batch of statuses, or of a tuple of statuses. Numbers are returned
    unchanged."""
    codes = jax.tree.leaves(status)
    return codes[0] if len(codes) == 1 else np.array(codes)


def status_of(codes: Any) -> Status:
    """Return the batch of statuses from an array of numbers, traced or not."""
    return jax.tree.unflatten(jax.tree.structure(Status.rest), [codes])


def is_one_of(status: Any, *members: Status) -> Any:
    """Return whether statuses, or numbers of statuses, are among the members, as arrays of NumPy or, if
    traced, of JAX."""
    code = code_of(status)
    xp = jnp if isinstance(code, jax.Array) else np
    return xp.isin(code, code_of(members))
