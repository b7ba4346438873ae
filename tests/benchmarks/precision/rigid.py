"""MuJoCo: a rigid block on a floor, with contact, shaken; for the bare block alone.

What it solves is not the linear model of the other methods. The block is a plane body on soft contact
and its rotations are finite; a landing loses the energy of an inelastic impact, where the linear model
with e = 1 loses none. The linear equations of a bare block keep their form when the tilt, nu, k and f
are scaled together, and both differences are of the second order in nu: so the engine is given a block
`SLIM` times as slender, with as much less friction and shaking, and its tilts are scaled back. Left are
an impact loss 1 - e of about 2 rho nu^2, contact that gives way over two time steps, and friction of
the rocking contact (`frictionloss` of the rotation) that is as soft. The shaking is the force of
inertia at the centroid, in the base's frame. Time is in units of tau: gravity 1, half height rho.
Errors against the truth of the linear model contain all this.
"""

import math
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout

from tests.benchmarks.precision import following
from tests.benchmarks.precision.following import GONE, Overturned, Settled
from tests.benchmarks.precision.methods import Method, Scene, Unable

SLIM = 0.03
"""Of 1, 0.3, 0.1 and 0.03 the first at which the block rocks on at every time step."""
SETTINGS = (1 / 250, 1 / 500, 1 / 1000, 1 / 2000, 1 / 4000)
"""Time step over the forcing period."""

SETTLING, AVERAGED = 25, 25
"""Forcing periods. The engine's motion does not come to repeat: contact begins and ends at whole steps,
and the amplitude trembles, so it is the mean of those of several periods."""
TREMBLE = 0.04
"""What differences take for its relative error; the best step is then a tenth of a parameter."""

XML = """
<mujoco>
  <option timestep="{step!r}" gravity="0 0 -1" cone="elliptic" integrator="Euler" tolerance="1e-14"
    iterations="50" solver="Newton"><flag warmstart="enable" energy="disable"/></option>
  <worldbody>
    <geom type="plane" size="9 9 1" friction="5" condim="3" solref="{stiff!r} 1" solimp="{hard}"/>
    <body pos="0 0 {b!r}">
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="z" type="slide" axis="0 0 1"/>
      <joint name="tilt" type="hinge" axis="0 1 0" frictionloss="{loss!r}"
        solreffriction="{stiff!r} 1" solimpfriction="{hard}"/>
      <geom type="box" size="{a!r} 1 {b!r}" mass="1" friction="5" condim="3" solref="{stiff!r} 1"
        solimp="{hard}"/>
    </body>
  </worldbody>
  <actuator><motor joint="x"/></actuator>
</mujoco>
"""


class Rig:
    """The block of one design in the engine."""

    def __init__(self, scene: Scene, share: float) -> None:
        p = following.plant(scene.x)
        if p.mu or p.e != 1.0:
            raise Unable("not the same model")
        self.p, nu = p, SLIM * p.nu
        self.b = 3.0 / (4.0 * (1.0 + nu * nu))
        self.a = nu * self.b
        step = share * p.period
        text = XML.format(
            step=step, a=self.a, b=self.b, loss=SLIM * p.k * self.b, stiff=2.0 * step, hard="0.9999 0.9999 1"
        )
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        times = step * np.arange(round(1.0 / share))
        self.push = -SLIM * p.f * np.sin(p.xi * times)[None, :, None]
        self.state: np.ndarray | None = None

    def start(self, y0: Any) -> None:
        """Stand still on the corner or, with a rate, rock about it."""
        tilt, rate = SLIM * float(y0[0]), SLIM * float(y0[2])
        sine, cosine, a = math.sin(tilt), math.cos(tilt), math.copysign(self.a, tilt or rate)
        # The centroid seen from the corner that carries.
        x, z = -a * cosine + self.b * sine, a * sine + self.b * cosine
        place = [x + a, z - self.b, tilt]
        self.state = np.array([[0.0, *place, z * rate, -x * rate, rate]])

    def period(self, _: np.ndarray) -> tuple[np.ndarray, float]:
        """One forcing period on from where the block is."""
        states, _ = rollout.rollout(self.model, self.data, self.state, self.push)
        tilts = np.abs(states[0, :, 3]) / SLIM
        if not np.max(tilts) < GONE:
            raise Overturned
        self.state = states[:, -1].copy()
        tilt, rate = self.state[0, 3] / SLIM, self.state[0, 6] / SLIM
        # Sliding along the floor does nothing: back to its middle.
        self.state[0, 1] = 0.0
        return np.array([tilt, 0.0, rate, 0.0]), float(np.max(tilts))


def settled(scene: Scene, y0: Any, share: float) -> Settled:
    """The mean motion with a time step that is a share of the forcing period."""
    rig = Rig(scene, share)
    rig.start(y0)
    y, peaks = np.array(y0, dtype=float), []
    for _ in range(SETTLING + AVERAGED):
        y, peak = rig.period(y)
        peaks.append(peak)
    return Settled(y, float(np.mean(peaks[SETTLING:])), len(peaks))


def _value(scene: Scene, share: float):
    return lambda: following.amplitude(lambda: settled(scene, scene.y0, share))


def _gradient(scene: Scene, share: float):
    return lambda: following.differences(scene, lambda s, y, _: settled(s, y, share), TREMBLE)


METHODS = (Method("MuJoCo", False, "time step / forcing period", SETTINGS, _value, _gradient),)
