"""The decision between slip, stick and rest, and the impact, by hand."""

import jax.numpy as jnp
import numba
import numpy as np
import pytest

from tests.exact.plants import plants_of
from tests.reference import HUNG, parameters
from tpd import Terms
from tpd.exact import contact_kernel
from tpd.exact.contact import (
    REST,
    SLIP,
    STICK,
    Mode,
    decide,
    released,
)
from tpd.exact.motion import MOTION
from tpd.models.segmented import _classify, _held_on_base
from tpd.scene.impacts import bob_change, housner, linear_bob_change, velocity_ratio
from tpd.theory.equations import Equations, Linear


def signs(mode):
    return int(mode.kind), float(mode.tilt_sign), float(mode.rate_sign)


@numba.njit
def compiled_decide(up, down, friction, tilt, rate):
    return contact_kernel.mode_of(up, down, friction, tilt, rate)


@numba.njit
def compiled_mode(plants, y, tilt, way, eta, modes):
    """Put the mode of a state into `modes`. Returns whether the block would be held at phi = 0."""
    contact_kernel.decide(plants[0], y, tilt, way, eta, modes[0])
    return contact_kernel.held_on_base(plants[0], y[1], y[3], eta)


@numba.njit
def compiled_impact(plants, rests, y2, y3):
    return contact_kernel.struck(plants[0], rests, y2, y3)


@pytest.mark.parametrize(
    ("up", "down", "tilt", "rate", "expected"),
    [
        (-0.1, 0.3, 0.0, 0.0, (REST, 0.0, 0.0)),
        (0.06, 0.46, 0.0, 0.0, (SLIP, 1.0, 1.0)),
        (-0.46, -0.06, 0.0, 0.0, (SLIP, -1.0, -1.0)),
        (-0.1, 0.3, 0.0, -1.0, (SLIP, -1.0, -1.0)),
        (0.04, 0.04, -1.0, 0.0, (STICK, -1.0, 0.0)),
        (0.06, 0.06, -1.0, 0.0, (SLIP, -1.0, 1.0)),
        (0.04, 0.04, 1.0, -1.0, (SLIP, 1.0, -1.0)),
    ],
)
def test_a_block_is_held_while_friction_balances_the_excess(up, down, tilt, rate, expected):
    numbers = up, down, 0.05, tilt, rate
    assert signs(decide(*map(jnp.asarray, numbers))) == expected
    assert compiled_decide(*numbers) == expected


def test_a_released_block_goes_to_the_side_of_the_limit():
    def held(kind):
        return Mode(jnp.asarray(kind), jnp.asarray(1.0), jnp.asarray(0.0))

    assert signs(released(held(REST), -1.0)) == (SLIP, -1.0, -1.0)
    assert signs(released(held(STICK), -1.0)) == (SLIP, 1.0, -1.0)


def test_signs_without_meaning_do_not_tell_modes_apart():
    def mode(*x):
        return Mode(*(jnp.asarray(a) for a in x))

    assert bool(mode(REST, 1.0, 1.0).equals(mode(REST, -1.0, 0.0)))
    assert bool(mode(STICK, 1.0, 1.0).equals(mode(STICK, 1.0, 0.0)))
    assert not bool(mode(STICK, 1.0, 1.0).equals(mode(STICK, -1.0, 1.0)))
    assert not bool(mode(SLIP, 1.0, 1.0).equals(mode(SLIP, 1.0, -1.0)))
    assert not bool(mode(SLIP, 1.0, 1.0).equals(mode(STICK, 1.0, 1.0)))


def test_closed_form_and_segments_decide_alike():
    p, plants, modes = parameters(HUNG[0].x), plants_of([HUNG[0].x]), np.zeros(1, MOTION)
    equations = Equations(p, Terms.linear)
    rng = np.random.default_rng(5)
    states = rng.normal(size=(40, 4)) * [0.2, 0.5, 0.1, 0.5]
    states[::2, 0], states[::3, 2] = 0.0, 0.0
    kinds = set()
    for tau, y in zip(rng.random(40) * p.period, states, strict=True):
        sine = np.sin(p.xi * tau)
        held = compiled_mode(plants, y, np.sign(y[0]), np.sign(y[2]), sine, modes)
        mode = modes[0]
        ours = Mode(jnp.asarray(int(mode["kind"])), jnp.asarray(mode["tilt"]), jnp.asarray(mode["way"]))
        assert bool(ours.equals(_classify(equations, jnp.asarray(y), jnp.asarray(tau))))
        assert held == bool(_held_on_base(equations, jnp.asarray(y), sine))
        kinds.add((int(ours.kind), held))
    assert len(kinds) >= 4


