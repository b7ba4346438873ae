"""A recorded ground motion: horizontal base acceleration over time.

`Record` is a pytree like `tpd.scene.scene.Harmonic`. The readers of files are in `tpd.formats`, records that
come with the package in `tpd.records`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tpd.core import checks
from tpd.core.checks import Real
from tpd.core.files import path_of
from tpd.formats.channel import GREATEST_PEAK
from tpd.scene.ground_motion import GroundMotion

STEPS = 1e-6, 1e3
"""Least and largest step between samples, s."""

if TYPE_CHECKING:
    from tpd.formats.channel import Channel


@dataclass(frozen=True, eq=False)
class Record(GroundMotion):
    """Horizontal base acceleration at equal steps: linear between samples, zero before the first and after
    the last. Leaves of the pytree are the acceleration, the step and the scale; the words are static.

    Two records are equal if all their fields but `source` are.

    Raises:
        ValueError: fewer than two samples, a number that is not finite, a step that is not positive, or a
            peak above 100 m/s^2.
    """

    acceleration: Any
    """(n,), m/s^2, n of 2 or more; a list is copied into an array."""
    dt: Real
    """Step between samples, s."""
    scale: Real = field(default=1.0, kw_only=True)
    """Factor on the acceleration."""
    name: str = field(default="", kw_only=True)
    """Station and component."""
    event: str = field(default="", kw_only=True)
    """The earthquake: records of one earthquake have the same."""
    notes: tuple[str, ...] = field(default=(), kw_only=True)
    """Remarks of the reader, such as that the record is uncorrected."""
    source: str = field(default="", kw_only=True, compare=False)
    """The file that the record was read from, and the number of the channel where the file has several."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "acceleration", _samples(self.acceleration))
        checks.set_checked(self, checks.within, "dt", *STEPS, " s")
        checks.set_checked(self, checks.number, "scale")
        for name in ("name", "event", "source"):
            checks.instance(name, getattr(self, name), str)
        if not (isinstance(self.notes, tuple) and all(isinstance(note, str) for note in self.notes)):
            raise ValueError(f"`notes` must be a tuple of strings, but is {checks.shown(self.notes)}")
        known = checks.is_concrete(self.acceleration) and checks.is_concrete(self.scale)
        if known and float(self.pga) > GREATEST_PEAK:
            raise ValueError(
                f"`acceleration` must be at most {GREATEST_PEAK:g} m/s^2 at its peak, but is "
                f"{float(self.pga):g} m/s^2: is it in cm/s^2?"
            )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record):
            return NotImplemented
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self) if f.compare)
        return all(np.array_equal(mine, theirs) for mine, theirs in pairs)

    def __hash__(self) -> int:
        return hash((self.name, self.event, np.shape(self.acceleration)))

    @property
    def pga(self) -> Real:
        """Peak ground acceleration, m/s^2, with the scale."""
        xp = checks.namespace(self.acceleration, self.scale)
        return xp.max(xp.abs(self.acceleration)) * xp.abs(self.scale)

    @property
    def pgv(self) -> Real:
        """Peak ground velocity (m/s) at the samples, with the scale: the integral of the acceleration by
        trapezoids, from rest."""
        xp = checks.namespace(self.acceleration, self.dt, self.scale)
        a = self.acceleration
        velocity = xp.cumsum(0.5 * (a[1:] + a[:-1])) * self.dt
        return xp.max(xp.abs(velocity)) * xp.abs(self.scale)

    @property
    def duration(self) -> Real:
        """Time from the first sample to the last, s."""
        return (np.shape(self.acceleration)[0] - 1) * self.dt

    def scaled(self, factor: Real) -> Record:
        """Return the record with its scale multiplied by a factor."""
        return replace(self, scale=self.scale * checks.number("factor", factor))

    @property
    def piece(self) -> Real:
        """Step between samples, s."""
        return self.dt

    def pieces(self) -> Any:
        """Acceleration over `pga` from sample to sample; see
        `tpd.scene.ground_motion.GroundMotion.pieces`."""
        xp = checks.namespace(self.acceleration, self.scale)
        a = self.acceleration * xp.sign(self.scale)
        peak = xp.max(xp.abs(a))
        # A record of zeros is one of zeros over any peak.
        a = a / xp.where(peak > 0.0, peak, 1.0)
        zero = xp.zeros_like(a[1:])
        return xp.stack([a[:-1], a[1:] - a[:-1], zero, zero], axis=1)

    @staticmethod
    def read(
        path: str | os.PathLike[str],
        *,
        channel: int | None = None,
        dt: float | None = None,
        baseline: str | None = None,
        unit: str | None = None,
        columns: Mapping[str, int] | str | None = None,
        skip: int = 0,
        scale: float = 1.0,
    ) -> Record:
        """Return one channel of a file. The format is recognised by the content: PEER AT2, CSMIP V1 and V2,
        COSMOS, USGS SMC, ESM, K-NET and KiK-net, GeoNet V1A and V2A, a table of text, each as it is or
        compressed by gzip; others through ObsPy (`tpd[obspy]`).

        A table is read as it is only if its whole header is understood: `tpd.formats.table` has the grammar.
        `columns`, `skip`, `unit` and `dt` read any other table. An option that contradicts what the file
        states is refused.

        Args:
            path: of the file.
            channel: number of the channel, from 0 in the order of the file. A file of one channel needs none.
            dt: step in s of a table that has accelerations only.
            baseline: "mean" removes the mean, "linear" the straight line of least squares, "none" nothing.
                Default: the mean, where the file states that the record is not corrected, or its format holds
                records as they are recorded. A table of text is read as it is.
            unit: of the acceleration, such as "g", "m/s2", "cm/s2" or "gal", of a file that states none.
            columns: numbers of the columns of a table, from 1, by their names, such as
                `{"time (ms)": 1, "N": 2, "E (gal)": 3}`; columns without a name are left out. "rows" if the
                samples follow one another, row by row.
            skip: number of lines at the top of a table that are not read.
            scale: factor on all samples, for a file whose numbers have to be multiplied.

        Raises:
            ValueError: a file that is damaged, incomplete, contradicts itself or is of no known format, or
                several channels of which none is chosen; one sentence.
            FileNotFoundError: no such file.
        """
        from tpd.formats.read import Options, one_channel

        how = Options(dt, baseline, unit, columns, skip, scale)
        return _of(one_channel(path_of(path), channel, how))

    @staticmethod
    def read_all(
        path: str | os.PathLike[str],
        *,
        dt: float | None = None,
        baseline: str | None = None,
        unit: str | None = None,
        columns: Mapping[str, int] | str | None = None,
        skip: int = 0,
        scale: float = 1.0,
    ) -> list[Record]:
        """Return all channels of a file, in its order; vertical ones have a note. Arguments and errors are
        those of `read`."""
        from tpd.formats.read import Options, channels

        how = Options(dt, baseline, unit, columns, skip, scale)
        return [_of(c) for c in channels(path_of(path), how)]


def _of(channel: Channel) -> Record:
    """The record of a channel of a file."""
    words = {name: getattr(channel, name) for name in ("name", "event", "notes", "source")}
    return Record(channel.acceleration, channel.dt, **words)


def _samples(value: Any) -> Any:
    """Checked samples: those of NumPy or of a list as an array that nobody can write to."""
    wanted = "an array of two accelerations or more"
    found = checks.array("acceleration", value, (-1,), wanted)
    if len(found) < 2:
        raise ValueError(f"`acceleration` must be {wanted}, but is {checks.shown(value)}")
    if checks.is_jax(value):
        return checks.plain("acceleration", value)
    array = np.array(found)
    array.flags.writeable = False
    return array
