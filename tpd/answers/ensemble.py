"""Ensembles of runs with different initial states, growth of the excitation, and uncertain parameters.

One run says little: rest, rocking and overturning exist for the same design, and a change of the amplitude by
one per cent may decide which is reached. The shares of a seeded set of runs are stable. All designs under
validation are evaluated with the same runs (common random numbers), and are compared run by run, see
`tpd.answers.paired`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tpd.answers.run_table import Runs, follow_runs
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing
from tpd.core import checks
from tpd.core.progress import count_for
from tpd.scene.conditions import FACTORS, Conditions, check_restitution, factors_at, under_each
from tpd.scene.ensemble import Ensemble
from tpd.scene.parameters import Parameters
from tpd.scene.quantities import parameters_of
from tpd.scene.scene import Pendulum, Scene
from tpd.theory.equations import Terms


class Plan(NamedTuple):
    """Inputs of `follow_runs` for the runs of an ensemble: arrays with the leading axis (size,)."""

    p: Parameters
    """Dimensionless parameters of each run."""
    y0: np.ndarray
    """Initial states, shape (size, 4)."""
    begin: np.ndarray
    """Dimensionless times at which the runs begin."""
    growth: np.ndarray
    """Number of forcing periods over which the excitation grows."""
    disturbed: np.ndarray
    """Whether each run begins with a disturbance."""
    condition: np.ndarray
    """Index of the condition of each run."""


def plan(p: Parameters, ensemble: Ensemble, conditions: Conditions | None = None) -> Plan:
    """Return the inputs of the runs of an ensemble for one design.

    Args:
        p: dimensionless parameters, plain numbers.
        ensemble: spreads of the runs.
        conditions: conditions that are distributed evenly over the runs, in addition to the scatter; by
            default the condition of the scene.
    """
    # Initial tilts are relative to nu: at |phi| = nu a block of any shape stands on its corner, at the limit
    # of static overturning.
    e, unit, nu = ensemble, ensemble.draws(), float(p.nu)
    reach = np.array([e.tilt * nu, e.swing, e.tilt_rate * nu, e.swing_rate])
    # The first six columns of the samples are disturbance, phase and kind of start. The others are the
    # scatter.
    scatter = factors_at(unit[:, 6:], e.widths(p.e))
    conditions = Conditions() if conditions is None else conditions
    # The conditions have equal numbers of runs (up to one), in random order.
    dealt = e.dealt(len(conditions))
    factor = np.stack([scatter.get(name, 1.0) * conditions.column(name)[dealt] for name in FACTORS])
    design = np.repeat([[float(x)] for x in (p.mu, p.lam, p.zeta)], e.size, axis=1)
    # Every parameter is an array with an element for each run. All ensembles, also those without a pendulum,
    # then share one compiled program.
    q = under_each(p, design, factor)
    xi = np.asarray(q.xi)
    # The phase is varied by the time at which a run begins. With a fixed phase all runs begin at tau = 0.
    *state, phase, kind = unit.T[:6]
    begin = phase * 2.0 * np.pi / xi if e.any_phase else np.zeros(e.size)
    growth, disturbed = e.starts(kind)
    # Samples from 0 to 1 become initial states from -reach to reach.
    y0 = np.where(disturbed[:, None], (2.0 * np.stack(state, axis=1) - 1.0) * reach, 0.0)
    return Plan(q, y0, begin, growth, disturbed, dealt)


def outcomes(
    subject: Parameters | Scene,
    pendulum: Pendulum | None = None,
    *,
    ensemble: Ensemble | None = None,
    conditions: Conditions | None = None,
    equations: Terms | str = Terms.linear,
    rtol: checks.Real = 1e-8,
    workers: checks.Whole | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
) -> Runs:
    """Follow the runs of an ensemble.

    Args:
        subject: a scene, or dimensionless parameters (plain numbers).
        pendulum: pendulum of the scene; None without a pendulum.
        ensemble: number, seed and spreads of the runs; `Ensemble()` by default.
        conditions: conditions that are distributed evenly over the runs, in addition to the scatter; by
            default the condition of the scene.
        equations: "linear", with the exact solution, or "nonlinear".
        rtol: relative tolerance of a step of the nonlinear model.
        workers: number of threads; all cores by default.
        progress: True for a progress bar on stderr, or a function that is called with (number of finished
            runs, number of all runs).

    Raises:
        ValueError: bad input, or a pendulum together with dimensionless parameters.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0)
        >>> runs = tpd.outcomes(p, ensemble=tpd.Ensemble(size=32))
        >>> runs.share_overturned.value, round(runs.quantiles("settled_tilt")[0], 3)
        (0.0, 0.055)
    """
    checks.require_x64()
    checks.one_of("equations", equations, (Terms.linear.value, Terms.nonlinear.value))
    terms = Terms(equations)
    ensemble = Ensemble() if ensemble is None else ensemble
    checks.instance("ensemble", ensemble, Ensemble)
    # The seed is set here, so that the result records it.
    ensemble = ensemble.seeded(0)
    if ensemble.restitution and isinstance(subject, Scene):
        check_restitution(subject, in_runs=True)
    checks.optional("conditions", conditions, Conditions)
    runs = plan(parameters_of(subject, pendulum), ensemble, conditions)
    forcing = HarmonicForcing(ensemble.periods, runs.begin, runs.growth)
    inputs: dict[str, Any] = {"condition": runs.condition, "seed": ensemble.seed or 0}
    inputs |= {"growth": runs.growth, "disturbed": runs.disturbed}
    with count_for(progress, "following") as report:
        where = {"workers": workers, "progress": report}
        return follow_runs(terms, row_of(runs.p), forcing, y0=runs.y0, rtol=rtol, **inputs, **where)
