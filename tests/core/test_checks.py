"""Bad input in Python: one sentence that names the argument, raised before anything is compiled.

The calls run in one process without the types that the other tests have beartype check, as a user's do.
"""

import inspect
import json
import pickle
import re
import subprocess
import sys

import pytest

import tpd

HEAD = """
import json, sys
import jax
jax.config.update("jax_enable_x64", True)
import jax.numpy as jnp
import numpy as np
import tpd
from datetime import date
from pathlib import Path
from tpd import *
from tpd.answers.bifurcations import bifurcations
from tpd.answers.ensemble import outcomes

def listen(event, seconds, **_):
    compiled.append(seconds) if "backend_compile" in event else None

compiled = []
nan = float("nan")
scene = paper_scene()
block, motion = scene.block, scene.excitation
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
class Quantity:
    # A number or an array with a unit, as astropy has it.
    def __init__(self, value, unit):
        self.value, self.unit = value, unit
    def __array__(self, dtype=None, copy=None):
        return np.asarray(self.value, dtype)
    def __float__(self):
        return float(self.value)
    def __repr__(self):
        return f"<Quantity {self.value} {self.unit}>"
class Pint(Quantity):
    # As pint has it.
    magnitude = property(lambda self: self.value)
    units = property(lambda self: self.__dict__["unit"])
class Unyt(np.ndarray):
    # As unyt has it.
    units = "cm"
class Column:
    # A column of pandas or an array of xarray with attributes.
    attrs = {"units": "cm"}
    def __array__(self, dtype=None, copy=None):
        return np.zeros(4)
unyt = np.asarray(0.1).view(Unyt)
masked = np.ma.masked_array(wave, np.arange(50) == 3)
one = np.array([0.25])
jax.monitoring.register_event_duration_secs_listener(listen)
said = {}
calls, alike = json.load(sys.stdin)
for call in calls:
    try:
        eval(call)
        said[call] = ["nothing", ""]
    except Exception as error:
        said[call] = [type(error).__name__, str(error)]
longest = max(compiled, default=0.0)
p = Parameters(nu=0.25, mu=0.125, lam=0.5, zeta=0.125, k=0.0625, f=0.5, xi=2.5)
def forms(numbers):
    # The same numbers in all forms of an array.
    a = np.array(numbers, dtype=float)
    wide = np.asfortranarray(np.stack([0.0 * a, a, a], axis=0))
    forms = {"strided": np.repeat(a, 3)[::3], "column": np.stack([a, a, a], axis=1)[:, 1], "fortran": wide[1],
             "reversed": a[::-1].copy()[::-1], "float32": a.astype("f4"), "big endian": a.astype(">f8"),
             "of jax": jnp.asarray(a), "list": a.tolist(), "seen": np.asarray(jnp.stack([a, a], 1))[:, 1],
             "unmasked": np.ma.masked_array(a), "longdouble": a.astype("longdouble")}
    forms["read only"] = forms["strided"].copy().repeat(2)[::2]
    forms["read only"].flags.writeable = False
    if np.all(a == np.round(a)):
        forms |= {"int": a.astype(int), "strided int": np.repeat(a.astype("i2"), 2)[::2]}
    return a, forms
def single(number):
    # The same number in all forms of one number.
    forms = {"float64": np.float64, "float32": np.float32, "array": np.array, "jax": jnp.asarray,
             "one": lambda x: np.array([x]), "one of jax": lambda x: jnp.array([x]),
             "longdouble": np.longdouble,
             "big endian": lambda x: np.array(x, ">f8")}
    if isinstance(number, int):
        forms = {"int32": np.int32, "array": np.array, "one": lambda x: np.array([x]), "jax": jnp.asarray}
    return number, {name: form(number) for name, form in forms.items()}
def plain(x):
    leaves = jax.tree.leaves(x)
    if len(leaves) == 1 and leaves[0] is x and hasattr(x, "__dict__"):
        leaves = jax.tree.leaves(list(vars(x).values()))
    return [np.asarray(leaf).ravel().tolist() if hasattr(leaf, "dtype") else str(leaf) for leaf in leaves]
different = {}
for call, text in alike.items():
    good, others = eval(text)
    known = repr(plain(eval(call, globals(), {"A": good})))
    for form, other in others.items():
        try:
            found = repr(plain(eval(call, globals(), {"A": other})))
        except Exception as error:
            found = f"{type(error).__name__}: {error}"
        if found != known:
            different.setdefault(call, []).append(f"{form}: {found[:200]}")
print(json.dumps([said, longest, different]))
"""

