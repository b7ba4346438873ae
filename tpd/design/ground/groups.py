"""Groups of ground motions: those that a design is tuned to, and those that it never saw.

Two records of one earthquake are alike. Hence an earthquake is on one side only.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from tpd.core import checks
from tpd.scene.ground_motion import GroundMotion, are_copies, events_of


class Role(enum.Enum):
    """Part of a group in the search."""

    tuned = "tuned to"
    held_out = "held out"


@dataclass(frozen=True)
class Group:
    """Ground motions that are counted together."""

    name: str
    role: Role
    motions: tuple[GroundMotion, ...]
    events: np.ndarray = field(default=None)  # type: ignore[assignment]
    """Number of the earthquake of every motion, shape (motions,), the same in all groups of a design; by
    default of this group alone."""

    def __post_init__(self) -> None:
        if self.events is None:
            object.__setattr__(self, "events", np.unique(events_of(self.motions), return_inverse=True)[1])


def unnamed(motions: Sequence[GroundMotion]) -> int:
    """Number of the records whose earthquake is not known."""
    return sum(getattr(m, "event", None) == "" for m in motions)


def grouped(
    motions: Sequence[GroundMotion],
    held_out: float | Mapping[str, Sequence[GroundMotion]],
    seed: int,
) -> tuple[Group, ...]:
    """The group that a design is tuned to, first, and those that are held out.

    Args:
        motions: of the conditions.
        held_out: the share of the motions that are held out, whole earthquakes by a seeded choice; or groups
            of other motions by name, without those of an earthquake that the design is tuned to.
        seed: of the choice.

    Raises:
        ValueError: a share outside 0 to 0.9, a group without motions, or no motion left on one side.
    """
    if isinstance(held_out, Mapping):
        return _others(motions, held_out)
    checks.within("held_out", held_out, 0.0, 0.9)
    names = events_of(motions)
    events = np.random.default_rng([seed, 9]).permutation(np.unique(names))
    # Whole earthquakes, one after the other, until there are enough.
    out: set[str] = set()
    for event in events:
        if sum(name in out for name in names) >= held_out * len(names):
            break
        out.add(str(event))
    inside = tuple(m for m, name in zip(motions, names, strict=True) if name not in out)
    outside = tuple(m for m, name in zip(motions, names, strict=True) if name in out)
    if not inside:
        raise ValueError(
            f"`held_out` must leave an earthquake to be tuned to, but of {len(events)} all are held out: "
            "give more records, name their earthquakes, or give 0, which holds out none"
        )
    numbers = np.unique(names, return_inverse=True)[1]
    held = np.array([name in out for name in names])
    tuned = Group("tuned to", Role.tuned, inside, numbers[~held])
    return (tuned, Group("held out", Role.held_out, outside, numbers[held])) if outside else (tuned,)


def _others(
    motions: Sequence[GroundMotion], held_out: Mapping[str, Sequence[GroundMotion]]
) -> tuple[Group, ...]:
    # An earthquake that the search has seen is no test.
    used = {getattr(m, "event", "") for m in motions} - {""}
    others = {}
    for name, listed in held_out.items():
        for i, motion in enumerate(listed):
            checks.instance(f"held_out[{name!r}][{i}]", motion, GroundMotion)
        # A motion without a name of its earthquake may be any: it stays.
        left = tuple(
            m
            for m in listed
            if getattr(m, "event", "") not in used and not any(are_copies(m, other) for other in motions)
        )
        if not left:
            raise ValueError(
                "`held_out` must hold motions of other earthquakes than the design is tuned to, but "
                f"{name!r} has none"
            )
        others[name] = left
    # Over all groups together: an earthquake, or copies of one motion, in two of them are still one.
    every = [*motions, *(m for left in others.values() for m in left)]
    numbers = np.unique(events_of(every), return_inverse=True)[1]
    ends = np.cumsum([len(motions), *(len(left) for left in others.values())])
    parts = np.split(numbers, ends[:-1])
    held = (Group(n, Role.held_out, m, x) for (n, m), x in zip(others.items(), parts[1:], strict=True))
    return (Group("tuned to", Role.tuned, tuple(motions), parts[0]), *held)
