"""Named outcomes of a motion: what happened, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from tpd.core import checks


class Status(eqx.Enumeration):
    """Outcome of a solve; `Status[s]` is its message, `status_name(s)` its name."""

    rocking = "The block settles into periodic rocking."
    sticking = (
        "The block settles into periodic rocking and is held by friction or on its base for a part of "
        "every period."
    )
    rest = "The block settles at rest on its base and does not rock."
    held = (
        "Friction holds the block leaning for good: it does not rock. The amplitude is the tilt it keeps: it "
        "depends on the start and has no gradient. Start from another state, or reduce the friction."
    )
    overturned = (
        "The tilt grows beyond any return: the block overturns. "
        "Change the pendulum, or start from another state."
    )
    aperiodic = (
        "The motion does not repeat, and motions that start side by side separate exponentially: the "
        "amplitude is the largest met over many periods and has no gradient. Judge the design by an "
        "ensemble of starts, or add hinge damping."
    )
    not_settled = (
        "No periodic motion was reached within `max_periods` (slow decay): "
        "the amplitude is the largest of the last periods and has no gradient. "
        "Raise `max_periods`, or add hinge damping."
    )
    unstable = (
        "The motion found is periodic but not attracting: the slightest push leads away from it. "
        "Start from another state."
    )
    neutral = (
        "The motion found is periodic, and neither attracts nor repels: nothing takes energy from it (no "
        "friction, no impact loss, and no hinge damping that the block feels). Add one of these."
    )
    near_fold = (
        "The periodic motion is about to merge with an unstable one and vanish: its gradient grows "
        "beyond bounds there and is refused. Move the parameters away from the fold."
    )
    grazing = (
        "The periodic motion touches an event without crossing it: on one side of such a design there "
        "is no gradient, and it is refused. Move the parameters."
    )
    event_bound = (
        "More events in one period than `max_events` allows (rattling without end), or more solver steps "
        "than `max_steps` (signs smoothed too sharply): the amplitude is the largest of the last periods and "
        "has no gradient. Raise that bound."
    )
    failed = (
        "The solver produced no finite number (resonance without damping, or a singular limit "
        "such as a length ratio near zero). Change the parameters."
    )
    no_orbit = "No such periodic motion was found. Start a simulation to see what there is instead."
    stood = "The block stays on its base: the motion does not lift it."
    rocked = "The block rocks during the motion and does not overturn."
    inexact = (
        "The model with smoothed signs ends in another motion than the exact model from the same start, or "
        "its amplitude is off by more than 5 %. Amplitude and gradient are those of the smoothed motion. "
        "Change the model to `Piecewise()`, or with nonlinear terms to `Nonlinear()`."
    )
    not_known = (
        "No symmetric orbit was found, and the block lifts from rest. Whether there is a periodic motion of "
        "another kind is not known. Start a simulation to see what the block does."
    )
    # Arrays and files hold the numbers of statuses, their places among the names: new ones come last.
    __names__ = tuple(name for name in vars() if not name.startswith("_"))


MOVING = (Status.rocking, Status.sticking)
"""Statuses of attracting periodic motions of the block."""
SETTLED = (*MOVING, Status.rest)
"""Statuses of attracting motions, with an amplitude and its gradient."""
NOT_ATTRACTING = (Status.unstable, Status.neutral, Status.near_fold, Status.grazing)
"""Statuses of periodic motions that do not attract, or of which this is not known."""
STANDING = (Status.stood, Status.rocked)
"""Statuses of a block that has not overturned under a ground motion."""
UNANSWERED = (Status.event_bound, Status.failed)
"""Statuses of runs without an answer. They are counted apart: the block neither overturns nor stands."""


def status_name(status: Status) -> str:
    """The name of one (not batched, not traced) status, such as `"rocking"`."""
    checks.instance("status", status, type(Status.rest))
    return str(names_of(status))


def names_of(status: Any) -> np.ndarray:
    """The names of statuses (not traced) or of their numbers: strings in an array, see `code_of`."""
    return np.asarray(np.array(Status.__names__)[np.asarray(code_of(status))])


def code_of(status: Any) -> Any:
    """The numbers of a status, of a batch of statuses, or of a tuple of them; numbers stay what they are."""
    codes = jax.tree.leaves(status)
    return codes[0] if len(codes) == 1 else np.array(codes)


def index_of(name: str) -> int:
    """The number of the status of a name."""
    return Status.__names__.index(name)


def status_of(codes: Any) -> Status:
    """The batch of statuses of an array of numbers, traced or not."""
    return jax.tree.unflatten(jax.tree.structure(Status.rest), [codes])


def codes_of(names: Sequence[str]) -> np.ndarray:
    """The numbers of the statuses of names, such as those of compiled code in their order."""
    return np.array([index_of(name) for name in names], dtype=np.int32)


def is_one_of(status: Any, *members: Status) -> Any:
    """Whether statuses, or numbers of statuses, are among the members: arrays of NumPy or, traced, of JAX."""
    code = code_of(status)
    xp = jnp if isinstance(code, jax.Array) else np
    return xp.isin(code, code_of(members))
