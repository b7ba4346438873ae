"""The equations of the page are those of the package: motions agree until chaos separates them."""

import numpy as np
import pytest

import tpd
from tests.browser.node import needs_node, run
from tpd.scene.impacts import housner

PERIODS = 10
CLOSE = 1e-4
"""Largest difference of the tilt, in shares of the slenderness."""


def parameters(**changes) -> tpd.Parameters:
    """Parameters of the chimney of the README; e follows Housner's rule unless it is stated."""
    chimney = {"nu": 0.13, "mu": 0.0355, "lam": 0.11, "zeta": 0.6, "k": 0.0, "f": 0.2356, "xi": 4.444}
    return tpd.Parameters(**({**chimney, "rho": 0.7364, "e": None} | changes))


NO_PENDULUM = {"mu": 0.0, "lam": 1.0, "zeta": 0.3}
PAPER = {"nu": 0.25, "k": 0.05, "f": 0.377, "xi": 2.67, "rho": None, "e": 1.0}
SCENES = {
    "without a pendulum, Housner": (parameters(**NO_PENDULUM), (0, 0, 0, 0)),
    "with a pendulum, Housner": (parameters(), (0, 0, 0, 0)),
    "with a pendulum, released": (parameters(), (0.06, 0, 0, 0)),
    "without a pendulum, friction": (parameters(**PAPER, **NO_PENDULUM), (0, 0, 0, 0)),
    "with a pendulum, friction": (parameters(**PAPER, mu=0.1, lam=0.15, zeta=0.3), (0, 0, 0, 0)),
    "friction, strong motion": (
        parameters(**PAPER | {"f": 0.5, "xi": 3.5}, mu=0.2, lam=0.8, zeta=0.1),
        (0, 0, 0, 0),
    ),
    "friction and impacts, released": (
        parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0, rho=None, e=0.9),
        (0.1, 0, 0, 0),
    ),
    "comes to rest": (
        parameters(nu=0.2, mu=0.1, lam=0.4, zeta=0.2, k=0.03, f=0.25, xi=4.0, rho=None, e=0.95),
        (0, 0, 0, 0),
    ),
    "strong impacts": (
        parameters(nu=0.2, mu=0.1, lam=0.5, zeta=0.2, k=0.0, f=0.3, xi=4.0, rho=None, e=0.8),
        (0, 0, 0, 0),
    ),
    "pushed": (
        parameters(nu=0.2, mu=0.1, lam=0.1, zeta=0.05, k=0.02, f=0.28, xi=3.2, rho=None, e=0.92),
        (0, 0, 0.1, 0),
    ),
    "overturns": (parameters(mu=0.02, zeta=0.3, f=0.2, xi=3.0), (-0.05, 0.2, 0, 0)),
}
FOLLOW = """({ p, start, times }) => {
  const motion = new Motion(p, start);
  const states = times.map((tau) => [...motion.advance(tau).y]);
  return { states, overturned: motion.overturned, impacts: motion.impacts };
}"""


def plain(p: tpd.Parameters) -> dict[str, float]:
    """Parameters by name, as the page has them."""
    own = {name: float(getattr(p, name)) for name in ("nu", "mu", "lam", "zeta", "k", "f", "xi")}
    return own | {"rho": float(p.inertia_ratio), "e": float(p.velocity_ratio)}


@needs_node
@pytest.mark.parametrize("scene", SCENES)
def test_motions_agree_with_the_nonlinear_model_over_ten_periods(scene):
    p, start = SCENES[scene]
    times = np.linspace(0.0, PERIODS, 20 * PERIODS + 1) * float(p.period)
    expected = tpd.simulate(p, np.array(start, dtype=float), times, model=tpd.Nonlinear())
    inputs = {"p": plain(p), "start": start, "times": times.tolist()}
    answer = run("rocking", "Motion", FOLLOW, inputs)
    tilt = np.array(answer["states"], dtype=float)[:, 0] / float(p.nu)
    # After an overturning the package has no state.
    known = np.isfinite(np.asarray(expected.ys)[:, 0])
    assert answer["overturned"] == (tpd.status_name(expected.status) == "overturned") == (not known.all())
    assert np.abs(tilt - np.asarray(expected.ys)[:, 0] / float(p.nu))[known].max() < CLOSE
    assert (np.abs(tilt).max() > 1e-3) == (scene != "comes to rest")
    assert answer["impacts"] > 0


