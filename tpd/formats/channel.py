"""Channels of files: units, directions, and checks that the statements of a file agree with each other."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, replace

import numpy as np

from tpd.core.formatting import called
from tpd.formats.text import Decimal, StatedByFile, UnreadableRecord, quote


class Remark(str):
    """Note on a channel that begins with its kind. Notes on many records are counted by their kinds."""

    kind: str

    def __new__(cls, kind: str, detail: str = "") -> Remark:
        """Create a note from its kind and what else it states."""
        # Pickle creates a note from the whole text, and then restores its kind.
        note = super().__new__(cls, f"{kind}: {detail}" if detail else kind)
        note.kind = kind
        return note


STANDARD_GRAVITY = 9.80665
"""Standard acceleration of gravity, m/s^2."""
GREATEST_PEAK = 100.0
"""Largest plausible acceleration of an earthquake, m/s^2: twice the strongest recorded."""
FACTORS = {"g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY, "m/s2": 1.0, "cm/s2": 0.01, "gal": 0.01}
FACTORS |= {"mm/s2": 0.001, "in/s2": 0.0254, "ft/s2": 0.3048, "%g": 0.01 * STANDARD_GRAVITY}
"""Factors that convert a unit to m/s^2."""
_SHOWN = ", ".join(FACTORS)
"""Units as a message lists them."""
TIMES: dict[str, float] = dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0)
"""Seconds per unit of time."""
TIMES |= dict.fromkeys(("ms", "msec", "msecs", "millisecond", "milliseconds"), 1e-3)
VERTICAL = "vertical component"
"""Note on a vertical channel."""
UNKNOWN = Remark("orientation not stated", "used as a horizontal component")
"""Note on a channel if the content of the file does not state the orientation."""
BOREHOLE = "instrument in a borehole, not at the surface"
"""Note on a channel of KiK-net, which has a second instrument at the surface."""
UNCORRECTED = Remark("uncorrected", "it may contain a drift and the response of the instrument")
"""Note on a channel if the file states that it is not corrected."""
UNSTATED = Remark("correction not stated", "it may contain a drift and the response of the instrument")
"""Note on a channel in a format for uncorrected data, if the file does not state whether it is corrected."""
RAW = UNCORRECTED, UNSTATED
"""Notes on channels whose mean is removed by default."""
_UPRIGHT = r"(?:up|down|dn|du|dwn|ud|updown|upward|ver|vert|vertical|vrt|z|v)[12]?"
"""Names of vertical components."""
_LEVEL = (
    r"(?:ns|sn|ew|we|north|south|east|west|[nsew]|[xy]|[lt]|h[12]?|long|longitudinal|tran|trans|transverse|"
    r"transversal|radial|horizontal|horiz|hor)[12]?|[ns]\d{1,2}[ew]"
)
"""Names of horizontal components."""
_SEED = r"[a-z][hlgn]"
"""Band and instrument of a SEED code. Its third letter is the direction."""
STEPS = (1e-5, 1.0)
"""Shortest and longest time step (s) of a record. A step beyond them is probably in another unit."""
OFFSET = 0.005
"""Share of the peak above which a mean leads to a note."""
DRIFT = 0.25
"""Share of the largest velocity above which the velocity at the end leads to a note."""
BASELINES = ("none", "mean", "linear")
"""Kinds of baseline correction."""


@dataclass(frozen=True, eq=False)
class Channel:
    """Channel of a file: one component of a record."""

    acceleration: np.ndarray
    """Samples, (n,), m/s^2."""
    dt: float
    """Time step, s."""
    component: str = ""
    """Direction as the file states it."""
    name: str = ""
    """Station and component."""
    event: str = ""
    """Name of the earthquake."""
    notes: tuple[str, ...] = ()
    """Notes for the user."""
    source: str = ""
    """Name of the file, with the number of the channel if the file has several."""

    @property
    def peak(self) -> float:
        """Largest acceleration, m/s^2."""
        return float(np.max(np.abs(self.acceleration)))

    def with_notes(self, *notes: str) -> Channel:
        """Return the channel with further notes."""
        return replace(self, notes=(*self.notes, *notes))


def check_channel(channel: Channel, baseline: str | None = "none") -> Channel:
    """Check that the numbers of a channel are plausible, and return it with notes on its baseline.

    Args:
        channel: channel of a file.
        baseline: baseline correction, one of `BASELINES`. None removes the mean of a channel that has a note
            in `RAW`.

    Raises:
        UnreadableRecord: there are fewer than two samples, the step or the peak is not plausible, or a number
            is not finite.
    """
    a, dt = channel.acceleration, channel.dt
    if a.size < 2:
        raise UnreadableRecord(f"a record needs at least 2 samples, but has {a.size}")
    if not (STEPS[0] <= dt <= STEPS[1]):
        raise UnreadableRecord(f"the step must be {STEPS[0]:g} s to {STEPS[1]:g} s, but is {dt:g} s")
    if not (np.isfinite(a).all() and channel.peak <= GREATEST_PEAK):
        wrong = f"the peak must be at most {GREATEST_PEAK:g} m/s^2, but is {channel.peak:g} m/s^2"
        raise UnreadableRecord(f"{wrong}: the unit or a number is wrong")
    if (peak := channel.peak) == 0.0:
        return channel.with_notes("all samples are zero")
    if baseline is None:
        baseline = "mean" if any(note in RAW for note in channel.notes) else "none"
    # Describe an offset and a drift, with the remedy. The share is that of the peak as read.
    notes, mean = [], float(np.mean(a))
    size = f"the mean, {mean:.3g} m/s^2, {abs(mean) / peak:.1%} of the peak"
    if baseline != "none":
        channel = _without_baseline(channel, baseline, size)
        a = channel.acceleration
    elif abs(mean) > OFFSET * peak:
        notes.append(Remark("offset", f"{size} (baseline 'mean' removes it)"))
    # The velocity from rest by the trapezoidal rule is the motion that the base of a block follows.
    velocity = np.cumsum(0.5 * (a[1:] + a[:-1])) * dt
    end, greatest = float(velocity[-1]), float(np.max(np.abs(velocity)))
    if abs(end) > DRIFT * greatest:
        speeds = f"the velocity at the end is {end:.3g} m/s, with a peak of {greatest:.3g} m/s"
        notes.append(Remark("drift", speeds))
    return channel.with_notes(*notes)


def note_direction(channel: Channel) -> Channel:
    """Return a channel with a note if it is vertical, or if the file does not state its orientation."""
    vertical = orientation(channel.component)
    return channel.with_notes(*([UNKNOWN] if vertical is None else [VERTICAL] if vertical else []))


def scale_channel(channel: Channel, factor: float) -> Channel:
    """Return a channel with all samples multiplied by a number."""
    if factor == 1.0:
        return channel
    values = factor * channel.acceleration
    note = Remark("factor", f"all samples are multiplied by {factor:g}")
    return replace(channel, acceleration=values).with_notes(note)


def _without_baseline(channel: Channel, baseline: str, size: str) -> Channel:
    """Return the channel without its mean ("mean") or its straight line of least squares ("linear").

    `size` describes the mean in words.
    """
    a = channel.acceleration
    mean = float(np.mean(a))
    if baseline == "mean":
        return replace(channel, acceleration=a - mean).with_notes(Remark("baseline removed", size))
    # With times relative to the middle, offset and slope are independent of each other.
    t = (np.arange(a.size) - 0.5 * (a.size - 1)) * channel.dt
    slope = float(t @ a / (t @ t))
    note = Remark("baseline removed", f"{size}, and a slope of {slope:.3g} m/s^3")
    return replace(channel, acceleration=a - mean - slope * t).with_notes(note)


def agree_on_count(stated: int, actual: int, where: str) -> None:
    """Raise `UnreadableRecord` if the stated number of samples is not the actual number."""
    if stated != actual:
        raise UnreadableRecord(f"{where} states {stated} samples, but there are {actual}")


def agree_on_peak(values: np.ndarray, stated: Decimal, where: str, *, digit: float) -> None:
    """Raise `UnreadableRecord` if the stated peak is not the peak of the samples.

    Args:
        values: samples in the unit of the statement.
        stated: the peak as printed, with its sign.
        where: words for the place of the statement.
        digit: size of the last digit of the samples at the peak.
    """
    peak = float(np.max(np.abs(values)))
    # Both numbers are rounded by at most half a unit of their last digit.
    margin = 0.51 * (stated.unit + digit) + 1e-9 * peak
    # The statement has a sign: compare it with the closer of the two extremes. The other extreme must not be
    # larger.
    ends = (float(np.max(values)), float(np.min(values)))
    closest = min(ends, key=lambda end: abs(end - stated.value))
    if abs(closest - stated.value) > margin or abs(peak - abs(stated.value)) > margin:
        raise UnreadableRecord(f"{where} states a peak of {stated.value:g}, but the samples have {peak:g}")


def agree_on_peak_time(
    values: np.ndarray, dt: float, stated: Decimal, where: str, start: float = 0.0
) -> None:
    """Raise `UnreadableRecord` if the peak of the samples is not at the stated time (s).

    The tolerance is the rounding of the time plus one step. Rounded samples may have several peaks of equal
    size.
    """
    size = np.abs(values)
    times = start + dt * np.flatnonzero(size >= size.max() * (1.0 - 1e-9))
    if np.min(np.abs(times - stated.value)) > dt + 0.51 * stated.unit + 1e-9 * stated.value:
        actual = f"in samples {dt:g} s apart it is at {times[0]:g} s"
        raise UnreadableRecord(f"{where} states the peak at {stated.value:g} s, but {actual}")


def agree(first: float, second: float, what: str, tolerance: float = 0.0) -> None:
    """Raise `UnreadableRecord` if two statements of one quantity differ."""
    # Sums and quotients of stated numbers have rounding errors of floats.
    if abs(first - second) > tolerance + 1e-9 * max(abs(first), abs(second)):
        raise UnreadableRecord(f"the file states {what} twice and differently, {first:g} and {second:g}")


def unit_spelling(text: str) -> str:
    """Return a unit in the spelling of `FACTORS`, such as cm/s2 for CM/SEC/SEC; any other text unchanged."""
    # Agencies write cm/s2, CM/SEC/SEC, cm/sec2, cm/s^2 and cm/s**2 for the same unit.
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
        UnreadableRecord: the text is not a known unit.
    """
    unit = unit_spelling(text)
    if unit not in FACTORS:
        wanted = f"a unit of acceleration ({_SHOWN})"
        raise UnreadableRecord(f"line {line} must state {wanted}, but has {quote(text)}")
    return unit


