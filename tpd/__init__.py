"""Tuned pendulum design: find the pendulum that keeps a rocking block from rocking.

Names are imported on first use, so that `tpd --help` does not wait for JAX.

The equations of the paper (Collini et al. 2016) and the modules that hold them. A folder imports only from
those named before it: formats, core, records, closed_form, exact, models, analysis, design, plot, report,
cli.

| equation | content | module |
|---|---|---|
| (4) | block and pendulum, nonlinear | core/equations; solved in models/segmented, models/smoothed |
| (5) | uplift, here with a pendulum | closed_form/no_uplift |
| (6), omega_0, rho | rate and inertia of the block | core/scene |
| (7) to (11) | free rocking | closed_form/free_rocking |
| (12) to (14) | forced bare block: mu = 0 | core/equations |
| (16) to (18) | motion on one arc | exact/plant, exact/arcs |
| (19) | periodic orbit, exact here | exact/half_period_kernel, analysis/symmetric_orbits |
| (20) to (24) | one-harmonic balance, bare block: mu = 0 | closed_form/harmonic_balance |
| (25) | block and pendulum, linear | core/equations; solved in models/piecewise |
| (26), (27) | one-harmonic balance with the pendulum | closed_form/harmonic_balance |
| Table 1 | pendulums that keep the block down | closed_form/no_uplift, analysis/design_map |
| as printed | formulas with their misprints, errata | closed_form/paper |
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tpd import closed_form as closed_form
    from tpd import engines  # noqa: F401
    from tpd import records as records
    from tpd.analysis.attractors import Starts as Starts
    from tpd.analysis.attractors import attractors as attractors
    from tpd.analysis.auto import Auto as Auto
    from tpd.analysis.compare_models import check as check
    from tpd.analysis.critical_scale import critical_scale as critical_scale
    from tpd.analysis.design_map import design_map as design_map
    from tpd.analysis.ensemble import Ensemble as Ensemble
    from tpd.analysis.ensemble import outcomes as outcomes
    from tpd.analysis.fragility import fragility as fragility
    from tpd.analysis.overturning_spectrum import overturning_spectrum as overturning_spectrum
    from tpd.analysis.paired import verdict as verdict
    from tpd.analysis.periodic_orbit import periodic_orbit as periodic_orbit
    from tpd.analysis.response import branches as branches
    from tpd.analysis.response import settled_response as settled_response
    from tpd.analysis.rocking_spectrum import rocking_spectrum as rocking_spectrum
    from tpd.analysis.steady_state import simulate as simulate
    from tpd.analysis.steady_state import steady_state as steady_state
    from tpd.analysis.symmetric_orbits import symmetric_orbits as symmetric_orbits
    from tpd.analysis.transient import transient as transient
    from tpd.core.batch import in_chunks as in_chunks
    from tpd.core.cluster import Cluster as Cluster
    from tpd.core.conditions import Conditions as Conditions
    from tpd.core.equations import Terms as Terms
    from tpd.core.ground_motion import Pulse as Pulse
    from tpd.core.parameters import Parameters as Parameters
    from tpd.core.record import Record as Record
    from tpd.core.scene import Block as Block
    from tpd.core.scene import Harmonic as Harmonic
    from tpd.core.scene import Pendulum as Pendulum
    from tpd.core.scene import Scene as Scene
    from tpd.core.scene import paper_scene as paper_scene
    from tpd.core.status import Status as Status
    from tpd.core.status import status_name as status_name
    from tpd.design import criteria as limits  # noqa: F401
    from tpd.design.criteria import DesignSpace as DesignSpace
    from tpd.design.criteria import Risk as Risk
    from tpd.design.front import front as front
    from tpd.design.ground.search import GroundSearch as GroundSearch
    from tpd.design.job import Job as Job
    from tpd.design.many import optimise_all as optimise_all
    from tpd.design.methods import Descent as Descent
    from tpd.design.methods import Sequential as Sequential
    from tpd.design.optimise import optimise as optimise
    from tpd.design.result import Design as Design
    from tpd.models.piecewise import Piecewise as Piecewise
    from tpd.models.segmented import Segmented as Segmented
    from tpd.models.smoothed import Smoothed as Smoothed

__version__ = "0.1.0"

_NAMES = {
    "analysis.attractors": "Starts attractors",
    "analysis.auto": "Auto",
    "analysis.compare_models": "check",
    "analysis.critical_scale": "critical_scale",
    "analysis.design_map": "design_map",
    "analysis.ensemble": "Ensemble outcomes",
    "analysis.fragility": "fragility",
    "analysis.overturning_spectrum": "overturning_spectrum",
    "analysis.paired": "verdict",
    "analysis.periodic_orbit": "periodic_orbit",
    "analysis.response": "branches settled_response",
    "analysis.rocking_spectrum": "rocking_spectrum",
    "analysis.steady_state": "simulate steady_state",
    "analysis.symmetric_orbits": "symmetric_orbits",
    "analysis.transient": "transient",
    "core.batch": "in_chunks",
    "core.cluster": "Cluster",
    "core.conditions": "Conditions",
    "core.equations": "Terms",
    "core.ground_motion": "Pulse",
    "core.parameters": "Parameters",
    "core.record": "Record",
    "core.scene": "Block Harmonic Pendulum Scene paper_scene",
    "core.status": "Status status_name",
    "design.criteria": "DesignSpace Risk",
    "design.front": "front",
    "design.ground.search": "GroundSearch",
    "design.job": "Job",
    "design.many": "optimise_all",
    "design.methods": "Descent Sequential",
    "design.optimise": "optimise",
    "design.result": "Design",
    "models.piecewise": "Piecewise",
    "models.segmented": "Segmented",
    "models.smoothed": "Smoothed",
}
"""Names by the modules that they come from."""
_HOMES = {name: home for home, names in _NAMES.items() for name in names.split()}
_MODULES = {
    "closed_form": "closed_form",
    "engines": "engines",
    "limits": "design.criteria",
    "records": "records",
}

__all__ = sorted([*_HOMES, *_MODULES])  # pyright: ignore[reportUnsupportedDunderAll]


if not TYPE_CHECKING:
    # Seen by a checker of types it would make every misspelt name one that is not known but allowed.
    def __getattr__(name: str) -> Any:
        if name in _MODULES:
            value = import_module(f"tpd.{_MODULES[name]}")
        elif name in _HOMES:
            value = getattr(import_module(f"tpd.{_HOMES[name]}"), name)
        else:
            raise AttributeError(f"module 'tpd' has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return __all__
