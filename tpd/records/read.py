"""Ground motions by name: files of accelerographs, folders of files, built-in records and sets of records."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core.checks import PLAUSIBLE
from tpd.core.files import label_of, path_of
from tpd.core.formatting import called, meant, number
from tpd.formats.channel import BOREHOLE, RAW, STANDARD_GRAVITY, UNKNOWN, VERTICAL
from tpd.formats.text import NoAcceleration, StatedByFile
from tpd.records.sets import el_centro, fema_p695, loma_prieta
from tpd.scene.earthquakes import STATED, is_one
from tpd.scene.ground_motion import GroundMotion, copy_factor, events_of
from tpd.scene.record import Record

BUILT_IN = {"el-centro": el_centro, "loma-prieta": loma_prieta}
"""Built-in records, by name."""
SETS = {
    "fema-p695": "far-field",
    "fema-p695-far-field": "far-field",
    "fema-p695-near-field-pulse": "near-field-pulse",
    "fema-p695-near-field-no-pulse": "near-field-no-pulse",
}
"""Names of the sets in a job file, with their names in `tpd.records.sets`."""
_UPWARD = re.compile(r"(?i)(?:^|[-_. \d])(?:up|ud|dwn|vert?|vertical|[a-z][hln]z|z|v)\d?(?:\.\w+)*$")
"""Pattern of the name of a file that may contain a vertical component."""
_TRACE = re.compile(r"(\w*\.\w+)\.(\w*)\.(\w\w)\w")
"""Pattern of the name of a channel with a SEED code: station, location, sensor."""
_MOST_LINES = 3
"""Largest number of records that are described one by one."""
_SMALLEST_PGA = 0.001
"""Smallest plausible PGA, g. People feel about 0.001 g."""
_ROUNDING, _RESAMPLING, _CORRELATION = 0.01, 0.1, 0.75
"""Largest difference of two copies over their peak, also with two time steps, and smallest correlation of two
processings of one channel. Two components of one station have at most 0.55."""


def read_motions(
    names: Sequence[str], *, events: Mapping[str, str] | None = None, channel: int | None = None, **how: Any
) -> tuple[list[GroundMotion], list[str]]:
    """Return all horizontal records of files, folders, built-in records and sets, and notes on them.

    The notes are sentences on what was left out or assumed.

    Args:
        names: names of files and folders, or names out of `BUILT_IN` and `SETS`.
        events: names of earthquakes, by file or folder. They replace what the files state.
        channel: number of the channel that is read from every file, vertical or not; default all horizontal
            ones.
        how: `dt`, `unit`, `baseline` and the other options of `tpd.Record.read`.

    Raises:
        ValueError: there is no horizontal record, or a file is not a record.
    """
    read: list[Record] = []
    omitted, messages, stated = list[str](), list[str](), list[str]()
    for name in events or ():
        if not path_of(name).exists():
            raise FileNotFoundError(f"{called('events')} must name files and folders, but there is no {name}")
    named = {path_of(name).resolve(): event for name, event in (events or {}).items()}

    for name in names:
        if not name.strip():
            raise ValueError("the name of a record must not be empty, but is ''")
        if name in SETS or name in BUILT_IN:
            try:
                read += fema_p695(SETS[name]) if name in SETS else [BUILT_IN[name]()]
            except ImportError as error:
                raise ValueError(str(error)) from None
            continue
        path = path_of(name)
        files, others = _files_of(path)
        omitted += others
        for file in files:
            records, options = None, dict(how)
            while records is None:
                try:
                    records = Record.read_all(file, **options)
                    if channel is not None:
                        records = [Record.read(file, channel=channel, **options)]
                # A file that the user names must be a motion and agree with all options. In a folder a file
                # without a motion is left out, and an option does not apply to a file that states its own.
                except StatedByFile as error:
                    if not path.is_dir() or options.pop(error.option, None) is None:
                        raise
                    stated.append(error.option)
                except NoAcceleration as error:
                    if not path.is_dir():
                        raise
                    omitted.append(f"{label_of(file)} ({error.content})")
                    records = []
            # The file itself is named before its folder.
            own = next((x for x in (file.resolve(), *file.resolve().parents) if x in named), None)
            for record in records:
                vertical = VERTICAL in record.notes
                if vertical and channel is None:
                    omitted.append(f"{record.source} ({VERTICAL})")
                    continue
                if vertical:
                    use = "but is used as a horizontal motion here"
                    messages.append(f"note: {record.source} is a {VERTICAL}, {use}")
                if UNKNOWN in record.notes and _UPWARD.search(file.name):
                    use = "but its content states no direction: it is used as a horizontal motion"
                    messages.append(f"warning: the name {file.name} may be that of a {VERTICAL}, {use}")
                if own is not None:
                    record = replace(record, event=named[own], notes=(*record.notes, STATED))
                read.append(record)
    for option, count in sorted(Counter(stated).items()):
        where = f"{count} of the files in folders: they state it"
        messages.append(f"note: {called(option)} does not apply to {where}")
    # Agencies deliver one channel in several files. Only the best of them counts.
    reasons = _repeated(read)
    repeats = [(record.source, why) for record, why in zip(read, reasons, strict=True) if why]
    omitted += [f"{source} ({why})" for source, why in repeats if source]
    # Records of a set have no file.
    if named_twice := sum(not source for source, _ in repeats):
        omitted.append(f"{named_twice} records of sets that are named twice")
    motions = [record for record, why in zip(read, reasons, strict=True) if not why]
    if omitted:
        messages.insert(0, f"left out: {'; '.join(omitted)}")
    if not motions:
        vertical = any(VERTICAL in why for why in omitted)
        hint = f"; {called('channel')} selects a vertical one" if vertical else ""
        others = f" ({messages[0]})" if omitted else ""
        raise ValueError(f"there is no horizontal record in {', '.join(names)}{others}{hint}")
    sizes = [(record.source or record.name, facts(record)["pga_g"]) for record in motions]
    low, (high, _) = _SMALLEST_PGA, PLAUSIBLE["pga"]
    if odd := [f"{name} ({number(x)} g)" for name, x in sizes if not low <= x <= high]:
        usual = f"usual are {low:g} to {high:g} g"
        wrong = f"the PGA is implausible ({usual}). Check the unit and the samples: {'; '.join(odd)}"
        messages.append(f"warning: {wrong}")
    for record in motions:
        a = np.abs(record.acceleration)
        # A mark of missing data has only nines in m/s^2, cm/s^2 or g.
        digits = (f"{a.max() / unit:.6g}".replace(".", "").strip("0") for unit in (1.0, STANDARD_GRAVITY))
        if np.sum(a > 0.999999 * a.max()) > 1 and any(re.fullmatch("9{3,}", x) for x in digits):
            wrong = "the largest sample has only nines and is repeated. Is it a mark of missing data?"
            messages.append(f"warning: {wrong} {record.source or record.name}")
    return list(motions), messages + _unknown(motions) + same_earthquakes(motions)


def _repeated(records: Sequence[Record]) -> list[str]:
    """Return words for why each record is left out in favour of another record; empty if the record counts.

    Each channel counts once, although agencies deliver it uncorrected and corrected, compressed and plain,
    and from a borehole as well.
    """
    seen: dict[Record, Record] = {}
    # Names may be in capitals or not, and agencies change only the extension, such as .V1 and .V2.
    names = [re.sub(r"[^\w/]|_", "", record.name.lower()).rpartition("/") for record in records]
    files = [re.sub(r"\.\w+(\.gz)?(, channel \d+.*)?$", "", record.source.lower()) for record in records]
    places = [(station, component, file) for (station, _, component), file in zip(names, files, strict=True)]
    reasons = []
    for record, place in zip(records, places, strict=True):
        # Two records are equal if all their fields except the names of the files are equal.
        first = seen.setdefault(record, record)
        pairs = zip(records, places, strict=True)
        better = (why for other, its in pairs if (why := _better(record, other, place, its)))
        reasons.append(f"the same as {first.source}" if first is not record else next(better, ""))
    for i, j in combinations(range(len(records)), 2):
        first, second, out = records[i], records[j], reasons[i] or reasons[j]
        likeness = 0.0 if out else _likeness(first, second, places[i], places[j])
        if likeness == 0.5:
            both = f"{first.source or first.name} and {second.source or second.name}"
            wrong = f"{both} may be one channel that was processed in two ways"
            raise ValueError(f"{wrong}: name only one of the files, or choose a column")
        if likeness == 1.0:
            # The choice depends on what the files contain, and not on their order.
            # The shortest step and the longest duration count.
            quality = {k: (-x.dt, x.duration, x.acceleration.tobytes()) for k, x in ((i, first), (j, second))}
            worse, kept = sorted(quality, key=quality.__getitem__)
            reasons[worse] = f"the same motion as {records[kept].source or records[kept].name}"
    return reasons


def _likeness(first: Record, second: Record, *places: tuple[str, ...]) -> float:
    """Return 1 for two copies of one motion, 0.5 for two processings of one channel, and 0 for two
    motions."""
    # Files that state different stations, components or earthquakes contain two motions.
    words = zip(places[0][:2], places[1][:2], strict=True)
    named = any(x and y and x != y and "column" not in x + y for x, y in words)
    named |= bool(first.event and second.event and not is_one(first.event, second.event))
    if named:
        return 0.0
    # A factor makes another motion.
    has_steps = abs(first.dt - second.dt) > 1e-6 * first.dt
    if factor := copy_factor(first, second):
        return float(abs(factor - 1.0) <= (_RESAMPLING if has_steps else _ROUNDING))
    if has_steps:
        return 0.0
    n = min(len(first.acceleration), len(second.acceleration))
    a, b = (x.acceleration[:n] for x in (first, second))
    if np.max(np.abs(a - b)) <= _ROUNDING * np.max(np.abs(a)):
        return 1.0
    # An offset of the instrument and a filter change a channel.
    a, b = a - a.mean(), b - b.mean()
    return 0.5 if a @ b > _CORRELATION * max(a @ a, b @ b) else 0.0


def _better(record: Record, other: Record, place: tuple[str, ...], its: tuple[str, ...]) -> str:
    """Return words for why another record counts instead of a record; empty if it does not.

    A place is the station, the component, and the name of the file without its extension.
    """
    # Two sensors of a station have recorded one pair of motions. An accelerometer counts first.
    one, two = (_TRACE.fullmatch(x.name) for x in (record, other))
    if one and two and one[1] == two[1] and record.event == other.event:
        rank, its_rank = (
            (match[3][1] != "N", x.dt, match[2], match[3]) for match, x in ((one, record), (two, other))
        )
        if its_rank < rank:
            return "another sensor of the station counts"
    # Most records have none of these notes, and count.
    marks = {*RAW, BOREHOLE} & {*record.notes} - {*other.notes}
    if not marks or (record.event and other.event and not is_one(record.event, other.event)):
        return ""
    is_one_station = place[0] == its[0] != ""
    if BOREHOLE in marks and is_one_station:
        return f"{BOREHOLE}; {other.source} is at the surface"
    # A corrected record replaces an uncorrected one of the same channel.
    is_raw = bool(marks & {*RAW}) and not {*RAW} & {*other.notes}
    is_one_channel = place[1] == its[1] and (is_one_station or place[2] == its[2])
    return f"uncorrected; {other.source} is corrected" if is_raw and is_one_channel else ""


def same_earthquakes(motions: Sequence[GroundMotion]) -> list[str]:
    """Return a sentence on the records that count as one earthquake although its name is written
    differently."""
    texts: dict[str, set[str]] = {}
    for record, name in zip(motions, events_of(motions), strict=True):
        texts.setdefault(name, set()).add(getattr(record, "event", "") or "an earthquake without a name")
    one = "; ".join(sorted(" = ".join(sorted(events)) for events in texts.values() if len(events) > 1))
    advice = "`records.events` (--event FILE=NAME) can state others"
    return [f"note: these count as one earthquake by dates, names or samples: {one}; {advice}"] if one else []


def facts(motion: Record) -> dict[str, Any]:
    """Return numbers and texts of a record for tables and JSON. The PGA is that of the file, without the
    scale."""
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
    """Return the facts of all records, and the notes on them, for JSON."""
    return {"files": [facts(m) for m in motions if isinstance(m, Record)], "notes": list(notes)}


def in_words(motions: Sequence[GroundMotion]) -> str:
    """Return the name of a pulse or record with its size and duration; for several records their number."""
    if len(motions) > 1:
        return f"{len(motions)} records"
    motion = motions[0]
    name = getattr(motion, "name", "") or getattr(motion, "kind", "motion")
    return f"{name}, {float(motion.pga):.4g} m/s^2 at most, {float(motion.duration):.4g} s"


def described(motions: Sequence[Any]) -> list[str]:
    """Return lines for a terminal about the records that were read: one line for each of a few, or one for
    all."""
    read = [facts(motion) for motion in motions if isinstance(motion, Record)]
    if len(read) > _MOST_LINES:
        # Show the smallest and the largest values. All values are in the report and in the JSON of the
        # command.
        ranges = []
        for key, digits in {"samples": 9, "step_s": 3, "duration_s": 3, "pga_g": 3}.items():
            values = [float(f[key]) for f in read]
            ranges.append(" to ".join(dict.fromkeys(number(x, digits) for x in (min(values), max(values)))))
        # Notes contain numbers: count only their kinds.
        kinds = Counter(getattr(note, "kind", note) for f in read for note in f["notes"])
        notes = "; ".join(f"{kind} {count}" for kind, count in kinds.items())
        return [
            f"records: {len(read)} of {len(set(events_of(motions)))} earthquakes, {ranges[0]} samples of "
            f"{ranges[1]} s, {ranges[2]} s long, PGA {ranges[3]} g" + (f"; notes: {notes}" if notes else "")
        ]
    lines = []
    for f in read:
        size = f"{f['samples']} samples of {number(f['step_s'])} s, {number(f['duration_s'])} s long"
        words = f"record: {f['source'] or f['name']}, {size}, PGA {number(f['pga_g'])} g"
        lines.append("; ".join([words, *f["notes"]]))
    return lines


def _unknown(records: Sequence[Any]) -> list[str]:
    """Return sentences on how many records state no orientation, and how many state no earthquake."""
    advice = "and count as one; state their earthquakes by `records.events` (--event FILE=NAME)"
    counts = {
        "orientation: used as horizontal": sum(UNKNOWN in record.notes for record in records),
        f"earthquake, {advice}": sum(not record.event for record in records),
    }
    several = {what: n for what, n in counts.items() if n and len(records) > 1}
    return [f"note: {n} of {len(records)} records state no {what}" for what, n in several.items()]


def _files_of(path: Path) -> tuple[list[Path], list[str]]:
    """Return the files of a path to be read, and words for the files of a folder that contain no
    acceleration."""
    if not path.exists():
        # A misspelt name of a built-in record looks like a file that does not exist.
        hint = meant(path.name, (*BUILT_IN, *SETS), listing=False)
        raise FileNotFoundError(f"the file does not exist: {path}{hint}")
    if not path.is_dir():
        return [path], []
    every = sorted(path.iterdir())
    files = [file for file in every if file.is_file() and not file.name.startswith(".")]
    others = (x for x in every if x not in files and not x.name.startswith("."))
    return files, [f"{x.name} ({'a folder in a folder' if x.is_dir() else 'no motion'})" for x in others]