def check_unit(unit: str) -> str:
    """Return the unit that a user passes, in the spelling of `FACTORS`."""
    if not isinstance(unit, str) or unit_spelling(unit) not in FACTORS:
        raise ValueError(f"{called('unit')} must be one of {_SHOWN}, but is {unit!r}")
    return unit_spelling(unit)


def factor_of(stated: str | None, unit: str | None) -> float:
    """Return the factor of the unit that a file states or, if it states none, that the user passes."""
    own = stated if unit is None else check_unit(unit)
    if own is None:
        raise UnreadableRecord(f"the header states no unit of acceleration: give {called('unit')}, such as g")
    # Units with equal factors are the same unit, such as gal and cm/s2.
    if stated is not None and FACTORS[own] != FACTORS[stated]:
        raise StatedByFile(f"the header states the unit {stated}, but {called('unit')} is {unit!r}", "unit")
    return FACTORS[own]


def orientation(text: str) -> bool | None:
    """Return whether a component is vertical; None if its name does not show it.

    Args:
        text: such as UP, U-D, 90 DEG, N-S, S16E, HNZ.
    """
    # Separate the words of names such as AccZ.
    text = re.sub(r"(?<=[a-z])(?=[A-Z](?:[^a-z]|$))", " ", text)
    lower = re.sub(r"\(.*?\)|\[.*?\]", " ", text).lower()
    words = re.findall(r"[^\W_]+", lower)
    pairs = ["".join(pair) for pair in itertools.pairwise(words)]
    names = [*words, *(pair for pair in pairs if re.fullmatch(r"(?:ud|ns|ew|updown)[12]?", pair))]
    if any(re.fullmatch(rf"{_UPRIGHT}|{_SEED}z", word) for word in names):
        return True
    # An azimuth means a horizontal component: 090 or 360, and 90 only if no word before it could be numbered
    # by it, such as a channel.
    angles = re.findall(r"(?<![a-z\d])(\d{3}(?=(?:deg)?(?![a-z\d]))|\d{1,2}(?=\W?deg))", lower)
    angles += re.findall(r"^\W*(?:(?:comp|component|azimuth|az)\W+)?(\d{1,2})\W*$", lower)
    azimuth = any(int(angle) <= 360 for angle in angles)
    if azimuth or any(re.fullmatch(rf"{_LEVEL}|{_SEED}[ne123]", word) for word in names):
        return False
    return None