@needs_node
def test_the_error_falls_with_the_fourth_power_of_the_step():
    p, start = SCENES["with a pendulum, friction"]
    times = np.linspace(0.0, 2.0, 41) * float(p.period)
    expected = np.asarray(tpd.simulate(p, np.zeros(4), times, model=tpd.Nonlinear()).ys)[:, 0]
    follow = FOLLOW.replace("(p, start);", "(p, start); motion.step *= 8 / split;").replace(
        "times }", "times, split }"
    )

    def error(split: int) -> float:
        inputs = {"p": plain(p), "start": start, "times": times.tolist(), "split": split}
        tilt = np.array(run("rocking", "Motion", follow, inputs)["states"])[:, 0]
        return float(np.abs(tilt - expected).max())

    coarse, fine = error(1), error(2)
    assert 8.0 < coarse / fine < 32.0


@needs_node
def test_the_velocity_ratio_is_housners():
    answer = run("rocking", "housner", "([nu, rho, mu]) => housner(nu, rho, mu)", [0.2, 0.72, 0.1])
    assert answer == pytest.approx(float(housner(0.2, 0.72, 0.1)), rel=1e-14)


@needs_node
def test_the_force_in_the_rod_is_that_of_the_acceleration_of_the_bob():
    """Newton's law for the bob, from its place: the second difference of the place in time."""
    p, start = SCENES["with a pendulum, friction"]
    q, h = plain(p), 1e-3
    tau = 0.37 * float(p.period)
    times = [tau - h, tau, tau + h]
    follow = """({ p, start, times }) => {
      const motion = new Motion(p, start);
      const at = ({ y, tension, side }) => ({ y: [...y], tension, side });
      return times.map((tau) => at(motion.advance(tau)));
    }"""
    before, now, after = run("rocking", "Motion", follow, {"p": q, "start": start, "times": times})
    assert before["side"] == now["side"] == after["side"] != 0

    def place(state):
        # In half heights, from the corner about which the block turns.
        (phi, psi, *_), s = state["y"], state["side"]
        hinge = np.array(
            [
                -s * q["nu"] * np.cos(phi) + 2.0 * np.sin(phi),
                s * q["nu"] * np.sin(phi) + 2.0 * np.cos(phi),
            ]
        )
        return hinge + q["lam"] * np.array([-np.sin(psi), -np.cos(psi)])

    acceleration = q["rho"] * (place(before) - 2.0 * place(now) + place(after)) / h**2
    acceleration += [q["f"] * np.sin(q["xi"] * tau), 1.0]
    psi = now["y"][1]
    force = acceleration @ [np.sin(psi), np.cos(psi)]
    assert now["tension"] == pytest.approx(force, rel=1e-4)
    # Nothing but the damper acts across the rod.
    across = acceleration @ [np.cos(psi), -np.sin(psi)]
    slip = now["y"][2] - now["y"][3]
    hinge = 2.0 * q["zeta"] * np.sqrt(q["lam"] * q["rho"])
    assert abs(across) == pytest.approx(abs(hinge * slip), rel=1e-3)


@needs_node
def test_a_rattle_without_losses_is_stalled_and_not_endless():
    """Without friction and impact losses hops never end; the package stops such a motion as well."""
    p = tpd.Parameters(nu=0.28, mu=0.2, lam=0.3, zeta=0.57, k=0.0, f=0.1, xi=0.73, e=1.0)
    start = (-0.0072, 0.0, 0.0, 0.0)
    follow = """({ p, start, tau }) => {
      const motion = new Motion(p, start).advance(tau), { stalled, overturned } = motion, end = motion.tau;
      return { stalled, overturned, end, later: motion.advance(tau + 1).tau };
    }"""
    inputs = {"p": plain(p), "start": start, "tau": 20.0 * float(p.period)}
    answer = run("rocking", "Motion", follow, inputs)
    assert answer["stalled"]
    assert not answer["overturned"]
    assert answer["end"] == answer["later"] < inputs["tau"]


@needs_node
def test_a_rattle_ends_at_rest_on_the_base():
    p, start = SCENES["comes to rest"]
    inputs = {"p": plain(p), "start": start, "times": [2.0 * float(p.period), 3.0 * float(p.period)]}
    answer = run("rocking", "Motion", FOLLOW, inputs)
    assert [state[0] for state in answer["states"]] == [0.0, 0.0]
    assert [state[2] for state in answer["states"]] == [0.0, 0.0]