def test_an_impact_conserves_the_second_row_of_the_momentum_and_a_rattle_is_the_sum_of_its_hops():
    x = (*HUNG[0].x, 0.7)
    p, linear, plants = parameters(x), Linear(parameters(x)), plants_of([x])
    rates = np.array([[0.7, -0.2]])
    for _ in range(200):
        rates = np.vstack([rates, compiled_impact(plants, False, *rates[-1])])
        # The impulse acts on the first row alone.
        jump = rates[-1] - rates[-2]
        assert float(linear.m21 * jump[0] + linear.m22 * jump[1]) == pytest.approx(0.0, abs=1e-16)
    np.testing.assert_allclose(rates[:, 0], 0.7 ** np.arange(1, 202), rtol=1e-13)
    captured = compiled_impact(plants, True, *rates[0])
    np.testing.assert_allclose(captured, [0.0, -0.2 - 2.0 / float(p.lam) * 0.7], rtol=1e-15)
    np.testing.assert_allclose(captured, rates[-1], rtol=1e-13, atol=1e-30)


class Struck:
    """An impact in SI units by impulses alone: block of 2a by 2b m, M kg and radius of gyration c about its
    centroid, bob of m kg on a rod of l m. x to the right, z upwards, angles clockwise."""

    def __init__(self, rng):
        self.a, self.b = rng.uniform(0.1, 0.4), rng.uniform(1.0, 2.0)
        self.mass, self.bob = rng.uniform(100.0, 900.0), rng.uniform(1.0, 400.0)
        self.radius, self.rod = rng.uniform(0.4, 1.2), rng.uniform(0.2, 2.0)
        self.psi, self.side = rng.uniform(-1.5, 1.5), rng.choice([-1.0, 1.0])
        # Down onto the base, in rad/s.
        self.before = np.array([-self.side * rng.uniform(0.01, 2.0), rng.normal()])

    @property
    def numbers(self):
        """nu, mu, lam, rho."""
        a, b = self.a, self.b
        return a / b, self.bob / self.mass, self.rod / b, b**2 / (a**2 + b**2 + self.radius**2)

    def velocities(self, rates, side):
        """Of the block's centroid and of the bob, while the block turns about the corner of `side`."""
        turn, swing = rates
        hinge = turn * np.array([2.0 * self.b, side * self.a])
        bob = hinge + self.rod * swing * np.array([-np.cos(self.psi), np.sin(self.psi)])
        return turn * np.array([self.b, side * self.a]), bob

    def energy(self, rates, side):
        block, bob = self.velocities(rates, side)
        own = self.radius**2 * rates[0] ** 2
        return 0.5 * self.mass * (block @ block + own) + 0.5 * self.bob * bob @ bob

    def momentum(self, rates, side):
        """Clockwise, of block and bob about the corner that is struck, which lies at x = -side a."""
        block, bob = self.velocities(rates, side)
        hinge = np.array([self.side * self.a, 2.0 * self.b])
        at = hinge - self.rod * np.array([np.sin(self.psi), np.cos(self.psi)])
        own = self.mass * (self.b * block[0] - self.side * self.a * block[1] + self.radius**2 * rates[0])
        return own + self.bob * (at[1] * bob[0] - at[0] * bob[1])

    @property
    def after(self):
        """Rates after an impact that stops the corner it strikes: a linear system in them, the pull J of the
        rod and the push R of the corner."""
        along = np.array([np.sin(self.psi), np.cos(self.psi)])
        across = np.array([-np.cos(self.psi), np.sin(self.psi)])
        block, bob = self.velocities(self.before, self.side)
        # Unknowns: velocity of the centroid (2), phi', psi', J, R (2).
        rows, right = np.zeros((7, 7)), np.zeros(7)
        rows[0:2, 0:2], rows[0:2, 4], rows[0:2, 5:7] = self.mass * np.eye(2), along, -np.eye(2)
        right[0:2] = self.mass * block
        # Clockwise moments about the centroid, of a force F at r: r_z F_x - r_x F_z.
        hinge, corner = np.array([0.0, self.b]), np.array([-self.side * self.a, -self.b])
        rows[2, 2] = self.mass * self.radius**2
        rows[2, 4] = hinge[1] * along[0] - hinge[0] * along[1]
        rows[2, 5:7] = -corner[1], corner[0]
        right[2] = self.mass * self.radius**2 * self.before[0]
        for i, arm in ((3, corner), (5, hinge)):
            rows[i : i + 2, 0:2], rows[i : i + 2, 2] = np.eye(2), [arm[1], -arm[0]]
        # The bob: its velocity is the hinge's, with the rod's turning, and it changes by J along the rod.
        rows[5:7, 3], rows[5:7, 4] = self.rod * across, -along / self.bob
        right[5:7] = bob
        return np.linalg.solve(rows, right)[2:4]

    def ours(self, restitution):
        nu, mu, lam, rho = self.numbers
        law = restitution, nu, mu, lam, rho, self.side, np.sin(self.psi), np.cos(self.psi)
        ratio = float(velocity_ratio(*law))
        jump = float(bob_change(ratio, *law))
        return self.before[0] * np.array([ratio, jump]) + np.array([0.0, self.before[1]])

    @property
    def housner(self):
        nu, mu, _, rho = self.numbers
        return housner(nu, rho, mu)


