"""Orientation of a component, from the words and codes by which files name it."""

from __future__ import annotations

import itertools
import re

VERTICAL = "vertical component"
"""Note of a channel that is vertical."""
UNKNOWN = "orientation not stated: taken for a horizontal component"
"""Note of a channel whose file and name do not say its orientation."""
_UPRIGHT = r"(?:up|down|dwn|dn|ud|du|vert|vertical|vertic|ver|vrt|updown|z|v)[12]?"
_LEVEL = (
    r"(?:ns|sn|ew|we|north|south|east|west|nord|sud|ost|est|ouest|[nsew]|[xy]|[lt]|h[12]?|"
    r"long|longitudinal|tran|trans|transverse|transversal|radial|horizontal|horiz|hor)[12]?|[ns]\d{1,2}[ew]"
)
_SEED = r"[a-z][hlgn]"
"""Band and instrument of a SEED code; the third letter is the direction."""
_AT_THE_END = rf"(?:^|[-_. ])(?:{_UPRIGHT[: -len('|z|v)[12]?')]}|z)[12]?|u-d|{_SEED}z)$"


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
