"""Block and pendulum as rigid bodies in SI units, and the text of models of them for MuJoCo and OpenSees.

The block stands on the two lower corners of its cross-section. In the frame of the floor the base's
acceleration acts on every mass, so that it enters as forces in the two centres of mass.

In OpenSees (Tcl) the block is a star of stiff beams from its centre of mass to its lower corners and to the
hinge; it stands on friction bearings that bear no tension. Coordinates move with the base.
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
from tpd.scene.scene import Harmonic, Pendulum, Scene

SLIDING = 0.6
"""Coefficient of friction against sliding, of stone on stone."""
_CONTACT = 0.01
"""Time constant of the contact over sqrt(b/g): soft enough for the step, and impacts are Housner's."""
_STEP = 0.4
"""Time step over the time constant of the contact."""
RADIUS = 1e-4
"""Radius of a corner over the half height. On a visible arc a thin block would roll and never rest."""


_FREE = 20.0
"""Free motion after a pulse or a record, s."""
_STEP_OPENSEES = 0.2
"""Time step of an OpenSees model over the time constant of the contact."""


@dataclass(frozen=True)
class RigidBody:
    """A block with its pendulum: SI units."""

    half_width: float
    half_height: float
    mass: float
    inertia: float
    """About the centre of mass, kg m^2."""
    friction: float
    """Moment of the dry friction of rocking, N m."""
    bob: float
    """Mass of the bob, kg; 0 for a bare block."""
    rod: float
    """Length of the rod, m."""
    damping: float
    """Constant of the hinge's damper, N m s."""
    gravity: float
    sliding: float = SLIDING
    steps: int = 1
    """Divisor of the time step."""

    @property
    def contact_time(self) -> float:
        """Time constant of the contact, s."""
        return _CONTACT * math.sqrt(self.half_height / self.gravity)

    @property
    def step(self) -> float:
        """Time step, s."""
        return _STEP * self.contact_time / self.steps

    @property
    def housner(self) -> float:
        """Velocity ratio of Housner's impact of the bare block."""
        # Angular momentum about the corner that is struck, kept through the impact.
        a2, b2 = self.half_width**2, self.half_height**2
        own = self.inertia / self.mass
        return 1.0 - 2.0 * a2 / (a2 + b2 + own)

    def mjcf(self) -> str:
        """Model as text, in MuJoCo's format."""
        return _rendered("mujoco.xml.j2", body=self, radius=RADIUS * self.half_height)


def _rendered(template: str, **values: Any) -> str:
    """Return the text of a model from its template, a file beside this one."""
    # Few commands write a model, and the others should not wait for this package.
    import jinja2

    source = resources.files("tpd.engines").joinpath(template).read_text(encoding="utf-8")
    # A name that is missing in the template is an error, not an empty place in a model.
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    return environment.from_string(source).render(values)


def parameters_under(scene: Scene, pendulum: Pendulum | None) -> Parameters:
    """Dimensionless parameters of a scene with any motion."""
    harmonic = isinstance(scene.motion, Harmonic)
    return scene.parameters(pendulum) if harmonic else scene.ground_parameters(pendulum)


def body_of(scene: Scene, p: Parameters, sliding: float, steps: int = 1) -> RigidBody:
    """Rigid bodies of dimensionless parameters (plain numbers), at the scene's size and mass."""
    b, mass, g = float(scene.block.half_height), float(scene.block.mass), float(scene.gravity)
    nu, mu, rod = float(p.nu), float(p.mu), float(p.lam) * b
    own = b**2 * (1.0 / float(p.inertia_ratio) - 1.0 - nu**2)
    damping = 2.0 * float(p.zeta) * mu * mass * rod * math.sqrt(g * rod)
    return RigidBody(
        half_width=nu * b,
        half_height=b,
        mass=mass,
        inertia=mass * own,
        friction=float(p.k) * mass * g * b,
        bob=mu * mass,
        rod=rod,
        damping=damping,
        gravity=g,
        sliding=sliding,
        steps=steps,
    )


def mjcf(scene: Scene, pendulum: Pendulum | None = None, *, sliding: checks.Real = SLIDING) -> str:
    """Block and pendulum as the text of a MuJoCo model, which needs no MuJoCo.

    The shaking is no part of the text: give every actuator the acceleration of the base in m/s^2 as control.

    Args:
        scene: of any motion.
        pendulum: None is the bare block.
        sliding: coefficient of friction of the corners on the floor.

    Raises:
        ValueError: bad input.
    """
    checks.instance("scene", scene, Scene)
    sliding = checks.positive("sliding", sliding)
    return body_of(scene, parameters_under(scene, pendulum), sliding).mjcf()


def opensees(scene: Scene, pendulum: Pendulum | None = None, *, sliding: checks.Real = SLIDING) -> str:
    """Block, pendulum and shaking as the text of an OpenSees model in Tcl, which needs no OpenSees.

    The text stands the block under its weight, shakes it and writes its motion to files. Its comments say
    how the model differs from the equations: damping of the contact takes the energy of impacts, and whoever
    runs the model must match it.

    Args:
        scene: of any motion: a harmonic lasts 40 periods; a record has its samples, and a pulse those between
            its pieces, with free motion of 20 s after either.
        pendulum: None is the bare block.
        sliding: coefficient of friction of the corners on the floor.

    Raises:
        ValueError: bad input.
    """
    checks.instance("scene", scene, Scene)
    sliding = checks.positive("sliding", sliding)
    p, motion = parameters_under(scene, pendulum), scene.motion
    body = body_of(scene, p, sliding)
    ground = isinstance(motion, GroundMotion)
    return _rendered(
        "opensees.tcl.j2",
        body=body,
        ratio=float(p.velocity_ratio),
        step=_STEP_OPENSEES * body.contact_time,
        end=float(motion.duration) + _FREE if ground else HARMONIC_PERIODS / float(motion.frequency),
        series=_series(motion),
    )


def _series(motion: Harmonic | GroundMotion) -> str:
    """Time series 1, the acceleration of the base."""
    if isinstance(motion, Harmonic):
        # The base begins to move to the right, and is braked.
        peak, period = -float(motion.amplitude) * float(motion.rate) ** 2, 1.0 / float(motion.frequency)
        return f"timeSeries Trig 1 0.0 $tEnd {period!r} -factor {peak!r}"
    piece = float(motion.piece)
    # Linear between samples: a record is so already, and the pieces of a pulse are short.
    values = motion.acceleration_at(np.arange(len(motion.pieces()) + 1) * piece)
    listed = textwrap.fill(" ".join(map(repr, values.tolist())), 100, break_on_hyphens=False)
    return f"timeSeries Path 1 -dt {piece!r} -values {{\n{listed}\n}}"
