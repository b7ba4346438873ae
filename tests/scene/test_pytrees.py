"""Dataclasses of numbers as pytrees, and classes that are importable without JAX."""

import dataclasses
import subprocess
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax

from tpd.scene.pytrees import pytree

HEAVY = "jax", "diffrax", "optax", "equinox", "numba", "scipy", "matplotlib"
LIGHT = "core.checks", "limits", "records.intensity", "records.read", "scene.quantities", "scene.record"
"""Modules of what is checked before JAX is imported."""


def test_settings_can_be_created_without_importing_jax():
    script = f"""
import sys
from importlib import import_module
for name in {LIGHT}:
    import_module(f"tpd.{{name}}")
from tpd.scene.conditions import Conditions, under_all
from tpd.scene.ensemble import Ensemble, Starts
from tpd.scene.scene import paper_scene
scene = paper_scene()
under_all(scene.parameters(), [[0.1, 0.3, 0.1]], Conditions.around(scene))
Ensemble(), Starts()
print(sorted({{*sys.modules}} & {{*{HEAVY}}}))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_numbers_of_a_pytree_are_leaves_and_words_are_static():
    @pytree
    @dataclasses.dataclass(frozen=True)
    class Thing:
        size: object
        word: object = "a"

        def __post_init__(self):
            assert self.size is not None, "whatever JAX puts here is not checked"

    doubled = jax.jit(lambda thing: jax.tree.map(lambda x: 2.0 * x, thing))(Thing(3.0))
    assert (doubled.size, doubled.word) == (6.0, "a")
    assert jax.tree.leaves(Thing(3.0, ("a", "b"))) == [3.0]
    # Optax and Equinox need leaves with a shape and a type.
    assert optax.tree.norm(eqx.filter_grad(lambda thing: thing.size**2)(Thing(3.0))) == 6.0
    assert optax.lbfgs().init(Thing(3.0, "b"))[0].params.word == "b"
    # The same field may hold a number.
    assert jax.tree.leaves(Thing(3.0, 4.0)) == [3.0, 4.0]
    assert jax.tree.structure(Thing(1.0)) != jax.tree.structure(Thing(1.0, "b"))
    paths = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_leaves_with_path(Thing(3.0, 4.0))]
    assert paths == [".size", ".word"]
    assert jax.tree.map(lambda _: None, Thing(1.0)).size is None
    stacked = jax.vmap(lambda thing: thing.size + 1.0)(Thing(jnp.arange(3.0)))
    np.testing.assert_array_equal(stacked, [1.0, 2.0, 3.0])
