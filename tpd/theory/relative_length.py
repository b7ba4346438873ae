"""Length of a pendulum relative to that of a pendulum with the period of the excitation."""

from __future__ import annotations

import math

from tpd.core import checks
from tpd.core.checks import Real
from tpd.formats.channel import STANDARD_GRAVITY
from tpd.scene.ground_motion import Pulse
from tpd.scene.record import Record
from tpd.scene.scene import Harmonic


def relative_length(
    length: Real, excitation: Harmonic | Pulse | Record, *, gravity: Real = STANDARD_GRAVITY
) -> Real:
    """Return x = l omega^2/g, the square of the period of the pendulum over that of the excitation.

    omega is the frequency of a harmonic or a pulse. For a record omega = 2 PGA/PGV.

    A pendulum must be slower than the ground motion. In 30 cases of a block under a pulse (nonlinear model,
    mu = 0.1, notebook 17) a pendulum with x of at least 2 never made overturning easier. With x = 1.5, which
    is l = 0.37 T^2 in m and s, it did in 2 of 27 cases, and with x of at most 0.7 in more than half. Under
    the records of FEMA P695 the change of the share of runs that overturn is near 0 for x from 1 to 1.5 and
    -0.08 to -0.14 above 10.

    Only the sign of the effect follows x. Its size does not (R^2 = 0.11): it depends on mass and block, too.
    For a harmonic, x = 1 is the resonance of the pendulum under a block at rest.

    Args:
        length: length of the pendulum, m.
        excitation: harmonic, pulse or record.
        gravity: acceleration of gravity, m/s^2.

    Raises:
        ValueError: the length is not positive, or the excitation is of another type.

    Example:
        >>> import tpd
        >>> pulse = tpd.Pulse.one_sine(acceleration=3.0, frequency=0.5)
        >>> round(tpd.theory.relative_length(1.5, pulse), 3)
        1.51
    """
    checks.instance("excitation", excitation, (Harmonic, Pulse, Record))
    length, gravity = checks.positive("length", length), checks.positive("gravity", gravity)
    if isinstance(excitation, Record):
        # A harmonic would have omega = PGA/PGV. The peaks of a record belong to different parts of it, and
        # the factor is that of the study in which the limits of x were found.
        rate = 2.0 * excitation.pga / excitation.pgv
    else:
        rate = 2.0 * math.pi * excitation.frequency
    return length * rate**2 / gravity
