"""The atlas of failures as a table: the regimes in which a method loses its footing, what holds there and
what does not, how it shows, what the user is told, and which tests keep it so.

`tests.benchmarks.guards` takes their guards away.
"""

from __future__ import annotations

from pathlib import Path
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
    tests: tuple[str, ...]


ROOT = Path(__file__).parents[1]


def test_ids(module: str, *names: str) -> tuple[str, ...]:
    """Identifiers for pytest of tests in `test_{module}.py`, in whichever folder that is.

    Raises:
        ValueError: no such file, or more than one.
    """
    (path,) = (ROOT / "tests").rglob(f"test_{module}.py")
    return tuple(f"{path.relative_to(ROOT).as_posix()}::test_{name}" for name in names)


test_ids.__test__ = False  # pytest would take it for a test


REGIMES = (
    Regime(
        "saddle-node fold",
        "amplitude, on both branches; the gradient until 1e-13 of the fold",
        "the gradient grows as the inverse root of the distance; beyond there is no orbit",
        "near_fold, the gradient refused; no_orbit; `tpd.bifurcations` says where",
        test_ids(
            "atlas",
            "at_a_fold_the_gradient_grows_as_the_inverse_root_over_six_decades",
            "next_to_a_fold_the_gradient_is_refused_by_name",
            "an_orbit_about_to_be_lost_has_a_name",
            "a_little_farther_from_a_fold_steady_state_and_orbits_have_the_same_large_gradient",
        )
        + test_ids("symmetric_orbits", "at_a_fold_there_is_no_gradient_and_beyond_it_no_orbit")
        + test_ids("bifurcations", "at_a_fold_two_orbits_meet_as_a_root_and_a_multiplier_becomes_one")
        + test_ids("periodic_orbit", "fold_is_told_and_refused"),
    ),
    Regime(
        "breaking of symmetry",
        "the symmetric orbit and its gradient, on both sides, by `symmetric_orbits` and `periodic_orbit`",
        "that orbit no longer attracts; the motion leans as the root of the distance, and its gradient grows "
        "as the inverse",
        "unstable, refused by `steady_state`; rocking and not `symmetric` of the leaning motion",
        test_ids(
            "atlas",
            "the_symmetric_orbit_loses_its_stability_and_keeps_its_gradient_where_symmetry_breaks",
            "beyond_the_breaking_steady_state_refuses_the_symmetric_orbit",
            "a_motion_that_leans_is_not_called_symmetric",
            "beyond_the_breaking_the_motion_leans_as_the_root_and_its_gradient_grows_as_the_inverse",
        )
        + test_ids("piecewise", "a_motion_on_a_repelling_orbit_is_called_unstable_and_has_no_gradient")
        + test_ids("periodic_orbit", "continuation_passes_where_the_orbit_repels"),
    ),
    Regime(
        "grazing",
        "the motion itself; its derivatives before the touch",
        "past a touch of the base the derivative of the motion grows as the inverse root of the distance",
        "grazing, the gradient refused, where an orbit's fall all but halts; not told: an orbit that turns "
        "just above its base, whose gradient is that of its own side",
        test_ids(
            "atlas",
            "past_a_touch_of_the_base_the_derivative_of_the_motion_grows_as_the_inverse_root",
            "next_to_a_grazing_the_gradient_is_refused_by_name",
            "the_verdict_has_a_name_for_each_loss",
        )
        + test_ids("bifurcations", "at_grazing_the_fall_halts_between_the_turns")
        + test_ids("segmented", "a_turn_that_only_touches_is_a_grazing"),
    ),
    Regime(
        "onset of sticking",
        "amplitude and gradient, which are continuous",
        "the symmetric orbits end; `steady_state` and `periodic_orbit` go on",
        "sticking in place of rocking; the margin to it vanishes in proportion",
        test_ids(
            "atlas",
            "where_sticking_begins_amplitude_and_gradient_are_continuous_and_the_status_changes",
            "a_block_that_friction_holds_for_a_while_is_called_sticking",
        )
        + test_ids(
            "bifurcations",
            "at_sticking_the_block_has_no_acceleration_after_its_turn_and_beyond_it_is_held",
        ),
    ),
    Regime(
        "rattling to rest",
        "the state after it, up to the square of the capture speed",
        "impacts without end in a finite time: their number grows as the logarithm of the capture speed",
        "rest or sticking; event_bound where rounding or too small a bound hides the capture",
        test_ids(
            "atlas",
            "the_hops_of_a_rattle_grow_as_the_logarithm_of_the_capture_speed",
            "friction_ends_a_rattle_without_impact_loss_as_fast_as_its_ratio_says",
            "what_capture_leaves_out_is_below_the_square_of_its_speed",
        )
        + test_ids("piecewise", "too_few_events_are_reported_and_leave_no_numbers")
        + test_ids("periodic_orbit", "no_orbit_says_why"),
    ),
    Regime(
        "period three and chaos",
        "every periodic orbit inside, by shooting, with its gradient",
        "derivatives through a long simulation grow at the Lyapunov exponent",
        "aperiodic with `lyapunov`, the gradient refused; periods = 3 of a motion of that period",
        test_ids(
            "atlas",
            "the_gradient_through_a_chaotic_simulation_grows_at_the_reported_rate",
            "shooting_has_the_gradient_of_an_orbit_inside_chaos_where_simulation_loses_it",
            "the_rates_agree_over_two_thousand_periods",
        )
        + test_ids(
            "piecewise",
            "a_chaotic_motion_is_aperiodic_with_the_rate_at_which_neighbours_part",
            "settled_state_returns_after_its_periods_and_not_before",
            "the_settled_state_has_the_gradient_of_differences",
        )
        + test_ids("compiled_linear", "a_motion_too_slow_to_repeat_is_not_settled_rather_than_aperiodic"),
    ),
    Regime(
        "overturning",
        "that it overturns, in every model",
        "there is no size and no gradient; a start next to the boundary ends anywhere, or on the saddle",
        "overturned with infinite sizes; unstable on the saddle; the gradient refused",
        test_ids(
            "atlas",
            "an_overturning_has_a_status_and_no_gradient",
            "a_free_block_let_go_next_to_its_balance_falls_after_the_logarithm_of_the_distance",
            "starts_that_all_but_overturn_have_the_attractor_s_answer_or_a_name",
            "the_same_of_the_integrated_models",
        )
        + test_ids(
            "piecewise",
            "a_trajectory_after_an_overturning_has_no_derivative",
            "an_overturned_trajectory_says_so_and_ends_in_nan",
        )
        + test_ids(
            "smoothed",
            "an_overturning_has_a_status_and_no_gradient",
            "a_coarse_sharpness_overturns_a_block_that_rocks",
        )
        + test_ids("segmented", "an_overturning_has_a_status_and_no_gradient"),
    ),
    Regime(
        "resonance without damping",
        "the stroke f/(2 zeta) of a bob too light to be felt, to rounding of the resonance",
        "a bob with mass lifts the block; without damping there is no steady swing",
        "overturned, event_bound (a swing beyond 1e6 rad), failed at the resonance to the last digit",
        test_ids(
            "atlas",
            "at_resonance_a_bob_under_a_resting_block_swings_by_its_damping_alone",
            "resonance_without_damping_to_the_last_digit_is_told",
        )
        + test_ids(
            "piecewise",
            "an_undamped_bob_that_rings_on_is_not_settled_and_has_no_gradient",
            "an_undamped_bob_under_a_resting_block_has_the_reach_of_its_two_swings",
        )
        + test_ids("symmetric_orbits", "an_undamped_hinge_is_no_exception"),
    ),
    Regime(
        "no mass, no rod",
        "the limits mu = 0 and lam = 0 to the first order",
        "nothing; lam = 0 itself is refused",
        "ValueError for lam = 0",
        test_ids(
            "properties",
            "a_bob_without_mass_is_the_limit_of_light_ones",
            "a_bob_on_the_shortest_rod_is_a_mass_on_the_top",
        )
        + test_ids("piecewise", "a_massless_bob_cannot_be_felt_whatever_its_rod_and_hinge")
        + test_ids("steady_state", "parameters_out_of_range_are_refused"),
    ),
    Regime(
        "slender blocks",
        "amplitude over slenderness, down to nu = 1e-10",
        "below nu = 1e-11 thresholds of the exact flow show: amplitude off by 6e-9, gradient by 1e-4",
        "nothing",
        test_ids("atlas", "a_slender_block_s_amplitude_is_in_proportion_as_nu_vanishes"),
    ),
    Regime(
        "fast and slow shaking",
        "xi from 2e-4 to 300: the limits of xi to infinity and to zero",
        "above 1000 the tilt is below what repetition is judged by; below 1e-4 a period has too many steps",
        "unstable or grazing above, event_bound or failed below; never a settled status",
        test_ids(
            "atlas",
            "under_fast_shaking_the_amplitude_is_that_of_a_block_that_nothing_topples",
            "under_slow_shaking_the_block_rests_or_overturns_and_the_bob_follows",
            "a_period_too_long_to_be_followed_is_told",
        ),
    ),
    Regime(
        "huge shaking and all other extremes",
        "that sizes are finite and derivatives known where the status is a settled one",
        "numbers that are not finite",
        "overturned, failed",
        test_ids(
            "atlas",
            "huge_shaking_overturns_or_is_told_to_be_beyond_numbers",
            "far_outside_every_design_there_is_no_nan_with_a_settled_status",
        )
        + test_ids("properties", "there_is_no_number_without_a_status_nor_nan_that_none_explains")
        + test_ids("symmetric_orbits", "there_is_never_a_nan_without_a_status"),
    ),
    Regime(
        "smoothing",
        "a bias in proportion to the sharpness",
        "too coarse a smoothing overturns a block that rocks; too sharp a one needs too many steps",
        "ValueError outside 1e-6 to 1; event_bound or failed",
        test_ids(
            "smoothed",
            "the_bias_falls_in_proportion_to_the_sharpness",
            "a_coarse_sharpness_overturns_a_block_that_rocks",
            "settings_out_of_range_are_refused",
        )
        + test_ids("atlas", "the_sharpest_smoothing_is_right_or_told_to_be_too_much"),
    ),
    Regime(
        "smoothed impacts",
        "amplitude and gradient, with a bias in proportion to the sharpness, for e from 0.5 on; rest",
        "the bias grows as e falls, to 1 % at e = 0.1; folds are displaced in proportion to the sharpness, "
        "and next to an exact one the gradient is another; sticking is not recognised; below a sharpness of "
        "1e-4 steps may pass over impacts, and the motion gains",
        "ValueError for e = 0, and for all impact loss with nonlinear terms; not_settled or unstable next to "
        "a fold, and where the block all but stops; event_bound for a traced e of 0",
        test_ids(
            "smoothed",
            "impacts_are_near_the_exact_ones_in_amplitude_and_gradient",
            "the_error_of_impacts_falls_in_proportion_to_the_sharpness",
            "impacts_without_a_smoothed_counterpart_are_refused",
        )
        + test_ids(
            "atlas",
            "with_smoothed_impacts_rest_and_overturning_are_those_of_the_exact_model",
            "smoothed_impacts_pass_the_onset_of_sticking_and_do_not_name_it",
            "smoothed_impacts_of_a_block_that_all_but_stops_are_not_called_settled",
            "with_smoothed_impacts_a_fold_is_beside_the_exact_one_in_proportion_to_the_width",
            "from_a_grazing_orbit_smoothed_impacts_lead_to_the_one_that_attracts",
            "the_bias_of_smoothed_impacts_grows_as_e_falls",
            "smoothed_impacts_too_sharp_to_be_met_by_every_step_are_right_or_told",
            "a_traced_ratio_that_has_no_smoothed_impact_is_told",
            "the_smoothed_equations_4_have_no_number_with_impacts",
        ),
    ),
    Regime(
        "32-bit floats",
        "nothing",
        "every answer",
        "RuntimeError from every call",
        test_ids("atlas", "in_32_bits_every_call_refuses_by_name")
        + test_ids("steady_state", "32_bit_jax_is_refused"),
    ),
    Regime(
        "scales",
        "dimensionless answers, to rounding, of blocks from 1 mm to 1 km and 1e-6 to 1e9 kg",
        "nothing",
        "nothing",
        test_ids("atlas", "neither_millimetres_nor_kilometres_change_a_dimensionless_answer")
        + test_ids("scene", "another_gravity_and_size_scale_the_forcing_and_not_the_block"),
    ),
)
