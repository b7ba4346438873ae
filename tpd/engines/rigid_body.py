"""Block and pendulum as rigid bodies in SI units, and their models as text for MuJoCo and OpenSees.

The block stands on the two lower corners of its cross-section. The coordinates move with the base, so
the acceleration of the base is a force on every mass, at the two centres of mass.

In OpenSees (Tcl) the block consists of stiff beams from its centre of mass to its lower corners and to the
hinge. It stands on friction bearings that carry no tension.
"""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.scene.conditions import HARMONIC_PERIODS
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.parameters import Parameters
from tpd.scene.scene import Harmonic, Pendulum, Scene, dimensionless

SLIDING = 0.6
"""Coefficient of friction against sliding, of stone on stone."""
_CONTACT = 0.01
"""Time constant of the contact divided by sqrt(b/g). The contact is soft enough for the time step, and its
impacts are Housner's."""
_STEP = 0.4
"""Time step divided by the time constant of the contact."""
RADIUS = 1e-4
"""Radius of a corner divided by the height of the centroid. With a larger radius a slender block would roll
and never come to rest."""


_FREE = 20.0
"""Duration of the free motion after a pulse or a record, s."""
_STEP_OPENSEES = 0.2
"""Time step of an OpenSees model divided by the time constant of the contact."""


@dataclass(frozen=True)
class RigidBody:
    """Block with its pendulum, in SI units."""

    half_width: float
    """Half width of the block, m."""
    centroid: float
    """Height of the centre of mass above the base, m."""
    mass: float
    """Mass of the block, kg."""
    inertia: float
    """Moment of inertia of the block about its centre of mass, kg m^2."""
    friction: float
    """Moment of the dry friction of rocking, N m."""
    bob: float
    """Mass of the bob, kg; 0 without a pendulum."""
    hinge: float
    """Height of the hinge of the pendulum above the base, m."""
    rod: float
    """Length of the rod, m."""
    damping: float
    """Damping constant of the hinge, N m s."""
    gravity: float
    """Acceleration of gravity, m/s^2."""
    sliding: float = SLIDING
    """Coefficient of friction against sliding."""
    steps: int = 1
    """Divisor of the time step."""

    @property
    def contact_time(self) -> float:
        """Time constant of the contact, s."""
        return _CONTACT * math.sqrt(self.centroid / self.gravity)

    @property
    def step(self) -> float:
        """Time step, s."""
        return _STEP * self.contact_time / self.steps

    @property
    def housner(self) -> float:
        """Coefficient of restitution of Housner's impact without a pendulum."""
        # The impact conserves the angular momentum about the new corner.
        a2, b2 = self.half_width**2, self.centroid**2
        gyration2 = self.inertia / self.mass
        return 1.0 - 2.0 * a2 / (a2 + b2 + gyration2)

    def mjcf(self) -> str:
        """Return the model as text in the format of MuJoCo."""
        return _rendered("mujoco.xml.j2", body=self, radius=RADIUS * self.centroid)


def _rendered(template: str, **values: Any) -> str:
    """Return the text of a model from its template, a file in this folder."""
    # The import is local, because only a few commands write a model and the others should start quickly.
    import jinja2

    source = resources.files("tpd.engines").joinpath(template).read_text(encoding="utf-8")
    # A name that is missing in the template raises an error and does not leave a gap in the model.
    blocks: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, **blocks)
    return environment.from_string(source).render(values)


def parameters_under(scene: Scene, pendulum: Pendulum | None) -> Parameters:
    """Return the dimensionless parameters of a scene with any excitation."""
    return Parameters(**dimensionless(scene.quantities(pendulum)))


