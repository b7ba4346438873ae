"""Read the channels of a file. The format is recognised from the content.

miniSEED and other formats of seismology are read by ObsPy, which is optional (the extra `obspy`).
"""

from __future__ import annotations

import gzip
import io
import re
import warnings
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core.files import label_of
from tpd.core.formatting import called, install
from tpd.formats import cosmos, csmip, esm, geonet, knet, peer, smc
from tpd.formats.channel import (
    UNSTATED,
    Channel,
    check_channel,
    event_of,
    factor_of,
    note_direction,
    orientation,
    scale_channel,
)
from tpd.formats.table import Options as Options
from tpd.formats.table import columns_in_words, overview, read_table
from tpd.formats.text import Cursor, NoAcceleration, StatedByFile, UnreadableRecord, quote

_MOST = 200_000_000
"""Largest number of bytes of a file, also after decompression."""
_GZIP = b"\x1f\x8b"
_BINARY = re.compile(rb"[\x00-\x08\x0e-\x19\x1b-\x1f]")
"""Bytes that do not occur in a text. Old systems used 0x1a to end and to fill files."""

_TABLE = "save time in s and acceleration as a table of text, such as CSV"
_SAVE = "save the acceleration as a table in m/s2"
_MATLAB_4 = rb"[\x00-\x34]\x00{3}.{8}[\x00\x01]\x00{3}.\x00{3}[A-Za-z]\w*\x00"
"""MATLAB 4 files contain no name of the format, only sizes and the name of the first array."""
_WORKBOOK = rb"PK\x03\x04.*(?:xl/(?:workbook|worksheets)|opendocument\.spreadsheet)|\xd0\xcf\x11\xe0\xa1\xb1"
_ARRAYS = rb"MATLAB \d\.\d MAT-file|\x93NUMPY|PK\x03\x04.*\.npy|\x89HDF\r\n|CDF[\x01\x02\x05]|PAR1.*PAR1$|"
_ARRAYS += rb"ARROW1\x00|FEA1.*FEA1$|SQLite format 3\x00|RDX[23]\n|[XA]\n\x00\x00\x00[\x02\x03]|"
_ARRAYS += rb"\x80[\x02-\x05].*\.$|"
_PACKED = rb"PK\x03\x04|PK\x05\x06|7z\xbc\xaf|Rar!\x1a\x07|BZh|\xfd7zXZ\x00|\x28\xb5\x2f\xfd|\x1f\x9d|"
_PACKED += rb".{257}ustar"
_NO_TEXT = (
    (_WORKBOOK, "a workbook (.xlsx, .ods, .xls)", "save the sheet as CSV"),
    (_ARRAYS + _MATLAB_4, "data of another program, such as NumPy, MATLAB, HDF5 or R", _TABLE),
    (rb"PK\x03\x04.*\[Content_Types\]|%PDF-|\{\\rtf", "a document (.docx, .pdf, .rtf)", _TABLE),
    (rb"\x89PNG\r\n|\xff\xd8\xff|GIF8[79]a", "a picture", _TABLE),
    (rb"(?i:(?:\xef\xbb\xbf)?\s*<(?:\?xml|!doctype|html))", "a page of HTML or XML", _TABLE),
    (_PACKED, "an archive or compressed (zip, 7z, rar, bzip2, xz, zstd, tar)", "unpack it first"),
)
"""Patterns at the beginning of files that are not plain text, the kind of such a file, and the remedy."""
_START = 100_000
"""Number of bytes that are searched at the beginning and at the end. A zip archive ends with its list of
files."""
_SPECTRA = re.compile(
    r"\s*(?:\d\s+)?(?:response|fourier)\b.*\bspectr(?:a|um)\b(?!.*(?:compatible|match))", re.IGNORECASE
)
"""Pattern of the first line of a file with spectra, which agencies deliver together with accelerations."""
_SAC = {
    "idep": {6: "displacement", 7: "velocity", 50: "volts"},
    "iftype": {2: "spectrum", 3: "spectrum", 4: "graph of two quantities", 51: "volume"},
}
"""Contents of a SAC file other than an acceleration, by field of the header and by its value."""
_SEG_Y = {1: "pressure", 2: "volts", 3: "volts", 4: "current", 5: "displacement", 6: "velocity", 8: "force"}
"""Contents of a SEG-Y file other than an acceleration, by the code of its unit."""
_NO_SEED = r"(?:EW|UD|CH)\d|VER|VRT|LON|TRA|TRN|RAD|HOR|VEL|DIS"
"""Pattern of names of channels that look like a SEED code."""
_SEED = re.compile(rf"(?!{_NO_SEED})[BCDEFGHLMOPQRSTUVW]([A-Z])[A-Z0-9]")
"""Pattern of a SEED code: rate, instrument and direction."""
_INSTRUMENTS = {"H": "velocity", "L": "velocity", "P": "velocity", "D": "pressure", "J": "rotation"}
_INSTRUMENTS |= {"A": "tilt", "K": "temperature", "W": "wind", "S": "strain", "F": "a magnetic field"}
"""Contents of a channel by the second letter of its SEED code. N is an accelerometer."""
_WORDS = {"VEL": "velocity", "DIS": "displacement", "DSP": "displacement"}
"""Contents of a channel by its name."""
Reader = Callable[[Cursor, str | None], list[Channel]]
_FORMATS: tuple[tuple[Callable[[Sequence[str]], bool], Reader], ...] = (
    (cosmos.is_cosmos, cosmos.read_cosmos),
    (smc.is_smc, smc.read_smc),
    (geonet.is_geonet, geonet.read_geonet),
    (csmip.is_csmip, csmip.read_csmip),
    (esm.is_esm, esm.read_esm),
    (knet.is_knet, knet.read_knet),
    (knet.is_knet_csv, knet.read_knet_csv),
    (peer.is_peer, peer.read_peer),
)
"""Tests whether lines are in a format, and the readers of the formats."""