def is_component(word: str) -> bool:
    """Return whether a word is the name of a component."""
    directions = rf"{_UPRIGHT}|{_LEVEL}|{_SEED}[zne123]|u-?d|n-?s|e-?w|\d{{3}}|\d{{1,3}}(?:deg|°)"
    return re.fullmatch(directions, word.strip().lower()) is not None


_MONTHS = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]
_DATES = (
    r"(?P<y>\d{4})[-/\s]\s*(?P<m>\d{1,2}|[a-z]{3,9})[-/\s]\s*(?P<d>\d{1,2})(?!\d)",
    r"(?<!\d)(?P<y>(?:19|20)\d\d)(?P<m>\d\d)(?P<d>\d\d)(?!\d)",
    r"(?<!\d)(?P<m>\d{1,2})/(?P<d>\d{1,2})/(?P<y>\d{4}|\d\d)(?!\d)",
    r"(?:of )?(?:\b[a-z]{3} )?\b(?P<m>[a-z]{3,9})\.? +(?P<d>\d{1,2}), *(?P<y>\d{4})(?!\d)",
)
"""Patterns of the dates in the headers of agencies."""
_EARLIEST_SHORT = 33
"""First year of the century to which years of two digits belong: 1933, the year of the first strong-motion
record, to 2032."""


def event_of(text: str) -> str:
    """Return the earthquake that a header states: the name before the date, and the date as 1979-10-15.

    >>> event_of("NOWHERE VALLEY 10/15/79 2316")
    'NOWHERE VALLEY 1979-10-15'
    """
    for match in (m for pattern in _DATES for m in re.finditer(pattern, text, re.IGNORECASE)):
        year, month, day = int(match["y"]), match["m"].lower()[:3], int(match["d"])
        # The month may be a word, and the year may have two digits.
        number = _MONTHS.index(month) + 1 if month in _MONTHS else int(month) if month.isdigit() else 0
        year += 0 if year > 99 else 1900 if year >= _EARLIEST_SHORT else 2000
        # Other numbers, such as that of a record, are no date.
        if 1800 < year < 2100 and 1 <= number <= 12 and 1 <= day <= 31:
            name = " ".join(text[: match.start()].split()).rstrip(",")
            return f"{name} {year}-{number:02d}-{day:02d}".strip()
    return " ".join(text.split())
