"""Measures that keep a block on its base without a pendulum at one level, by static estimates."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tpd.core.formatting import number
from tpd.design.ground_motion import PERIODS
from tpd.design.problem import Problem

_MOST_WIDTH = 2.0
"""Largest width of a base that is an alternative, over the width of the block. A coefficient of friction
above 1 is no alternative either."""


class Alternatives(NamedTuple):
    """Estimates of what keeps the block on its base without a pendulum, from statics of a rigid block."""

    tie: float
    """Horizontal force (N) of a tie at the top of the block, at the height h. The tie supplies the moment
    that the weight lacks: M g (f - nu - k) b/h, from (5) with the largest acceleration f."""
    width: float
    """Width of the base (m) with which the excitation does not lift the block: 2 b (f - k)."""
    friction: float
    """Coefficient of friction with which the wider base does not slide: f."""
    present: float
    """Width of the block (m)."""
    periods: np.ndarray
    """Smallest period (s) of a base isolation that transmits less acceleration than lifts the block, for each
    motion with the peak acceleration of `friction` in g. Under ground motions it is the period from which on
    the response spectrum stays below the uplift acceleration; infinite if 8 s is not enough. Under a harmonic
    of period T it is T sqrt(1 + f/(nu + k)), for the lowest frequency only. A problem has at least one
    motion, so that there is at least one period."""
    damping: float
    """Damping ratio of the isolation: 0.05 under ground motions, 0 under a harmonic."""
    acceleration: float
    """Acceleration (m/s^2) that lifts the block."""
    level: str
    """Words for the level of the excitation at which the measures prevent uplift."""

    @property
    def isolation(self) -> float:
        """Largest of `periods`."""
        return float(np.max(self.periods))

    def displacement(self, period: float) -> float:
        """Return the displacement (m) of the isolated block relative to the ground, which is the spectral
        displacement at one of `periods`."""
        return self.acceleration * (period / (2.0 * math.pi)) ** 2

    @property
    def brief(self) -> str:
        """Clause with tie and base."""
        base = f", or a base of {_at_least(self.width)} m," if self._has_base else ""
        at = f"at {_at_least(self.friction)} g ({self.level})"
        return f"a top tie for {self._force}{base} prevents uplift {at}"

    @property
    def _has_base(self) -> bool:
        """Whether a wider base is practicable: it does not slide, and is at most twice as wide."""
        return self.friction <= 1.0 and self.width <= _MOST_WIDTH * self.present

    @property
    def _force(self) -> str:
        return f"{_at_least(self.tie / 1e3)} kN" if self.tie >= 1e3 else f"{_at_least(self.tie)} N"

    def _isolation(self, period: float) -> str:
        if not math.isfinite(period):
            return f"more than {PERIODS[1]:g} s"
        return f"at least {_at_least(period)} s (displacement {_at_least(self.displacement(period))} m)"

    def __str__(self) -> str:
        friction = f"with a coefficient of friction of at least {_at_least(self.friction)}"
        kind = f"a base isolation with {100.0 * self.damping:g} % damping and"
        kind = kind if self.damping else "an undamped base isolation with"
        isolation = f"{kind} a period of {self._isolation(self.isolation)}"
        if (n := len(self.periods)) > 1:
            isolation += (
                f" for all {n} motions, or {self._isolation(float(np.median(self.periods)))} for half"
            )
        tie = f"at {_at_least(self.friction)} g ({self.level}): a tie at the top for at least {self._force}"
        if not self._has_base:
            return (
                f"{tie}, or {isolation} (static estimates); no base of up to twice the width prevents uplift"
            )
        width = f"a base at least {_at_least(self.width)} m wide {friction}"
        return f"{tie}, {width}, or {isolation} (static estimates)"


def _at_least(x: float) -> str:
    """Format a required value with two significant digits, rounded up."""
    place = 10.0 ** (math.floor(math.log10(x)) - 1) if x > 0.0 else 1.0
    # Rounding must not raise a value that already has two digits.
    return number(math.ceil(x / place - 1e-9) * place, 2)


def alternatives(problem: Problem) -> Alternatives:
    """Estimate what keeps the block of a problem on its base without a pendulum."""
    block, alone, gravity = problem.scene.block, problem.at_rest, float(problem.scene.gravity)
    peak, words = problem.usual_level
    if (stated := problem.job and problem.job.level) is not None:
        peak, words = stated, "as stated"
    periods, damping = problem.isolation(peak)
    # The tie pulls at the top, and the weight and the inertia act at the centroid.
    z = float(block.centroid)
    # The block lifts when the moment of the inertia exceeds that of the weight; the tie holds the rest.
    tie = float(block.mass) * gravity * max(peak - alone.uplift, 0.0) * z / float(block.height)
    # The block rocks on the same share of a wider base.
    width = 2.0 * z * (peak - float(block.friction)) * float(block.width / block.base_width)
    lifts = alone.uplift * gravity
    return Alternatives(tie, width, peak, float(block.width), periods, damping, lifts, words)
