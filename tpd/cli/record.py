"""`tpd record`: description of ground motion records, which shows a wrong unit before they are used."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from tpd.cli import outputs
from tpd.cli.terminal import SOUND
from tpd.core import files
from tpd.core.files import path_of
from tpd.core.formatting import aligned, number
from tpd.design.job import job_of
from tpd.formats.channel import STANDARD_GRAVITY
from tpd.formats.read import Options, contents
from tpd.records.intensity import base_motion, peak_velocity, significant_times, spectral_acceleration
from tpd.records.read import facts
from tpd.scene.record import Record

_PERIODS = (0.2, 0.5, 1.0, 2.0)
"""Periods (s) for which the spectral acceleration is printed."""
_TABLE = {
    "step_s": "step s",
    "duration_s": "length s",
    "pga_g": "PGA g",
    "pgv_m_s": "PGV m/s",
    "pgd_m": "PGD m",
    "significant_s": "5-95 % s",
}
"""Columns of the table of several records: keys of the facts about a record, and headings."""


def run(options: argparse.Namespace) -> int:
    """Read the records, print a table, or several lines for a single record, draw the records if `--out` is
    given, and return the exit status."""
    # A job reads the records, so they are read as in all other commands.
    options.tables["excitation"].update({"records": options.records})
    job, rows, out = job_of(options.tables), [], options.out
    for record in job.motions:
        # Velocity and displacement are exact integrals of the record. They show a wrong baseline first.
        v, d = peak_velocity(record), float(np.max(np.abs(base_motion(record)[3])))
        first, last = significant_times(record)
        sizes = {"pgv_m_s": v, "pgd_m": d, "significant_s": last - first, "significant_from_s": first}
        rows.append(facts(record) | sizes)
    # The folder is checked after the records were read, and before anything is printed.
    if out is not None:
        files.claim(out, overwrite=options.overwrite)
    names = [row["source"] or row["name"] for row in rows]
    if len(rows) == 1:
        lines = [*_lines(job.motions[0], rows[0])]
    else:
        notes = ["; ".join(getattr(note, "kind", note) for note in row["notes"]) for row in rows]
        cells = ([number(row[key]) for key in _TABLE] for row in rows)
        # Notes are shortened to their kinds. The table in CSV has the whole notes.
        table = [[name, *x, note] for name, x, note in zip(names, cells, notes, strict=True)]
        lines = aligned([["record", *_TABLE.values(), "notes"], *table])
    # A file that is named alone is shown as the message on an unreadable file shows it.
    file = path_of(options.records[0])
    if len(options.records) == 1 and file.is_file():
        lines += ["contents of the file:", *contents(file, Options(**job.reading))]
    print("\n".join([*job.messages, *lines]))
    if out is not None:
        table = files.as_csv(rows[0], (row.values() for row in rows))
        pictures = {f"record_{i + 1}.png": partial(outputs.plot, r) for i, r in enumerate(job.motions)}
        outputs.write(out, [("records.csv", table)], pictures, overwrite=options.overwrite)
    return SOUND


def _lines(record: Record, row: dict[str, Any]) -> Iterator[str]:
    """Yield the lines about a single record."""
    duration, first = row["significant_s"], row["significant_from_s"]
    yield f"  peak acceleration (PGA)  {number(row['pga_g'])} g = {number(record.pga)} m/s^2"
    yield f"  peak velocity (PGV)      {number(row['pgv_m_s'])} m/s"
    yield f"  peak displacement (PGD)  {number(row['pgd_m'])} m"
    ends = f"{number(first)} to {number(first + duration)} s"
    yield f"  significant duration     {number(duration)} s (5 to 95 % of the energy, from {ends})"
    values = ((spectral_acceleration(record, t) / STANDARD_GRAVITY, t) for t in _PERIODS)
    yield "  spectral acceleration    " + ", ".join(f"{number(x)} g at {t:g} s" for x, t in values)
