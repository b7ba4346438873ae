"""The atlas of failures: the regimes in which a method loses its footing, and the tests that say what holds
there, what does not, how it shows, and what the user is told.

`tests.benchmarks.guards` takes their guards away.
"""

from __future__ import annotations

REGIMES = {
    "saddle-node fold": (
        "models/piecewise: next_to_a_fold, farther_from_a_fold; exact/symmetric_orbit_kernel: "
        "about_to_be_lost; answers/symmetric_orbits: at_a_fold; answers/response: the_fold_over_hz; "
        "answers/periodic_orbit: fold_is_told"
    ),
    "breaking of symmetry": (
        "answers/symmetric_orbits: where_symmetry_breaks; models/piecewise: breaking_of_symmetry; "
        "exact/steady: leans_is_not_called_symmetric, repelling_orbit; answers/periodic_orbit: "
        "continuation_passes"
    ),
    "grazing": (
        "exact/trajectory: past_a_touch; models/piecewise: grazing; exact/steady: verdict; "
        "answers/bifurcations: last_of_those_beside_it; models/segmented: only_touches"
    ),
    "onset of sticking": (
        "models/piecewise: where_sticking_begins; exact/settle: called_sticking; "
        "answers/bifurcations: last_of_those_beside_it"
    ),
    "rattling to rest": (
        "exact/settle: hops_of_a_rattle, friction_ends_a_rattle, capture_leaves_out; "
        "exact/trajectory: too_few_events; answers/periodic_orbit: says_why"
    ),
    "period three and chaos": (
        "exact/steady: chaotic_motion, after_its_periods, too_slow_to_repeat, "
        "gradient_of_differences; answers/periodic_orbit: symmetric_orbits_are_found_again"
    ),
    "overturning": (
        "models/piecewise: overturn; exact/trajectory: next_to_its_balance, overturned_trajectory; "
        "models/smoothed: overturn; models/segmented: overturning"
    ),
    "resonance without damping": (
        "models/piecewise: resonance; exact/settle: undamped_bob; exact/steady: undamped_bob; "
        "answers/symmetric_orbits: undamped_hinge"
    ),
    "no mass, no rod": (
        "properties/settled: without_mass, shortest_rod; models/piecewise: light_bob; "
        "answers/steady_state: out_of_range"
    ),
    "slender blocks": "models/piecewise: slender",
    "fast and slow shaking": "models/piecewise: fast_shaking, slow_shaking, too_long",
    "huge shaking and all other extremes": (
        "models/piecewise: huge_shaking, far_outside; properties/settled: without_a_status; "
        "answers/symmetric_orbits: without_a_status"
    ),
    "smoothing": "models/smoothed: bias_falls, coarse_sharpness, out_of_range, cannot_keep_up",
    "smoothed impacts": ("models/smoothed: impacts, no_smoothed_impact, smoothed_counterpart, equations_4"),
    "32-bit floats": "answers/steady_state: 32_bits",
    "scales": "models/piecewise: kilometres; scene/scene: another_gravity",
}
"""Modules with words from the names of their tests."""


def test_ids(module: str, *names: str) -> tuple[str, ...]:
    """Identifiers for pytest of tests of a module such as "exact/steady"."""
    folder, _, name = module.rpartition("/")
    return tuple(f"tests/{folder}/test_{name}.py::test_{test}" for test in names)


test_ids.__test__ = False  # pytest would take it for a test
