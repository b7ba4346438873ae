"""Bad input in Python: one sentence that names the argument, raised before anything is compiled.

The calls run in one process without the types that the other tests have beartype check, as a user's do.
"""

import json
import subprocess
import sys

import pytest

HEAD = """
import json, sys
import jax
jax.config.update("jax_enable_x64", True)
import jax.numpy as jnp
import numpy as np
import tpd
from tpd import *
from tpd.answers.bifurcations import bifurcations
from tpd.answers.ensemble import outcomes
from tpd.answers.bifurcations import sweep

def listen(event, seconds, **_):
    compiled.append(seconds) if "backend_compile" in event else None

compiled = []
nan = float("nan")
scene = paper_scene()
block, motion = scene.block, scene.motion
p = scene.parameters()
hung = Pendulum(mass=1.0, length=0.1, damping_ratio=0.1)
wave = np.sin(np.arange(50.0))
record = Record(wave, 0.01)
shaken = Scene(block, record)
def made(kind, **given):
    good = {Block: dict(width=0.1, height=0.4, mass=16.0), Harmonic: dict(amplitude=0.015, frequency=2.5),
            Pendulum: dict(mass=1.0, length=0.1, damping_ratio=0.1),
            Parameters: dict(nu=0.25, mu=0.1, lam=0.5, zeta=0.1, k=0.05, f=0.3, xi=3.0)}
    return kind(**{**good[kind], **given})
jax.monitoring.register_event_duration_secs_listener(listen)
said = {}
for call in json.load(sys.stdin):
    try:
        eval(call)
        said[call] = ["nothing", ""]
    except Exception as error:
        said[call] = [type(error).__name__, str(error)]
print(json.dumps([said, max(compiled, default=0.0)]))
"""