CALLS = {
    'made(Block, width="0.1")': "`width` must be a number, but is '0.1'",
    "made(Block, width=nan)": "`width` must be positive and finite, but is nan",
    "made(Block, mass=[1.0, 2.0])": "`mass` must be a number, but is [1.0, 2.0]",
    "made(Block, restitution=1.2)": "`restitution` must be between 0 and 1, but is 1.2",
    "Scene(block, 2.5)": "`excitation` must be a Harmonic or GroundMotion, but is 2.5",
    'made(Block, restitution="bouncy")': "`restitution` must be a number or 'housner', but is 'bouncy'",
    "Scene(motion, block)": "`block` must be a Block, but is Harmonic(amplitude=0.015, frequency=2.5)",
    "Scene(Block, motion)": "`block` must be an object of Block, `Block(...)`, but is the class itself",
    # The design space, conditions, starts, risks and limits.
    "DesignSpace(mass_ratio=-0.1)": "`mass_ratio` must be positive and finite, but is -0.1",
    "DesignSpace(mass=(1, 2, 3))": "`mass` must be a pair of numbers (low, high), but is (1, 2, 3)",
    "DesignSpace(mass_ratio=(nan, 0.2))": "`mass_ratio` must be an interval low < high within 0 to 1, but is",
    "Conditions.band(scene, 3.0, 2.0)": "`band` must be an interval low < high within",
    "Conditions.amplitudes()": "`factors` must be one or more numbers, all finite, but is ()",
    "Conditions.amplitudes(0.0)": "`factors` must be positive and finite, but is [0.]",
    'Conditions({"colour": np.ones(2)})': "`factors` must be one of amplitude, frequency, friction",
    'Conditions({"friction": [1.0, nan]})': "`friction` must be a vector of factors, all finite, but is [1.0",
    'Conditions({"mass": [1.0], "length": [1.0, 1.1]})': "`factors` must be of one length, but have lengths",
    "Starts(swing=2.0)": "`swing` must be at most 1.5708, a right angle in rad, but is 2",
    'Starts(kind="rest")': "`kind` must be a StartKind, but is 'rest'",
    "Ensemble(growth=())": "`growth` must contain at least one number of periods, but is empty",
    "Ensemble(any_phase=1)": "`any_phase` must be True or False, but is 1",
    'Risk(share="all", name="mine")': "`share` must be a number, but is 'all'",
    "limits.Stroke(3.0)": "`stroke` must be at most 1.5708, a right angle in rad, but is 3",
    # Motions.
    "steady_state(scene)": "`p` must be a Parameters, but is Scene(",
    "steady_state(p, model=Piecewise)": ", `Piecewise(...)`, but is the class itself",
    'steady_state(p, model="exact")': "`model` must be a Model or Choice, but is 'exact'",
    "steady_state(p, y0=[nan, 0, 0, 0])": "`y0` must be (phi, psi, phi', psi'), all finite, but is [nan, 0, ",
    "simulate(p, np.zeros(4), [1.0, 0.0])": "`times` must be a vector of 2 or more increasing numbers, but",
    "periodic_orbit(p, [0.0, nan, 0.0, 0.0])": "`y0` must be (phi, psi, phi', psi'), all finite",
    "attractors(block)": "`subject` must be a Parameters or Scene, but is Block(",
    'settled_response(scene, "frequency", ["a"])': "`values` must be one or more numbers, all finite, but is",
    'settled_response(scene, "colour", [1.0])': "`name` must be one of width, height, centroid_height, mass",
    'settled_response(scene, "frequency", [2.0], progress=3)': "`progress` must be True or a function, but i",
    'branches(scene, "frequency", 3.0, 2.0)': "must be an interval low < high",
    'design_map(scene, "mu", ("lam", [0.1, 0.2]), pendulum=hung)': "`x` must be a name and its values, but i",
    'design_map(scene, ("mu", [0.1, 0.2]), ("lam", [0.1, 0.2]), pendulum=hung, start=[0, 0])': "`start` must",
    'design_map(scene, ("pendulum_mass", [1.0, 20.0]), ("lam", [0.1, 0.2]), pendulum=hung)': "`pendulum_mass",
    "outcomes(scene, ensemble=Ensemble)": "`ensemble` must be an object of Ensemble, `Ensemble(...)`",
    "paired_runs(scene, hung, conditions=2.5)": "`conditions` must be a Conditions, but is 2.5",
    # Searches.
    "optimise(p)": "`scene` must be a Scene, but is Parameters(",
    'optimise(scene, starts="rest")': "`starts` must be a Starts, but is 'rest'",
    "optimise(scene, limits=limits.Stroke(0.5))": "`limits` must be a list of objects of `tpd.limits`, but i",
    'optimise(scene, method="adam")': "`method` must be a Descent, but is 'adam'",
    "optimise(scene, seed=1.5)": "`seed` must be a whole number, 0 or more, but is 1.5",
    'optimise(scene, progress="bar")': "`progress` must be True or a function, but is 'bar'",
    "optimise(Scene(block, made(Harmonic, amplitude=0)))": "`amplitude` must be above 0 in a search, but is ",
    "optimise(scene, method=Descent(model=Piecewise))": "`model` must be Smoothed() with linear ",
    "Descent(optimiser=3)": "`optimiser` must be a transformation of optax, or one of newton, adam, but",
    # Once raw, or accepted.
    "Record(wave, 1e300)": "`dt` must be between 1e-06 and 1000 s, but is 1e+300",
    "Record.read(3)": "`path` must name a file, but is 3",
    "record.acceleration_at([nan])": "`times` must be finite, but is [nan]",
    'Pulse.sine_train(acceleration=1.0, frequency=1.0, cycles="3")': "`cycles` must be a number, but is '3'",
    "Conditions.around(shaken)": "`excitation` must be a Harmonic, but is Record(",
    'Conditions.exactly().column("colour")': "`name` must be one of amplitude, frequency, friction",
    "Conditions.exactly().subset(0)": "`most` must be a whole number, 1 or more, but is 0",
    "Conditions.scatter(10**12, mass=0.1)": "`size` must be a whole number, 1 to 10000000, but is 1e+12",
    "Conditions.records(record)": "`motions` must be a Sequence, but is Record(",
    "Ensemble(periods=10**12)": "`periods` must be a whole number, 1 to 10000, but is 1e+12",
    "limits.Requirements(at_least=np.array([0.1, 2.0]))": "`at_least` must be a single number, but is [",
    "Smoothed(terms=3)": "`terms` must be a Terms, but is 3",
    "status_name(99)": "`status` must be a EnumerationItem, but is 99",
    "theory.equivalent_friction(scene, 0.1)": "`p` must be a Parameters, but is Scene(",
    "attractors(shaken, hung)": "`excitation` must be a Harmonic, but is Record(",
    "paired_runs(shaken, hung)": "`excitation` must be a Harmonic, but is Record(",
    'branches(shaken, "frequency", 2.0, 3.0)': "`excitation` must be a Harmonic, but is Record(",
    "paired_runs(scene)": "`pendulum` must be a Pendulum, but is None",
    "check(scene, hung, models=3)": "`models` must be a tuple or list, but is 3",
    "transient(shaken, free=1e300)": "`free` must be between 0 and 100000 s, but is 1e+300",
    "critical_scale(shaken, highest=1e300)": "`highest` must be between 1e-09 and 1e+09, but is 1e+300",
    "fragility(block, record, scales=[1.0])": "`motions` must be a Sequence, but is Record(",
    "fragility(block, [record], scales=[1.0], states=3)": "`states` must be a Mapping, but is 3",
    'fragility(block, [record], scales=[1.0], states={"x": "a"})': "`states` must name tilts over the slend",
    "fragility(block, [record], scales=[1.0], nonlinear=1)": "`nonlinear` must be True or False, but is 1",
    "Hazard(levels=[0.1, 1.0], rates=[0.02, 6e-5]).factor(2.0)": "`other` must be a Measure, but is 2.0",
    'fold_curve(p, "mu", [])': "`y` must be one of nu, mu, lam",
    "made(Block, width=date(1979, 10, 15))": "`width` must be a number, but is 1979-10-15",
    "rocking_spectrum(block, record, periods=3.0)": "`periods` must be a vector of numbers, all finite, but",
    "in_chunks(3, np.zeros(3))": "`function` must be a function, but is 3",
    "optimise_all(scene)": "`scenes` must be a Sequence, but is Scene(",
    "optimise_all([scene, block])": "`scenes[1]` must be a Scene, but is Block(",
    "engines.mujoco(scene, 3)": "`pendulum` must be a Pendulum, but is 3",
    # Numbers that mean more than they are.
    'made(Block, width=Quantity(10.0, "cm"))': "`width` must be plain numbers, but is <Quantity 10.0 cm>",
    'made(Block, mass=Pint(0.1, "t"))': "`mass` must be plain numbers, but is <Quantity 0.1 t>",
    'Record(Quantity(wave, "cm/s2"), 0.01)': "with the unit 'cm/s2': convert it to the unit",
    "Record(masked, 0.01)": "`acceleration` must have no masked elements",
    "steady_state(p, y0=Column())": "`y0` must be plain numbers",
    "steady_state(p, y0=[unyt, 0, 0, 0])": "`y0` must be plain numbers",
    'Pulse.one_sine(acceleration=Pint(300.0, "cm/s2"), frequency=1.0)': "`acceleration` must be plain",
    "Ensemble(growth=unyt)": "`growth` must be plain numbers",
    "DesignSpace(mass_ratio=(unyt, 0.2))": "`mass_ratio` must be plain numbers",
    "fragility(block, [record], scales=wave.view(Unyt))": "`scales` must be plain numbers",
    # Arrays where one number is meant, and other types.
    "transient(shaken, free=jnp.array([1.0, 2.0]))": "`free` must be a single number",
    'Pulse.mavroeidis_papageorgiou(velocity=1.0, frequency="x", cycles=2.0)': "`frequency` must be a number",
    "record.scaled_to(pga=np.array([1.0, 2.0]))": "`pga` must be a single number, but is [1. 2.]",
    "Ensemble(growth=[None])": "`growth` must be a number, but is None",
    "Risk.cvar(np.array([0.1, 0.2]))": "`share` must be a single number, but is [0.1 0.2]",
    "optimise(scene, limits={})": "`limits` must be a list of objects of `tpd.limits`, but is {}",
    "Conditions.records([record], scatter=[1])": "`scatter` must be a Mapping, but is [1]",
    "Conditions({}, which=3)": "`which` must be a vector of indices of motions",
    'Terms("x")': "`terms` must be one of linear, parametric, nonlinear, but is 'x'",
    "in_chunks(jnp.sin, masked)": "`batch` must have no masked elements",
    # Absurd values.
    "Ensemble(tilt_rate=1e300)": "`tilt_rate` must be at most 10, ten times the rate that overturns",
    "made(Block, radius_of_gyration=1e-300)": "`radius_of_gyration` must be at least 0.2 of that",
    "made(Pendulum, length=1e300)": "`length` must be between 1e-06 and 1e+06 m, but is 1e+300",
    "made(Parameters, mu=1e300)": "`mu` must be between 0 and 1e+12, but is 1e+300",
    "fragility(block, [record], scales=[1.0], intensity='sa', period=1e300)": "`period` must be between",
    # Further calls.
    "made(Parameters, nu=nan)": "`nu` must be positive and finite, but is nan",
    'steady_state(p, throw="yes")': "`throw` must be True or False, but is 'yes'",
    "simulate(scene, np.zeros(4), [0.0, 1.0])": "`p` must be a Parameters, but is Scene(",
    "symmetric_orbits(scene)": "`p` must be a Parameters, but is Scene(",
    "theory.uplift(scene)": "`p` must be a Parameters, but is Scene(",
    'check(scene, hung, swing_limit="wide")': "`swing_limit` must be a number, but is 'wide'",
    "check(shaken, hung)": "`excitation` must be a Harmonic, but is Record(",
    'settled_response(shaken, "frequency", [2.0])': "`excitation` must be a Harmonic, but is Record(",
    "paired_runs(p)": "`mu` must be positive and finite, but is 0",
    'rocking_spectrum(block, record, mass_ratio="a")': "`mass_ratio` must be a number, but is 'a'",
    "fragility(block, [record], scales=[1.0], pendulum=3)": "`pendulum` must be a Pendulum, but is 3",
    'record.scaled_to(pga_g="x")': "`pga_g` must be a number, but is 'x'",
    'limits.Mass("2 kg")': "`mass` must be a number, but is '2 kg'",
    "Record(wave.astype('m8[s]'), 0.01)": "`acceleration` must be an array of at least two accelerations",
    "in_chunks(jnp.sin, wave.astype('m8[s]'))": "`batch` must be arrays of numbers",
    # Work that Ctrl-C could not stop.
    "simulate(p, np.zeros(4), [0.0, 1e9])": "100000 forcing periods in one call, but is 1e+09",
    "simulate(p, np.zeros(4), [0.0, 1e6], model=Smoothed())": "800 forcing periods in one call",
    "Piecewise(max_periods=10**6)": "`max_periods` must be a whole number, 1 to 100000, but is 1e+06",
    "transient(shaken, max_events=10**7)": "`max_events` must be a whole number, 1 to 1000000, but is 1e+07",
}

