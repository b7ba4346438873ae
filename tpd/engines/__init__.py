"""Independent rigid-body engines: the same block, pendulum and excitation with other codes than this package.

An engine includes contact, sliding and bouncing, which the equations of the paper neglect. It has no exact
events, so its results depend on its time step. Comparisons therefore use two time steps.
"""

from typing import TYPE_CHECKING, Any

from tpd.engines.rigid_body import mjcf as mjcf
from tpd.engines.rigid_body import opensees as opensees

if TYPE_CHECKING:
    from tpd.engines.comparison import EngineVerdict as EngineVerdict
    from tpd.engines.comparison import mujoco as mujoco

__all__ = ["EngineVerdict", "mjcf", "mujoco", "opensees"]


def __getattr__(name: str) -> Any:
    """Import the comparison with an engine on first use. It needs JAX, which a model for export does not."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from tpd.engines import comparison

    return getattr(comparison, name)
