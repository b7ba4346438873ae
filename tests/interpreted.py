"""Results of the package with its compiled code interpreted, for another order of the parameters.

    python -m tests.interpreted rho xi e mu kappa nu f k zeta lam

prints them as JSON: numbers by name, never by the place of a parameter.
"""

from __future__ import annotations

import json
import os
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np

VALUES = {
    **{"nu": 0.25, "mu": 0.1, "lam": 0.6, "zeta": 0.1, "k": 0.05, "f": 0.4, "xi": 2.5},
    **{"rho": 0.7, "e": 0.9, "kappa": 1.3},
}


def results() -> dict[str, Any]:
    """Results of all kernels and of what reads rows of parameters, with derivatives by name."""
    import jax

    import tpd
    from tpd.answers.bifurcations import bifurcations
    from tpd.answers.ensemble import plan
    from tpd.answers.motion_history import motion_history
    from tpd.answers.run_table import ANGLES, follow_scaled
    from tpd.compiled.orbits import orbit_slopes, solve_orbits
    from tpd.compiled.rows import row_of
    from tpd.compiled.simulate import HarmonicForcing, follow
    from tpd.design.geometry import Geometry
    from tpd.design.orbits import Orbits
    from tpd.scene.parameters import NAMES, Parameters

    def leaves(tree: Any) -> list[float]:
        known = [np.asarray(leaf) for leaf in jax.tree.leaves(tree)]
        parts = [part for x in known for part in ((x.real, x.imag) if np.iscomplexobj(x) else (x,))]
        return np.concatenate([np.ravel(x).astype(float) for x in parts]).tolist()

    def named(slopes: Any) -> dict[str, Any]:
        return {name: np.asarray(slopes)[..., NAMES.index(name)].tolist() for name in VALUES}

    p = Parameters(**VALUES)
    scene = tpd.Scene(
        tpd.Block(width=0.5, height=2.0, mass=1000.0, friction=0.05, restitution=1.0),
        tpd.Pulse.one_sine(acceleration=3.2, frequency=1.5),
    )
    pendulum = tpd.Pendulum(mass=80.0, length=0.5, damping_ratio=0.1)
    steady = tpd.steady_state(p)
    row = row_of(p)
    orbits = solve_orbits(row[None])
    slopes = orbit_slopes(row[None], orbits, np.eye(len(NAMES))[None], (0, 11))[0, 0]
    runs = plan(p, tpd.Ensemble(size=3))
    shaken = (
        follow_scaled(
            scene.block, [None, pendulum], [scene.excitation], np.array([[1.0]]), free=2.0, equations=terms
        )
        for terms in (tpd.Terms.linear, tpd.Terms.nonlinear)
    )
    block = tpd.Scene(scene.block, tpd.Harmonic(amplitude=0.03, frequency=1.5))
    conditions = tpd.Conditions.band(block, 1.4, 1.6, 2)
    free, space = block.parameters(), tpd.DesignSpace()
    objective = Orbits(free, conditions, space, tpd.Risk.worst(), (), Geometry.of(block, conditions))

    history = motion_history(scene, pendulum, times=np.linspace(0.0, 2.0, 9))

    periodic = tpd.periodic_orbit(p, steady.state)

    def on_orbit(given: dict[str, Any]) -> Any:
        return tpd.periodic_orbit(Parameters(**given), steady.state).amplitude

    return {
        "steady": leaves(steady),
        "orbits": leaves(tpd.symmetric_orbits(p)),
        "gradient": leaves(jax.grad(lambda given: tpd.steady_state(Parameters(**given)).amplitude)(VALUES)),
        "slopes of orbits": named(np.moveaxis(slopes, 0, -1)[:11]),
        "objective": leaves(objective.evaluate(np.array([[0.15, 0.26, 0.35]]))),
        "gradient of an orbit": leaves(jax.grad(on_orbit)(VALUES)),
        "periodic": leaves(periodic),
        "nonlinear": leaves(follow(tpd.Terms.nonlinear, row[None], HarmonicForcing(5))),
        "nonlinear steady state": leaves(tpd.steady_state(p, model=tpd.Nonlinear())),
        "history": leaves((history.tilt, history.horizontal, history.impacts)),
        "ensemble": leaves(runs),
        "shaken": [leaves([getattr(one, n) for n in (*ANGLES, "impacts", "outcome")]) for one in shaken],
        "bifurcations": [
            [b.value, b.amplitude, *(b.slopes.get(n, 0.0) for n in VALUES)]
            for b in bifurcations(p, "k", 0.01, 0.4, samples=12)
        ],
    }


def flat(tree: Any) -> list[float]:
    """Return the numbers in nested lists and dictionaries."""
    if isinstance(tree, dict):
        return [x for name in sorted(tree) for x in flat(tree[name])]
    return [x for part in tree for x in flat(part)] if isinstance(tree, list) else [tree]


def interpret() -> None:
    """Let Python run what Numba compiles, from its entrances on."""
    import numba

    from tpd.compiled import custom_call

    def records(make: Any) -> Any:
        def made(*args: Any, **options: Any) -> np.ndarray:
            x = make(*args, **options)
            return x.view(np.recarray) if x.dtype.names else x

        return made

    def view(buffer: np.ndarray, shape: tuple[int, ...], dtype: Any) -> np.ndarray:
        dtype, flat = np.dtype(dtype), buffer.reshape(-1).view(np.uint8)
        # A task may read the first row of one only.
        x = flat[: int(np.prod(shape)) * dtype.itemsize].view(dtype).reshape(-1, *shape[1:])
        return x.view(np.recarray) if dtype.names else x

    np.empty, np.zeros = records(np.empty), records(np.zeros)
    custom_call.view = view
    numba.cfunc = lambda *_, **__: lambda function: SimpleNamespace(address=0)  # type: ignore[assignment]
    from tpd.compiled import orbit_entry, run_entry

    for entry in (run_entry, orbit_entry):

        def run(first: int, last: int, *buffers: np.ndarray, entry: Any = entry) -> None:
            entry._run([*buffers, *[np.empty(0)] * (8 - len(buffers))], first, last)

        entry.run = run


if __name__ == "__main__":
    os.environ["NUMBA_DISABLE_JIT"] = "1"
    from tpd.scene import parameters

    parameters.NAMES = tuple(sys.argv[1:])
    import jax

    jax.config.update("jax_enable_x64", True)
    interpret()
    print(json.dumps(results()))
