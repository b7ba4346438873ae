"""Named outcomes of a motion: what happened, and what to do about it."""

from __future__ import annotations

import equinox as eqx


class Status(eqx.Enumeration):
    """Outcome of a steady-state solve; `Status[s]` is its message, `status_name(s)` its name."""

    rocking = "The block settles into periodic rocking."
    rest = "The block settles at rest on its base and does not rock."
    overturned = (
        "The tilt grows beyond any return: the block overturns. "
        "Change the pendulum, or start from another state."
    )
    not_settled = (
        "No periodic motion was reached within `max_periods` (slow decay, or aperiodic motion): "
        "the amplitude is the largest of the last periods and has no gradient. "
        "Raise `max_periods`, or add hinge damping."
    )
    unstable = (
        "The motion found is periodic but not attracting, or so near a fold that its gradient "
        "does not exist. Move the parameters away from the fold."
    )
    event_bound = (
        "More events in one period than `max_events` allows (rattling without end). Raise `max_events`."
    )
    failed = (
        "The solver produced no finite number (resonance without damping, or a singular limit "
        "such as a length ratio near zero). Change the parameters."
    )


_NAMES = (
    "rocking",
    "rest",
    "overturned",
    "not_settled",
    "unstable",
    "event_bound",
    "failed",
)


def status_name(status: Status) -> str:
    """The name of one (not batched, not traced) status, such as `"rocking"`."""
    return next(name for name in _NAMES if bool(getattr(Status, name) == status))
