"""From a file to its channels: the format is recognised by the content.

miniSEED and other files of seismology are read through ObsPy, which is optional (`tpd[obspy]`).
"""

from __future__ import annotations

import gzip
import io
import os
import re
import warnings
import zlib
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from tpd.formats import cosmos, csmip, esm, geonet, knet, peer, smc
from tpd.formats.channel import (
    BASELINES,
    FACTORS,
    Channel,
    checked,
    chosen,
    directed,
    given,
    of_file,
    orientation,
    without_baseline,
)
from tpd.formats.table import read_table
from tpd.formats.text import Cursor, UnreadableRecord

_MOST = 200_000_000
"""Most bytes of a file, also when it is decompressed."""
_GZIP = b"\x1f\x8b"
_BINARY = re.compile(rb"[\x00-\x08\x0e-\x19\x1b-\x1f]")
"""Bytes that no text has; 0x1a ended and filled files of old systems."""

_ARCHIVES = {
    b"PK\x03\x04": "zip",
    b"PK\x05\x06": "zip, and empty",
    b"7z\xbc\xaf\x27\x1c": "7z",
    b"Rar!\x1a\x07": "rar",
    b"BZh": "bzip2",
    b"\xfd7zXZ\x00": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\x1f\x9d": "compress",
}
"""First bytes of archives and of compressed files other than gzip."""
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


def channels(
    path: str | os.PathLike[str], *, dt: float | None, baseline: str | None, unit: str | None
) -> list[Channel]:
    """Return all channels of a file, checked. Arguments and errors are those of `tpd.Record.read`."""
    if unit is not None:
        given(unit)
    if baseline is not None and baseline not in BASELINES:
        raise ValueError(f"`baseline` must be one of {', '.join(BASELINES)} or None, but is {baseline!r}")
    number = isinstance(dt, (int, float)) and not isinstance(dt, bool)
    if dt is not None and not (number and 0.0 < dt < float("inf")):
        raise ValueError(f"`dt` must be positive and finite, in s, but is {dt!r}")
    file = Path(path)
    try:
        read = [checked(channel) for channel in _of_bytes(_content(file), dt, unit)]
        # The name of a file of several channels is that of none of them.
        named = of_file(file.name) if len(read) == 1 else None
        found = [directed(channel, named) for channel in read]
        for channel in found:
            if dt is not None and abs(dt - channel.dt) > 1e-6 * channel.dt:
                raise UnreadableRecord(f"the file states a step of {channel.dt:g} s, but `dt` is {dt:g} s")
    except UnreadableRecord as error:
        raise UnreadableRecord(f"{file.name}: {error}") from None
    return found if baseline is None else [without_baseline(channel, baseline) for channel in found]


def one_channel(
    path: str | os.PathLike[str],
    *,
    channel: int | None,
    dt: float | None,
    baseline: str | None,
    unit: str | None,
) -> Channel:
    """Return one channel of a file. Arguments and errors are those of `tpd.Record.read`."""
    if channel is not None and (not isinstance(channel, int) or isinstance(channel, bool)):
        raise ValueError(f"`channel` must be a whole number, but is {channel!r}")
    found = channels(path, dt=dt, baseline=baseline, unit=unit)
    if channel is None and len(found) == 1:
        return found[0]
    if channel is None or not 0 <= channel < len(found):
        listed = ", ".join(
            f"{i}: {c.component or 'unnamed'} ({c.peak:.3g} m/s^2)" for i, c in enumerate(found)
        )
        wrong = "choose one by `channel`" if channel is None else f"`channel` is {channel}"
        raise UnreadableRecord(f"{Path(path).name}: the file has the channels {listed}; {wrong}")
    return found[channel]


def _content(file: Path) -> bytes:
    """Bytes of a file, decompressed.

    Raises:
        FileNotFoundError: no such file.
        UnreadableRecord: a directory, a file that cannot be opened, is empty or too large.
    """
    if not file.exists():
        raise FileNotFoundError(f"no such file: {file}")
    if file.is_dir():
        raise UnreadableRecord("a directory is no file of ground motion")
    try:
        # One byte more than allowed shows that there are more.
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
        raise UnreadableRecord("the file is empty")
    return data