IMPACTS = [Struck(np.random.default_rng([7, i])) for i in range(200)]


def test_an_impact_with_the_bob_at_an_angle_is_that_of_impulses_in_si():
    for impact in IMPACTS:
        np.testing.assert_allclose(impact.ours(impact.housner), impact.after, rtol=1e-11, atol=1e-12)


def test_housner_s_impact_conserves_the_momentum_of_block_and_bob_and_gains_no_energy():
    for impact in IMPACTS:
        after = impact.ours(impact.housner)
        expected = impact.momentum(impact.before, impact.side)
        scale = impact.mass * impact.b**2 * abs(impact.before[0]) + impact.bob * impact.b * impact.rod
        assert impact.momentum(after, -impact.side) == pytest.approx(expected, abs=1e-13 * scale)
        assert impact.energy(after, -impact.side) < impact.energy(impact.before, impact.side)


def test_an_impact_of_a_given_ratio_gains_no_energy_either():
    gains = [
        impact.energy(impact.ours(e), -impact.side) / impact.energy(impact.before, impact.side) - 1.0
        for impact in IMPACTS
        for e in (0.0, 0.5, 0.9, 0.99, 1.0 - 1e-9)
    ]
    # At the most that conserves it the energy is the same up to rounding.
    assert max(gains) < 1e-14
    assert sum(abs(gain) < 1e-14 for gain in gains) > 20


def test_with_the_bob_below_its_hinge_the_impact_has_the_given_ratio():
    for impact in IMPACTS[:20]:
        impact.psi = 0.0
        for e in (0.0, 0.7, impact.housner, 0.999):
            assert impact.ours(e)[0] / impact.before[0] == pytest.approx(e, rel=1e-14, abs=1e-16)
    nu, mu, _, rho = impact.numbers
    assert impact.after[0] / impact.before[0] == pytest.approx(housner(nu, rho, mu), rel=1e-13)


def test_without_a_bob_its_angle_does_not_matter():
    assert float(velocity_ratio(0.8, 0.2, 0.0, 0.5, 0.7, 1.0, np.sin(1.0), np.cos(1.0))) == 0.8


def test_the_nonlinear_impact_tends_to_the_linear_one_as_the_square_of_the_angles():
    apart = []
    for s in (1e-1, 1e-2, 1e-3):
        e, lam = housner(0.3 * s, 0.7, 0.2), 0.5
        of = e, 0.3 * s, 0.2, lam, 0.7
        angle = -1.0, np.sin(0.4 * s), np.cos(0.4 * s)
        ratio = float(velocity_ratio(*of, *angle))
        bob = float(bob_change(ratio, *of, *angle))
        apart.append([abs(ratio - e), abs(bob - linear_bob_change(e, *of))])
    np.testing.assert_allclose(np.diff(np.log10(apart), axis=0), -2.0, atol=0.1)
