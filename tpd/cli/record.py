"""`tpd record`: a preview of ground motions, so that a wrong unit is seen before they are used."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial

import numpy as np

from tpd.cli import outputs
from tpd.cli.interrupts import SOUND
from tpd.cli.options import given, put
from tpd.core import files
from tpd.core.formatting import aligned, number
from tpd.design.job import job_of
from tpd.formats.channel import STANDARD_GRAVITY
from tpd.records.intensity import base_motion, significant_times, spectral_acceleration
from tpd.scene.record import Record

_USUAL = (0.001, 2.0)
"""Peaks that are not questioned, g: the strongest records have about 3 g, and felt ones at least 0.001 g."""
_PERIODS = (0.2, 0.5, 1.0, 2.0)
"""Periods of the spectral accelerations in the text, s."""
_HEADER = ("record", "samples", "step s", "length s", "PGA g", "PGV m/s", "PGD m", "5-95 % s", "notes")


def run(options: argparse.Namespace) -> int:
    """Read the records, print a line on each, or more on a single one, and draw them; return the exit
    status."""
    put(options, "motion", {"records": options.records})
    job = job_of(given(options))
    records, out = job.motions, options.out
    if out is not None:
        files.claim(out, overwrite=options.overwrite)
    rows = [_numbers(record) for record in records]
    lines = _lines(records[0], rows[0]) if len(rows) == 1 else aligned([_HEADER, *map(_cells, rows)])
    print("\n".join([*job.told, *lines]))
    odd = [f"{row[0]} ({number(row[4])} g)" for row in rows if not _USUAL[0] <= row[4] <= _USUAL[1]]
    if odd:
        usual = f"{_USUAL[0]:g} to {_USUAL[1]:g} g is usual"
        print(f"warning: the PGA is implausible ({usual}), check --unit and --scale: {'; '.join(odd)}")
    if out is not None:
        names = ["record.png"] if len(rows) == 1 else [f"record_{i + 1}.png" for i in range(len(rows))]
        pictures = {name: partial(outputs.plot, r) for name, r in zip(names, records, strict=True)}
        outputs.write(out, [("record.csv", files.as_csv(_HEADER, rows))], pictures)
    return SOUND


def _numbers(record: Record) -> tuple:
    """Values of `_HEADER`."""
    a, v, d = (float(np.max(np.abs(x))) for x in base_motion(record))
    first, last = significant_times(record)
    sampling = len(record.acceleration), float(record.dt), float(record.duration)
    return (
        record.source or record.name,
        *sampling,
        a / STANDARD_GRAVITY,
        v,
        d,
        last - first,
        "; ".join(record.notes),
    )


def _cells(row: tuple) -> tuple[str, ...]:
    name, samples, *others, notes = row
    return (
        name,
        str(samples),
        *map(number, others),
        "; ".join(x.partition(":")[0] for x in notes.split("; ")),
    )


def _lines(record: Record, row: tuple) -> Iterator[str]:
    """Lines on a single record."""
    *_, a, v, d, duration, _ = row
    first, last = map(number, significant_times(record))
    yield f"  peak acceleration (PGA)  {number(a)} g = {number(float(record.pga))} m/s^2"
    yield f"  peak velocity (PGV)      {number(v)} m/s"
    yield f"  peak displacement (PGD)  {number(d)} m"
    yield f"  significant duration     {number(duration)} s (5 to 95 % of the energy, {first} to {last} s)"
    sizes = ((spectral_acceleration(record, t) / STANDARD_GRAVITY, t) for t in _PERIODS)
    yield "  spectral acceleration    " + ", ".join(f"{number(x)} g at {t:g} s" for x, t in sizes)