START, TIMES, WAVE = "forms([0.0625, -0.125, 0.03125, 0.25])", "forms([0, 1, 3])", "forms([0, 3, -2, 1, 0])"
SHARE, COUNT = "single(0.25)", "single(16)"
ALIKE = {
    "steady_state(p, y0=A, model=Nonlinear())": START,
    "simulate(p, A, [0.0, 1.0, 30.0])": START,
    "simulate(p, [0.25, 0.0, 0.0, 0.0], A)": TIMES,
    "periodic_orbit(p, A)": START,
    "transient(shaken, hung, y0=A, model=Nonlinear())": START,
    "transient(Scene(block, Record(A, 0.25)), hung)": WAVE,
    "fragility(block, [Record(A, 0.25)], scales=[1.0, 2.0], nonlinear=False)": WAVE,
    "fragility(block, [record], scales=A, nonlinear=False)": "forms([1, 2, 3])",
    "overturning_spectrum(block, Pulse.ricker(acceleration=1.0, frequency=1.0), frequency_ratios=A, "
    "acceleration_ratios=A)": "forms([1, 2, 3])",
    "record.acceleration_at(A)": "forms([0, 0.125, 0.25])",
    'settled_response(scene, "frequency", A)': "forms([2, 3])",
    'design_map(p, ("mu", A), ("lam", [0.5, 0.75]))': "forms([0.125, 0.25])",
    'design_map(p, ("mu", [0.1, 0.2]), ("lam", [0.5, 0.75]), start=A)': START,
    'Conditions({"mass": A}).factor_rows()': "forms([1, 1.25])",
    "symmetric_orbits(Parameters(nu=A, mu=A, lam=A, zeta=A, k=0.0625, f=0.5, xi=2.5))": SHARE,
    "attractors(Parameters(nu=A, mu=A, lam=A, zeta=A, k=A, f=0.5, xi=2), starts=Starts(size=4))[0].steady": (
        SHARE
    ),
    "transient(Scene(made(Block, width=A, height=1, mass=100), record), made(Pendulum, length=A))": SHARE,
    "critical_scale(shaken, scan=A)": SHARE,
    "Record(wave, 0.01, scale=A).pga": SHARE,
    "Pulse.mavroeidis_papageorgiou(velocity=A, frequency=A, cycles=2, phase=A).pieces()": SHARE,
    "repr(Ensemble(tilt=A, mass=A, growth=A))": SHARE,
    "repr(Ensemble(size=A, seed=A))": COUNT,
    "repr((limits.Stroke(A), limits.Mass(A), DesignSpace(damping_ratio=A)))": SHARE,
    "repr((Piecewise(tolerance=A), Smoothed(sharpness=A), Nonlinear(rtol=A), Auto(tolerance=A)))": SHARE,
    "repr(Piecewise(max_periods=A, lyapunov_periods=A))": COUNT,
}
"""Calls with an array or a number A, and the numbers that A is in all forms."""