def body_of(scene: Scene, p: Parameters, sliding: float, steps: int = 1) -> RigidBody:
    """Return the rigid bodies of dimensionless parameters (plain numbers) in SI units.

    Size and mass of the block are those of the scene.
    """
    b, mass, g = float(scene.block.centroid), float(scene.block.mass), float(scene.gravity)
    nu, mu, rod = float(p.nu), float(p.mu), float(p.lam) * b
    # The inertia ratio is rho = b^2/(a^2 + b^2 + c^2), where c is the radius of gyration.
    gyration2 = b**2 * (1.0 / float(p.inertia_ratio) - 1.0 - nu**2)
    # zeta is relative to the critical damping of the pendulum with a fixed hinge.
    damping = 2.0 * float(p.zeta) * mu * mass * rod * math.sqrt(g * rod)
    return RigidBody(
        half_width=nu * b,
        centroid=b,
        mass=mass,
        inertia=mass * gyration2,
        friction=float(p.k) * mass * g * b,
        bob=mu * mass,
        hinge=float(p.kappa) * b,
        rod=rod,
        damping=damping,
        gravity=g,
        sliding=sliding,
        steps=steps,
    )


def mjcf(scene: Scene, pendulum: Pendulum | None = None, *, sliding: checks.Real = SLIDING) -> str:
    """Return block and pendulum as the text of a MuJoCo model. This needs no MuJoCo.

    The text does not contain the excitation: use the acceleration of the base in m/s^2 as the control of
    every actuator.

    Args:
        scene: block with any excitation.
        pendulum: pendulum of the block; None for the block without a pendulum.
        sliding: coefficient of friction of the corners on the floor.

    Raises:
        ValueError: bad input.

    Example:
        >>> import tpd
        >>> scene = tpd.paper_scene()
        >>> pendulum = scene.pendulum(mass_ratio=0.1, length_ratio=0.8, damping_ratio=0.1)
        >>> tpd.engines.mjcf(scene, pendulum).count("<joint")
        4
    """
    checks.instance("scene", scene, Scene)
    sliding = checks.positive("sliding", sliding)
    return body_of(scene, parameters_under(scene, pendulum), sliding).mjcf()


def opensees(scene: Scene, pendulum: Pendulum | None = None, *, sliding: checks.Real = SLIDING) -> str:
    """Return block, pendulum and excitation as the text of an OpenSees model in Tcl. This needs no OpenSees.

    The model first applies the weight, then the excitation, and writes the motion to files. Its comments
    describe how it differs from the equations. The damping of the contact dissipates the energy of impacts,
    and the user must adapt it.

    Args:
        scene: block with any excitation. A harmonic lasts 40 periods. A record has its samples, and a pulse
            the samples between its pieces; free motion of 20 s follows.
        pendulum: pendulum of the block; None for the block without a pendulum.
        sliding: coefficient of friction of the corners on the floor.

    Raises:
        ValueError: bad input.

    Example:
        >>> import tpd
        >>> text = tpd.engines.opensees(tpd.paper_scene())
        >>> [line[:36] for line in text.splitlines() if line.startswith("timeSeries")]
        ['timeSeries Trig 1 0.0 $tEnd 0.4 -fac']
    """
    checks.instance("scene", scene, Scene)
    sliding = checks.positive("sliding", sliding)
    p = parameters_under(scene, pendulum)
    body, (series, end) = body_of(scene, p, sliding), _series(scene.excitation)
    return _rendered(
        "opensees.tcl.j2",
        body=body,
        ratio=float(p.velocity_ratio),
        step=_STEP_OPENSEES * body.contact_time,
        end=end,
        series=series,
    )


def _series(motion: Harmonic | GroundMotion) -> tuple[str, float]:
    """Return time series 1, the acceleration of the base, in Tcl, and the end of the run, s."""
    if isinstance(motion, Harmonic):
        # The base moves to the right first, and decelerates.
        peak, period = -float(motion.pga), 1.0 / float(motion.frequency)
        series = f"timeSeries Trig 1 0.0 $tEnd {period!r} -factor {peak!r}"
        return series, HARMONIC_PERIODS / float(motion.frequency)
    piece = float(motion.piece)
    # Linear between samples. This is exact for a record, and the pieces of a pulse are short.
    values = motion.acceleration_at(np.arange(len(motion.pieces()) + 1) * piece)
    listed = textwrap.fill(" ".join(map(repr, values.tolist())), 100, break_on_hyphens=False)
    return f"timeSeries Path 1 -dt {piece!r} -values {{\n{listed}\n}}", float(motion.duration) + _FREE
