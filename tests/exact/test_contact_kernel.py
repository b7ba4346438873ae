"""Contact and impacts in compiled code: by hand, like those of `Segmented`, and by impulses in SI units."""

import jax.numpy as jnp
import numba
import numpy as np
import pytest

from tests.exact.plants import plants_of
from tests.reference import HUNG, parameters
from tpd import Terms
from tpd.exact import contact_kernel
from tpd.exact.contact import Mode
from tpd.exact.events import FIRST, SECOND
from tpd.exact.motion import MOTION
from tpd.exact.terms import REST, SLIP, STICK
from tpd.models.segmented import _classify, _held_on_base
from tpd.scene.impacts import bob_change, housner, linear_bob_change, velocity_ratio
from tpd.theory.equations import Equations, Linear

DECISIONS = [
    (-0.1, 0.3, 0.0, 0.0, (REST, 0.0, 0.0)),
    (0.06, 0.46, 0.0, 0.0, (SLIP, 1.0, 1.0)),
    (-0.46, -0.06, 0.0, 0.0, (SLIP, -1.0, -1.0)),
    (-0.1, 0.3, 0.0, -1.0, (SLIP, -1.0, -1.0)),
    (0.05, 0.05, -1.0, 0.0, (STICK, -1.0, 0.0)),
    (0.06, 0.06, -1.0, 0.0, (SLIP, -1.0, 1.0)),
    (0.04, 0.04, 1.0, -1.0, (SLIP, 1.0, -1.0)),
]
"""Excess upward and downward under friction 0.05, signs of tilt and rate, and the mode."""


@numba.njit
def mode_of(up, down, friction, tilt, rate):
    return contact_kernel.mode_of(up, down, friction, tilt, rate)


@numba.njit
def put_mode(plants, y, tilt, way, eta, modes):
    """Put the mode of a state into `modes`. Returns whether the block would be held at phi = 0, and the
    distances of the moment from both limits."""
    q, m = plants[0], modes[0]
    contact_kernel.decide(q, y, tilt, way, eta, m)
    left = [contact_kernel.reserve(q, m.kind, m.tilt, w, y[0], y[1], y[3], eta) for w in (FIRST, SECOND)]
    return contact_kernel.held_on_base(q, y[1], y[3], eta), left[0], left[1]


@numba.njit
def struck(plants, rests, y2, y3):
    return contact_kernel.struck(plants[0], rests, y2, y3)


@numba.njit
def meet(plants, which, capture, eta, y, modes):
    return contact_kernel.meet(plants[0], which, capture, eta, y, modes[0])


@pytest.mark.parametrize(("up", "down", "tilt", "rate", "expected"), DECISIONS)
def test_a_block_is_held_while_friction_balances_the_excess(up, down, tilt, rate, expected):
    assert mode_of(up, down, 0.05, tilt, rate) == expected


def test_closed_form_and_segments_decide_alike():
    p, plants, modes = parameters(HUNG[0].x), plants_of([HUNG[0].x]), np.zeros(1, MOTION)
    equations, rng, kinds = Equations(p, Terms.linear), np.random.default_rng(5), set()
    states = rng.normal(size=(40, 4)) * [0.2, 0.5, 0.1, 0.5]
    states[::2, 0], states[::3, 2] = 0.0, 0.0
    for tau, y in zip(rng.random(40) * p.period, states, strict=True):
        sine = np.sin(p.xi * tau)
        held, *left = put_mode(plants, y, np.sign(y[0]), np.sign(y[2]), sine, modes)
        mode = modes[0]
        ours = Mode(jnp.asarray(int(mode["kind"])), jnp.asarray(mode["tilt"]), jnp.asarray(mode["way"]))
        assert bool(ours.equals(_classify(equations, jnp.asarray(y), jnp.asarray(tau))))
        assert held == bool(_held_on_base(equations, jnp.asarray(y), sine))
        if mode["kind"] != SLIP:
            assert min(left) >= 0.0
        kinds.add((int(ours.kind), held))
    assert len(kinds) >= 4


