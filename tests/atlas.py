"""The atlas of failures as a table: the regimes in which a method loses its footing, what holds there and
what does not, how it shows, what the user is told, and which tests keep it so.

`tests.benchmarks.guards` takes their guards away.
"""

from __future__ import annotations

from typing import NamedTuple


class Regime(NamedTuple):
    """One of them."""

    name: str
    holds: str
    """What can be relied on."""
    fails: str
    """What cannot, and how it shows."""
    told: str
    """Statuses and errors."""
    tests: str
    """Modules with words from the names of their tests."""


def test_ids(module: str, *names: str) -> tuple[str, ...]:
    """Identifiers for pytest of tests of a module such as "exact/steady"."""
    folder, _, name = module.rpartition("/")
    return tuple(f"tests/{folder}/test_{name}.py::test_{test}" for test in names)


test_ids.__test__ = False  # pytest would take it for a test


REGIMES = (
    Regime(
        "saddle-node fold",
        "amplitude, on both branches; the gradient until 1e-13 of the fold",
        "the gradient grows as the inverse root of the distance; beyond there is no orbit",
        "near_fold, the gradient refused; no_orbit; `tpd.bifurcations` says where",
        "models/piecewise: next_to_a_fold, farther_from_a_fold; exact/symmetric_orbit_kernel: "
        "about_to_be_lost; answers/symmetric_orbits: at_a_fold; answers/bifurcations: at_a_fold; "
        "answers/periodic_orbit: fold_is_told",
    ),
    Regime(
        "breaking of symmetry",
        "the symmetric orbit and its gradient, on both sides, by `symmetric_orbits` and `periodic_orbit`",
        "that orbit no longer attracts; the motion leans as the root of the distance, and its gradient "
        "grows as the inverse",
        "unstable, refused by `steady_state`; rocking and not `symmetric` of the leaning motion",
        "answers/symmetric_orbits: where_symmetry_breaks; models/piecewise: breaking_of_symmetry; "
        "exact/steady: leans_is_not_called_symmetric, repelling_orbit; answers/periodic_orbit: "
        "continuation_passes",
    ),
    Regime(
        "grazing",
        "the motion itself; its derivatives before the touch",
        "past a touch of the base the derivative of the motion grows as the inverse root of the distance",
        "grazing, the gradient refused, where an orbit's fall all but halts; not told: an orbit that "
        "turns just above its base, whose gradient is that of its own side",
        "exact/trajectory: past_a_touch; models/piecewise: grazing; exact/steady: verdict; "
        "answers/bifurcations: at_grazing; models/segmented: only_touches",
    ),
    Regime(
        "onset of sticking",
        "amplitude and gradient, which are continuous",
        "the symmetric orbits end; `steady_state` and `periodic_orbit` go on",
        "sticking in place of rocking; the margin to it vanishes in proportion",
        "models/piecewise: where_sticking_begins; exact/settle: called_sticking; answers/bifurcations: "
        "at_sticking",
    ),
    Regime(
        "rattling to rest",
        "the state after it, up to the square of the capture speed",
        "impacts without end in a finite time: their number grows as the logarithm of the capture speed",
        "rest or sticking; event_bound where rounding or too small a bound hides the capture",
        "exact/settle: hops_of_a_rattle, friction_ends_a_rattle, capture_leaves_out; exact/trajectory: "
        "too_few_events; answers/periodic_orbit: says_why",
    ),
    Regime(
        "period three and chaos",
        "every periodic orbit inside, by shooting, with its gradient",
        "derivatives through a long simulation grow at the Lyapunov exponent",
        "aperiodic with `lyapunov`, the gradient refused; periods = 3 of a motion of that period",
        "exact/steady: chaotic_motion, after_its_periods, too_slow_to_repeat, gradient_of_differences; "
        "answers/periodic_orbit: inside_chaos",
    ),
    Regime(
        "overturning",
        "that it overturns, in every model",
        "there is no size and no gradient; a start next to the boundary ends anywhere, or on the saddle",
        "overturned with infinite sizes; unstable on the saddle; the gradient refused",
        "models/piecewise: overturn; exact/trajectory: next_to_its_balance, overturned_trajectory; "
        "models/smoothed: overturn; models/segmented: overturning",
    ),
    Regime(
        "resonance without damping",
        "the stroke f/(2 zeta) of a bob too light to be felt, to rounding of the resonance",
        "a bob with mass lifts the block; without damping there is no steady swing",
        "overturned, event_bound (a swing beyond 1e6 rad), failed at the resonance to the last digit",
        "models/piecewise: resonance; exact/settle: undamped_bob; exact/steady: undamped_bob; "
        "answers/symmetric_orbits: undamped_hinge",
    ),
    Regime(
        "no mass, no rod",
        "the limits mu = 0 and lam = 0 to the first order",
        "nothing; lam = 0 itself is refused",
        "ValueError for lam = 0",
        "answers/properties: without_mass, shortest_rod; models/piecewise: light_bob; "
        "answers/steady_state: out_of_range",
    ),
    Regime(
        "slender blocks",
        "amplitude over slenderness, down to nu = 1e-10",
        "below nu = 1e-11 thresholds of the exact flow show: amplitude off by 6e-9, gradient by 1e-4",
        "nothing",
        "models/piecewise: slender",
    ),
    Regime(
        "fast and slow shaking",
        "xi from 2e-4 to 300: the limits of xi to infinity and to zero",
        "above 1000 the tilt is below what repetition is judged by; below 1e-4 a period has too many steps",
        "unstable or grazing above, event_bound or failed below; never a settled status",
        "models/piecewise: fast_shaking, slow_shaking, too_long",
    ),
    Regime(
        "huge shaking and all other extremes",
        "that sizes are finite and derivatives known where the status is a settled one",
        "numbers that are not finite",
        "overturned, failed",
        "models/piecewise: huge_shaking, far_outside; answers/properties: without_a_status; "
        "answers/symmetric_orbits: without_a_status",
    ),
    Regime(
        "smoothing",
        "a bias in proportion to the sharpness",
        "too coarse a smoothing overturns a block that rocks; too sharp a one needs too many steps",
        "ValueError outside 1e-6 to 1; event_bound or failed",
        "models/smoothed: bias_falls, coarse_sharpness, out_of_range, cannot_keep_up",
    ),
    Regime(
        "smoothed impacts",
        "amplitude and gradient, with a bias in proportion to the sharpness, for e from 0.5 on; rest",
        "the bias grows as e falls, to 1 % at e = 0.1; folds are displaced in proportion to the "
        "sharpness, and next to an exact one the gradient is another; sticking is not recognised; below "
        "a sharpness of 1e-4 steps may pass over impacts, and the motion gains",
        "ValueError for e = 0, and for all impact loss with nonlinear terms; not_settled or unstable "
        "next to a fold, and where the block all but stops; event_bound for a traced e of 0",
        "models/smoothed: impacts, no_smoothed_impact, smoothed_counterpart, equations_4",
    ),
    Regime(
        "32-bit floats",
        "nothing",
        "every answer",
        "RuntimeError from every call",
        "answers/steady_state: 32_bits",
    ),
    Regime(
        "scales",
        "dimensionless answers, to rounding, of blocks from 1 mm to 1 km and 1e-6 to 1e9 kg",
        "nothing",
        "nothing",
        "models/piecewise: kilometres; scene/scene: another_gravity",
    ),
)
