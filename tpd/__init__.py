"""Tuned pendulum design: find the pendulum that keeps a rocking block from rocking.

Names are imported on first use, so that `tpd --help` does not wait for JAX. They stand in `__init__.pyi`.

The equations of the paper (Collini et al. 2016), corrected where it is misprinted (`tpd.theory.paper`), and
the functions that compute them: `tests/test_equation_table.py` compares each with its equation. A folder
imports only from those named before it: formats, core, cluster, scene, records, theory, exact, models,
answers, engines, design, plots, report, explore, cli.

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

from typing import Any

import lazy_loader

__version__ = "0.2.0"

_value_of, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    value = _value_of(name)
    # The classes of a scene are pytrees wherever a user of the package reaches them.
    from tpd.scene import pytrees  # noqa: F401

    return value
