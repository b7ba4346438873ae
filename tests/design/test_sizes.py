"""Sizes of limits and objectives for many designs: order, derivatives, and functions that are rejected."""

import dataclasses
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tpd.design.geometry import Geometry
from tpd.design.sizes import Evaluation, evaluate_sizes

SCENE = tpd.paper_scene()
GEOMETRY = Geometry.of(SCENE, tpd.Conditions.amplitudes(1.0, 1.1))


@dataclasses.dataclass(frozen=True)
class LongestRod(tpd.limits.Limit):
    """Limit of a user: the length of the equivalent pendulum."""

    length: float
    name: ClassVar[str] = "rod"

    def size(self, motion, design, geometry):
        return geometry.rod(design) / self.length


@dataclasses.dataclass(frozen=True)
class Anything(tpd.limits.Limit):
    """Limit of a user: any function of the tilt."""

    of: object
    name: ClassVar[str] = "anything"

    def size(self, motion, design, geometry):
        return self.of(motion.tilt)


def evaluation(m: int, n: int = 2) -> Evaluation:
    slope = np.broadcast_to(np.array([1.0, 2.0, 3.0]), (m, n, 3))
    return Evaluation.blank(m, n)._replace(design=np.full((m, 3), 0.2), tilt_slope=slope)


def test_a_user_limit_is_differentiated_automatically():
    (size,) = evaluate_sizes([LongestRod(0.1)], evaluation(3), GEOMETRY, slopes=True)
    np.testing.assert_allclose(size.value, 0.2 * SCENE.block.centroid / 0.1)
    np.testing.assert_allclose(size.slope, np.broadcast_to([0.0, 2.0, 0.0], (3, 2, 3)), atol=1e-12)


def test_a_user_limit_has_the_chain_rule_derivatives_of_the_motion():
    (size,) = evaluate_sizes([Anything(lambda tilt: tilt**2)], evaluation(1), GEOMETRY, slopes=True)
    np.testing.assert_allclose(size.slope[0, 0], [2.0, 4.0, 6.0])
    (constant,) = evaluate_sizes([Anything(lambda tilt: 0.7)], evaluation(1), GEOMETRY, slopes=True)
    np.testing.assert_array_equal(constant.value, 0.7)
    np.testing.assert_array_equal(constant.slope, 0.0)


def test_an_infinite_derivative_of_a_limit_is_replaced_by_zero():
    e = evaluation(1)._replace(tilt=np.zeros((1, 2)))
    (size,) = evaluate_sizes([Anything(jnp.sqrt)], e, GEOMETRY, slopes=True)
    np.testing.assert_array_equal(size.slope, 0.0)


def test_sizes_have_the_order_of_the_limits_for_any_shape():
    limits = tpd.limits.Stroke(), tpd.limits.Clearance(), LongestRod(0.1)
    names = ["stroke", "clearance", "thickness", "depth", "rod"]
    for shape in ((3, 2), (0, 2)):
        sizes = evaluate_sizes(limits, evaluation(*shape), GEOMETRY)
        assert [(size.name, size.value.shape) for size in sizes] == [(name, shape) for name in names]
    assert evaluate_sizes([], evaluation(1), GEOMETRY) == []


@pytest.mark.parametrize("of", [lambda x: jnp.ones(3) * x, float, lambda x: x if x > 0.0 else 0.0, str])
def test_a_function_that_jax_cannot_differentiate_is_rejected_in_one_sentence(of):
    with pytest.raises(
        ValueError, match="`size` of each of anything must be one number that JAX can"
    ) as error:
        evaluate_sizes([Anything(of)], evaluation(1), GEOMETRY, slopes=True)
    assert "\n" not in str(error.value)


def test_a_limit_that_is_nan_for_a_known_motion_is_rejected():
    message = "`size` of anything must be a number for every motion, but is NaN for some"
    with pytest.raises(ValueError, match=message):
        evaluate_sizes([Anything(lambda tilt: jnp.sqrt(-tilt))], evaluation(2), GEOMETRY)
    unknown = evaluation(2)._replace(tilt=np.full((2, 2), np.nan))
    (size,) = evaluate_sizes([Anything(jnp.sin)], unknown, GEOMETRY)
    assert np.isnan(size.value).all()
    # A limit that no design can keep is allowed.
    (size,) = evaluate_sizes([Anything(lambda tilt: tilt / 0.0)], evaluation(2), GEOMETRY)
    assert np.isinf(size.value).all()