CALLS = {
    'made(Block, width="0.1")': "`width` must be a number, but is '0.1'",
    "made(Block, width=True)": "`width` must be a number, but is True",
    "made(Block, width=nan)": "`width` must be positive and finite, but is nan",
    "made(Block, mass=-1)": "`mass` must be positive and finite, but is -1",
    "made(Block, mass=[1.0, 2.0])": "`mass` must be a number, but is [1.0, 2.0]",
    "made(Block, friction=nan)": "`friction` must be zero or positive, and finite, but is nan",
    "made(Block, restitution=1.2)": "`restitution` must be between 0 and 1, but is 1.2",
    "made(Pendulum, mass=-1)": "`mass` must be zero or positive, and finite, but is -1",
    "Scene(block, 2.5)": "`motion` must be a Harmonic or GroundMotion, but is 2.5",
    'made(Block, restitution="bouncy")': "`restitution` must be a number or 'housner', but is 'bouncy'",
    "made(Pendulum, mass=1j)": "`mass` must be a number, but is 1j",
    "Scene(motion, block)": "`block` must be a Block, but is Harmonic(amplitude=0.015, frequency=2.5)",
    "Scene(Block, motion)": "`block` must be a Block that is made, `Block(...)`, but is the class itself",
    "scene.parameters(block)": "`pendulum` must be a Pendulum, but is Block(width=0.1",
    "made(Parameters, nu=nan)": "`nu` must be positive and finite, but is nan",
    'made(Parameters, k="0.1")': "`k` must be a number, but is '0.1'",
    # The design space, conditions, starts, risks and limits.
    "DesignSpace(mass_ratio=0.1)": "`mass_ratio` must be a pair of numbers (low, high), but is 0.1",
    "DesignSpace(mass_ratio=(0.1, True))": "`mass_ratio` must be a pair of numbers (low, high), but is (0.1,",
    "DesignSpace(mass_ratio=(nan, 0.2))": "`mass_ratio` must be an interval low < high within 0 to 1, but is",
    "DesignSpace(damping_ratio=True)": "`damping_ratio` must be a number, but is True",
    "DesignSpace(damping_ratio=nan)": "`damping_ratio` must be between 0 and 2, but is nan",
    "Conditions.band(block, 2.0, 3.0)": "`scene` must be a Scene, but is Block(width=0.1",
    "Conditions.band(scene, 3.0, 2.0)": "`band` must be an interval low < high within",
    "Conditions.amplitudes()": "`factors` must hold at least one number",
    "Conditions.scatter(8, mas=0.1)": "what scatters must be of amplitude",
    "Conditions.amplitudes(0.0)": "`factors` must be positive and finite, but is 0",
    'Conditions({"colour": np.ones(2)})': "`factors` must be one of amplitude, frequency, friction",
    'Conditions({"friction": [1.0, nan]})': "`friction` must be a vector of factors, all finite, but is [1.0",
    'Conditions({"mass": [1.0], "length": [1.0, 1.1]})': "`factors` must be of one length, but have lengths",
    "Conditions.scatter(4, mass=0.9)": "`mass` must be between 0 and 0.5, but is 0.9",
    "Starts(swing=2.0)": "`swing` must be at most 1.5708, a right angle in rad, but is 2",
    "Starts(tilt=1.5)": "`tilt` must be at most 1, a block that stands on its corner, but is 1.5",
    'Starts(kind="rest")': "`kind` must be a StartKind, but is 'rest'",
    'Ensemble(ramps="x")': "`ramps` must be a number, but is 'x'",
    "Ensemble(ramps=())": "`ramps` must hold at least one duration, but is empty",
    "Ensemble(any_phase=1)": "`any_phase` must be True or False, but is 1",
    'Risk(share="all", name="mine")': "`share` must be a number, but is 'all'",
    "limits.Stroke(3.0)": "`stroke` must be at most 1.5708, a right angle in rad, but is 3",
    'limits.Mass("2 kg")': "`mass` must be a number, but is '2 kg'",
    # Motions.
    "steady_state(scene)": "`p` must be a Parameters, but is Scene(",
    "steady_state(p, model=Piecewise)": "that is made, `Piecewise(...)`, but is the class itself",
    'steady_state(p, model="exact")': "`model` must be a Model or Choice, but is 'exact'",
    "steady_state(p, y0=[nan, 0, 0, 0])": "`y0` must be (phi, psi, phi', psi'), all finite, but is [nan, 0, ",
    "steady_state(p, y0=[0.0, 0.0])": "`y0` must be (phi, psi, phi', psi'), all finite, but is [0.0, 0.0]",
    'steady_state(p, y0="rest")': "`y0` must be (phi, psi, phi', psi'), all finite, but is 'rest'",
    'steady_state(p, throw="yes")': "`throw` must be True or False, but is 'yes'",
    "simulate(scene, np.zeros(4), [0.0, 1.0])": "`p` must be a Parameters, but is Scene(",
    "simulate(p, np.zeros(4), [1.0, 0.0])": "`times` must increase and be finite, but do not",
    'simulate(p, np.zeros(4), ["a", "b"])': "`times` must be a vector of two or more increasing numbers, all",
    "symmetric_orbits(scene)": "`p` must be a Parameters, but is Scene(",
    "theory.uplift(scene)": "`p` must be a Parameters, but is Scene(",
    "periodic_orbit(p, [0.0, nan, 0.0, 0.0])": "`y0` must be (phi, psi, phi', psi'), all finite",
    "attractors(block)": "`subject` must be a Parameters or Scene, but is Block(",
    "attractors(scene, starts=12)": "`starts` must be a Starts, but is 12",
    'settled_response(scene, "frequency", ["a"])': "`values` must be one or more numbers, all finite, but is",
    'settled_response(scene, "colour", [1.0])': "`name` must be one of width, height, mass",
    'settled_response(scene, "frequency", [2.0], progress=3)': "`progress` must be True or a function, but i",
    'branches(scene, "frequency", 3.0, 2.0)': "must be an interval low < high",
    'sweep(scene, "frequency", [2.0, nan])': "`values` must be two or more numbers that increase, all finite",
    'design_map(scene, "mu", ("lam", [0.1, 0.2]), pendulum=hung)': "`x` must be a name and its values, but i",
    'design_map(scene, ("mu", [0.1, 0.2]), ("lam", [0.1, 0.2]), pendulum=hung, start=[0, 0])': "`start` must",
    'design_map(scene, ("pendulum_mass", [1.0, 20.0]), ("lam", [0.1, 0.2]), pendulum=hung)': "`pendulum_mass",
    "outcomes(scene, ensemble=Ensemble)": "`ensemble` must be a Ensemble that is made, `Ensemble(...)`",
    "verdict(scene, hung, conditions=2.5)": "`conditions` must be a Conditions, but is 2.5",
    'check(scene, hung, stroke="wide")': "`stroke` must be a number, but is 'wide'",
    # Searches.
    "optimise(p)": "`scene` must be a Scene, but is Parameters(",
    "optimise(scene, (0.01, 0.2))": "`space` must be a DesignSpace, but is (0.01, 0.2)",
    "optimise(scene, conditions=[2.4, 2.6])": "`conditions` must be a Conditions, but is [2.4, 2.6]",
    'optimise(scene, starts="rest")': "`starts` must be a Starts, but is 'rest'",
    'optimise(scene, risk="worst")': "`risk` must be a Risk, but is 'worst'",
    "optimise(scene, limits=limits.Stroke(0.5))": "`limits` must be a list of objects of `tpd.limits`, but i",
    "optimise(scene, limits=[limits.Stroke])": "`limits` must hold objects of `tpd.limits`, but has <class",
    'optimise(scene, method="adam")': "`method` must be a Method, but is 'adam'",
    "optimise(scene, method=Descent)": "`method` must be a Method that is made, `Descent(...)`",
    "optimise(scene, ensemble=512)": "`ensemble` must be a Ensemble, but is 512",
    "optimise(scene, seed=1.5)": "`seed` must be a whole number, 0 or more, but is 1.5",
    "optimise(scene, checkpoint=3)": "`checkpoint` must be a Path or str, but is 3",
    'optimise(scene, progress="bar")': "`progress` must be True or a function, but is 'bar'",
    "optimise(Scene(block, made(Harmonic, amplitude=0)))": "`amplitude` must be above 0 in a search, but is ",
    "Descent(model=Piecewise)": "`model` must be Smoothed() with linear terms, or Piecewise(), whose symm",
    "Descent(optimiser=3)": "`optimiser` must be a transformation of optax, or one of adam, rmsprop, but",
    "Piecewise(max_periods=0)": "`max_periods` must be a whole number, 1 or more, but is 0",
    # Once raw, or accepted.
    "made(Block, width=np.array([]))": "`width` must be positive and finite, but is []",
    "made(Block, mass=10**400)": "`mass` must be positive and finite, but is inf",
    "Record(wave, 1e300)": "`dt` must be between 1e-06 and 1000 s, but is 1e+300",
    "Record.read(3)": "`path` must name a file, but is 3",
    "Record.read_all(None)": "`path` must name a file, but is None",
    'record.scaled("a")': "`factor` must be a number, but is 'a'",
    "record.acceleration_at([nan])": "`times` must be finite, but is [nan]",
    "record.acceleration_at(None)": "`times` must be a number, but is None",
    'Pulse.sine_train(acceleration=1.0, frequency=1.0, cycles="3")': "`cycles` must be a number, but is '3'",
    "DesignSpace(mass_ratio={0.1, 0.2})": "`mass_ratio` must be a pair of numbers (low, high), but is {0.",
    "Conditions.around(None)": "`scene` must be a Scene, but is None",
    "Conditions.around(shaken)": "`motion` must be a Harmonic, but is Record(",
    'Conditions.exactly().column("colour")': "`name` must be one of amplitude, frequency, friction",
    "Conditions.exactly().subset(0)": "`most` must be a whole number, 1 or more, but is 0",
    "Conditions.scatter(4)": "what scatters must be of amplitude, frequency, friction",
    "Conditions.scatter(10**12, mass=0.1)": "`size` must be a whole number, 1 to 10000000, but is 1e+12",
    "Conditions.records(None)": "`motions` must be a Sequence, but is None",
    "Conditions.records(record)": "`motions` must be a Sequence, but is Record(",
    "Ensemble(periods=10**12)": "`periods` must be a whole number, 1 to 10000, but is 1e+12",
    "limits.Stroke(np.array([0.1, 0.2]))": "`stroke` must be a single number, but is [0.1 0.2]",
    "limits.Worth(at_least=np.array([0.1, 0.2]))": "`at_least` must be a single number, but is [0.1 0.2]",
    "Smoothed(terms=3)": "`terms` must be a Terms, but is 3",
    'Segmented(terms="x")': "`terms` must be a Terms, but is 'x'",
    "status_name(99)": "`status` must be a EnumerationItem, but is 99",
    'theory.free_motion("x")': "`p` must be a Parameters, but is 'x'",
    "theory.equivalent_friction(scene, 0.1)": "`p` must be a Parameters, but is Scene(",
    "attractors(shaken, hung)": "`motion` must be a Harmonic, but is Record(",
    "check(shaken, hung)": "`motion` must be a Harmonic, but is Record(",
    "verdict(shaken, hung)": "`motion` must be a Harmonic, but is Record(",
    'settled_response(shaken, "frequency", [2.0])': "`motion` must be a Harmonic, but is Record(",
    'branches(shaken, "frequency", 2.0, 3.0)': "`motion` must be a Harmonic, but is Record(",
    'branches(scene, "frequency", 2.0, 1e300)': "must be",
    "verdict(scene)": "`pendulum` must be a Pendulum, but is None",
    "verdict(p)": "`mu` must be positive and finite, but is 0",
    "verdict(scene, hung, bare=3)": "`bare` must be a Outcomes, but is 3",
    "verdict(scene, hung, cluster=3)": "`cluster` must be a Cluster, but is 3",
    'outcomes(scene, workers="a")': "`workers` must be a number, but is 'a'",
    "check(scene, hung, models=3)": "`models` must be a tuple or list, but is 3",
    'design_map(scene, ("mu", [0.1]), ("lam", [0.1]), pendulum=hung, cluster=3)': "`cluster` must be a Clust",
    "transient(shaken, free=1e300)": "`free` must be between 0 and 100000 s, but is 1e+300",
    "critical_scale(shaken, highest=1e300)": "`highest` must be between 1e-09 and 1e+09, but is 1e+300",
    "fragility(block, record, scales=[1.0])": "`motions` must be a Sequence, but is Record(",
    "fragility(block, [record], scales=[])": "`scales` must be a vector of numbers, all finite, but is []",
    "fragility(block, [record], scales=[1.0], states=3)": "`states` must be a Mapping, but is 3",
    'fragility(block, [record], scales=[1.0], states={"x": "a"})': "`states` must name tilts over the slend",
    "fragility(block, [record], scales=[1.0], gravity=0)": "`gravity` must be positive and finite, but is 0",
    "fragility(block, [record], scales=[1.0], nonlinear=1)": "`nonlinear` must be True or False, but is 1",
    "fragility(block, [record], scales=[1.0], progress=3)": "`progress` must be a function, but is 3",
    "fragility(block, [record], scales=[1.0], pendulum=3)": "`pendulum` must be a Pendulum, but is 3",
    "rocking_spectrum(block, record, periods=3.0)": "`periods` must be a vector of numbers, all finite, but",
    'rocking_spectrum(block, record, mass_ratio="a")': "`mass_ratio` must be a number, but is 'a'",
    "rocking_spectrum(block, record, length_ratio=nan)": "`length_ratio` must be positive and finite, but is",
    "in_chunks(3, np.zeros(3))": "`function` must be a function, but is 3",
    "Cluster(3)": "`folder` must be a Path or str, but is 3",
    'Cluster("")': "`folder` must be a folder, but is ''",
    "optimise_all(scene)": "`scenes` must be a Sequence, but is Scene(",
    "optimise_all([scene, block])": "`scenes[1]` must be a Scene, but is Block(",
    "engines.mujoco(scene, 3)": "`pendulum` must be a Pendulum, but is 3",
}


@pytest.fixture(scope="module")
def said():
    """Answers of all calls, and the longest compilation (s)."""
    call = [sys.executable, "-W", "error", "-c", HEAD]
    done = subprocess.run(call, input=json.dumps(list(CALLS)), capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(("call", "message"), CALLS.items(), ids=CALLS)
def test_bad_input_is_refused_in_one_sentence(said, call, message):
    kind, text = said[0][call]
    assert kind == "ValueError", (kind, text)
    assert message in text
    assert len(text.splitlines()) == 1
    assert len(text) < 260


def test_nothing_is_compiled_for_bad_input(said):
    """A search, an orbit or an integration takes seconds to compile; an addition of two numbers does not."""
    assert said[1] < 0.5
