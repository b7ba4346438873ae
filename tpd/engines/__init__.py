"""Independent rigid-body engines: the same block, pendulum and shaking by codes that share nothing with ours.

An engine knows contact, sliding and bouncing, which the equations of the paper leave out. It has no exact
events: its answers depend on its time step, hence two steps stand side by side.
"""

from tpd.engines.comparison import EngineVerdict as EngineVerdict
from tpd.engines.comparison import mujoco as mujoco
from tpd.engines.rigid_body import mjcf as mjcf
from tpd.engines.rigid_body import opensees as opensees

__all__ = ["EngineVerdict", "mjcf", "mujoco", "opensees"]
