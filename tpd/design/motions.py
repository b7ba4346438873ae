"""Exact settled motions of one design under all conditions, from rest, by events."""

from __future__ import annotations

import numpy as np

from tpd.analysis.steady_state import steady_state
from tpd.core.conditions import Conditions, under, under_all
from tpd.core.parameters import Parameters, as_arrays
from tpd.core.status import names_of, status_name
from tpd.design.verified import Motions
from tpd.models.batches import settle_all
from tpd.models.piecewise import Piecewise

_POLISHED = 32
"""Conditions up to which exact amplitudes are polished by Newton's method, to round-off."""


def motions_from_rest(p: Parameters, design: np.ndarray, conditions: Conditions, periods: int) -> Motions:
    """Motions as followed for at most `periods` forcing periods; without multipliers."""
    q = under_all(p, design[None], conditions)
    settled = settle_all(q, np.zeros((len(conditions), 4)), model=Piecewise(max_periods=periods))
    names = names_of(settled.status)
    sizes = settled.amplitude, settled.stroke, settled.peak, settled.peak_stroke
    amplitude, stroke, peak, peak_stroke = (
        np.where(names == "overturned", np.inf, np.asarray(x)) for x in sizes
    )
    return Motions(
        status=names,
        amplitude=amplitude,
        stroke=stroke,
        peak=peak,
        peak_stroke=peak_stroke,
        multiplier=np.full(len(names), np.nan),
        periods=np.asarray(settled.periods),
    )


def polished(p: Parameters, design: np.ndarray, conditions: Conditions, motions: Motions) -> Motions:
    """The motions with amplitudes to round-off and multipliers; as they are under many conditions."""
    if len(conditions) > _POLISHED:
        return motions

    # One after the other: the program for a single motion is compiled for many other uses.
    def one(row: np.ndarray) -> tuple:
        s = steady_state(as_arrays(under(p, design, row)), model=Piecewise())
        return status_name(s.status), float(s.amplitude), float(s.stroke), float(s.multiplier), int(s.periods)

    columns = zip(*(one(row) for row in conditions.factor_rows()), strict=True)
    status, amplitude, stroke, multiplier, periods = (np.array(x) for x in columns)
    # Newton's method has no orbit to polish where the block overturns.
    lost = status == "overturned"
    return Motions(
        status=status,
        amplitude=np.where(lost, np.inf, amplitude),
        stroke=np.where(lost, np.inf, stroke),
        peak=motions.peak,
        peak_stroke=motions.peak_stroke,
        multiplier=multiplier,
        periods=periods,
    )
