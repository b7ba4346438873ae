"""Tuned pendulum design: find the pendulum that keeps a rocking block from rocking.

Names are imported on first use, so that `tpd --help` does not wait for JAX.

The equations of the paper (Collini et al. 2016), corrected where it is misprinted (`tpd.theory.paper`), and
the functions that compute them: `tests/test_equation_table.py` compares each with its equation. A folder
imports only from those named before it: formats, core, cluster, scene, records, theory, exact, models,
answers, engines, design, plots, report, cli.

| equation | content | function |
|---|---|---|
| (4) | block and pendulum, nonlinear | theory/equations: Equations |
| (5), Table 1 | no uplift, with a pendulum as well | theory/no_uplift: uplift |
| (6) | rate omega_0 of the block | scene/scene: Scene.rate |
| after (6) | inertia ratio rho | scene/scene: Block.inertia_ratio |
| (7) to (11) | free rocking | theory/free_rocking: free_motion |
| (12) to (14) | forced bare block: mu = 0 | theory/equations: Equations |
| (16) to (18) | motion between two events | answers/steady_state: simulate |
| (19) | symmetric orbit, exact here | answers/symmetric_orbits: symmetric_orbits |
| (20) to (24) | one harmonic, bare block: mu = 0 | theory/harmonic_balance: parametric_branches |
| (25) | block and pendulum, linear | theory/equations: Linear |
| (26), (27) | one harmonic with the pendulum | theory/harmonic_balance: one_harmonic_branches |
| not in it | Housner's velocity ratio | scene/impacts: housner |
| not in it | law of impacts with a bob | scene/impacts: velocity_ratio, bob_change |
| not in it | friction of equal loss | theory/free_rocking: equivalent_friction |
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tpd import engines  # noqa: F401
    from tpd import records as records
    from tpd import theory as theory
    from tpd.answers.attractors import attractors as attractors
    from tpd.answers.auto import Auto as Auto
    from tpd.answers.compare_models import check as check
    from tpd.answers.critical_scale import critical_scale as critical_scale
    from tpd.answers.design_map import design_map as design_map
    from tpd.answers.ensemble import outcomes as outcomes
    from tpd.answers.fragility import fragility as fragility
    from tpd.answers.paired import paired_runs as paired_runs
    from tpd.answers.periodic_orbit import periodic_orbit as periodic_orbit
    from tpd.answers.response import branches as branches
    from tpd.answers.response import settled_response as settled_response
    from tpd.answers.spectra import overturning_spectrum as overturning_spectrum
    from tpd.answers.spectra import rocking_spectrum as rocking_spectrum
    from tpd.answers.steady_state import simulate as simulate
    from tpd.answers.steady_state import steady_state as steady_state
    from tpd.answers.symmetric_orbits import symmetric_orbits as symmetric_orbits
    from tpd.answers.transient import transient as transient
    from tpd.cluster.cluster import Cluster as Cluster
    from tpd.core.batch import in_chunks as in_chunks
    from tpd.design import criteria as limits  # noqa: F401
    from tpd.design.as_built import study as study
    from tpd.design.criteria import DesignSpace as DesignSpace
    from tpd.design.criteria import Risk as Risk
    from tpd.design.design import Design as Design
    from tpd.design.job import Job as Job
    from tpd.design.optimise import optimise as optimise
    from tpd.design.pareto import front as front
    from tpd.design.pareto import optimise_all as optimise_all
    from tpd.design.reading import read_design as read_design
    from tpd.design.settings import Descent as Descent
    from tpd.design.settings import GroundSearch as GroundSearch
    from tpd.models.nonlinear import Nonlinear as Nonlinear
    from tpd.models.piecewise import Piecewise as Piecewise
    from tpd.models.smoothed import Smoothed as Smoothed
    from tpd.plots.results import plot as plot
    from tpd.report.files import write_report as write_report
    from tpd.scene.conditions import Conditions as Conditions
    from tpd.scene.ensemble import Ensemble as Ensemble
    from tpd.scene.ground_motion import Pulse as Pulse
    from tpd.scene.parameters import Parameters as Parameters
    from tpd.scene.record import Record as Record
    from tpd.scene.scene import Block as Block
    from tpd.scene.scene import Harmonic as Harmonic
    from tpd.scene.scene import Pendulum as Pendulum
    from tpd.scene.scene import Scene as Scene
    from tpd.scene.scene import paper_scene as paper_scene
    from tpd.scene.starts import Starts as Starts
    from tpd.scene.status import Status as Status
    from tpd.scene.status import status_name as status_name
    from tpd.theory.equations import Terms as Terms

__version__ = "0.2.0"

_NAMES = {
    "answers.attractors": "attractors",
    "answers.auto": "Auto",
    "answers.compare_models": "check",
    "answers.critical_scale": "critical_scale",
    "answers.design_map": "design_map",
    "answers.ensemble": "outcomes",
    "answers.fragility": "fragility",
    "answers.paired": "paired_runs",
    "answers.periodic_orbit": "periodic_orbit",
    "answers.response": "branches settled_response",
    "answers.spectra": "overturning_spectrum rocking_spectrum",
    "answers.steady_state": "simulate steady_state",
    "answers.symmetric_orbits": "symmetric_orbits",
    "answers.transient": "transient",
    "core.batch": "in_chunks",
    "cluster.cluster": "Cluster",
    "scene.conditions": "Conditions",
    "theory.equations": "Terms",
    "scene.ensemble": "Ensemble",
    "scene.ground_motion": "Pulse",
    "scene.starts": "Starts",
    "scene.parameters": "Parameters",
    "scene.record": "Record",
    "scene.scene": "Block Harmonic Pendulum Scene paper_scene",
    "scene.status": "Status status_name",
    "design.criteria": "DesignSpace Risk",
    "design.job": "Job",
    "design.pareto": "front optimise_all",
    "design.optimise": "optimise",
    "design.design": "Design",
    "design.settings": "Descent GroundSearch",
    "design.reading": "read_design",
    "design.as_built": "study",
    "models.piecewise": "Piecewise",
    "models.nonlinear": "Nonlinear",
    "models.smoothed": "Smoothed",
    "plots.results": "plot",
    "report.files": "write_report",
}
"""Names by the modules that they come from."""
_HOMES = {name: home for home, names in _NAMES.items() for name in names.split()}
_MODULES = {
    "theory": "theory",
    "engines": "engines",
    "limits": "design.criteria",
    "records": "records",
}

__all__ = sorted([*_HOMES, *_MODULES])  # pyright: ignore[reportUnsupportedDunderAll]


if not TYPE_CHECKING:
    # Seen by a checker of types it would make every misspelt name one that is not known but allowed.
    def __getattr__(name: str) -> Any:
        # The classes of a scene are pytrees wherever a user of the package reaches them.
        import_module("tpd.scene.pytrees")
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
