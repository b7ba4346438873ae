"""Files of made-up ground motion in every format, as the agencies write them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

G = 9.80665


def rows(values: Sequence[str], columns: int) -> list[str]:
    return ["".join(values[i : i + columns]) for i in range(0, len(values), columns)]


def peak(values: Sequence[float]) -> tuple[float, int]:
    """Greatest value, with its sign, and its place."""
    i = int(np.argmax(np.abs(values)))
    return float(values[i]), i


def joined(lines: Sequence[str], end: str = "\n") -> str:
    return end.join(lines) + end


def peer(values: Sequence[float], dt: float) -> str:
    """In g; synthetic, since files of the database may not be carried."""
    head = ["PEER NGA STRONG MOTION DATABASE RECORD", "Nowhere, 1/2/1999, Made-up Station, 90"]
    head += ["ACCELERATION TIME SERIES IN UNITS OF G", f"NPTS=   {len(values)}, DT=   {dt:.4f} SEC,"]
    return joined(head + rows([f"{v:15.7E}" for v in values], 5))


def esm(values: Sequence[float], dt: float) -> str:
    """In cm/s^2."""
    top, i = peak(values)
    head = "EVENT_NAME: NOWHERE|EVENT_DATE_YYYYMMDD: 19990102|EVENT_TIME_HHMMSS: 030405|MAGNITUDE_W: |"
    head += f"NETWORK: XX|STATION_CODE: MADE|SAMPLING_INTERVAL_S: {dt:.6f}|NDATA: {len(values)}|"
    head += f"DURATION_S: {len(values) * dt:.4f}|STREAM: HNE|UNITS: cm/s^2|PGA_CM/S^2: {top:.6f}|"
    head += f"TIME_PGA_S: {i * dt:.6f}|BASELINE_CORRECTION: BASELINE REMOVED|DATA_TYPE: ACCELERATION|"
    return joined([*f"{head}PROCESSING: manual|USER5: ".split("|"), *(f"{v:.6f}" for v in values)])


def knet(values: Sequence[float], dt: float) -> str:
    """Whole numbers; synthetic, since files of NIED may not be carried. They last whole seconds."""
    gal = np.array(values) * 3920.0 / 6182761.0
    head = "Origin Time=1999/01/02 03:04:00|Lat.=41.0|Long.=142.5|Depth. (km)=30|Mag.=6.2|"
    head += "Station Code=XXX001|Station Lat.=41.5|Station Long.=140.9|Station Height(m)=39|"
    head += f"Record Time=1999/01/02 03:04:43|Sampling Freq(Hz)={1 / dt:.0f}Hz|"
    head += f"Duration Time(s)={len(values) * dt:.0f}|Dir.=E-W|Scale Factor=3920(gal)/6182761|"
    head += (
        f"Max. Acc. (gal)={np.max(np.abs(gal - gal.mean())):.3f}|Last Correction=1999/01/02 03:04:43|Memo.="
    )
    pairs = (line.split("=") for line in head.split("|"))
    return joined([*(f"{key:18}{value}" for key, value in pairs), *rows([f"{v:8.0f} " for v in values], 8)])


def geonet(values: Sequence[float], dt: float, *, corrected: bool = True) -> str:
    """In mm/s^2, two components."""
    a = np.array(values)
    return "".join(_geonet(x, dt, name, corrected) for x, name in ((a, "N10E"), (-a, "Up")))


def _geonet(values: np.ndarray, dt: float, component: str, corrected: bool) -> str:
    n, (top, i) = len(values), peak(values)
    kind, step = "Uncorrected", f"Raw readings in units of 1.00 mm/s/s  at intervals of {dt:.3f} s"
    if corrected:
        kind, step = "Corrected", f"Instrument corrected data at {dt:.3f} sec intervals"
    head = f"""{kind} accelerogram 19990102_030400_MADE_20 GNS Science
