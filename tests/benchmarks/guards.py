"""Takes the guards of the atlas away, one at a time, and sees the tests that cover them fail.

.venv/bin/python -m tests.benchmarks.guards

Prints a Markdown table, writes it to `results/guards.md`, and exits with 1 if a test passes without its
guard.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from shutil import copyfile
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
RESULT = Path(__file__).parent / "results" / "guards.md"
COMPILED = Path(".pytest_cache") / "compiled"
QUICK = "--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true"
"""Every guard has to be compiled anew."""
TIMEOUT = 900.0
"""Seconds for the tests of one guard; most of them go into compiling what changed."""


class Guard(NamedTuple):
    """A line that keeps a wrong number from being told, and what fails without it."""

    regime: str
    what: str
    path: str
    text: str
    """In that file, once."""
    instead: str
    tests: tuple[str, ...]
    """All of them must fail."""


def _atlas(*names: str) -> tuple[str, ...]:
    return tuple(f"tests/test_atlas.py::test_{name}" for name in names)


_JUDGED = "the_verdict_has_a_name_for_each_loss"
_LOST = "an_orbit_about_to_be_lost_has_a_name_and_no_derivative"
GUARDS = (
    Guard(
        "fold",
        "orbits: no derivative where a multiplier of the half map is within 1e-6 of 1",
        "tpd/analysis/symmetric_orbits.py",
        "usable = there & ~near & ~grazes",
        "usable = there & ~grazes",
        _atlas(_LOST + "[0.9999999-1.0-near_fold]"),
    ),
    Guard(
        "fold",
        "steady_state: near_fold",
        "tpd/analysis/steady_state.py",
        "moving & (to_fold < 2.0 * NEAR_FOLD)",
        "moving & (to_fold < 0.0)",
        _atlas(_JUDGED + "[what3-near_fold]"),
    ),
    Guard(
        "breaking of symmetry",
        "steady_state: unstable where a multiplier exceeds 1",
        "tpd/analysis/steady_state.py",
        "moving & (multiplier > 1.0)",
        "moving & (multiplier > jnp.inf)",
        _atlas(_JUDGED + "[what5-unstable]"),
    ),
    Guard(
        "breaking of symmetry",
        "steady_state: symmetric only if it leans to neither side",
        "tpd/analysis/steady_state.py",
        "(periods % 2 == 1) & (orbit.lean < _SYMMETRIC)",
        "(periods % 2 == 1)",
        _atlas("a_motion_that_leans_is_not_called_symmetric"),
    ),
    Guard(
        "grazing",
        "orbits: no derivative where the fall all but halts",
        "tpd/analysis/symmetric_orbits.py",
        "usable = there & ~near & ~grazes",
        "usable = there & ~near",
        _atlas(_LOST + "[0.5-1e-08-grazing]"),
    ),
    Guard(
        "grazing",
        "steady_state: grazing where an event is met too gently",
        "tpd/analysis/steady_state.py",
        "moving & (orbit.gentlest < GRAZING)",
        "moving & (orbit.gentlest < 0.0)",
        _atlas(_JUDGED + "[what1-grazing]"),
    ),
    Guard(
        "onset of sticking",
        "statuses: sticking where the block was held",
        "tpd/models/settling.py",
        "status = Status.where(held, Status.sticking, Status.rocking)",
        "status = Status.where(held, Status.rocking, Status.rocking)",
        _atlas("a_block_that_friction_holds_for_a_while_is_called_sticking"),
    ),
    Guard(
        "rattling to rest",
        "arcs: an impact slower than the capture speed is rest",
        "tpd/exact/arc.py",
        "rests = (jnp.abs(y[2]) <= quiet) & holds",
        "rests = (jnp.abs(y[2]) <= -quiet) & holds",
        _atlas(
            "the_hops_of_a_rattle_grow_as_the_logarithm_of_the_capture_speed",
            "what_capture_leaves_out_is_below_the_square_of_its_speed",
        ),
    ),
    Guard(
        "period three and chaos",
        "steady_state: aperiodic where neighbours part",
        "tpd/analysis/steady_state.py",
        "separation > _APERIODIC",
        "separation > jnp.inf",
        _atlas(
            _JUDGED + "[what8-aperiodic]",
            "the_gradient_through_a_chaotic_simulation_grows_at_the_reported_rate",
        ),
    ),
    Guard(
        "period three and chaos",
        "periodic_orbit: unstable where a multiplier exceeds 1",
        "tpd/analysis/periodic_orbit.py",
        "status = Status.where(largest < 1.0, status, Status.unstable)",
        "status = Status.where(largest < jnp.inf, status, Status.unstable)",
        ("tests/test_general.py::test_continuation_passes_where_the_orbit_repels",),
    ),
    Guard(
        "motion that does not repeat",
        "steady_state: not_settled where Newton's method has not closed the orbit",
        "tpd/analysis/steady_state.py",
        "moving & ~(orbit.residual < _RESIDUAL)",
        "moving & ~(orbit.residual < jnp.inf)",
        _atlas(_JUDGED + "[what6-not_settled]"),
    ),
    Guard(
        "overturning",
        "every model: overturned once the tilt is beyond return",
        "tpd/models/settling.py",
        "status = Status.where(self.lost, Status.overturned, status)",
        "status = Status.where(self.lost, status, status)",
        _atlas(
            "every_model_tells_an_overturning_and_refuses_its_gradient[piecewise]",
            "every_model_tells_an_overturning_and_refuses_its_gradient[smoothed]",
            "every_model_tells_an_overturning_and_refuses_its_gradient[segmented nonlinear]",
        ),
    ),
    Guard(
        "overturning",
        "exact flow: a tilt beyond ten times the balance is lost",
        "tpd/exact/flow.py",
        "(m.steps + 1, ~(tilt < limit))",
        "(m.steps + 1, ~(tilt < jnp.inf * limit))",
        _atlas(
            "every_model_tells_an_overturning_and_refuses_its_gradient[piecewise]",
            "a_free_block_let_go_next_to_its_balance_falls_after_the_logarithm_of_the_distance",
        ),
    ),
    Guard(
        "overturning, all but",
        "steady_state: unstable on the saddle between rocking and overturning",
        "tpd/analysis/steady_state.py",
        "moving & (multiplier > 1.0)",
        "moving & (multiplier > jnp.inf)",
        _atlas("starts_that_all_but_overturn_have_the_attractor_s_answer_or_a_name"),
    ),
    Guard(
        "no derivative without an orbit",
        "steady_state: derivatives only of what is settled and attracts",
        "tpd/analysis/steady_state.py",
        "slopes = jnp.where(isolated, slopes, jnp.nan)",
        "slopes = jnp.where(isolated, slopes, slopes)",
        (
            *_atlas("starts_that_all_but_overturn_have_the_attractor_s_answer_or_a_name"),
            "tests/test_exact.py::test_a_slow_decay_is_not_settled_rather_than_aperiodic",
        ),
    ),
    Guard(
        "resonance without damping; huge shaking",
        "every model: failed where a number is not finite",
        "tpd/models/settling.py",
        "status = Status.where(jnp.all(jnp.isfinite(self.y)), status, Status.failed)",
        "status = Status.where(jnp.all(jnp.isfinite(self.y)), status, status)",
        _atlas(
            "resonance_without_damping_to_the_last_digit_is_told",
            "huge_shaking_overturns_or_is_told_to_be_beyond_numbers[1e+300]",
        ),
    ),
    Guard(
        "slow shaking",
        "exact cycle: a period that runs out of steps has no end",
        "tpd/models/piecewise.py",
        "y = jnp.where(m.steps < self.max_events, y, jnp.nan)",
        "y = jnp.where(m.steps < self.max_events, y, y)",
        _atlas("a_period_too_long_to_be_followed_is_told"),
    ),
    Guard(
        "slow shaking",
        "steady_state: event_bound where the period of a resting block was cut short",
        "tpd/analysis/steady_state.py",
        "status = Status.where(cut_short, Status.event_bound, status)",
        "status = Status.where(cut_short, status, status)",
        _atlas("a_period_too_long_to_be_followed_is_told"),
    ),
    Guard(
        "smoothing too sharp",
        "Smoothed: sharpness within bounds",
        "tpd/models/smoothed.py",
        'checks.within("sharpness", self.sharpness, 1e-6, 1.0)',
        'checks.within("sharpness", self.sharpness, -1e99, 1e99)',
        ("tests/test_smoothed.py::test_settings_out_of_range_are_refused",),
    ),
    Guard(
        "impact loss in a model without",
        "Smoothed: e < 1 is refused",
        "tpd/models/smoothed.py",
        'checks.within("e", p.e, 1.0, 1.0,',
        'checks.within("e", p.e, 0.0, 1.0,',
        ("tests/test_smoothed.py::test_an_impact_loss_is_refused",),
    ),
    Guard(
        "32-bit floats",
        "every entry: 64 bits are asked for",
        "tpd/core/checks.py",
        "if not jax.config.jax_enable_x64:",
        "if jax.config.jax_enable_x64 is None:",
        _atlas("in_32_bits_every_call_refuses_by_name"),
    ),
    Guard(
        "scales",
        "scene: omega0 from the half height",
        "tpd/core/scene.py",
        "return (gravity * rho / half_height) ** 0.5",
        "return (gravity * rho / 0.2) ** 0.5",
        _atlas("neither_millimetres_nor_kilometres_change_a_dimensionless_answer"),
    ),
)


def _copied(root: Path) -> None:
    """The working tree at `root`, with what has been compiled."""
    listed = ["git", "ls-files", "-co", "--exclude-standard"]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\n")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            copyfile(ROOT / name, root / name)
    (ROOT / COMPILED).mkdir(parents=True, exist_ok=True)
    (root / COMPILED.parent).mkdir()
    (root / COMPILED).symlink_to((ROOT / COMPILED).resolve())


def _outcomes(root: Path, tests: tuple[str, ...]) -> dict[str, str]:
    """Of each test: fails, passes, or why it did not run."""
    command = [sys.executable, "-m", "pytest", "-n", "0", "-x", "-q", "-p", "no:cacheprovider", "-m", ""]
    found = {}
    for test in tests:
        try:
            done = subprocess.run(
                [*command, test],
                cwd=root,
                env={**os.environ, "PYTHONPATH": str(root), "XLA_FLAGS": QUICK},
                capture_output=True,
                text=True,
                timeout=TIMEOUT,
            )
        except subprocess.TimeoutExpired:
            found[test] = "fails (never ends)"
            continue
        found[test] = {0: "passes", 1: "fails"}.get(done.returncode, f"did not run ({done.returncode})")
    return found


def without(root: Path, guard: Guard) -> dict[str, str]:
    """What its tests say in the copy at `root` when a guard is taken away."""
    source = root / guard.path
    whole = source.read_text(encoding="utf-8")
    if whole.count(guard.text) != 1:
        raise ValueError(
            f"{guard.path} must hold {guard.text!r} once, but does {whole.count(guard.text)} times"
        )
    source.write_text(whole.replace(guard.text, guard.instead), encoding="utf-8")
    try:
        return _outcomes(root, guard.tests)
    finally:
        source.write_text(whole, encoding="utf-8")


def line(guard: Guard, outcomes: dict[str, str]) -> str:
    """Of the table."""
    tests = "<br>".join(f"`{test.removeprefix('tests/')}`" for test in outcomes)
    said = ["yes" if s.startswith("fails") else f"**no**: {s}" for s in outcomes.values()]
    return f"| {guard.regime} | {guard.what} (`{guard.path}`) | {tests} | {'<br>'.join(said)} |"


def main() -> None:
    """Print the table, and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, default=1, help="guards taken away at the same time")
    parser.add_argument("--only", default="", help="part of a regime's name; the table is not written then")
    asked = parser.parse_args()
    guards = [g for g in GUARDS if asked.only in g.regime]
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(asked.workers) as pool:
        copies: Queue[Path] = Queue()
        for i in range(asked.workers):
            copy = Path(folder) / str(i)
            copy.mkdir()
            _copied(copy)
            copies.put(copy)

        def one(guard: Guard) -> dict[str, str]:
            copy = copies.get()
            try:
                return without(copy, guard)
            finally:
                copies.put(copy)

        table = ["| regime | guard | test | fails without it |", "|---|---|---|---|"]
        print("\n".join(table), flush=True)
        survived = False
        for guard, outcomes in zip(guards, pool.map(one, guards), strict=True):
            table.append(line(guard, outcomes))
            print(table[-1], flush=True)
            survived |= not all(said.startswith("fails") for said in outcomes.values())
    if not asked.only:
        RESULT.parent.mkdir(exist_ok=True)
        RESULT.write_text("\n".join(table) + "\n", encoding="utf-8")
    sys.exit(int(survived))


if __name__ == "__main__":
    main()
