"""The dimensionless parameters, and dataclasses of numbers as pytrees."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd import Parameters
from tpd.scene.parameters import as_arrays, check_parameters
from tpd.scene.pytrees import pytree

P = Parameters(nu=0.25, mu=0.1, lam=0.4, zeta=0.2, k=0.0, f=0.3, xi=2.5, e=None)


def test_what_follows_from_the_numbers():
    assert P.inertia_ratio == pytest.approx(0.75 / (1 + 0.25**2), rel=1e-15)
    assert dataclasses.replace(P, rho=0.6).inertia_ratio == 0.6
    assert P.hinge == pytest.approx(2 * 0.2 * np.sqrt(0.4 * P.inertia_ratio), rel=1e-15)
    assert P.period == pytest.approx(2 * np.pi / 2.5, rel=1e-15)
    assert dataclasses.replace(P, e=0.9).velocity_ratio == 0.9
    arrays = as_arrays(dataclasses.replace(P, mu=1))
    assert all(isinstance(x, np.ndarray) and x.dtype == float for x in jax.tree.leaves(arrays))
    assert arrays.rho is arrays.e is None


def test_a_bob_that_throws_the_block_back_is_refused():
    # A scene refuses a bob heavier than its block before: only parameters can have one.
    most, rest = 1 / (0.6 * 0.25) - 2, {"lam": 0.4, "zeta": 0.2, "k": 0.0, "f": 0.3, "xi": 2.5, "e": None}
    at_most = Parameters(nu=0.5, mu=most - 1e-9, **rest)
    assert at_most.velocity_ratio == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(
        ValueError, match=r"`mu` must be at most 4\.667 with Housner's restitution .*, but is 5"
    ):
        Parameters(nu=0.5, mu=5.0, **rest)
    with pytest.raises(ValueError, match=r"`mu` must be at most 4\.667 .*, but is 6"):
        Parameters(nu=0.5, mu=np.array([1.0, 6.0]), **rest)


def test_parameters_are_asked_for_by_name():
    check_parameters(P)
    with pytest.raises(ValueError, match=r"`q` must be a Parameters, but is 3$"):
        check_parameters(3, "q")


def test_a_dataclass_of_numbers_has_its_words_apart():
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
    # The same field may hold a number.
    assert jax.tree.leaves(Thing(3.0, 4.0)) == [3.0, 4.0]
    assert jax.tree.structure(Thing(1.0)) != jax.tree.structure(Thing(1.0, "b"))
    paths = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_leaves_with_path(Thing(3.0, 4.0))]
    assert paths == [".size", ".word"]
    assert jax.tree.map(lambda _: None, Thing(1.0)).size is None
    stacked = jax.vmap(lambda thing: thing.size + 1.0)(Thing(jnp.arange(3.0)))
    np.testing.assert_array_equal(stacked, [1.0, 2.0, 3.0])