@pytest.mark.parametrize(
    ("mode", "which", "y", "rests", "after", "state"),
    [
        # A turn too low to matter ends on the base, a higher one goes on; a slow impact is the last.
        ((SLIP, 1.0, 1.0), FIRST, [1e-13, 0.0, 0.0, 0.0], True, REST, [0.0, 0.0, 0.0, 0.0]),
        ((SLIP, 1.0, 1.0), FIRST, [0.02, 0.0, 0.0, 0.0], False, SLIP, [0.02, 0.0, 0.0, 0.0]),
        ((SLIP, 1.0, -1.0), SECOND, [0.0, 0.0, -1e-7, 0.0], True, REST, [0.0, 0.0, 0.0, 1e-6]),
        ((SLIP, 1.0, -1.0), SECOND, [0.0, 0.0, -0.1, 0.0], False, SLIP, [0.0, 0.0, -0.07, 0.3]),
        ((REST, 0.0, 0.0), SECOND, [0.0, 0.1, 0.0, 0.2], False, SLIP, [0.0, 0.1, 0.0, 0.2]),
    ],
)
def test_events_change_state_and_mode(mode, which, y, rests, after, state):
    plants, modes, y = (
        plants_of([(0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67, 0.7)]),
        np.zeros(1, MOTION),
        np.array(y),
    )
    modes["kind"], modes["tilt"], modes["way"] = mode
    assert meet(plants, which, 1e-6, 0.0, y, modes) == rests
    assert modes["kind"][0] == after
    np.testing.assert_allclose(y, state, rtol=1e-12)
    if mode[0] == REST:
        assert modes["way"][0] == modes["tilt"][0] == -1.0


def test_an_impact_conserves_the_second_row_of_the_momentum_and_a_rattle_is_the_sum_of_its_hops():
    x = (*HUNG[0].x, 0.7)
    p, linear, plants = parameters(x), Linear(parameters(x)), plants_of([x])
    rates = np.array([[0.7, -0.2]])
    for _ in range(200):
        rates = np.vstack([rates, struck(plants, False, *rates[-1])])
        # The impulse acts on the first row alone.
        jump = rates[-1] - rates[-2]
        assert float(linear.m21 * jump[0] + linear.m22 * jump[1]) == pytest.approx(0.0, abs=1e-16)
    np.testing.assert_allclose(rates[:, 0], 0.7 ** np.arange(1, 202), rtol=1e-13)
    captured = struck(plants, True, *rates[0])
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


IMPACTS = [Struck(np.random.default_rng([7, i])) for i in range(100)]


def test_an_impact_with_the_bob_at_an_angle_is_that_of_impulses_in_si():
    for impact in IMPACTS:
        nu, mu, _, rho = impact.numbers
        np.testing.assert_allclose(impact.ours(housner(nu, rho, mu)), impact.after, rtol=1e-11, atol=1e-12)


def test_an_impact_gains_no_energy():
    gains = [
        impact.energy(impact.ours(e), -impact.side) / impact.energy(impact.before, impact.side) - 1.0
        for impact in IMPACTS
        for e in (0.0, 0.5, 0.9, 0.99, 1.0 - 1e-9)
    ]
    # At the most that conserves it the energy is the same up to rounding.
    assert max(gains) < 1e-14
    assert sum(abs(gain) < 1e-14 for gain in gains) > 10


def test_with_the_bob_below_its_hinge_or_without_one_the_impact_has_the_given_ratio():
    for nu, mu, lam, rho in (impact.numbers for impact in IMPACTS[:20]):
        for e in (0.0, 0.7, 0.999):
            assert float(velocity_ratio(e, nu, mu, lam, rho, 1.0, 0.0, 1.0)) == pytest.approx(e, abs=1e-16)
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
