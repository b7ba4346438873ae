"""No-uplift condition |B| f <= (1 + mu) nu + k: the shaking that a block at rest withstands, as in Table 1.

While the block stands still the bob is a damped oscillator under the base motion, Z = F/D with
D = 1 - lam rho xi^2 + i xi c_p. The moment on the held block then has the amplitude |B| f with

    B = 1 + 2 mu + (2 mu rho lam xi^2 - i xi mu lam c_p)/D

and weight and friction hold it up to (1 + mu) nu + k. All formulas take arrays in the fields of `Parameters`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tpd.core import checks
from tpd.core.formatting import number
from tpd.scene.parameters import Parameters, check_parameters
from tpd.scene.pytrees import Number
from tpd.scene.scene import Scene

DRY = 0.3
"""Coefficient of friction that a dry base of stone or concrete may not have."""


class Uplift(NamedTuple):
    """State of a block at rest under the settled pendulum.

    A positive margin does not exclude rocking from another start, nor a lift before the pendulum has settled.
    """

    margin: Number
    """1 - |B| f / ((1 + mu) nu + k): positive where the block at rest does not lift."""
    swing: Number
    """Amplitude (rad) of the bob's angle under the resting block, f/|D|."""


class AtRest(NamedTuple):
    """The resting block without a pendulum under the excitation that comes nearest to lifting it.

    Accelerations are over that of gravity.
    """

    uplift: float
    """Acceleration of the base that lifts the block, nu + k, see (5)."""
    peak: float
    """Largest acceleration of the base."""
    base_friction: float | None
    """Coefficient of friction of the base; None if it is not known."""
    needed_friction: float
    """Coefficient of friction of the base without which the block slides before it lifts, under any of the
    conditions: the base pushes the block sideways with as much as its acceleration asks for, and never with
    more than is enough to lift the block."""

    @staticmethod
    def of(nu: Any, k: Any, f: Any, base_friction: float | None = None) -> AtRest:
        """Return that of many conditions: numbers, or arrays of shape (n,)."""
        uplift, peak = np.broadcast_arrays(np.asarray(nu) + np.asarray(k), np.abs(f))
        worst, needed = np.argmax(peak / uplift), float(np.max(np.minimum(uplift, peak)))
        return AtRest(float(uplift.flat[worst]), float(peak.flat[worst]), base_friction, needed)

    @staticmethod
    def under(scene: Scene) -> AtRest:
        """Return that of a scene."""
        return AtRest.of(scene.block.slenderness, scene.block.friction, scene.peak, scene.block.base_friction)

    @property
    def margin(self) -> float:
        """Factor on the excitation from which it lifts the block."""
        return self.uplift / self.peak if self.peak > 0.0 else np.inf

    @property
    def slides(self) -> bool:
        """Whether the block is known to slide before it lifts."""
        return self.base_friction is not None and self.base_friction < self.needed_friction

    @property
    def sliding_in_words(self) -> str:
        """Whether the resting block slides before it lifts."""
        least, own = number(self.needed_friction, 2), self.base_friction
        if own is None:
            more = f". A dry base may have only {DRY:g}: state `base_friction`"
            least += more if self.needed_friction > DRY else ""
            return f"not before it lifts, if the coefficient of friction of the base is at least {least}"
        if self.slides:
            return f"at {number(own, 2)} g, BEFORE IT LIFTS: a coefficient of friction of {least} is needed"
        has = f"the base has {number(own, 2)}"
        return f"not before it lifts: a coefficient of friction of {least} is needed, {has}"

    @property
    def lifting_in_words(self) -> str:
        """When the resting block lifts, and whether the excitation is strong enough."""
        ratio, lifts = number(1.0 / self.margin, 3), "lifts" if self.margin < 1.0 else "does not lift"
        reaches = f"the excitation reaches {number(self.peak, 3)} g, {ratio} times as much"
        return f"at {number(self.uplift, 3)} g; {reaches}: the block {lifts}"

    def __str__(self) -> str:
        return f"  lifts   {self.lifting_in_words}\n  slides  {self.sliding_in_words}"


def _transfer(p: Parameters) -> tuple[Number, Number, Number]:
    """Return |D|^2 and the real and imaginary part of B."""
    # In real numbers, because the search differentiates `uplift` by imaginary steps of the parameters.
    rho, c = p.inertia_ratio, p.hinge
    real, imaginary = 1.0 - p.lam * rho * p.xi**2, p.xi * c
    size2 = real**2 + imaginary**2
    h_real, h_imag = 2.0 * p.mu * rho * p.lam * p.xi**2, -p.xi * p.mu * p.lam * c
    b_real = 1.0 + 2.0 * p.mu + (h_real * real + h_imag * imaginary) / size2
    b_imag = (h_imag * real - h_real * imaginary) / size2
    return size2, b_real, b_imag


def uplift(p: Parameters) -> Uplift:
    """Margin of the no-uplift condition and the bob's stroke, differentiable in every parameter.

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    check_parameters(p)
    # Friction adds to the capacity: at rest it resists lifting to either side.
    # An undamped bob in resonance has an infinite stroke.
    with np.errstate(divide="ignore", invalid="ignore"):
        size2, b_real, b_imag = _transfer(p)
        moment2, capacity = b_real**2 + b_imag**2, (1.0 + p.mu) * p.nu + p.k
        sqrt = checks.namespace(moment2, size2).sqrt
        return Uplift(1.0 - p.f * sqrt(moment2) / capacity, p.f / sqrt(size2))
