"""Tuned pendulum design: find a pendulum that reduces the rocking of a block.

The public names are listed in `__init__.pyi` and imported on first use, so that `tpd --help` does not wait
for JAX.

The table lists the equations of the paper (Collini et al. 2016) and the functions that compute them.
Misprinted equations are corrected (page "Errata" of the guide). `tests/test_equation_table.py` compares each
function with its equation.

A folder imports only from the folders before it in this list: core, formats, scene, records, theory,
compiled, models, answers, engines, design, plots, report, explore, cli.

| equation | content | function |
|---|---|---|
| (4) | block and pendulum, nonlinear | theory/equations: Equations |
| (5), Table 1 | no uplift, with a pendulum as well | theory/no_uplift: uplift |
| (6) | rate omega_0 of the block | scene/scene: Scene.rate |
| after (6) | inertia ratio rho | scene/scene: Block.inertia_ratio |
| (7) to (11) | free rocking | theory/free_rocking: free_motion |
| (12) to (14) | forced block without pendulum: mu = 0 | theory/equations: Equations |
| (16) to (18) | motion between two events | theory/arc: arc |
| (19) | symmetric orbit, exact here | answers/symmetric_orbits: symmetric_orbits |
| (20) to (24) | one harmonic without pendulum: mu = 0 | theory/harmonic_balance: parametric_branches |
| (25) | block and pendulum, linear | theory/equations: Linear |
| (26), (27) | one harmonic with the pendulum | theory/harmonic_balance: one_harmonic_branches |
| not in the paper | Housner's coefficient of restitution | scene/impacts: housner |
| not in the paper | law of impacts with a bob | scene/impacts: velocity_ratio, bob_change |
| not in the paper | friction of equal loss | theory/free_rocking: equivalent_friction |
"""

import ast
import pkgutil
from typing import Any

import lazy_loader

__version__ = "0.2.0"

# `lazy_loader.attach_stub` needs the stub as a separate file. A wheel on the import path has none.
_names: dict[str | None, list[str]] = {}
for _node in ast.parse(pkgutil.get_data(__name__, "__init__.pyi") or "").body:
    if isinstance(_node, ast.ImportFrom):
        _names.setdefault(_node.module, []).extend(alias.name for alias in _node.names)
_value_of, __dir__, __all__ = lazy_loader.attach(__name__, _names.pop(None), _names)


def __getattr__(name: str) -> Any:
    try:
        value = _value_of(name)
    except AttributeError as error:
        from tpd.core.formatting import meant

        error.args = (f"{error}{meant(name, __all__, listing=False)}",)
        raise
    # A user who reaches a class of a scene by this function can pass its objects to JAX: register them.
    from tpd.scene import pytrees  # noqa: F401

    return value
