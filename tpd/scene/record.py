"""Record: a recorded ground motion as horizontal base acceleration over time.

`Record` is a pytree like `tpd.scene.scene.Harmonic`. The readers of files are in `tpd.formats`, and the
records of the package are in `tpd.records`.
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
"""Smallest and largest time step between samples, s."""
_BUILDINGS, _PER_PERIOD, _REST = (0.01, 20.0), 40, 0.01
"""Shortest and longest period of a building, s; smallest number of samples in it; and share of a free motion
at which it counts as rest."""

if TYPE_CHECKING:
    from tpd.formats.channel import Channel


@dataclass(frozen=True, eq=False)
class Record(GroundMotion):
    """Horizontal base acceleration at equal time steps, linear between samples, and zero before and after
    them.

    The fields are the `acceleration` in m/s^2, shape (n,), the time step `dt` in s, and a factor `scale`;
    `name` is station and component, `event` the earthquake, `notes` are remarks of the reader, and `source`
    is the file. Leaves of the pytree are the acceleration, the step and the scale; the texts are static. Two
    records are equal if all their fields except `source` are equal.

    Raises:
        ValueError: there are fewer than two samples, a number is not finite, the step is not positive, or the
            peak is above 100 m/s^2.

    Example:
        >>> import tpd
        >>> record = tpd.Record([0.0, 1.0, -2.0, 0.0], 0.01)
        >>> float(record.pga), round(record.duration, 4)
        (2.0, 0.03)
    """

    acceleration: Any
    """Samples, shape (n,), m/s^2, n at least 2. A list is copied into an array."""
    dt: Real
    """Time step between samples, s."""
    scale: Real = field(default=1.0, kw_only=True)
    """Factor on the acceleration."""
    name: str = field(default="", kw_only=True)
    """Station and component."""
    event: str = field(default="", kw_only=True)
    """Name of the earthquake, with the date as 1979-10-15 or the year at its end. All records without a name
    count as one earthquake."""
    notes: tuple[str, ...] = field(default=(), kw_only=True)
    """Remarks of the reader, for example that the record is uncorrected."""
    source: str = field(default="", kw_only=True, compare=False)
    """File of the record, with the number of the channel if the file has several."""
    ground: Record | None = field(default=None, kw_only=True, compare=False)
    """Record of the ground below a building on which this motion acts, at a scale of 1; None for a motion of
    the ground."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "acceleration", _samples(self.acceleration))
        checks.set_checked(self, checks.within, "dt", *STEPS, " s")
        checks.set_checked(self, checks.number, "scale")
        for name in ("name", "event", "source"):
            checks.instance(name, getattr(self, name), str)
        if not (isinstance(self.notes, tuple) and all(isinstance(note, str) for note in self.notes)):
            raise ValueError(f"`notes` must be a tuple of strings, but is {checks.quote(self.notes)}")
        # A record in cm/s^2 is a hundred times too large, and would pass all other checks.
        most = "the largest plausible peak in m/s^2 (a larger one is in cm/s^2)"
        checks.at_most("acceleration", self.pga, GREATEST_PEAK, most)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record):
            return NotImplemented
        # Arrays have no single truth value, so the generated comparison of a dataclass would fail.
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self) if f.compare)
        return all(np.array_equal(mine, theirs) for mine, theirs in pairs)

    def __hash__(self) -> int:
        return hash((self.name, self.event, np.shape(self.acceleration)))

    @property
    def pga(self) -> Real:
        """Peak ground acceleration, m/s^2, including the scale."""
        return checks.largest(self.acceleration) * abs(self.scale)

    @property
    def pgv(self) -> Real:
        """Peak ground velocity (m/s), at a sample or between two of them, including the scale.

        The velocity is the integral of the acceleration, starting at rest.
        """
        xp = checks.namespace(self.acceleration, self.dt, self.scale)
        a, b = self.acceleration[:-1], self.acceleration[1:]
        ends = xp.cumsum(0.5 * (a + b))
        # Between two samples of opposite sign the velocity is largest where the acceleration is zero.
        turns = ends - 0.5 * (a + b) + xp.where(a * b < 0.0, 0.5 * a**2 / xp.where(a == b, 1.0, a - b), 0.0)
        return checks.largest(xp.concatenate([ends, turns])) * self.dt * xp.abs(self.scale)

    @property
    def duration(self) -> Real:
        """Time from the first sample to the last sample, s."""
        return (np.shape(self.acceleration)[0] - 1) * self.dt

    def scaled(self, factor: Real) -> Record:
        """Return the record with its scale multiplied by a factor."""
        return replace(self, scale=self.scale * checks.number("factor", factor))

    @property
    def at_ground(self) -> Record:
        """See `GroundMotion.at_ground`."""
        return self if self.ground is None else self.ground.scaled(self.scale)

    def on_building(self, period: Real, damping: Real = 0.05) -> Record:
        """Return the absolute acceleration at the mass of an oscillator that this record shakes.

        The oscillator stands for the mode of a building that moves the block. The motion is exact for an
        acceleration that is linear between samples, and is sampled 40 times in a period. It lasts until the
        building has come to rest. Intensities such as PGA remain those of the ground.

        Args:
            period: natural period of the building, s.
            damping: its damping ratio.

        Raises:
            ValueError: a number is out of range, or the record is already one on a building.

        Example:
            >>> import numpy as np, tpd
            >>> ground = tpd.Record(np.sin(np.arange(4000) * 0.01 * 2.0 * np.pi), 0.01)
            >>> roof = ground.on_building(0.5, 0.05)
            >>> round(float(roof.pga), 2), round(float(roof.at_ground.pga), 2)
            (1.62, 1.0)
        """
        from scipy.signal import lsim

        if self.ground is not None:
            raise ValueError(f"the record must be one of the ground, but {self.name!r} is one on a building")
        rate = 2.0 * np.pi / checks.within("period", period, *_BUILDINGS, " s")
        damping = checks.within("damping", damping, 0.005, 0.5)
        a, step = np.asarray(self.acceleration, dtype=float), float(self.dt)
        fine = max(1, int(np.ceil(step * rate * _PER_PERIOD / (2.0 * np.pi))))
        tail = int(np.ceil(np.log(1.0 / _REST) / (damping * rate) / step))
        samples = np.arange((len(a) + tail) * fine) / fine
        base = np.interp(samples, np.arange(len(a)), a, right=0.0)
        # States are the relative displacement and its rate, and the output is the absolute acceleration.
        row = [-(rate**2), -2.0 * damping * rate]
        system = [[0.0, 1.0], row], [[0.0], [-1.0]], [row], [[0.0]]
        roof = lsim(system, base, samples * step)[1]
        note = f"on a building with a period of {float(period):g} s and {100.0 * damping:g} % damping"
        own = {"notes": (*self.notes, note), "ground": replace(self, scale=1.0)}
        return replace(self, acceleration=roof, dt=step / fine, **own)

    @property
    def piece(self) -> Real:
        """Step between samples, s."""
        return self.dt

    def pieces(self) -> Any:
        """Return the acceleration over `pga` between the samples; see
        `tpd.scene.ground_motion.GroundMotion.pieces`."""
        xp = checks.namespace(self.acceleration, self.scale)
        a = self.acceleration * xp.sign(self.scale)
        peak = checks.largest(a)
        # A record of zeros has no peak to divide by.
        a = a / xp.where(peak > 0.0, peak, 1.0)
        # The acceleration is linear between samples, so the quadratic and cubic coefficients are zero.
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
        factor: float = 1.0,
    ) -> Record:
        """Read one channel of a file. The format is recognised from the content.

        The formats are PEER AT2, CSMIP V1 and V2, COSMOS, USGS SMC, ESM, K-NET and KiK-net, GeoNet V1A and
        V2A, and text tables, each plain or compressed by gzip. Other formats are read by ObsPy
        (the extra `obspy`).

        A table is read without `columns` only if one line above the numbers names all columns in the words
        of `tpd.formats.table.NAMES`, with units in brackets or in a line such as "unit: g", or if it has one
        column. The message about any other table shows its columns, and options with places to fill in. An
        option that contradicts the file is rejected.

        Args:
            path: path of the file.
            channel: number of the channel, from 0 in the order of the file; not needed for a file with one
                channel.
            dt: time step in s of a table that contains only accelerations.
            baseline: "mean" removes the mean, "linear" removes the straight line of least squares, "none"
                removes nothing. Default: the mean if the file states that the record is not corrected, or if
                its format is for uncorrected records. For a text table the default is none.
            unit: unit of the acceleration, such as "g", "m/s2", "cm/s2" or "gal", for a file that states
                none.
            columns: numbers of the columns of a table, from 1, by their names, such as `{"time (ms)": 1, "N":
                2, "E (gal)": 3}`; columns that are not listed are ignored. "rows" means that the samples
                continue row by row. With names the lines above the numbers need not be understood.
            skip: number of lines at the top of a table that are skipped.
            factor: factor by which all samples are multiplied.

        Raises:
            ValueError: the file is damaged, incomplete, contradictory or of an unknown format, or it has
                several channels and none is chosen.
            FileNotFoundError: the file does not exist.

        Example:
            >>> import pathlib, tempfile, tpd
            >>> path = pathlib.Path(tempfile.mkdtemp()) / "record.csv"
            >>> _ = path.write_text("0.0,0.0 0.01,1.5 0.02,-0.5".replace(" ", chr(10)))
            >>> record = tpd.Record.read(path, columns={"time": 1, "N": 2}, unit="m/s2")
            >>> float(record.pga), record.dt
            (1.5, 0.01)
        """
        from tpd.formats.read import Options, one_channel

        how = Options(dt, baseline, unit, columns, skip, factor)
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
        factor: float = 1.0,
    ) -> list[Record]:
        """Read all channels of a file, in the order of the file. Vertical channels have a note.

        Arguments and errors are those of `read`.
        """
        from tpd.formats.read import Options, channels

        how = Options(dt, baseline, unit, columns, skip, factor)
        return [_of(c) for c in channels(path_of(path), how)]


def _of(channel: Channel) -> Record:
    """Return the record of a channel of a file."""
    words = {name: getattr(channel, name) for name in ("name", "event", "notes", "source")}
    return Record(channel.acceleration, channel.dt, **words)


def _samples(value: Any) -> Any:
    """Check samples. Samples from NumPy or from a list are returned as a read-only array."""
    expected = "an array of at least two accelerations"
    samples = checks.array("acceleration", value, (-1,), expected)
    if len(samples) < 2:
        raise ValueError(f"`acceleration` must be {expected}, but is {checks.quote(value)}")
    if checks.is_jax(value):
        return checks.plain("acceleration", value)
    # A copy that cannot be changed, because `Record` is frozen and can be hashed.
    array = np.array(samples)
    array.flags.writeable = False
    return array
