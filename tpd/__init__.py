"""Tuned pendulum design: find the pendulum that keeps a rocking block from rocking.

Names are imported on first use, so that `tpd --help` does not wait for JAX.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tpd.attractor import Attractor as Attractor
    from tpd.attractor import Starts as Starts
    from tpd.attractor import attractors as attractors
    from tpd.balance import neglected_harmonics as neglected_harmonics
    from tpd.balance import one_harmonic as one_harmonic
    from tpd.balance import one_harmonic_branches as one_harmonic_branches
    from tpd.balance import parametric_branches as parametric_branches
    from tpd.balance import uplift as uplift
    from tpd.batch import in_chunks as in_chunks
    from tpd.bifurcation import Bifurcation as Bifurcation
    from tpd.bifurcation import bifurcations as bifurcations
    from tpd.checking import check as check
    from tpd.design import Design as Design
    from tpd.design import DesignSpace as DesignSpace
    from tpd.ensemble import Ensemble as Ensemble
    from tpd.ensemble import outcomes as outcomes
    from tpd.ensemble import verdict as verdict
    from tpd.equations import Terms as Terms
    from tpd.free import free_motion as free_motion
    from tpd.general import continue_orbit as continue_orbit
    from tpd.general import periodic_orbit as periodic_orbit
    from tpd.ladder import Auto as Auto
    from tpd.losses import equivalent_friction as equivalent_friction
    from tpd.maps import DesignMap as DesignMap
    from tpd.maps import design_map as design_map
    from tpd.models.piecewise import Piecewise as Piecewise
    from tpd.models.segmented import Segmented as Segmented
    from tpd.models.smoothed import Smoothed as Smoothed
    from tpd.optimiser import optimise as optimise
    from tpd.orbits import symmetric_orbits as symmetric_orbits
    from tpd.parameters import Parameters as Parameters
    from tpd.response import branches as branches
    from tpd.response import frequency_response as frequency_response
    from tpd.response import settled_response as settled_response
    from tpd.robust.conditions import Conditions as Conditions
    from tpd.robust.conditions import Limits as Limits
    from tpd.robust.conditions import Measure as Measure
    from tpd.robust.optimise import optimise_over as optimise_over
    from tpd.robust.pareto import pareto as pareto
    from tpd.scene import Block as Block
    from tpd.scene import Harmonic as Harmonic
    from tpd.scene import Pendulum as Pendulum
    from tpd.scene import Scene as Scene
    from tpd.scene import paper_scene as paper_scene
    from tpd.status import Status as Status
    from tpd.status import status_name as status_name
    from tpd.steady import simulate as simulate
    from tpd.steady import steady_state as steady_state
    from tpd.sweeps import sweep as sweep

__version__ = "0.1.0"

_HOMES = {
    "Attractor": "attractor",
    "Auto": "ladder",
    "Bifurcation": "bifurcation",
    "Block": "scene",
    "Conditions": "robust.conditions",
    "Design": "design",
    "DesignMap": "maps",
    "DesignSpace": "design",
    "Ensemble": "ensemble",
    "Harmonic": "scene",
    "Limits": "robust.conditions",
    "Measure": "robust.conditions",
    "Parameters": "parameters",
    "Pendulum": "scene",
    "Piecewise": "models.piecewise",
    "Scene": "scene",
    "Segmented": "models.segmented",
    "Smoothed": "models.smoothed",
    "Starts": "attractor",
    "Status": "status",
    "Terms": "equations",
    "attractors": "attractor",
    "bifurcations": "bifurcation",
    "branches": "response",
    "check": "checking",
    "continue_orbit": "general",
    "design_map": "maps",
    "equivalent_friction": "losses",
    "free_motion": "free",
    "frequency_response": "response",
    "in_chunks": "batch",
    "neglected_harmonics": "balance",
    "one_harmonic": "balance",
    "one_harmonic_branches": "balance",
    "optimise": "optimiser",
    "optimise_over": "robust.optimise",
    "outcomes": "ensemble",
    "paper_scene": "scene",
    "parametric_branches": "balance",
    "pareto": "robust.pareto",
    "periodic_orbit": "general",
    "settled_response": "response",
    "simulate": "steady",
    "status_name": "status",
    "steady_state": "steady",
    "sweep": "sweeps",
    "symmetric_orbits": "orbits",
    "uplift": "balance",
    "verdict": "ensemble",
}

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'tpd' has no attribute {name!r}")
    value = getattr(import_module(f"tpd.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