def channels(file: Path, how: Options) -> list[Channel]:
    """Return all channels of a file after checks. Options and errors are those of `tpd.Record.read`."""
    channels, label = list[Channel](), label_of(file)
    try:
        read = _of_bytes(_content(file), how)
        for i, channel in enumerate(read):
            if len(read) > 1:
                component = f" ({channel.component})" if channel.component else ""
                label = f"{label_of(file)}, channel {i}{component}"
            # Files round their step, so a small difference is no contradiction.
            if how.dt is not None and abs(how.dt - channel.dt) > 1e-6 * channel.dt:
                wrong = f"the file states a step of {channel.dt:g} s, but {called('dt')} is {how.dt:g} s"
                raise StatedByFile(wrong, "dt")
            channel = note_direction(check_channel(scale_channel(channel, how.factor), how.baseline))
            channels.append(replace(channel, source=label, event=event_of(channel.event)))
    # Of several files the message must name the one that is wrong.
    except UnreadableRecord as error:
        error.args = (f"{label}: {error.args[0]}",)
        raise
    return channels


def one_channel(file: Path, channel: int | None, how: Options) -> Channel:
    """Return one channel of a file. Options and errors are those of `tpd.Record.read`."""
    if channel is not None and (not isinstance(channel, int) or isinstance(channel, bool)):
        raise ValueError(f"{called('channel')} must be a whole number, but is {channel!r}")
    every = channels(file, how)
    if channel is None and len(every) == 1:
        return every[0]
    if channel is None or not 0 <= channel < len(every):
        each = (f"{i}: {c.component or 'unnamed'} ({c.peak:.3g} m/s^2)" for i, c in enumerate(every))
        name = called("channel")
        wrong = f"choose one by {name}" if channel is None else f"{name} is {channel}"
        raise UnreadableRecord(f"{label_of(file)}: the file has the channels {', '.join(each)}; {wrong}")
    return every[channel]


