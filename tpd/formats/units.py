"""Units of acceleration, as files state them."""

from __future__ import annotations

import re

from tpd.formats.text import UnreadableRecord, shown

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


def plain(text: str) -> str:
    """Return a unit in the spelling of `FACTORS`, such as cm/s2 for CM/SEC/SEC, or the text as it is."""
    # Agencies write cm/s2, CM/SEC/SEC, cm/sec2, cm/s^2 and cm/s**2 for the same.
    unit = text.strip(" \t.,;:").lower().replace("²", "2").replace("^", "").replace("**", "")
    unit = re.sub(r"[\s·]+", "", unit)
    unit = re.sub(r"seconds?|secs?", "s", unit).replace("/s/s", "/s2").replace("s-2", "/s2")
    unit = re.sub(r"\.(?=/)", "", unit.replace("//", "/").replace("(s2)", "s2"))
    unit = re.sub(r"^(?:inch(?:es)?|feet|foot|met(?:er|re)s?|centimet(?:er|re)s?)(?=/)", _short, unit)
    return {"gals": "gal", "g's": "g", "gs": "g", "milli-g": "mg", "cm/ss": "cm/s2"}.get(unit, unit)


def _short(word: re.Match[str]) -> str:
    return {"i": "in", "f": "ft", "m": "m", "c": "cm"}[word[0][0]]


def looks_like(text: str) -> bool:
    """Return whether a text has the form of a unit of acceleration, known or not: a length over s2."""
    return bool(re.fullmatch(r"[a-zµ%]{1,12}/s2", plain(text)))


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