Site MADE      42 31 24S  172 49 50E     Basalt file:  19990102_030400_MADE
Made-up Centre
Instrument Basalt_1
Resolution: 24-bit   Instr Period: 0.0050 s   Damping: 0.700
Accelerogram 19990102_030400_MADE_20                 Processed 1999 January 03
5 km south-west of Nowhere
1999 January 02         03:04:00 UT
Epicentre  42 41 33S 173 01 19E  Bearing S40E  Dist   25km  Depth   15km Mw 7.00
Number of points {n:5d}    Duration {(n - 1) * dt:.2f} sec
{step}
Data is unfiltered
Component {component}
Acceleration:  peak {top:8.1f} mm/s/s at {i * dt:6.2f} sec     rms      2.2 mm/s/s
Velocity record unevaluated
Displacement record unevaluated"""
    integers, reals = [0] * 40, [0.0] * 60
    integers[30] = integers[33] = n
    integers[34] = integers[35] = n if corrected else 0
    reals[25] = dt
    numbers = rows([f"{v:8d}" for v in integers], 10) + rows([f"{v:8.4f}" for v in reals], 10)
    data = rows([f"{v:8.1f}" for v in values], 10)
    others = rows([f"{0.01 * v:8.2f}" for v in values], 10) * (2 if corrected else 0)
    return joined([head, *numbers, *data, *others])


def smc(values: Sequence[float], dt: float) -> str:
    """In cm/s^2."""
    integers, reals = [-32768] * 48, [1.7e38] * 50
    integers[12:17] = [90, 360, 101, 1, len(values)]
    top, bottom = int(np.argmax(values)), int(np.argmin(values))
    reals[1] = 1.0 / dt
    if values[top] > 0.0 > values[bottom]:
        reals[28:32] = [top * dt, values[top], bottom * dt, values[bottom]]
    text = "2 CORRECTED ACCELEROGRAM|*|XX0A|     1999   1   2    0304 Nowhere|Moment Mag=      7.0|"
    text += "station = Made-up Station component=    360||inst type=SMA-1|*|*|*"
    numbers = rows([f"{v:10d}" for v in integers], 8) + rows([f"{v:15.7E}" for v in reals], 5)
    return joined([*text.split("|"), *numbers, "| a comment", *rows([_smc(v) for v in values], 8)], "\r\n")


def _smc(value: float) -> str:
    """One digit in the exponent."""
    mantissa, _, exponent = f"{value:.4E}".partition("E")
    return f"{mantissa + 'E' + format(int(exponent), '+d'):>10}"


def csmip_v1(values: Sequence[float], dt: float) -> str:
    """In g, two channels."""
    n, rate, blocks = len(values), round(1.0 / dt), []
    numbers = rows([f"{0:5d}"] * 100, 16) + rows([f"{0:10.3f}"] * 50, 8)
    for number, sign, name in ((1, 1.0, "90 Deg"), (2, -1.0, "Up")):
        a = sign * np.array(values)
        top, i = peak(a)
        head = "Uncorrected Accelerogram Data             Processed: 01/03/99, CGS  made|||||Made-up|"
        head += f"Chan  {number}: {name}|Record of Sat Jan 2, 1999||Instr Period =  .0109 sec|"
        head += f"No. of Points =  {n:5d}  Record Length ={n * dt:7.3f} sec   at {rate} Samples/sec|"
        head += f"Units of uncor data are sec and g .        Max  = {top:7.3f} g , at {i * dt:7.3f} sec.|RMS"
        title = f"{n:6d} Accelerogram points at {rate} pts/sec in units of g .      Format: (8f9.6)"
        end = f"/&  ----------  End of Data for Channel  {number}  ----------"
        blocks += [*head.split("|"), *numbers, title, *rows([f"{v:9.6f}" for v in a], 8), end]
    return joined(blocks, "\r\n")


def csmip_v2(values: Sequence[float], dt: float) -> str:
    """In cm/s^2, two channels."""
    n, blocks = len(values), []
    numbers = rows([f"{0:5d}"] * 100, 16) + rows([f"{0:10.3f}"] * 100, 8)
    for number, sign, name in ((1, 1.0, "90 DEG"), (2, -1.0, "UP")):
        a = sign * np.array(values)
        top, i = peak(a)
        head = f"CORRECTED ACCELEROGRAM   MADE       CHAN  {number}: {name}     FROM|"
        head += "UNCORRECTED ACCELEROGRAM DATA|NOWHERE EARTHQUAKE||||MADE-UP STATION|"
        head += f"CHAN  {number}: {name}|NOWHERE EARTHQUAKE     JANUARY 2, 1999|||||||"
        head += f"{n:6d} POINTS OF INSTRUMENT- AND BASELINE-CORRECTED ACCEL, VELOC AND DISPL DATA|"
        head += f"AT EQUALLY-SPACED INTERVALS OF   {dt:.3f}  SEC.|"
        head += f"PEAK ACCELERATION = {top:9.3f}    CM/SEC/SEC  AT {i * dt:8.3f}   SEC.|||||||"
        blocks += [*head.split("|"), *numbers]
        for kind, unit in (("ACCEL", "CM/SEC/SEC"), ("VELOC", "CM/SEC"), ("DISPL", "CM")):
            blocks += [f"{n:5d} POINTS OF {kind} DATA EQUALLY SPACED AT  {dt:.3f} SEC.  (UNITS: {unit})"]
            blocks += rows([f"{v:10.3f}" for v in a], 8)
        blocks += [f"/&  ----------  END OF DATA FOR CHANNEL  {number}  ----------"]
    return joined(blocks, "\r\n") + "\x1a" * 30


def cosmos(values: Sequence[float], dt: float) -> str:
    """In cm/s^2."""
    n, (top, i) = len(values), peak(values)
    integers, reals = [-999] * 100, [-999.0] * 100
    reals[61:65] = [1000.0 * dt, n * dt, top, i * dt]
    text = "Corrected acceleration    (Format v01.20 with 13 text lines)|Record of Nowhere Earthquake|||"
    text += "Statn No: 01-1  Code:XX-MADE||||Sta Chan   1: 90 Deg (Rcrdr Chan  ?)||"
    text += f"Processed: never, Max = {top:9.5f} cm/sec2 at {i * dt:8.3f} sec||Values used when unknown: -999"
    blocks = [*text.split("|"), " 100 Integer-header values follow on  10 lines, Format= (10I8)"]
    blocks += rows([f"{v:8d}" for v in integers], 10)
    blocks += [" 100 Real-header values follow on  20 lines, Format= (5F15.6)"]
    blocks += rows([f"{v:15.6f}" for v in reals], 5)
    blocks += ['   1 Comment line(s) follow, each starting with a "|":', "| made up"]
    blocks += [f"{n:8d} acceleration pts, approx {n * dt:4.0f} secs, units=cm/sec2(04),Format=(8F10.5)"]
    return joined([*blocks, *rows([f"{v:10.5f}" for v in values], 8), "End-of-data for Chan 1 acceleration"])


def table(values: Sequence[float], dt: float) -> str:
    """In g."""
    return joined(["time,acc (g)", *(f"{i * dt:.3f},{v:.6f}" for i, v in enumerate(values))])


def column(values: Sequence[float], dt: float) -> str:
    """In m/s^2."""
    return joined(["# acceleration [m/s^2]", f"# dt = {dt:.3f} s", *(f"{v:.6f}" for v in values)])


@dataclass(frozen=True)
class Format:
    """A writer, and what its digits make of a value."""

    write: Callable[[Sequence[float], float], str]
    digits: str
    """Of a printed value, for `format`."""
    factor: float
    """m/s^2 of its unit."""
    size: float
    """Usual greatest value in its unit."""

    @property
    def name(self) -> str:
        return self.write.__name__

    def __str__(self) -> str:
        return self.name

    def printed(self, values: Sequence[float]) -> list[float]:
        """The values, rounded to the digits of the format."""
        return [float(format(v, self.digits)) for v in values]


def geonet_raw(values: Sequence[float], dt: float) -> str:
    return geonet(values, dt, corrected=False)


FORMATS = (
    Format(peer, ".7E", G, 0.4),
    Format(csmip_v1, ".6f", G, 0.4),
    Format(csmip_v2, ".3f", 0.01, 400.0),
    Format(cosmos, ".5f", 0.01, 400.0),
    Format(smc, ".4E", 0.01, 400.0),
    Format(esm, ".6f", 0.01, 400.0),
    Format(knet, ".0f", 0.01 * 3920.0 / 6182761.0, 5e5),
    Format(geonet, ".1f", 0.001, 4000.0),
    Format(geonet_raw, ".1f", 0.001, 4000.0),
    Format(table, ".6f", G, 0.4),
    Format(column, ".6f", 1.0, 4.0),
)


def shaking(n: int, seed: int = 0) -> np.ndarray:
    """Made-up shaking with a peak of 1, and none at its beginning."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, n)
    a = rng.standard_normal(n) * t * np.exp(-5.0 * t)
    return a / np.max(np.abs(a))
