"""Block, pendulum and shaking as the text of a plane OpenSees model in Tcl, in SI units.

The block is a star of stiff beams from its centre of mass to its lower corners and to the hinge; it stands on
friction bearings that bear no tension. Coordinates move with the base, whose acceleration is an excitation.
"""

from __future__ import annotations

import textwrap
from importlib import resources

import numpy as np

from tpd.core import checks
from tpd.engines.rigid_body import SLIDING, body_of, parameters_under
from tpd.scene.conditions import HARMONIC_PERIODS
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.scene import Harmonic, Pendulum, Scene

_FREE = 20.0
"""Free motion after a pulse or a record, s."""
_STEP = 0.2
"""Time step over the time constant of the contact."""


def opensees(scene: Scene, pendulum: Pendulum | None = None, *, sliding: float = SLIDING) -> str:
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
    # A model in MJCF needs no template, and should not wait for one.
    import jinja2

    checks.instance("scene", scene, Scene)
    checks.positive("sliding", sliding)
    p, motion = parameters_under(scene, pendulum), scene.motion
    body = body_of(scene, p, sliding)
    ground = isinstance(motion, GroundMotion)
    source = resources.files("tpd.engines").joinpath("model.tcl.j2").read_text(encoding="utf-8")
    # A name that is missing in the template is an error, not an empty place in a model.
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    return environment.from_string(source).render(
        body=body,
        ratio=float(p.velocity_ratio),
        step=_STEP * body.contact_time,
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
