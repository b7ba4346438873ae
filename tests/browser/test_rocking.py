"""The equations of the page are those of the package: motions agree until chaos separates them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import tpd
from tests.browser.node import needs_node, run
from tpd.design.optimise import problem_of
from tpd.explore.content import content
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
    "hinge at mid-height": (
        parameters(nu=0.2, mu=0.1, lam=0.5, zeta=0.2, k=0.02, f=0.3, xi=4.0, rho=None, e=0.9, kappa=1.0),
        (0, 0, 0, 0),
    ),
    "overturns": (parameters(mu=0.02, zeta=0.3, f=0.2, xi=3.0), (-0.05, 0.2, 0, 0)),
}
FOLLOW = """({ p, start, times }) => {
  const motion = new Motion(p, start);
  const states = times.map((tau) => [...motion.advance(tau).y]);
  return { states, overturned: motion.overturned, impacts: motion.impacts };
}"""


RUNS = """({ p, scatter, isHousner, periods }) => scatter.phase.map((_, n) => {
  return overturns(p, scatter, n, isHousner, periods);
})"""


@needs_node
@pytest.mark.parametrize("restitution", ["housner", 0.95])
def test_runs_in_the_browser_overturn_as_in_the_package(restitution):
    block = tpd.Block(width=1.3, height=10.0, mass=16280.0, restitution=restitution, cavity_width=0.9)
    problem = problem_of(tpd.Scene(block, tpd.Harmonic(amplitude=0.081, frequency=0.85)))
    pendulum = tpd.Pendulum(mass=400.0, length=0.7, damping_ratio=0.2)
    trials = content(problem.scene)["trials"]
    settings = {"ensemble": replace(problem.ensemble, size=100), "conditions": problem.conditions}
    fallen = 0
    for own in (pendulum, None):
        expected = tpd.outcomes(problem.scene, own, equations="nonlinear", **settings)
        inputs = {"p": plain(problem.scene.parameters(own)), "scatter": trials["scatter"], "periods": 100}
        answer = run("rocking", "overturns", RUNS, inputs | {"isHousner": restitution == "housner"})
        # A run near overturning may end in the other way after a hundred periods of chaos.
        assert np.sum(np.array(answer) != expected.is_overturned) <= 3
        fallen += int(expected.is_overturned.sum())
    assert 5 < fallen < 195


@needs_node
def test_the_excitation_of_a_run_grows_from_its_phase():
    load = "({ p, tau }) => tau.map((at) => new Motion(p).load(at))"
    p, tau = plain(parameters()) | {"phase": 1.0, "growth": 10}, [0.1, 1.0, 40.0]
    phase = p["xi"] * np.array(tau)
    expected = p["f"] * np.minimum(1.0, phase / (20.0 * np.pi)) * np.sin(phase)
    np.testing.assert_allclose(run("rocking", "Motion", load, {"p": p, "tau": tau}), expected, rtol=1e-12)
    assert run("rocking", "Motion", "(p) => new Motion(p).tau", p) == pytest.approx(1.0 / p["xi"])


def plain(p: tpd.Parameters) -> dict[str, float]:
    """Parameters by name, as the page has them."""
    own = {name: float(getattr(p, name)) for name in ("nu", "mu", "lam", "zeta", "k", "f", "xi", "kappa")}
    return own | {"rho": float(p.inertia_ratio), "e": float(p.velocity_ratio)}


@needs_node
@pytest.mark.parametrize("scene", SCENES)
def test_motions_in_the_browser_agree_with_the_nonlinear_model(scene):
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
def test_the_error_of_the_browser_falls_with_the_fourth_power_of_the_step():
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
def test_the_restitution_in_the_browser_is_housners():
    answer = run("rocking", "housner", "([nu, rho, mu]) => housner(nu, rho, mu)", [0.2, 0.72, 0.1])
    assert answer == pytest.approx(float(housner(0.2, 0.72, 0.1)), rel=1e-14)


@needs_node
@pytest.mark.parametrize("kappa", [2.0, 1.2, 3.0])
def test_the_force_in_the_rod_satisfies_newtons_law_for_the_bob(kappa):
    """Newton's law for the bob, from its place: the second difference of the place in time."""
    p, start = SCENES["with a pendulum, friction"]
    q, h = plain(replace(p, kappa=kappa)), 1e-3
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
        # In heights of the centroid, from the corner about which the block turns.
        (phi, psi, *_), s = state["y"], state["side"]
        hinge = np.array(
            [
                -s * q["nu"] * np.cos(phi) + kappa * np.sin(phi),
                s * q["nu"] * np.sin(phi) + kappa * np.cos(phi),
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
def test_a_rattle_without_losses_is_stopped():
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


MODES = {
    *("slip, right corner, to the right", "slip, right corner, to the left"),
    *("slip, left corner, to the right", "slip, left corner, to the left"),
    *("stuck to the right", "stuck to the left", "at rest"),
}
RECORD = """(cases) => cases.map(({ p, start, ground, times }) => {
  const motion = new Motion(p, start, ground), modes = new Set();
  const largest = { tilt: 0, swing: 0, rod_angle: 0 };
  const record = ({ y, kind, side, way }) => {
    const at = side > 0 ? "right" : "left", to = way > 0 ? "right" : "left";
    modes.add(["at rest", `stuck to the ${at}`, `slip, ${at} corner, to the ${to}`][kind]);
    const values = { tilt: y[0], swing: y[1], rod_angle: y[1] - y[0] };
    for (const name in largest) largest[name] = Math.max(largest[name], Math.abs(values[name]));
  };
  record(motion);
  const tilts = times.map((tau) => motion.advance(tau, record).y[0]);
  const { overturned, stalled, impacts, tau } = motion;
  return { ...largest, overturned, stalled, impacts, tau, tilts, modes: [...modes] };
})"""
"""Largest angles, outcome, tilts at some times and contact modes of motions in the browser."""


def random_blocks(rng: np.random.Generator, count: int):
    """Blocks with all kinds of losses, pendulums or None, and initial states of a push or of rest."""
    for _ in range(count):
        width, slenderness = rng.uniform(0.4, 1.5), rng.uniform(3.0, 10.0)
        restitution: Any = (0.6, 0.9, 0.97, "housner")[rng.integers(4)]
        block = tpd.Block(
            width=width,
            height=width * slenderness,
            mass=1000.0,
            friction=float(rng.choice([0.0, 0.0, 0.01, 0.05, 0.3])) / slenderness,
            restitution=restitution,
        )
        pendulum = tpd.Pendulum(
            mass=10.0 ** rng.uniform(0.5, 2.6),
            length=0.5 * width * slenderness * 10.0 ** rng.uniform(-1.0, 0.2),
            damping_ratio=float(rng.choice([0.0, 0.05, 0.3, 0.8])),
        )
        push = (rng.random(3) < 0.6) * rng.uniform(-1.0, 1.0, 3) * [0.6 / slenderness, 0.3, 0.2 / slenderness]
        yield block, (pendulum if rng.random() < 0.8 else None), np.append(push, 0.0)


def random_motion(rng: np.random.Generator) -> Any:
    """A pulse of any kind, or a record that begins and ends with a jump."""
    frequency, kind = 10.0 ** rng.uniform(-0.4, 0.4), rng.integers(6)
    if kind < 3:
        make = (tpd.Pulse.one_sine, tpd.Pulse.one_cosine, tpd.Pulse.ricker)[kind]
        return make(acceleration=1.0, frequency=frequency)
    if kind == 3:
        shape = {"cycles": rng.uniform(1.0, 3.0), "phase": rng.uniform(0.0, 6.0)}
        return tpd.Pulse.mavroeidis_papageorgiou(velocity=1.0, frequency=frequency, **shape)
    dt = float(rng.choice([0.005, 0.02, 0.1, 0.3]))
    return tpd.Record(rng.uniform(-1.0, 1.0, int(4.0 / dt) + 2), dt)


def modes_of(answers: list[dict[str, Any]]) -> set[str]:
    """Contact modes that motions in the browser go through."""
    return {mode for answer in answers for mode in answer["modes"]}


@needs_node
def test_random_motions_under_pulses_and_records_agree_with_the_package():
    rng, free = np.random.default_rng(0), 3.0
    inputs, expected, units = [], [], []
    for block, pendulum, start in random_blocks(rng, 120):
        motion = random_motion(rng).scaled_to(pga_g=rng.uniform(0.5, 3.0) * float(block.slenderness))
        scene, pieces = tpd.Scene(block, motion), np.asarray(motion.pieces())
        p, rate = scene.ground_parameters(pendulum), float(scene.rate)
        ground = {"powers": pieces.ravel().tolist(), "order": 4, "span": float(motion.piece) * rate}
        y0 = start * [1.0, 1.0, rate, rate]
        expected.append(tpd.transient(scene, pendulum, y0=y0, model=tpd.Nonlinear(), free=free))
        # The package continues a run until its outcome is certain.
        last = np.nan_to_num(float(expected[-1].overturning_time), posinf=0.0) + 0.01
        end = max(float(motion.duration) + free, last)
        times = [end * rate]
        # The length of a step depends on xi, and nothing else: the page has 1 under a ground motion.
        inputs.append(
            {"p": plain(p) | {"xi": 1.0}, "start": start.tolist(), "ground": ground, "times": times}
        )
        units.append((float(p.nu), rate))
    answers = run("rocking", "Motion", RECORD, inputs)
    assert [a["overturned"] for a in answers] == [tpd.status_name(r.status) == "overturned" for r in expected]
    assert not any(a["stalled"] for a in answers)
    errors = []
    for answer, result, (nu, rate) in zip(answers, expected, units, strict=True):
        if answer["overturned"]:
            errors.append(abs(answer["tau"] / rate - float(result.overturning_time)) / 10.0)
            continue
        angles = [(answer["tilt"], result.tilt), (answer["tilts"][-1], result.state[0])]
        errors.append(max(abs(mine - float(theirs)) / nu for mine, theirs in angles))
        # The page records the angles of a bob at the ends of its steps.
        assert answer["swing"] <= float(result.swing) * (1.0 + 1e-3) + 1e-3 or not float(result.swing)
    # The motions that differ most hop many times on the base, and magnify every rounding.
    assert (np.quantile(errors, [0.5, 0.9, 1.0]) < (1e-5, 1e-3, 0.02)).all()
    assert 10 < sum(a["overturned"] for a in answers) < 60
    assert modes_of(answers) == MODES


@needs_node
def test_random_motions_under_a_harmonic_agree_with_the_package():
    rng, periods = np.random.default_rng(1), 4
    inputs, expected, errors = [], [], []
    for block, pendulum, start in random_blocks(rng, 80):
        frequency = 10.0 ** rng.uniform(-0.2, 0.5)
        size = rng.uniform(0.5, 3.0) * 9.80665 * float(block.slenderness)
        motion = tpd.Harmonic(amplitude=size / (2.0 * np.pi * frequency) ** 2, frequency=frequency)
        p = tpd.Scene(block, motion).parameters(pendulum)
        times = np.linspace(0.0, periods, 8 * periods + 1) * float(p.period)
        inputs.append({"p": plain(p), "start": start.tolist(), "ground": None, "times": times.tolist()})
        expected.append(tpd.simulate(p, start, times, model=tpd.Nonlinear()))
    answers = run("rocking", "Motion", RECORD, inputs)
    for answer, result, given in zip(answers, expected, inputs, strict=True):
        tilts, known = np.asarray(result.ys)[:, 0], np.isfinite(np.asarray(result.ys)[:, 0])
        assert answer["overturned"] == (tpd.status_name(result.status) == "overturned")
        errors.append(np.abs(np.array(answer["tilts"]) - tilts)[known].max() / given["p"]["nu"])
    assert (np.quantile(errors, [0.5, 0.9, 1.0]) < (1e-5, 1e-3, 0.02)).all()
    assert modes_of(answers) == MODES


@needs_node
@pytest.mark.parametrize("above", [0.0, 1e-12])
def test_a_load_that_only_touches_the_uplift_limit_does_not_lift_the_block(above):
    """The load reaches the limit at the end of the first piece, and falls back from there."""
    p = plain(parameters(**NO_PENDULUM, f=0.13 * (1.0 + above)))
    ground = {"powers": [0.0, -1.0, -1.0, 1.0], "order": 2, "span": 0.5}
    (answer,) = run(
        "rocking", "Motion", RECORD, [{"p": p, "start": [0] * 4, "ground": ground, "times": [3.0]}]
    )
    assert answer["tilt"] < 1e-15
    assert answer["tilts"] == [0.0]
    assert answer["impacts"] <= 1
