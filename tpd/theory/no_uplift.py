"""No-uplift condition |B| f <= (1 + mu) nu + k: the excitation that a block at rest withstands (Table 1).

While the block is at rest, the bob is a damped oscillator driven by the base: its amplitude is Z = F/D with
D = 1 - lam rho xi^2 + i xi c_p. The moment on the block then has the amplitude |B| f with

    B = 1 + kappa mu + (kappa mu rho lam xi^2 - i xi mu lam c_p)/D

and weight and friction resist this moment up to (1 + mu) nu + k. Without damping D = 1 - x with x = lam rho
xi^2 = l omega^2/g, so the swing is f/|x - 1| and B = 1 + kappa mu/(1 - x). A pendulum that is longer
than g/omega^2 swings against the base and relieves the block: its moment is f - kappa mu Z.
`lightest_pendulum` solves for the mass. All formulas accept arrays in the fields of `Parameters`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from tpd.core import checks
from tpd.core.formatting import number, pair_of
from tpd.scene.parameters import Parameters, check_parameters
from tpd.scene.pytrees import Number
from tpd.scene.scene import Scene

DRY = 0.3
"""Coefficient of friction above which a dry base of stone or concrete may be too smooth."""


class Uplift(NamedTuple):
    """Uplift margin of a block at rest, and swing of the settled pendulum.

    A positive margin excludes neither rocking from another initial state, nor an uplift before the pendulum
    has settled.
    """

    margin: Number
    """1 - |B| f / ((1 + mu) nu + k). If it is positive, a block at rest does not lift."""
    swing: Number
    """Amplitude of the bob angle (rad) while the block is at rest, f/|D|."""


class Lightest(NamedTuple):
    """Undamped pendulum with the smallest mass under which a settled block does not lift."""

    mu: Number
    """Mass ratio; zero if the block does not lift without a pendulum."""
    lam: Number
    """Length ratio."""


class AtRest(NamedTuple):
    """Resistance of the block at rest, without a pendulum, under the condition that is closest to lifting it.

    Accelerations are divided by the acceleration of gravity.
    """

    uplift: float
    """Base acceleration that lifts the block: nu + k, see (5)."""
    peak: float
    """Largest base acceleration."""
    base_friction: float | None
    """Coefficient of friction of the base; None if it is unknown."""
    needed_friction: float
    """Smallest coefficient of friction of the base with which the block does not slide before it lifts, over
    all conditions. The friction force must equal the mass times the base acceleration, which increases up to
    the peak or up to the uplift, whichever is smaller."""
    conditions: int = 1
    """Number of conditions."""

    @staticmethod
    def of(nu: Any, k: Any, f: Any, base_friction: float | None = None) -> AtRest:
        """Return the most critical of many conditions. Each argument is a number or an array (n,)."""
        # The condition that is closest to lifting the block gives uplift and peak; sliding is checked for
        # all.
        uplift, peak = np.broadcast_arrays(np.asarray(nu) + np.asarray(k), np.abs(f))
        worst, needed = np.argmax(peak / uplift), float(np.max(np.minimum(uplift, peak)))
        return AtRest(float(uplift.flat[worst]), float(peak.flat[worst]), base_friction, needed, peak.size)

    @staticmethod
    def under(scene: Scene) -> AtRest:
        """Return the resistance of the block of a scene under the excitation of the scene."""
        return AtRest.of(scene.block.slenderness, scene.block.friction, scene.peak, scene.block.base_friction)

    @property
    def safety_factor(self) -> float:
        """Factor on the excitation at which the block lifts; infinite without an excitation."""
        return self.uplift / self.peak if self.peak > 0.0 else np.inf

    @property
    def slides(self) -> bool:
        """Whether the block slides before it lifts, according to the friction of its base."""
        # If the friction of the base is unknown, sliding is unknown too, and `sliding_in_words` has a hint.
        return self.base_friction is not None and self.base_friction < self.needed_friction

    @property
    def sliding_in_words(self) -> str:
        """Text that says whether the block at rest slides before it lifts."""
        base, more = self.base_friction, " (more may be needed during rocking)"
        if base is None:
            # Only friction that a dry base may lack is worth a hint.
            hint = f". A dry base may have only {DRY:g}: state `base_friction`"
            least = number(self.needed_friction, 2) + more + (hint if self.needed_friction > DRY else "")
            return f"none before uplift if the coefficient of friction of the base is at least {least}"
        least, base = pair_of(self.needed_friction, base)
        needed = f"a coefficient of friction of {least} is needed"
        if self.slides:
            return f"at {base} g, BEFORE UPLIFT: {needed}"
        return f"none before uplift: {needed}, the base has {base}{more}"

    @property
    def lifting_in_words(self) -> str:
        """Text that says when the block at rest lifts, and whether the excitation is large enough."""
        lifts = "lifts" if self.safety_factor < 1.0 else "does not lift"
        strongest = "the strongest condition" if self.conditions > 1 else "the excitation"
        ratio, _ = pair_of(1.0 / self.safety_factor, 1.0, 3)
        peak, uplift = pair_of(self.peak, self.uplift, 3)
        return f"at {uplift} g; {strongest} reaches {peak} g, {ratio} times as much: the block {lifts}"

    @property
    def lines(self) -> tuple[str, str]:
        """Lines for the terminal."""
        return f"  uplift      {self.lifting_in_words}", f"  sliding     {self.sliding_in_words}"

    def __str__(self) -> str:
        return "\n".join(self.lines)


class Sliding(NamedTuple):
    """Friction that the base of a rocking block needs."""

    slides: bool
    """Whether the base has less friction, so that the equations do not describe the block."""
    sentence: str
    """Sentence that compares the friction of the base with the needed friction."""
    needed: float = math.nan
    """Largest coefficient of friction that the base needs."""


def sliding_in_runs(needed: Mapping[str, float], base: float | None) -> Sliding:
    """Compare the friction that the base needs while the block rocks with its friction.

    Args:
        needed: coefficient of friction that the runs need, by the name of the case.
        base: coefficient of friction of the base; None if it is unknown.
    """
    limit = math.inf if base is None else base
    # Four digits are shown, and more if they decide.
    pairs = {name: pair_of(x, limit, 4) for name, x in needed.items()}
    worst = max(needed, key=needed.__getitem__)
    slides = needed[worst] > limit
    listed = " and ".join(f"{value} {name}" for name, (value, _) in pairs.items())
    has = "" if base is None else f", {'but' if slides else 'and'} has {pairs[worst][1]}"
    friction = f"the base needs a coefficient of friction of {listed}{has}"
    if slides:
        return Sliding(
            True, f"SLIDES WHILE IT ROCKS: {friction}. The equations have no sliding.", needed[worst]
        )
    return Sliding(False, f"While the block rocks from rest, {friction} (linear model).", needed[worst])


def _transfer(p: Parameters) -> tuple[Number, Number, Number]:
    """Return |D|^2, and the real and the imaginary part of B."""
    # Real numbers only, because the search differentiates `uplift` with imaginary steps of the parameters.
    rho, c = p.inertia_ratio, p.hinge
    # Real and imaginary part of D, and of h = kappa mu rho lam xi^2 - i xi mu lam c_p.
    real, imaginary = 1.0 - p.lam * rho * p.xi**2, p.xi * c
    size2 = real**2 + imaginary**2
    h_real, h_imag = p.kappa * p.mu * rho * p.lam * p.xi**2, -p.xi * p.mu * p.lam * c
    b_real = 1.0 + p.kappa * p.mu + (h_real * real + h_imag * imaginary) / size2
    b_imag = (h_imag * real - h_real * imaginary) / size2
    return size2, b_real, b_imag


def uplift(p: Parameters) -> Uplift:
    """Return the margin of the no-uplift condition and the swing of the bob.

    Both are differentiable in all parameters.

    Args:
        p: dimensionless parameters. Fields may be arrays.

    Raises:
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.25, mu=0.4, lam=0.8, zeta=0.0, k=0.05, f=0.377, xi=2.67)
        >>> lift = tpd.theory.uplift(p)
        >>> round(float(lift.margin), 3), round(float(lift.swing), 3)
        (0.307, 0.125)
    """
    check_parameters(p)
    # At rest the friction of rocking resists uplift to both sides, so k is added to the capacity. The
    # swing of an undamped bob is infinite at resonance, hence the division by zero.
    with np.errstate(divide="ignore", invalid="ignore"):
        size2, b_real, b_imag = _transfer(p)
        moment2, capacity = b_real**2 + b_imag**2, (1.0 + p.mu) * p.nu + p.k
        sqrt = checks.namespace(moment2, size2).sqrt
        return Uplift(1.0 - p.f * sqrt(moment2) / capacity, p.f / sqrt(size2))


def lightest_pendulum(p: Parameters, swing: Any) -> Lightest:
    """Return the lightest pendulum under which a settled block bears the harmonic without uplift.

    The bob may swing by at most `swing`. The law has a closed form:

        l = g/omega^2 + alpha/swing, or lam rho xi^2 = 1 + f/swing,    mu = (f - nu - k)/(nu + kappa swing).

    A mass ratio mu raises the acceleration that the settled block bears by mu (nu + kappa swing).

    The law is exact for the linear model, for an undamped hinge, and after the bob has settled. It is for
    machines that start slowly, and never for earthquakes:

    - After a sudden start it fails. In tests no block stays on its base with 1.1 times the mass, and many
      overturn.
    - After a gradual start of ten periods 1.1 times the mass is enough for the linear model, but not for
      the nonlinear ones. They need 1.5 times the mass, which is enough in three of four cases.

    Args:
        p: dimensionless parameters. Fields may be arrays. mu, lam, zeta and e are not used.
        swing: largest bob angle, rad.

    Raises:
        ValueError: `swing` is not positive.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.25, mu=0.0, lam=1.0, zeta=0.0, k=0.05, f=0.377, xi=2.67)
        >>> lightest = tpd.theory.lightest_pendulum(p, swing=0.3)
        >>> round(float(lightest.mu), 4), round(float(lightest.lam), 4)
        (0.0906, 0.4484)
    """
    check_parameters(p)
    swing = checks.positive("swing", swing, every=True)
    # A shorter pendulum swings too far. A longer one swings less, and needs more mass for the same moment.
    length = (1.0 + p.f / swing) / (p.inertia_ratio * p.xi**2)
    mass = (p.f - p.nu - p.k) / (p.nu + p.kappa * swing)
    # A block that does not lift without a pendulum would get a negative mass.
    return Lightest(checks.namespace(mass).maximum(mass, 0.0), length)
