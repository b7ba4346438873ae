"""miniSEED and other files of seismology, through ObsPy, which is optional (`tpd[obspy]`)."""

from __future__ import annotations

import io
import warnings
from importlib import import_module
from typing import Any

import numpy as np

from tpd.formats.channel import Channel
from tpd.formats.orientation import orientation
from tpd.formats.text import UnreadableRecord
from tpd.formats.units import FACTORS, chosen


def read_waveforms(data: bytes, unit: str | None) -> list[Channel]:
    """Return the channels of a file that is no text.

    Raises:
        UnreadableRecord: ObsPy is missing or knows no such format, gaps, or counts of the instrument: nothing
            in such a file says what acceleration a count is.
    """
    stream = _opened(data)
    if len(stream) == 0:
        raise UnreadableRecord("the file holds no trace")
    identities = [trace.id for trace in stream]
    if len(set(identities)) < len(identities):
        raise UnreadableRecord(
            f"samples are missing: a channel has several pieces ({', '.join(identities[:9])})"
        )
    return [_channel(trace, unit) for trace in stream]


def _opened(data: bytes) -> Any:
    """The stream of ObsPy."""
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
            return obspy.read(io.BytesIO(data))
    except Exception:
        # Each of ObsPy's formats fails in its own way on a damaged file.
        raise UnreadableRecord("the file is no text, and ObsPy cannot read it") from None


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
