"""What the package does for an answer, and how near it comes, may not get worse unnoticed: counts and errors
against the stored ones. No seconds, so that it does not matter where this runs.

    python -m tests.test_guard

writes `counts.json` anew, after a change that is meant; half a minute.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend import core

jax.config.update("jax_enable_x64", True)

from tests.counting import counted  # noqa: E402
from tests.exact.test_truth import SETTLE, SETTLED, scales  # noqa: E402
from tests.reference import BARE, HUNG, STILL, parameters  # noqa: E402
from tpd import Piecewise, Risk, Segmented, Smoothed, symmetric_orbits  # noqa: E402
from tpd.core.files import as_json, place, versions  # noqa: E402
from tpd.design.ends import Linearisation  # noqa: E402
from tpd.design.methods import minimise  # noqa: E402
from tpd.design.screening import with_design  # noqa: E402
from tpd.exact.orbit_roots_kernel import BRACKETS, NODES  # noqa: E402
from tpd.exact.symmetric_orbit_kernel import ORBITS  # noqa: E402
from tpd.theory import one_harmonic  # noqa: E402

STORED = Path(__file__).with_name("counts.json")
COMMAND = "python -m tests.test_guard"

MORE, LESS = 1.1, 0.5
"""How much above and below the stored one a count may be: rounding differs between machines, and half of the
work is rather work that is no longer counted."""
WORSE, ROUND_OFF = 4.0, 2e-13
"""How much above the stored one an error of the size of rounding may be, and what is none."""
SCENES = (HUNG[0], BARE[1], STILL)
EVERY = 3
"""Every so many rows of the table of 50 digits are looked at here; `test_truth` looks at all."""


def steps() -> dict[str, float]:
    """Solver steps until the integrated models have settled."""
    out: dict[str, float] = {}
    for model in (Smoothed(), Segmented()):
        with counted() as solves:
            run = jax.jit(lambda x, y0, model=model: model.settle(parameters(x), y0).elapsed)
            for case in SCENES[:2]:
                periods = int(run(np.array(case.x), np.array(case.y0)))
                name = f"{type(model).__name__}, {case.name}"
                out |= {f"{name}: solver steps": sum(solves.taken()), f"{name}: periods": periods}
    return out


def periods() -> dict[str, float]:
    """Periods of the exact solution until it has settled."""
    run = jax.jit(lambda x, y0: Piecewise().settle(parameters(x), y0).elapsed)
    found = {case.name: int(run(np.array(case.x), np.array(case.y0))) for case in SCENES}
    return {f"Piecewise, {name}: periods": count for name, count in found.items()}


def program() -> dict[str, float]:
    """Equations in what is compiled for the closed form and its gradient, those of all loops and branches
    once; and the turns of its loops."""

    def orbits(x: jax.Array) -> tuple:
        o = symmetric_orbits(parameters(x))
        return o.amplitude, (o.multipliers, o.status)

    size = equations(jax.make_jaxpr(jax.jacfwd(orbits, has_aux=True))(jnp.array([*HUNG[0].x, 1.0])).jaxpr)
    turns = {"samples": int(NODES), "roots": int(BRACKETS), "orbits": int(ORBITS)}
    return {"equations": size, **{f"constant: {name}": value for name, value in turns.items()}}


def equations(jaxpr: core.Jaxpr) -> int:
    """Of a program and all within it."""
    inner = (value for eqn in jaxpr.eqns for leaf in eqn.params.values() for value in jax.tree.leaves(leaf))
    nested = (v.jaxpr if isinstance(v, core.ClosedJaxpr) else v for v in inner)
    return len(jaxpr.eqns) + sum(equations(v) for v in nested if isinstance(v, core.Jaxpr))


def search() -> dict[str, float]:
    """Designs that descents over a band of frequencies look at, and the tilt they get to; on the one-harmonic
    balance, which takes no time to compile."""
    p, low, high = parameters(HUNG[0].x), np.array([0.01, 0.3, 0.05]), np.array([0.2, 1.5, 0.4])

    def one(x: jax.Array, xi: jax.Array) -> tuple[jax.Array, jax.Array]:
        def tilt(u: jax.Array) -> jax.Array:
            q = with_design(p, low + u * (high - low))
            return one_harmonic(eqx.tree_at(lambda q: q.xi, q, xi)).amplitude / p.nu

        return tilt(x), jax.grad(tilt)(x)

    every = jax.jit(jax.vmap(jax.vmap(one, (None, 0)), (0, None)))
    band = jnp.geomspace(1.5, 2.2, 6)

    def local(unit: np.ndarray) -> Linearisation:
        value, slope = (np.array(v) for v in every(jnp.asarray(unit), band))
        return Linearisation(value, slope, np.zeros((len(unit), 0)), np.zeros((len(unit), 0, 3)))

    starts = np.random.default_rng(3).random((6, 3))
    found = minimise(local, starts, 1.0, Risk.worst().of, steps=40)
    return {"designs": found.evaluations, "steps": int(found.steps.sum()), "value": float(found.merit.min())}


HOST = """
import jax
jax.config.update("jax_enable_x64", True)
compiled = []
def heard(name, seconds, **about):
    if name.endswith("backend_compile_duration"):
        compiled.append(about.get("fun_name"))