def _from_utf_16(data: bytes) -> bytes:
    """Text of UTF-16, as some programs of Windows save it, in UTF-8; other bytes as they are."""
    if not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        if len(data) > 8 and (set(data[1:64:2]) == {0} or set(data[0:64:2]) == {0}):
            raise UnreadableRecord("the text is UTF-16 without a byte order mark: save it as UTF-8")
        return data
    try:
        return data.decode("utf-16").encode()
    except UnicodeDecodeError:
        raise UnreadableRecord("the text is UTF-16, but damaged or cut: save it as UTF-8") from None


def _of_bytes(data: bytes, dt: float | None, unit: str | None) -> list[Channel]:
    # No format of text has control characters: damage of one byte is damage.
    for mark, kind in _ARCHIVES.items():
        if data.startswith(mark):
            raise UnreadableRecord(f"the file is an archive or compressed ({kind}): unpack it first")
    if data[257:262] == b"ustar":
        raise UnreadableRecord("the file is an archive (tar): unpack it first")
    data = _from_utf_16(data)
    if _BINARY.search(data):
        return read_waveforms(data, unit)
    text = data.rstrip(b"\x1a")
    try:
        decoded = text.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Names of stations of older files; every byte is a character there.
        decoded = text.decode("latin-1")
    lines = re.split(r"\r\n|\n|\r", decoded)
    whole = lines[-1] == ""
    # Where 0x1a ends the file, its last line may have no end of its own.
    cursor = Cursor(lines[:-1] if whole else lines, ended=whole or text != data)
    if "RENADIC" in " ".join(cursor.lines[:15]).upper():
        raise UnreadableRecord(
            "the format of RENADIC (Chile) is not read: save time in s and acceleration as two columns, with "
            "a header that states the unit"
        )
    # A reader that recognises a file keeps it, sound or not: a damaged one must not pass for a table.
    for known, reader in _FORMATS:
        if known(cursor.lines):
            return reader(cursor, unit)
    return read_table(cursor, dt, unit)


def read_waveforms(data: bytes, unit: str | None) -> list[Channel]:
    """Return the channels of a file that is no text.

    Raises:
        UnreadableRecord: ObsPy is missing or knows no such format, gaps, or counts of the instrument: nothing
            in such a file says what acceleration a count is.
    """
    try:
        # ObsPy warns of its own dependencies on import.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            obspy = import_module("obspy")
    except ImportError:
        raise UnreadableRecord(
            "the file is no text; miniSEED and other formats of seismology need the extra tpd[obspy]: "
            "pip install 'tpd[obspy]'"
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            stream = obspy.read(io.BytesIO(data))
    except Exception:
        # Each of ObsPy's formats fails in its own way on a damaged file.
        raise UnreadableRecord("the file is no text, and ObsPy cannot read it") from None
    if len(stream) == 0:
        raise UnreadableRecord("the file holds no trace")
    identities = [trace.id for trace in stream]
    if len(set(identities)) < len(identities):
        raise UnreadableRecord(
            f"samples are missing: a channel has several pieces ({', '.join(identities[:9])})"
        )
    return [_channel(trace, unit) for trace in stream]


def _channel(trace: Any, unit: str | None) -> Channel:
    # Gaps are masked where pieces of a channel were merged.
    samples = trace.data
    if np.ma.is_masked(samples):
        raise UnreadableRecord(f"samples of {trace.id} are missing")
    if not np.issubdtype(samples.dtype, np.floating):
        raise UnreadableRecord(
            f"{trace.id} holds counts of the instrument: remove its response with ObsPy and save the "
            "acceleration as a table in m/s2"
        )
    values = np.array(samples, dtype=float)
    if not np.isfinite(values).all():
        raise UnreadableRecord(f"{trace.id} holds numbers that are not finite")
    # Such files have no unit of their own: the user must know it.
    factor = FACTORS[chosen(None, unit)]
    event = str(trace.stats.starttime)[:10]
    component = trace.stats.channel
    # SAC also states the angle of a component from the vertical.
    if orientation(component) is None and getattr(trace.stats, "sac", {}).get("cmpinc") in (0.0, 180.0):
        component = f"{component} up".strip()
    return Channel(values * factor, float(trace.stats.delta), component, trace.id, event)
