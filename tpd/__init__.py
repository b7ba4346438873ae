"""Tuned pendulum design: find the pendulum that keeps a rocking block from rocking.

Names are imported on first use, so that `tpd --help` does not wait for JAX.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tpd.analysis.attractors import Attractor as Attractor
    from tpd.analysis.attractors import Starts as Starts
    from tpd.analysis.attractors import attractors as attractors
    from tpd.analysis.auto import Auto as Auto
    from tpd.analysis.bifurcations import Bifurcation as Bifurcation
    from tpd.analysis.bifurcations import bifurcations as bifurcations
    from tpd.analysis.compare_models import check as check
    from tpd.analysis.design_map import DesignMap as DesignMap
    from tpd.analysis.design_map import design_map as design_map
    from tpd.analysis.ensemble import Ensemble as Ensemble
    from tpd.analysis.ensemble import outcomes as outcomes
    from tpd.analysis.ensemble import verdict as verdict
    from tpd.analysis.periodic_orbit import continue_orbit as continue_orbit
    from tpd.analysis.periodic_orbit import periodic_orbit as periodic_orbit
    from tpd.analysis.response import branches as branches
    from tpd.analysis.response import frequency_response as frequency_response
    from tpd.analysis.response import settled_response as settled_response
    from tpd.analysis.steady_state import simulate as simulate
    from tpd.analysis.steady_state import steady_state as steady_state
    from tpd.analysis.sweep import sweep as sweep
    from tpd.analysis.symmetric_orbits import symmetric_orbits as symmetric_orbits
    from tpd.closed_form.free_rocking import free_motion as free_motion
    from tpd.closed_form.harmonic_balance import neglected_harmonics as neglected_harmonics
    from tpd.closed_form.harmonic_balance import one_harmonic as one_harmonic
    from tpd.closed_form.harmonic_balance import one_harmonic_branches as one_harmonic_branches
    from tpd.closed_form.harmonic_balance import parametric_branches as parametric_branches
    from tpd.closed_form.impact_loss import equivalent_friction as equivalent_friction
    from tpd.closed_form.no_uplift import uplift as uplift
    from tpd.core.batch import in_chunks as in_chunks
    from tpd.core.conditions import Conditions as Conditions
    from tpd.core.conditions import Limits as Limits
    from tpd.core.conditions import Measure as Measure
    from tpd.core.equations import Terms as Terms
    from tpd.core.parameters import Parameters as Parameters
    from tpd.core.scene import Block as Block
    from tpd.core.scene import Harmonic as Harmonic
    from tpd.core.scene import Pendulum as Pendulum
    from tpd.core.scene import Scene as Scene
    from tpd.core.scene import paper_scene as paper_scene
    from tpd.core.status import Status as Status
    from tpd.core.status import status_name as status_name
    from tpd.design.many import optimise_over as optimise_over
    from tpd.design.pareto import pareto as pareto
    from tpd.design.result import Design as Design
    from tpd.design.result import DesignSpace as DesignSpace
    from tpd.design.single import optimise as optimise
    from tpd.models.piecewise import Piecewise as Piecewise
    from tpd.models.segmented import Segmented as Segmented
    from tpd.models.smoothed import Smoothed as Smoothed

__version__ = "0.1.0"

_HOMES = {
    "Attractor": "analysis.attractors",
    "Auto": "analysis.auto",
    "Bifurcation": "analysis.bifurcations",
    "Block": "core.scene",
    "Conditions": "core.conditions",
    "Design": "design.result",
    "DesignMap": "analysis.design_map",
    "DesignSpace": "design.result",
    "Ensemble": "analysis.ensemble",
    "Harmonic": "core.scene",
    "Limits": "core.conditions",
    "Measure": "core.conditions",
    "Parameters": "core.parameters",
    "Pendulum": "core.scene",
    "Piecewise": "models.piecewise",
    "Scene": "core.scene",
    "Segmented": "models.segmented",
    "Smoothed": "models.smoothed",
    "Starts": "analysis.attractors",
    "Status": "core.status",
    "Terms": "core.equations",
    "attractors": "analysis.attractors",
    "bifurcations": "analysis.bifurcations",
    "branches": "analysis.response",
    "check": "analysis.compare_models",
    "continue_orbit": "analysis.periodic_orbit",
    "design_map": "analysis.design_map",
    "equivalent_friction": "closed_form.impact_loss",
    "free_motion": "closed_form.free_rocking",
    "frequency_response": "analysis.response",
    "in_chunks": "core.batch",
    "neglected_harmonics": "closed_form.harmonic_balance",
    "one_harmonic": "closed_form.harmonic_balance",
    "one_harmonic_branches": "closed_form.harmonic_balance",
    "optimise": "design.single",
    "optimise_over": "design.many",
    "outcomes": "analysis.ensemble",
    "paper_scene": "core.scene",
    "parametric_branches": "closed_form.harmonic_balance",
    "pareto": "design.pareto",
    "periodic_orbit": "analysis.periodic_orbit",
    "settled_response": "analysis.response",
    "simulate": "analysis.steady_state",
    "status_name": "core.status",
    "steady_state": "analysis.steady_state",
    "sweep": "analysis.sweep",
    "symmetric_orbits": "analysis.symmetric_orbits",
    "uplift": "closed_form.no_uplift",
    "verdict": "analysis.ensemble",
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
