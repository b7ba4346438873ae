"""Sets of conditions: their factors, labels, products, samples, and the parameters under them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tpd import Conditions, paper_scene
from tpd.scene.conditions import FACTORS, MEASURED, check_restitution, under, under_all
from tpd.scene.impacts import housner

SCENE = paper_scene()


def rows(conditions):
    return [tuple(r) for r in np.asarray(conditions.factor_rows())]


def test_a_product_combines_every_condition_with_every_other():
    both = Conditions.band(SCENE, 2.0, 4.0, 2) * Conditions.amplitudes(0.5, 1.0, 2.0)
    np.testing.assert_allclose(both.column("frequency"), [0.8, 0.8, 0.8, 1.6, 1.6, 1.6])
    np.testing.assert_allclose(both.column("amplitude"), [0.5, 1.0, 2.0, 0.5, 1.0, 2.0])
    assert both.description == ("2 frequencies from 2 to 4 Hz", "amplitude factors 0.5, 1, 2")
    assert np.asarray(both.factor_rows()).shape == (6, len(FACTORS))


def test_the_label_of_a_condition_states_the_factors_that_differ():
    band = Conditions.band(SCENE, 2.0, 4.0, 2)
    assert (band * Conditions.amplitudes(0.5, 1.1)).label(1) == "2 Hz and 1.1 times the amplitude"
    assert band.label(1) == "4 Hz"
    assert Conditions().label(0) == "the scene's own shaking"
    np.testing.assert_array_equal(Conditions().factor_rows(), np.ones((1, len(FACTORS))))
    # The number of a sample says nothing about it.
    factors = {"friction": [1.0, 0.93], "frequency": [1.0, 0.98], "amplitude": [1.0, 1.1]}
    some = Conditions({k: np.array(v) for k, v in factors.items()})
    assert some.label(1) == "frequency x 0.98, 1.1 x amplitude, friction x 0.93"
    in_hertz = Conditions(some.factors, (), {"frequency": (2.5, "Hz")})
    assert in_hertz.label(1) == "2.45 Hz, 1.1 x amplitude, friction x 0.93"
    scattered = Conditions.scatter(8, 0, mass=0.1, length=0.1, friction=0.1)
    assert len({scattered.label(i) for i in range(8)}) == 8


def test_the_samples_of_a_seed_do_not_change_between_versions():
    some = Conditions.scatter(3, 5, friction=0.2, length=0.05)
    rng, expected = np.random.default_rng(5), {}
    for name in FACTORS:
        unit = (rng.permutation(3) + rng.random(3)) / 3
        expected[name] = 1.0 + {"friction": 0.2, "length": 0.05}.get(name, 0.0) * (2.0 * unit - 1.0)
        np.testing.assert_array_equal(some.column(name), expected[name])
    assert tuple(some.factors) == ("friction", "length")
    assert some.description == ("3 samples of friction within 20%, length within 5% (seed 5)",)


def test_a_scattered_restitution_is_at_most_one():
    p = dataclasses.replace(SCENE.parameters(), e=0.9)
    some = Conditions.scatter(40, 2, restitution=0.2)
    q = under_all(p, jnp.array([[0.1, 0.5, 0.1]]), some)
    np.testing.assert_allclose(q.e, np.minimum(0.9 * some.column("restitution"), 1.0), rtol=1e-15)
    assert np.max(q.e) == 1.0
    assert np.min(q.e) < 0.75
    slope = jax.grad(lambda e: under(dataclasses.replace(p, e=e), jnp.ones(3), jnp.ones(8)).e)
    assert float(slope(1.0)) == 1.0


def test_a_subset_of_conditions_contains_the_corners():
    band = Conditions.band(SCENE, 2.0, 3.0, 64)
    both = band * Conditions.amplitudes(0.8, 1.2)
    some = both.subset(64, 1)
    assert len(some) == 64
    assert some.units == both.units
    assert len(set(rows(some))) == 64
    for frequency in band.column("frequency")[[0, -1]]:
        at = some.column("frequency") == frequency
        assert set(some.column("amplitude")[at]) == {0.8, 1.2}
    # Both amplitudes are there over the whole band.
    low = some.column("frequency") < 1.0
    for amplitude in (0.8, 1.2):
        assert 0.25 < np.mean(low[some.column("amplitude") == amplitude]) < 0.75
    assert rows(some) == rows(both.subset(64, 1))
    assert rows(some) != rows(both.subset(64, 2))
    assert band.subset(64) is band
    for seed in range(5):
        frequencies = band.subset(4, seed).column("frequency")
        assert {frequencies.min(), frequencies.max()} == {*band.column("frequency")[[0, -1]]}


def test_a_condition_equals_the_scene_with_scaled_quantities():
    conditions = Conditions.band(SCENE, 2.0, 3.0, 2) * Conditions.amplitudes(1.2)
    design = {"mass_ratio": 0.1, "length_ratio": 0.3, "damping_ratio": 0.2}
    for i, hertz in enumerate((2.0, 3.0)):
        q = under(SCENE.parameters(), jnp.array(list(design.values())), conditions.factor_rows()[i])
        motion = dataclasses.replace(
            SCENE.excitation, frequency=hertz, amplitude=1.2 * SCENE.excitation.amplitude
        )
        p = dataclasses.replace(SCENE, excitation=motion).parameters(SCENE.pendulum(**design))
        for name in ("nu", "mu", "lam", "zeta", "k", "f", "xi", "e"):
            assert float(getattr(q, name)) == pytest.approx(float(getattr(p, name)), rel=1e-14), name


@pytest.mark.parametrize("restitution", [1.0, "housner"])
def test_conditions_vary_fastest_in_a_batch_of_designs(restitution):
    block = dataclasses.replace(SCENE.block, restitution=restitution)
    p = dataclasses.replace(SCENE, block=block).parameters()
    conditions = Conditions.scatter(3, 0, slenderness=0.1, damping=0.2, mass=0.2)
    designs = jnp.array([[0.1, 0.3, 0.2], [0.2, 0.4, 0.1]])
    q = under_all(p, designs, conditions)
    names = ("nu", "mu", "lam", "zeta", "k", "f", "xi", "inertia_ratio", "velocity_ratio")
    each = [under(p, design, factors) for design in designs for factors in conditions.factor_rows()]
    for name in names:
        expected = [float(getattr(one, name)) for one in each]
        np.testing.assert_allclose(np.broadcast_to(getattr(q, name), 6), expected, rtol=1e-14)
    assert len(set(expected)) == (1 if restitution == 1.0 else 6)


def test_a_neighbourhood_contains_the_stated_and_stronger_excitations():
    near = Conditions.around(SCENE)
    assert len(near) == 10
    assert set(near.factors) == {"frequency", "amplitude"}
    np.testing.assert_allclose(np.unique(near.column("frequency")), [0.95, 0.975, 1.0, 1.025, 1.05])
    np.testing.assert_allclose(np.unique(near.column("amplitude")), [1.0, 1.1])
    assert (1.0,) * len(FACTORS) in rows(near)
    assert near.description == ("5 frequencies from 2.38 to 2.62 Hz", "amplitude factors 1, 1.1")
    other = Conditions.around(SCENE, frequency=0.2, amplitude=0.0, count=3)
    np.testing.assert_allclose(other.column("frequency"), [0.8, 1.0, 1.2])
    for wrong, message in (
        ({"frequency": 0.6}, r"`frequency` must be between 0\.001 and 0\.5, but is 0\.6"),
        ({"amplitude": -0.1}, "`amplitude` must be between 0 and 1, but is -0.1"),
        ({"count": 1}, "`count` must be a whole number, 2 or more, but is 1"),
    ):
        with pytest.raises(ValueError, match=message):
            Conditions.around(SCENE, **wrong)


def test_conditions_of_records_combine_every_record_with_every_scale():
    rng = np.random.default_rng(0)
    records = [tpd.Record(rng.normal(size=50), 0.02, event=str(i)) for i in range(3)]
    scatter = {"slenderness": 0.02, "damping": 0.2}
    c = tpd.Conditions.records(records, (1.0, 2.0), scatter=scatter, samples=2, seed=4)
    assert len(c) == 12
    assert np.asarray(c.which).tolist() == sorted([0, 1, 2] * 4)
    assert c.column("amplitude").tolist() == [1.0, 1.0, 2.0, 2.0] * 3
    assert np.ptp(c.column("slenderness")) > 0.03
    unit = "PGA over g tan(alpha); at 1 the block lifts"
    assert c.description == (
        f"3 ground motions, each at 1, 2 ({unit}) with scatter of slenderness, damping (seed 4)",
    )
    assert tpd.Conditions.records(records[:1]).description == (f"1 ground motion at 1 ({unit})",)
    assert tpd.Conditions.records(records[:1], 2.0).column("amplitude").tolist() == [2.0]
    both = tpd.Conditions.records(records[:2], (1.0,)) * tpd.Conditions.amplitudes(1.0, 1.5)
    assert both.column("amplitude").tolist() == [1.0, 1.5] * 2
    assert np.asarray(both.which).tolist() == [0, 0, 1, 1]
    for call, message in (
        (lambda: both * both, "only one of two sets"),
        (lambda: tpd.Conditions.records([]), "at least one ground motion"),
        (lambda: tpd.Conditions.records(records, intensity="magnitude"), "`intensity`"),
    ):
        with pytest.raises(ValueError, match=message):
            call()
    train = tpd.Conditions.records([tpd.Harmonic(amplitude=0.01, frequency=1.0)]).motions[0]
    assert float(train.pga) == pytest.approx(0.01 * (2.0 * np.pi) ** 2)
    assert float(train.duration) == pytest.approx(40.0)


def test_only_a_numerical_restitution_below_one_can_vary():
    for own, words in (("housner", "'housner', which follows"), (1.0, "1, which is no loss")):
        scene = dataclasses.replace(SCENE, block=dataclasses.replace(SCENE.block, restitution=own))
        with pytest.raises(ValueError, match=f"`restitution` can vary only if .*, but it is {words}"):
            check_restitution(scene)


def test_housners_restitution_can_vary_in_runs():
    block = dataclasses.replace(SCENE.block, restitution="housner")
    check_restitution(dataclasses.replace(SCENE, block=block), in_runs=True)
    p, design = dataclasses.replace(SCENE, block=block).parameters(), np.array([[0.1, 0.5, 0.1]])
    exact, some = (Conditions.scatter(40, 2, mass=0.1, **x) for x in ({}, {"restitution": MEASURED}))
    q, scattered = under_all(p, design, exact), under_all(p, design, some)
    # Without the scatter e is Housner's to the last digit.
    np.testing.assert_array_equal(q.e, housner(np.asarray(q.nu), np.asarray(q.rho), np.asarray(q.mu)))
    apart = some.column("restitution") - 1.0
    np.testing.assert_array_equal(scattered.e, np.clip(np.asarray(q.e) + apart, 0.0, 0.999))
    assert some.description == (
        "40 samples of mass within 10%, e normal with mean Housner's e -0.01 and standard deviation 0.03 "
        "(seed 2)",
    )


def test_the_samples_of_a_record_do_not_depend_on_the_order_of_records():
    motions = [tpd.Pulse.ricker(acceleration=x, frequency=1.0) for x in (1.0, 2.0, 3.0)]
    widths = {"slenderness": 0.1, "mass": 0.1}
    first = Conditions.records(motions, (1.0, 2.0), scatter=widths, samples=2, seed=4)
    second = Conditions.records(motions[::-1], (2.0, 1.0), scatter=widths, samples=2, seed=4)
    for one, other in ((0, 2), (1, 1), (2, 0)):
        mine, theirs = first.factor_rows()[first.which == one], second.factor_rows()[second.which == other]
        np.testing.assert_array_equal(sorted(map(tuple, mine)), sorted(map(tuple, theirs)))
    np.testing.assert_array_equal(np.sort(first.ranks), np.arange(12))
