"""One channel of a file: its unit and direction as files name them, and whether a file agrees with itself."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, replace

import numpy as np

from tpd.formats.text import Decimal, UnreadableRecord, shown

STANDARD_GRAVITY = 9.80665
"""m/s^2"""
GREATEST_PEAK = 100.0
"""Greatest acceleration (m/s^2) that is taken for that of an earthquake: twice the strongest recorded."""
FACTORS = {
    "g": STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY,
    "m/s2": 1.0,
    "cm/s2": 0.01,
    "gal": 0.01,
    "mm/s2": 0.001,
    "in/s2": 0.0254,
    "ft/s2": 0.3048,
    "%g": 0.01 * STANDARD_GRAVITY,
}
"""m/s^2 of a unit."""
_SHOWN = ", ".join(FACTORS)
VERTICAL = "vertical component"
"""Note of a channel that is vertical."""
UNKNOWN = "orientation not stated: taken for a horizontal component"
"""Note of a channel whose file and name do not say its orientation."""
BOREHOLE = "instrument in a borehole, not at the surface"
"""Note of a channel of KiK-net, which has a second instrument at the surface."""
UNCORRECTED = "uncorrected: a drift and the response of the instrument may be left in it"
"""Note of a channel whose file states that it is not corrected."""
UNSTATED = "correction not stated: a drift and the response of the instrument may be left in it"
"""Note of a channel of a format for data as recorded, whose file does not say whether it is corrected."""
RAW = UNCORRECTED, UNSTATED
"""Notes of the channels whose mean is removed unless the user asks for something else."""
_UPRIGHT = (
    r"(?:up|down|dwn|dn|ud|du|ver|vrt|vert\w*|updown|upward\w*|arriba|haut|lotrecht|senkrecht|d[uü][sş]ey|"
    r"pionow\w*|svisl\w*|zvisl\w*|вертик\w*|上下|鉛直|z|v)[12]?"
)
_LEVEL = (
    r"(?:ns|sn|ew|we|north|south|east|west|nord|s[uü]d|ost|est|ouest|norte|sur|sul|leste|oeste|[nsew]|[xy]|"
    r"[lt]|h[12]?|long|longitudinal|tran|trans|transverse|transversal|radial|horizontal|horiz|hor)[12]?|[ns]\d{1,2}[ew]"
)
_SEED = r"[a-z][hlgn]"
"""Band and instrument of a SEED code; the third letter is the direction."""
_AT_THE_END = rf"(?:^|[-_. ])(?:{_UPRIGHT[: -len('|z|v)[12]?')]}|z)[12]?|u-d|{_SEED}z)$"
STEPS = (1e-5, 1.0)
"""Shortest and longest step (s) of a record; beyond them a step was stated in another unit."""
OFFSET = 0.005
"""Share of the peak from which on a mean is noted."""
DRIFT = 0.25
"""Share of the greatest velocity from which on the velocity at the end is noted."""
BASELINES = ("none", "mean", "linear")


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
    source: str = ""
    """The file, and the number of the channel where the file has several."""

    @property
    def peak(self) -> float:
        """Greatest acceleration, m/s^2."""
        return float(np.max(np.abs(self.acceleration)))

    def noted(self, *notes: str) -> Channel:
        """Return the channel with further remarks."""
        return replace(self, notes=(*self.notes, *notes))


def checked(channel: Channel, baseline: str | None = "none") -> Channel:
    """Return a channel whose numbers are those of a ground motion, with remarks on its baseline.

    Args:
        channel: of a file.
        baseline: what is removed, one of `BASELINES`; None removes the mean of a channel that has a note of
            `RAW`.

    Raises:
        UnreadableRecord: fewer than two samples, a step or a peak beyond the bounds, or a number that is not
            finite.
    """
    a, dt = channel.acceleration, channel.dt
    if a.size < 2:
        raise UnreadableRecord(f"a record needs 2 samples or more, but {a.size} were found")
    if not (STEPS[0] <= dt <= STEPS[1]):
        raise UnreadableRecord(f"the step must be {STEPS[0]:g} s to {STEPS[1]:g} s, but is {dt:g} s")
    if not (np.isfinite(a).all() and channel.peak <= GREATEST_PEAK):
        raise UnreadableRecord(
            f"the peak must be at most {GREATEST_PEAK:g} m/s^2, but is {channel.peak:g} m/s^2: the "
            "unit or a number is wrong"
        )
    peak = channel.peak
    if peak == 0.0:
        return channel.noted("all samples are zero")
    if baseline is None:
        baseline = "mean" if any(note in RAW for note in channel.notes) else "none"
    # An offset and a drift, in words that name the remedy. The share is that of the peak as read.
    notes, mean = [], float(np.mean(a))
    size = f"the mean, {mean:.3g} m/s^2, {abs(mean) / peak:.1%} of the peak"
    if baseline != "none":
        channel = _without_baseline(channel, baseline, size)
        a = channel.acceleration
    elif abs(mean) > OFFSET * peak:
        notes.append(f"offset: {size} (baseline 'mean' removes it)")
    # Velocity from rest by trapezoids: what a block on the ground would follow.
    velocity = np.cumsum(0.5 * (a[1:] + a[:-1])) * dt
    end, greatest = float(velocity[-1]), float(np.max(np.abs(velocity)))
    if abs(end) > DRIFT * greatest:
        notes.append(f"drift: the velocity at the end is {end:.3g} m/s, with a peak of {greatest:.3g} m/s")
    return channel.noted(*notes)


def directed(channel: Channel, named: bool | None = None) -> Channel:
    """Return a channel with a remark where it is vertical, or where nothing says its orientation.

    Args:
        channel: of a file.
        named: what the name of the file says, which counts where the file itself says nothing.
    """
    vertical = orientation(channel.component)
    vertical = named if vertical is None else vertical
    return channel.noted(UNKNOWN) if vertical is None else channel.noted(*([VERTICAL] if vertical else []))


def scaled(channel: Channel, scale: float) -> Channel:
    """Return a channel with all samples multiplied by a number."""
    if scale == 1.0:
        return channel
    values = scale * channel.acceleration
    return replace(channel, acceleration=values).noted(f"scale: all samples are multiplied by {scale:g}")


def _without_baseline(channel: Channel, baseline: str, size: str) -> Channel:
    """Return the channel less its mean ("mean", of a `size` in words) or its straight line of least squares
    ("linear")."""
    a = channel.acceleration
    mean = float(np.mean(a))
    if baseline == "mean":
        return replace(channel, acceleration=a - mean).noted(f"baseline removed: {size}")
    # Times from the middle: offset and slope are then independent of each other.
    t = (np.arange(a.size) - 0.5 * (a.size - 1)) * channel.dt
    slope = float(t @ a / (t @ t))
    said = f"baseline removed: {size}, and a slope of {slope:.3g} m/s^3"
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


def plain(text: str) -> str:
    """Return a unit in the spelling of `FACTORS`, such as cm/s2 for CM/SEC/SEC, or the text as it is."""
    # Agencies write cm/s2, CM/SEC/SEC, cm/sec2, cm/s^2 and cm/s**2 for the same.
    unit = text.strip(" \t.,;:").lower().replace("²", "2").replace("^", "").replace("**", "")
    unit = re.sub(r"[\s·]+", "", unit)
    unit = re.sub(r"seconds?|secs?", "s", unit).replace("/s/s", "/s2").replace("s-2", "/s2")
    unit = re.sub(r"\.(?=/)", "", unit.replace("//", "/").replace("(s2)", "s2"))
    length = r"^(?:inch(?:es)?|feet|foot|met(?:er|re)s?|centimet(?:er|re)s?)(?=/)"
    unit = re.sub(length, lambda word: {"i": "in", "f": "ft", "m": "m", "c": "cm"}[word[0][0]], unit)
    return {"gals": "gal", "g's": "g", "gs": "g", "milli-g": "mg", "cm/ss": "cm/s2"}.get(unit, unit)


def unit_of(text: str, line: int) -> str:
    """Return the unit of acceleration that a header states.

    Raises:
        UnreadableRecord: none that is known.
    """
    unit = plain(text)
    if unit not in FACTORS:
        raise UnreadableRecord(
            f"line {line} must state a unit of acceleration ({_SHOWN}), but has {shown(text)}"
        )
    return unit


def given(unit: str) -> str:
    """Return the unit that a user gives, in the spelling of `FACTORS`."""
    if not isinstance(unit, str) or plain(unit) not in FACTORS:
        raise ValueError(f"`unit` must be one of {_SHOWN}, but is {unit!r}")
    return plain(unit)


def chosen(stated: str | None, unit: str | None) -> str:
    """Return the unit stated by a file or, where it states none, by the user."""
    if stated is None and unit is None:
        raise UnreadableRecord("the header states no unit of acceleration: give `unit`, such as unit='g'")
    if unit is None:
        return stated or ""
    # Gal and cm/s2 are one unit.
    if stated is not None and FACTORS[given(unit)] != FACTORS[stated]:
        raise UnreadableRecord(f"the header states the unit {stated}, but `unit` is {unit!r}")
    return given(unit)


def orientation(text: str) -> bool | None:
    """Return whether a component is vertical; None where its name does not say so.

    Args:
        text: such as UP, U-D, 90 DEG, N-S, S16E, HNZ.
    """
    # The Z of AccZ is a word of its own.
    text = re.sub(r"(?<=[a-z])(?=[A-Z](?:[^a-z]|$))", " ", text)
    bare = re.sub(r"\(.*?\)|\[.*?\]", " ", text).lower()
    words = re.findall(r"[^\W_]+", bare)
    pairs = ["".join(pair) for pair in itertools.pairwise(words)]
    said = [*words, *(pair for pair in pairs if re.fullmatch(r"(?:ud|ns|ew|updown)[12]?", pair))]
    if any(re.fullmatch(rf"{_UPRIGHT}|{_SEED}z", word) for word in said):
        return True
    # An azimuth: 090, 360, and 90 where no word before it can be what is numbered, such as a channel.
    angles = re.findall(r"(?<![a-z\d])(\d{3}(?=(?:deg)?(?![a-z\d]))|\d{1,2}(?=\W?deg))", bare)
    angles += re.findall(r"^\W*(?:(?:comp|component|azimuth|az)\W+)?(\d{1,2})\W*$", bare)
    azimuth = any(int(angle) <= 360 for angle in angles)
    if azimuth or any(re.fullmatch(rf"{_LEVEL}|{_SEED}[ne123]", word) for word in said):
        return False
    return None


def is_component(word: str) -> bool:
    """Return whether a word is the name of a component and nothing else."""
    directions = rf"{_UPRIGHT}|{_LEVEL}|{_SEED}[zne123]|u-?d|n-?s|e-?w|\d{{1,3}}(?:deg|°)"
    return re.fullmatch(directions, word.strip().lower()) is not None


def of_file(name: str) -> bool | None:
    """Return what the name of a file says, such as RSN1_AA-UP.AT2, XXX.UD2, STATION.HNZ.csv.

    Words other than the last may be anything. PEER also writes the direction without a gap: MYG004UD.AT2.
    """
    stem, _, ending = name.lower().removesuffix(".gz").rpartition(".")
    if re.fullmatch(r"(?:ud|ns|ew)[12]?", ending):
        return ending.startswith("ud")
    if re.search(_AT_THE_END, stem):
        return True
    if ending == "at2" and re.search(r"(?:up|ud|dwn|vert|ver|[-_\d]v|\dz)$", stem):
        return True
    level = r"(?:^|[-_. ])(?:ns|ew|n-s|e-w|north|east|n|e|x|y|[ns]\d\d[ew]|[a-z][hlgn][ne12])$"
    digits = ending == "at2" and re.search(r"(?:\d{3}|[ns]\d\d[ew]|ns|ew|[-_][nelth][12]?)$", stem)
    return False if digits or re.search(level, stem) else None