def _content(file: Path) -> bytes:
    """Return the bytes of a file, decompressed.

    Raises:
        FileNotFoundError: the file does not exist.
        UnreadableRecord: the path is a directory, or the file cannot be opened, is empty or is too large.
    """
    if not file.exists():
        raise FileNotFoundError(f"the file does not exist: {file}")
    if file.is_dir():
        raise UnreadableRecord("the path is a directory and not a file")
    try:
        # Read one byte more than allowed, to detect a file that is too large.
        with file.open("rb") as stream:
            data = stream.read(_MOST + 1)
    except OSError as error:
        raise UnreadableRecord(f"the file cannot be read ({error.strerror})") from None
    if data.startswith(_GZIP):
        try:
            with gzip.open(file) as stream:
                data = stream.read(_MOST + 1)
        except (OSError, EOFError, zlib.error):
            raise UnreadableRecord("the compressed file is damaged or cut") from None
    if len(data) > _MOST:
        raise UnreadableRecord(f"a file must have at most {_MOST} bytes")
    if not data.strip():
        raise NoAcceleration("the file is empty", "an empty file")
    return data


def _from_utf_16(data: bytes) -> bytes:
    """Return text in UTF-16, which some programs of Windows write, as UTF-8; other bytes unchanged."""
    if not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        if len(data) > 8 and (set(data[1:64:2]) == {0} or set(data[0:64:2]) == {0}):
            raise UnreadableRecord("the text is UTF-16 without a byte order mark: save it as UTF-8")
        return data
    try:
        return data.decode("utf-16").encode()
    except UnicodeDecodeError:
        raise UnreadableRecord("the text is UTF-16, but damaged or cut: save it as UTF-8") from None


def _of_bytes(data: bytes, how: Options) -> list[Channel]:
    """Return the channels from the bytes of a file."""
    # A zip archive ends with the list of its files, and a Parquet file or a pickle with a mark.
    ends = data if len(data) < 2 * _START else data[:_START] + data[-_START:]
    for pattern, kind, remedy in _NO_TEXT:
        if re.match(pattern, ends, re.DOTALL):
            raise NoAcceleration(f"the file is {kind}: {remedy}", kind)
    data = _from_utf_16(data)
    # A text contains no control characters, so a file with one is not a text or is damaged.
    if _BINARY.search(data):
        return read_waveforms(data, how.unit)
    cursor = _lines_of(data)
    # Options about columns state that the file is a table, whatever its words are.
    if how.columns is not None or how.skip:
        return read_table(cursor, how)
    if _SPECTRA.match(cursor.peek()):
        raise NoAcceleration(f"a motion is needed, but line 1 is {quote(cursor.peek())}", "response spectrum")
    # The reader that recognises a file must read it, even if the file is damaged. A damaged file must not be
    # read as a table.
    reader = _reader_of(cursor)
    return reader(cursor, how.unit) if reader else read_table(cursor, how)


def _lines_of(data: bytes) -> Cursor:
    """Return the lines of a text."""
    text = data.rstrip(b"\x1a")
    try:
        decoded = text.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Older files may have names of stations in another encoding. In Latin-1 every byte is a character.
        decoded = text.decode("latin-1")
    lines = re.split(r"\r\n|\n|\r", decoded)
    whole = lines[-1] == ""
    # If the byte 0x1a ends the file, its last line may have no line break.
    return Cursor(lines[:-1] if whole else lines, ended=whole or text != data)


def _reader_of(cursor: Cursor) -> Reader | None:
    """Return the reader of the format of a text; None for a table."""
    return next((reader for is_format, reader in _FORMATS if is_format(cursor.lines)), None)


def contents(file: Path, how: Options) -> list[str]:
    """Return lines that show what a file contains: the first lines and the columns of a table, or the
    channels of any other format, in m/s^2."""
    data = _from_utf_16(_content(file))
    if not _BINARY.search(data):
        cursor = _lines_of(data)
        if how.columns is not None or how.skip or not _reader_of(cursor):
            return overview(cursor.lines, how.skip)
    names = ((f"{i} {c.component}".strip(), c.acceleration) for i, c in enumerate(channels(file, how)))
    return ["  channels in m/s^2:", *columns_in_words(dict(names))]


