"""Named outcomes of a motion: what happened, and what to do about it."""

from __future__ import annotations

from enum import StrEnum, auto

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

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


class Outcome(StrEnum):
    """Names of the members of `Status`, in their order, as they stand in arrays, tables and files.

    Files hold their numbers as well: new names are for the end.
    """

    rocking = auto()
    sticking = auto()
    rest = auto()
    held = auto()
    overturned = auto()
    aperiodic = auto()
    not_settled = auto()
    unstable = auto()
    neutral = auto()
    near_fold = auto()
    grazing = auto()
    event_bound = auto()
    failed = auto()
    no_orbit = auto()
    stood = auto()
    rocked = auto()
    inexact = auto()
    not_known = auto()


MOVING = (Outcome.rocking, Outcome.sticking)
"""Outcomes of attracting periodic motions, see `is_moving`."""
SETTLED = (*MOVING, Outcome.rest)
"""Outcomes of attracting motions, see `is_settled`."""
LOST = (Outcome.overturned,)
"""Outcomes of runs that count as overturned."""
UNANSWERED = (Outcome.event_bound, Outcome.failed)
"""Outcomes of runs without an answer: they are counted apart, and are neither falls nor rest."""


def status_name(status: Status) -> str:
    """The name of one (not batched, not traced) status, such as `"rocking"`."""
    checks.instance("status", status, type(Status.rest))
    return str(names_of(status))


def names_of(status: Status) -> np.ndarray:
    """The names of a batch of statuses (not traced), an array of strings of its shape."""
    (index,) = jax.tree.leaves(status)
    return names_by_code(np.asarray(index))


def codes_of(names: np.ndarray) -> np.ndarray:
    """Numbers that stand for names of statuses in files: their places in `Outcome`.

    Raises:
        ValueError: a name that is not in the list.
    """
    equal = np.asarray(names)[..., None] == np.array(Outcome)
    if not equal.any(axis=-1).all():
        raise ValueError(f"names of statuses must be among {', '.join(Outcome)}, but are {np.unique(names)}")
    return np.argmax(equal, axis=-1).astype(np.int8)


def names_by_code(codes: np.ndarray) -> np.ndarray:
    """Names of statuses that `codes_of` has turned into numbers."""
    return np.asarray(np.array(Outcome)[np.asarray(codes)])


def index_of(name: str) -> int:
    """Number that stands for a status."""
    return tuple(Outcome).index(Outcome(name))


def is_moving(status: Status) -> Array:
    """Whether a status is that of an attracting periodic motion of the block."""
    return (status == Status.rocking) | (status == Status.sticking)


def is_settled(status: Status) -> Array:
    """Whether a status is that of an attracting motion, with an amplitude and its gradient."""
    return is_moving(status) | (status == Status.rest)
