"""A script of a user that misspells something is refused by a checker of types, and a right one passes. While
the tests run, types and shapes are checked in all calls of the package."""

import json
import subprocess
import sys

import jax.numpy as jnp
import jaxtyping
import pytest
from beartype.roar import BeartypeCallHintParamViolation

from tpd.compiled.derivatives import moved
from tpd.core.formatting import number

SCRIPT = """
import tpd
from tpd import limits

block = tpd.Block(width=0.5, height=2.0, mass=1000.0, restitution="housner", cavity_width=0.4)
scene = tpd.Scene(block, tpd.Harmonic(amplitude=0.05, frequency=1.0))
space = tpd.DesignSpace(mass_ratio=(0.01, 0.2), length_ratio=(0.1, 1.5), damping_ratio=0.1)
conditions = tpd.Conditions.band(scene, 0.8, 1.2, count=5) * tpd.Conditions.amplitudes(1.0, 1.1)
design = tpd.optimise(
    scene,
    space,
    conditions=conditions,
    starts=tpd.Starts.any(),
    risk=tpd.Risk.cvar(0.2),
    limits=[limits.Stroke(0.4), limits.Clearance(limits.Bob(density=7850.0)), limits.Worsening()],
    method=tpd.Descent("adam", searches=8),
    ensemble=tpd.Ensemble(size=128, seed=1),
    requirements=limits.Requirements(at_least=0.2),
    seed=1,
    progress=True,
)
print(design.status.name, design.status.is_sound)
if design.pendulum is not None:
    print(design.pendulum.mass, design.pendulum.length)
    p = scene.parameters(design.pendulum)
    steady = tpd.steady_state(p, model=tpd.Smoothed(terms=tpd.Terms.linear))
    print(steady.amplitude, tpd.status_name(steady.status), tpd.theory.uplift(p).margin)
    record = tpd.records.el_centro()
    curve = tpd.fragility(block, [record], scales=[0.5, 1.0], pendulum=design.pendulum)
    print(curve, tpd.engines.mjcf(scene))
"""
WRONG = {
    "an option of optimise": ("seed=1,\n    progress", "sed=1,\n    progress"),
    "a size of the block": ("width=0.5", "widht=0.5"),
    "a bound of the space": ("mass_ratio=", "mas_ratio="),
    "a limit": ("limits.Stroke", "limits.Strok"),
    "an option of a limit": ("density=7850.0", "densty=7850.0"),
    "a word for an enum": ("terms=tpd.Terms.linear", 'terms="linear"'),
    "a member of an enum": ("Terms.linear", "Terms.liner"),
    "a result": ("design.pendulum is", "design.pendulm is"),
    "a part of a result": ("design.status.is_sound", "design.status.sound"),
    "a function": ("tpd.optimise", "tpd.optimize"),
    "a function of a part": ("theory.uplift", "theory.uplft"),
    "records": ("records.el_centro", "records.el_zentro"),
    "text for a number": ("height=2.0", 'height="2.0"'),
    "a number for an object": ("risk=tpd.Risk.cvar(0.2)", "risk=0.2"),
    "a limit that stands alone": ("limits=[limits.Stroke(0.4), ", "limits=limits.Stroke(0.4), method=["),
}


@pytest.fixture(scope="module")
def errors(tmp_path_factory):
    """Lines of the errors in each script by its name; the right one is `right`."""
    folder = tmp_path_factory.mktemp("scripts")
    names = {"right": "right", **{name: f"wrong{i}" for i, name in enumerate(WRONG)}}
    (folder / "right.py").write_text(SCRIPT)
    for name, (right, wrong) in WRONG.items():
        assert SCRIPT.count(right) == 1, right
        (folder / f"{names[name]}.py").write_text(SCRIPT.replace(right, wrong))
    call = [sys.executable, "-m", "basedpyright", "--outputjson", "--pythonpath", sys.executable, "."]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, timeout=600)
    said = [d for d in json.loads(done.stdout)["generalDiagnostics"] if d["severity"] == "error"]
    by_file = {name: [d for d in said if d["file"].endswith(f"/{file}.py")] for name, file in names.items()}
    return {name: [d["range"]["start"]["line"] for d in found] for name, found in by_file.items()}


def test_a_correct_script_passes_the_type_checker(errors):
    assert errors["right"] == []


@pytest.mark.parametrize("name", WRONG)
def test_the_type_checker_reports_the_line_of_a_mistake(errors, name):
    line = SCRIPT[: SCRIPT.index(WRONG[name][0])].count("\n")
    # An option that stands in two lines is refused in the second.
    assert any(found - line in (0, 1) for found in errors[name]), errors[name]


def test_types_and_shapes_are_checked_while_the_tests_run():
    with pytest.raises(BeartypeCallHintParamViolation, match="parameter x="):
        number("12")
    assert moved(jnp.ones((2, 3)), jnp.ones(3), jnp.ones(3)).shape == (2,)
    with pytest.raises(jaxtyping.TypeCheckError, match="moved"):
        moved(jnp.ones((2, 3)), jnp.ones(3), jnp.ones(2))
