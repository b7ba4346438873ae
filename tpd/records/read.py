"""Ground motions by name: files of accelerographs, folders of them, built-in records and sets."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core.files import path_of, readable
from tpd.core.formatting import meant, number
from tpd.formats.channel import BOREHOLE, RAW, STANDARD_GRAVITY, UNKNOWN, VERTICAL
from tpd.formats.text import NoAcceleration
from tpd.records.sets import el_centro, fema_p695, loma_prieta
from tpd.scene.earthquakes import is_one
from tpd.scene.ground_motion import GroundMotion, events_of
from tpd.scene.record import Record

BUILT_IN = {"el-centro": el_centro, "loma-prieta": loma_prieta}
SETS = {
    "fema-p695": "far-field",
    "fema-p695-far-field": "far-field",
    "fema-p695-near-field-pulse": "near-field-pulse",
    "fema-p695-near-field-no-pulse": "near-field-no-pulse",
}
_FEW = 3
"""Most records that are described one by one."""
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
    read: list[tuple[Any, str]] = []
    left: list[str] = []
    said: list[str] = []
    for i, name in enumerate(names):
        if name in SETS:
            try:
                read += [(record, "") for record in fema_p695(SETS[name])]
            except ImportError as error:
                raise ValueError(str(error)) from None
        elif name in BUILT_IN:
            read.append((BUILT_IN[name](), ""))
        else:
            path = path_of(name)
            files, others = _files_of(path)
            left += others
            event = readable(path.resolve().name) if path.is_dir() else ""
            event = event if events is None else events[i if len(events) > 1 else 0]
            for file in files:
                try:
                    records = (
                        Record.read_all(file, **how)
                        if channel is None
                        else [Record.read(file, channel=channel, **how)]
                    )
                except NoAcceleration as error:
                    # A file that is named must be a motion; of a folder what is none is left out.
                    if not path.is_dir():
                        raise
                    left.append(f"{file.name} ({error.content})")
                    continue
                for record in records:
                    vertical = VERTICAL in record.notes
                    if vertical and channel is None:
                        left.append(f"{record.source} ({VERTICAL})")
                        continue
                    if vertical:
                        said.append(
                            f"note: {record.source} is a {VERTICAL}, but shakes the block sideways here"
                        )
                    # The channels of one file are of one earthquake.
                    named = record.event or event or (str(file) if len(records) > 1 else "")
                    assumed = path.is_dir() and events is None and not record.event
                    read.append((replace(record, event=named), name if assumed else ""))
    reasons = _repeated([record for record, _ in read])
    left += [f"{record.source} ({why})" for (record, _), why in zip(read, reasons, strict=True) if why]
    kept = [one for one, why in zip(read, reasons, strict=True) if not why]
    for name, count in Counter(folder for _, folder in kept if folder).items():
        if count > 1:
            said.append(
                f"note: {count} records of the folder {name} name no earthquake and are taken for one; "
                "if they are of several, give the files one by one, with their `event`"
            )
    if left:
        said.insert(0, f"left out: {'; '.join(left)}")
    if not kept:
        hint = "; `channel` takes one that is vertical" if any(VERTICAL in why for why in left) else ""
        others = f" ({said[0]})" if left else ""
        raise ValueError(f"there is no horizontal record in {', '.join(names)}{others}{hint}")
    found = [record for record, _ in kept]
    return found, said + _unknown(found) + same_earthquakes(found)


def _repeated(records: Sequence[Record]) -> list[str]:
    """Why each record is left out beside the others, in words; empty where it counts. One channel counts
    once: agencies deliver it uncorrected and corrected, compressed and not, and in a borehole as well."""
    seen: dict[Record, Record] = {}
    # Files write names in capitals or not, and agencies change only the ending, such as .V1 and .V2.
    names = [re.sub(r"[^\w/]|_", "", record.name.lower()).rpartition("/") for record in records]
    files = [re.sub(r"\.\w+(\.gz)?(, channel \d+.*)?$", "", record.source.lower()) for record in records]
    places = [(station, component, file) for (station, _, component), file in zip(names, files, strict=True)]
    reasons = []
    for record, place in zip(records, places, strict=True):
        # Two records are equal if all but the names of their files is the same.
        first = seen.setdefault(record, record)
        pairs = zip(records, places, strict=True)
        better = (why for other, its in pairs if (why := _better(record, other, place, its)))
        reasons.append(f"the same as {first.source}" if first is not record else next(better, ""))
    return reasons


def _better(record: Record, other: Record, place: tuple[str, ...], its: tuple[str, ...]) -> str:
    """Why another record counts in place of a record, in words; empty where it does not. A place is station,
    component and name of the file without its ending."""
    # Most records have none of these notes, and count.
    marks = {*RAW, BOREHOLE} & {*record.notes} - {*other.notes}
    if not marks or (record.event and other.event and not is_one(record.event, other.event)):
        return ""
    is_one_station = place[0] == its[0] != ""
    if BOREHOLE in marks and is_one_station:
        return f"{BOREHOLE}, beside {other.source}"
    is_raw = bool(marks & {*RAW}) and not {*RAW} & {*other.notes}
    is_one_channel = place[1] == its[1] and (is_one_station or place[2] == its[2])
    return f"uncorrected, beside the corrected {other.source}" if is_raw and is_one_channel else ""


def same_earthquakes(found: Sequence[GroundMotion]) -> list[str]:
    """Return a sentence on the records whose earthquakes are written differently and are taken for one."""
    texts: dict[str, set[str]] = {}
    for record, name in zip(found, events_of(found), strict=True):
        texts.setdefault(name, set()).add(getattr(record, "event", "") or "an earthquake without a name")
    one = "; ".join(sorted(" = ".join(sorted(events)) for events in texts.values() if len(events) > 1))
    return [f"note: taken for one earthquake by dates, names or samples: {one}"] if one else []


def facts(motion: Record) -> dict[str, Any]:
    """Numbers and words of a record, for tables and JSON; its PGA is that of the file, without the scale."""
    a = np.asarray(motion.acceleration)
    return {
        "source": motion.source,
        "name": motion.name,
        "earthquake": motion.event,
        "samples": len(a),
        "step_s": float(motion.dt),
        "duration_s": float(motion.duration),
        "pga_g": float(np.max(np.abs(a))) / STANDARD_GRAVITY,
        "scale": float(motion.scale),
        "notes": list(motion.notes),
    }


def summary(motions: Sequence[GroundMotion], notes: Sequence[str] = ()) -> dict[str, Any]:
    """Facts of all records, and the notes on them, for JSON."""
    return {"records": [facts(m) for m in motions if isinstance(m, Record)], "notes": list(notes)}


def in_words(motions: Sequence[GroundMotion]) -> str:
    """Return the name of a pulse or record with its size and duration; of several their number."""
    if len(motions) > 1:
        return f"{len(motions)} records"
    motion = motions[0]
    name = getattr(motion, "name", "") or getattr(motion, "kind", "motion")
    return f"{name}, {float(motion.pga):.4g} m/s^2 at most, {float(motion.duration):.4g} s"


def described(motions: Sequence[Any]) -> list[str]:
    """Lines for a terminal on the records that were read: one for each of a few, or one for all."""
    read = [facts(motion) for motion in motions if isinstance(motion, Record)]
    if len(read) > _FEW:
        # Smallest and largest values; all values are in the report and in the JSON of the command.
        said = []
        for key, digits in {"samples": 9, "step_s": 3, "duration_s": 3, "pga_g": 3}.items():
            values = [float(f[key]) for f in read]
            said.append(" to ".join(dict.fromkeys(number(x, digits) for x in (min(values), max(values)))))
        kinds = Counter(note.partition(":")[0] for f in read for note in f["notes"])
        notes = "; ".join(f"{kind} {count}" for kind, count in kinds.items())
        return [
            f"records: {len(read)} of {len(set(events_of(motions)))} earthquakes, {said[0]} samples of "
            f"{said[1]} s, {said[2]} s long, PGA {said[3]} g" + (f"; noted: {notes}" if notes else "")
        ]
    return [
        "; ".join(
            (
                f"record: {f['source'] or f['name']}, {f['samples']} samples of {number(f['step_s'])} s, "
                f"{number(f['duration_s'])} s long, PGA {number(f['pga_g'])} g",
                *f["notes"],
            )
        )
        for f in read
    ]


def _unknown(found: Sequence[Any]) -> list[str]:
    """Sentences on how many records state no orientation, and how many no earthquake."""
    said = []
    flat = sum(UNKNOWN in getattr(record, "notes", ()) for record in found)
    if flat and len(found) > 1:
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
    if not path.exists():
        # A misspelt name of a built-in record looks like a file that does not exist.
        hint = meant(path.name, (*BUILT_IN, *SETS), listing=False)
        raise FileNotFoundError(f"the file does not exist: {path}{hint}")
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
