"""Two records of the public domain, in `tpd/records/data`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tpd.scene.record import Record

_DATA = Path(__file__).parent / "data"


def el_centro() -> Record:
    """Return the north-south component of El Centro, Imperial Valley earthquake of 18 May 1940: 0.319 g,
    1560 points of 0.02 s. Recorded by the U.S. Coast and Geodetic Survey, tabulated in textbooks; public
    domain."""
    record = Record.read(_DATA / "elcentro_1940_ns.csv.gz")
    return replace(record, name="El Centro/NS", event="Imperial Valley 1940")


def loma_prieta() -> Record:
    """Return the corrected component 360° of San Francisco, 1295 Shafter, Loma Prieta earthquake of 18
    October 1989: 104.4 cm/s^2, 6001 points of 0.005 s. Recorded by the U.S. Geological Survey; public
    domain."""
    record = Record.read(_DATA / "loma_prieta_1989_0111a.smc.gz")
    return replace(record, name="San Francisco 1295 Shafter/360", event="Loma Prieta 1989")