@pytest.fixture(scope="module")
def said():
    """Answers of all calls, the longest compilation (s), and the forms of arrays that change an answer."""
    call = [sys.executable, "-W", "error", "-c", HEAD]
    asked = json.dumps([list(CALLS), ALIKE])
    done = subprocess.run(call, input=asked, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(("call", "message"), CALLS.items(), ids=CALLS)
def test_invalid_input_of_a_public_call_is_rejected_in_one_sentence(said, call, message):
    kind, text = said[0][call]
    assert kind == "ValueError", (kind, text)
    assert message in text
    assert len(text.splitlines()) == 1
    assert len(text) < 260


def test_invalid_input_is_rejected_before_compilation(said):
    """A search, an orbit or an integration takes seconds to compile; an addition of two numbers does not."""
    assert said[1] < 0.5


@pytest.mark.parametrize("call", ALIKE)
def test_numbers_and_arrays_of_any_type_give_bitwise_equal_results(said, call):
    assert said[2].get(call, []) == []


def test_an_unknown_or_old_name_gets_a_hint_with_the_new_name():
    for call, message in (
        (lambda: tpd.Block(widht=1.0), "`Block` has no argument `widht`; did you mean `width`?"),
        (lambda: tpd.Ensemble(sise=3), "`Ensemble` has no argument `sise`; did you mean `size`?"),
        (lambda: tpd.limits.Requirements(strikes=0.1), "it is now called `wall_contacts`"),
        (lambda: tpd.optimise(None, worth=1), "`optimise` has no argument `worth`; it is now called `requir"),
        (lambda: tpd.check(None, colour=0.5), "allowed are subject, pendulum, swing_limit, models, progress"),
    ):
        with pytest.raises(TypeError, match=re.escape(message)):
            call()
    with pytest.raises(AttributeError, match="attribute study; it is now called `details`"):
        tpd.study  # noqa: B018


def test_a_class_with_checked_keywords_keeps_its_signature_and_its_name():
    assert list(inspect.signature(tpd.Block).parameters)[:3] == ["width", "height", "mass"]
    assert inspect.signature(tpd.optimise).parameters["seed"].default is None
    assert (tpd.Block.__init__.__name__, tpd.optimise.__name__) == ("__init__", "optimise")
    assert pickle.loads(pickle.dumps(tpd.optimise)) is tpd.optimise