jax.monitoring.register_event_duration_secs_listener(heard)
import numpy as np
from tpd import Block, Conditions, Ensemble, Harmonic, Scene
from tpd.answers.ensemble import plan
from tpd.scene.conditions import under_all
from tpd.scene.parameters import as_arrays
from tpd.scene.status import Status, names_of
from tpd.design.objective import blank, margins
from tpd.design.problem import Problem
block = Block(width=1.3, height=10.0, mass=16280.0, restitution="housner", cavity_width=0.9)
scene = Scene(block, Harmonic(amplitude=0.081, frequency=0.85))
problem = Problem.of(scene)
o, p = problem.orbits, scene.parameters()
designs = problem.space.unscaled(np.full((5, len(problem.space.bounds[0])), 0.5))
margins(o, designs)
o.linearised(blank(2, len(o.conditions)))
every = as_arrays(under_all(p, designs, o.conditions))
plan(p, Ensemble(size=8, friction=0.1), conditions=o.conditions)
names_of(Status.rocking)
print(len(compiled), compiled)
"""
"""Work between the programs of a search."""


def host() -> dict[str, float]:
    """Programs that JAX compiles for work that is NumPy's."""
    done = subprocess.run([sys.executable, "-c", HOST], capture_output=True, text=True, check=True)
    return {"constant: programs": int(done.stdout.split()[0])}


def truth() -> dict[str, float]:
    """The worst relative errors of settled motions against 50 digits."""
    sizes, states = [], []
    for row in SETTLED[::EVERY]:
        x = np.array(row["parameters"])
        s = SETTLE(x, np.array(row["y0"]))
        pairs = ((float(getattr(s, name)), float(row[name])) for name in ("amplitude", "stroke"))
        sizes.append(max(abs(found - known) / (known or 1.0) for found, known in pairs))
        end = np.array([float(v) for v in row["end"]])
        states.append(np.max(np.abs(np.asarray(s.state) - end) / scales(x)))
    return {"error of the sizes": float(max(sizes)), "error of the state": float(max(states))}


MEASURES: dict[str, Callable[[], dict[str, float]]] = {
    f.__name__: f for f in (steps, periods, program, search, host, truth)
}


@pytest.mark.parametrize("kind", MEASURES)
def test_no_more_work_and_no_larger_error_than_stored(kind):
    stored = json.loads(STORED.read_text())[kind]
    found = MEASURES[kind]()
    assert set(found) == set(stored), f"what is counted has changed: run `{COMMAND}`"
    wrong = {
        name: (value, stored[name]) for name, value in found.items() if not holds(name, value, stored[name])
    }
    assert not wrong, f"(found, stored), if meant run `{COMMAND}`: {wrong}"


def holds(name: str, value: float, stored: float) -> bool:
    """Whether a number is within the slack of its kind."""
    if name.startswith("error"):
        return value <= max(WORSE * stored, ROUND_OFF)
    if name.startswith("constant"):
        return value == stored
    if name == "value":
        return value <= stored + 1e-4 * abs(stored)
    return LESS * stored <= value <= MORE * stored


@pytest.mark.parametrize(
    ("name", "value", "stored", "expected"),
    [
        ("periods", 110, 100, True),
        ("periods", 112, 100, False),
        ("periods", 40, 100, False),
        ("error of x", 3.9e-12, 1e-12, True),
        ("error of x", 4.1e-12, 1e-12, False),
        ("error of x", 1.9e-13, 1e-15, True),
        ("error of x", np.nan, 1e-12, False),
        ("constant: samples", 63, 64, False),
        ("value", 0.27, 0.28, True),
        ("value", 0.2801, 0.28, False),
    ],
)
def test_the_slack_is_as_stated(name, value, stored, expected):
    assert holds(name, value, stored) is expected


def main() -> None:
    """Store what is counted now."""
    found = {kind: measure() for kind, measure in MEASURES.items()}
    print(place(STORED, as_json({"command": COMMAND, "versions": versions(), **found})))


if __name__ == "__main__":
    main()