def read_waveforms(data: bytes, unit: str | None) -> list[Channel]:
    """Return the channels of a file that is not a text, by ObsPy.

    Raises:
        UnreadableRecord: ObsPy is missing or does not know the format, samples are missing, or the samples
            are counts of the instrument, whose factor such a file does not contain.
    """
    try:
        # ObsPy prints warnings about its own dependencies when it is imported.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            obspy = import_module("obspy")
    except ImportError:
        needs = "miniSEED and other formats of seismology need the extra `obspy`"
        raise NoAcceleration(f"the file is not a text; {needs}: {install('obspy')}") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            stream = obspy.read(io.BytesIO(data))
    except Exception:
        # Each format of ObsPy raises other exceptions for a damaged file.
        raise NoAcceleration("the file is not a text, and ObsPy cannot read it") from None
    if len(stream) == 0:
        raise UnreadableRecord("the file contains no trace")
    identities = [trace.id for trace in stream]
    if len(set(identities)) < len(identities):
        pieces = ", ".join(identities[:9])
        raise UnreadableRecord(f"samples are missing: a channel has several pieces ({pieces})")
    return [_channel(trace, unit) for trace in stream]


def _channel(trace: Any, unit: str | None) -> Channel:
    """Return the channel from a trace of ObsPy."""
    # ObsPy masks the gaps where it has merged pieces of a channel.
    samples = trace.data
    if np.ma.is_masked(samples):
        raise UnreadableRecord(f"samples of {trace.id} are missing")
    if not np.issubdtype(samples.dtype, np.floating):
        remedy, content = f"remove its response with ObsPy and {_SAVE}", "counts of the instrument"
        raise NoAcceleration(f"{trace.id} contains {content}: {remedy}", content)
    stats, sac = trace.stats, getattr(trace.stats, "sac", {})
    code, notes = str(stats.channel).upper(), list[str]([UNSTATED])
    seg_y = (getattr(stats, name, {}).get("trace_header") for name in ("segy", "su"))
    # CyberShake simulates velocities, and its files do not state it.
    # All statements of the file about its contents count, wherever they are.
    contents = ["velocity" if getattr(stats, "_format", "") == "CYBERSHAKE" else None, _WORDS.get(code)]
    contents += [values.get(sac.get(field, 0)) for field, values in _SAC.items()]
    contents += [_SEG_Y.get(getattr(header, "trace_value_measurement_unit", 0)) for header in seg_y]
    if (seed := _SEED.fullmatch(code)) and seed[1] in "HL":
        # An acceleration is the derivative of what a seismometer measures.
        notes.append(f"the code {code} is that of a seismometer: its samples count as accelerations")
    elif seed and seed[1] != "N":
        contents.append(_INSTRUMENTS.get(seed[1], f"the instrument {seed[1]} of {code}"))
    if content := next(filter(None, contents), ""):
        wrong = f"{trace.id} contains no acceleration: its header or format states {content}"
        raise NoAcceleration(wrong, content)
    if (factor := getattr(stats, "calib", 1.0)) != 1.0:
        meaning = f"which may be missing in the samples: apply it with ObsPy and {_SAVE}"
        raise UnreadableRecord(f"the header of {trace.id} states the factor {factor:g}, {meaning}")
    values = np.array(samples, dtype=float)
    if not np.isfinite(values).all():
        raise UnreadableRecord(f"{trace.id} contains numbers that are not finite")
    # Such files state no unit, so the user must pass it.
    factor, event, component = factor_of(None, unit), str(stats.starttime)[:10], stats.channel
    # This date is the default of files without one.
    event = "" if event == "1970-01-01" else event
    # SAC files also state the angle between a component and the vertical.
    if orientation(component) is None and sac.get("cmpinc") in (0.0, 180.0):
        component = f"{component} up".strip()
    return Channel(values * factor, float(stats.delta), component, trace.id, event, tuple(notes))
