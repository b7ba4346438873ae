"""Strides and series give the same runs, and neither depends on how the samples of a record are cut."""

import functools

import jax
import numpy as np
import pytest

import tpd
from tests.compiled.shaken import Case, changed, motions, operands, random_scenes
from tests.reference import REST, box, parameters
from tpd import Piecewise, simulate, status_name
from tpd.compiled.columns import WIDTH
from tpd.compiled.simulate import GroundForcing, follow
from tpd.scene.status import Status, code_of, is_one_of, names_of

SCENES = random_scenes(60)
ANGLES = ("tilt", "swing", "rod_angle")
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
PENDULUM = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)


def assert_nearly_equal(found, known, name):
    """Each step has an error of 1e-13, and a long rattle doubles an error at every few impacts."""
    error = np.abs(found / known - 1.0)
    assert np.median(error) < 1e-12, name
    assert np.quantile(error, 0.95) < 1e-10, name


def test_runs_under_a_harmonic_with_and_without_strides_are_the_same():
    # Legs are recorded for derivatives, and a run that records legs takes no strides.
    times = np.linspace(0.0, 1.0, 41)

    @jax.jit
    def states(x, y0):
        motion = simulate(parameters(x), y0, 20.0 / x[6] * times, model=Piecewise(max_events=4000))
        return motion.ys, motion.status

    by_series = jax.jit(lambda x, y0: jax.jvp(functools.partial(states, y0=y0), (x,), (x,))[0])
    rattles = (0.25, 0.0986, 0.6, 0.1, 0.05, 0.37, 2.67, 1.0), (0.25, 0.4, 0.4, 0.3, 0.0, 0.37, 2.67, 0.91)
    compared, apart = 0, []
    for x, y0 in (*zip(*box(60, 5), strict=True), *((np.array(x), np.array(REST)) for x in rattles)):
        (ys, status), (known, expected) = states(x, y0), by_series(x, y0)
        assert status_name(status) == status_name(expected)
        if status_name(status) == "rocking":
            apart.append(np.abs(np.asarray(ys) - known).max())
            compared += np.any(np.asarray(ys)[:, 0] != y0[0])
    assert compared > 30
    assert np.median(apart) < 1e-13
    assert np.quantile(apart, 0.9) < 1e-9


def test_runs_under_records_with_and_without_strides_are_the_same():
    cases = [case for case, _, _ in SCENES[:20]]
    rows, pieces, rates = operands(cases)
    known, found = motions(cases), []
    for row, one, rate in zip(rows, pieces, rates, strict=True):
        run = functools.partial(follow, tpd.Terms.linear, forcing=GroundForcing([one], 5.0 * rate))
        found.append(jax.jvp(run, (row,), (np.ones(WIDTH),))[0])
    assert [status_name(run.status) for run in found] == list(names_of(known.status))
    rocked = is_one_of(known.status, Status.rocked)
    for name in (*ANGLES, "uplift_time"):
        by = rates if name == "uplift_time" else 1.0
        values = np.array([float(getattr(run, name)) for run in found]) / by
        sure = rocked & (getattr(known, name) > 0.0)
        assert_nearly_equal(values[sure], getattr(known, name)[sure], name)


@pytest.mark.parametrize("terms", [tpd.Terms.linear, tpd.Terms.nonlinear])
def test_interpolated_samples_do_not_change_the_motion(terms):
    def doubled(a, dt):
        out = np.empty(2 * len(a) - 1)
        out[::2], out[1::2] = a, 0.5 * (a[1:] + a[:-1])
        return out, 0.5 * dt

    known = motions([case for case, _, _ in SCENES], terms=terms)
    finer = motions(changed(SCENES, doubled), terms=terms)
    assert np.array_equal(code_of(finer.status), code_of(known.status))
    rocked = is_one_of(known.status, Status.rocked)
    with_it = rocked & np.array([case.pendulum is not None for case, _, _ in SCENES])
    for name, sure in zip(ANGLES, (rocked, with_it, with_it), strict=True):
        if terms is tpd.Terms.linear:
            assert_nearly_equal(getattr(finer, name)[sure], getattr(known, name)[sure], name)
        else:
            error = np.abs(getattr(finer, name)[sure] / getattr(known, name)[sure] - 1.0)
            assert np.median(error) < 1e-7


def test_a_brief_simulation_gives_the_statuses_of_a_full_one():
    sizes = np.linspace(0.9, 4.0, 40) * 9.80665 / 6.0
    cases = [Case(COLUMN, PENDULUM, tpd.Pulse.one_sine(acceleration=a, frequency=1.2375)) for a in sizes]
    rows, pieces, _ = operands(cases)
    forcing = GroundForcing(pieces, 30.0, np.arange(40))
    full, brief = (follow(tpd.Terms.linear, rows, forcing, brief=b) for b in (False, True))
    assert np.array_equal(code_of(full.status), code_of(brief.status))
    # Turns of the bob are not looked for: other pieces are taken in one step, and rounding is another.
    np.testing.assert_allclose(brief.tilt, full.tilt, rtol=1e-13)
