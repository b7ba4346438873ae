"""One channel of a file, and the checks that a file agrees with itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tpd.formats.orientation import UNKNOWN, VERTICAL, orientation
from tpd.formats.text import Decimal, UnreadableRecord
from tpd.formats.units import GREATEST_PEAK

STEPS = (1e-5, 1.0)
"""Shortest and longest step (s) of a record; beyond them a step was stated in another unit."""
OFFSET = 0.005
"""Share of the peak from which on a mean is noted."""
DRIFT = 0.25
"""Share of the greatest velocity from which on the velocity at the end is noted."""
BASELINES = ("mean", "linear")


@dataclass(frozen=True, eq=False)
class Channel:
    """One component of a record."""

    acceleration: np.ndarray
    """(n,), m/s^2."""
    dt: float
    """s"""
    component: str = ""
    """Direction as the file states it."""
    name: str = ""
    """Station and component."""
    event: str = ""
    """The earthquake."""
    notes: tuple[str, ...] = ()
    """Remarks to the user."""

    @property
    def peak(self) -> float:
        """Greatest acceleration, m/s^2."""
        return float(np.max(np.abs(self.acceleration)))

    def noted(self, *notes: str) -> Channel:
        """Return the channel with further remarks."""
        return replace(self, notes=(*self.notes, *notes))


def checked(channel: Channel) -> Channel:
    """Return a channel whose numbers are those of a ground motion, with remarks on its baseline.

    Raises:
        UnreadableRecord: fewer than two samples, a step or a peak beyond the bounds, or a number that is not
            finite.
    """
    a, dt = channel.acceleration, channel.dt
    # The channel is named where a file has several.
    where = f" in the channel {channel.component!r}" if channel.component else ""
    if a.size < 2:
        raise UnreadableRecord(f"a record needs 2 samples or more, but {a.size} were found{where}")
    if not (STEPS[0] <= dt <= STEPS[1]):
        raise UnreadableRecord(f"the step must be {STEPS[0]:g} s to {STEPS[1]:g} s, but is {dt:g} s{where}")
    if not (np.isfinite(a).all() and channel.peak <= GREATEST_PEAK):
        raise UnreadableRecord(
            f"the peak must be at most {GREATEST_PEAK:g} m/s^2, but is {channel.peak:g} m/s^2{where}: the "
            "unit or a number is wrong"
        )
    return channel.noted(*_of_baseline(a, dt, channel.peak))


def directed(channel: Channel, named: bool | None = None) -> Channel:
    """Return a channel with a remark where it is vertical, or where nothing says its orientation.

    Args:
        channel: of a file.
        named: what the name of the file says, which counts where the file itself says nothing.
    """
    vertical = orientation(channel.component)
    vertical = named if vertical is None else vertical
    return channel.noted(UNKNOWN) if vertical is None else channel.noted(*([VERTICAL] if vertical else []))


def _of_baseline(a: np.ndarray, dt: float, peak: float) -> tuple[str, ...]:
    """Remarks on an offset and a drift, in words that name the remedy."""
    if peak == 0.0:
        return ("all samples are zero",)
    notes = []
    mean = float(np.mean(a))
    if abs(mean) > OFFSET * peak:
        notes.append(f"offset: the mean is {mean:.3g} m/s^2, {abs(mean) / peak:.1%} of the peak (`baseline`)")
    # Velocity from rest by trapezoids: what a block on the ground would follow.
    velocity = np.cumsum(0.5 * (a[1:] + a[:-1])) * dt
    end, greatest = float(velocity[-1]), float(np.max(np.abs(velocity)))
    if abs(end) > DRIFT * greatest:
        notes.append(f"drift: the velocity at the end is {end:.3g} m/s, with a peak of {greatest:.3g} m/s")
    return tuple(notes)


def without_baseline(channel: Channel, baseline: str) -> Channel:
    """Return the channel less its mean ("mean") or its straight line of least squares ("linear")."""
    a = channel.acceleration
    mean = float(np.mean(a))
    if baseline == "mean":
        return replace(channel, acceleration=a - mean).noted(f"baseline: the mean, {mean:.3g} m/s^2, removed")
    # Times from the middle: offset and slope are then independent of each other.
    t = (np.arange(a.size) - 0.5 * (a.size - 1)) * channel.dt
    slope = float(t @ a / (t @ t))
    said = f"baseline: the mean, {mean:.3g} m/s^2, and a slope of {slope:.3g} m/s^3 removed"
    return replace(channel, acceleration=a - mean - slope * t).noted(said)


def agree_on_count(stated: int, found: int, where: str) -> None:
    """Raise `UnreadableRecord` unless a stated number of samples is the one found."""
    if stated != found:
        raise UnreadableRecord(f"{where} states {stated} samples, but there are {found}")


def agree_on_peak(values: np.ndarray, stated: Decimal, where: str, *, digit: float) -> None:
    """Raise `UnreadableRecord` unless the peak of the samples is the stated one.

    Args:
        values: samples in the unit of the statement.
        stated: the peak as printed, with its sign.
        where: the statement, in words.
        digit: size of the last digit of the samples at the peak.
    """
    peak = float(np.max(np.abs(values)))
    # Both numbers are rounded, each by half a unit of its last digit.
    margin = 0.51 * (stated.unit + digit) + 1e-9 * peak
    # An extreme of the same sign as the statement, and no greater one of the other sign.
    ends = (float(np.max(values)), float(np.min(values)))
    found = min(ends, key=lambda end: abs(end - stated.value))
    if abs(found - stated.value) > margin or abs(peak - abs(stated.value)) > margin:
        raise UnreadableRecord(f"{where} states a peak of {stated.value:g}, but the samples have {peak:g}")


def agree_on_peak_time(
    values: np.ndarray, dt: float, stated: Decimal, where: str, start: float = 0.0
) -> None:
    """Raise `UnreadableRecord` unless the sample of the peak is at the stated time (s), within its rounding
    and one step. Samples that are rounded may have several of the greatest size."""
    size = np.abs(values)
    times = start + dt * np.flatnonzero(size >= size.max() * (1.0 - 1e-9))
    if np.min(np.abs(times - stated.value)) > dt + 0.51 * stated.unit + 1e-9 * stated.value:
        raise UnreadableRecord(
            f"{where} states the peak at {stated.value:g} s, but in samples {dt:g} s apart it is at "
            f"{times[0]:g} s"
        )


def agree(first: float, second: float, what: str, tolerance: float = 0.0) -> None:
    """Raise `UnreadableRecord` unless two statements of one quantity agree."""
    # Sums and quotients of stated numbers carry rounding errors of floats.
    if abs(first - second) > tolerance + 1e-9 * max(abs(first), abs(second)):
        raise UnreadableRecord(f"the file states {what} twice and differently, {first:g} and {second:g}")
