"""Remove the guards of the page "Models and their limits" one at a time, and check that their tests fail.

A guard is identified by its function and by the change that removes it (`tests.benchmarks.removals`), so
that other changes of its line do not matter. The table has a "no" for each test that passes without its
guard. The benchmark takes an hour.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from shutil import copyfile
from typing import Any, NamedTuple

from tests.benchmarks import stored
from tests.benchmarks.removals import (
    Mutation,
    constant,
    mutated,
    never,
    nothing_true,
    unchecked,
    unrefused,
    without_nan,
    without_term,
)

QUESTION = "Does each guard have a test that fails without it?"
SEED = None
ROOT = stored.ROOT
COMPILED = Path(".pytest_cache") / "compiled"
QUICK = "--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true"
"""Flags of XLA that shorten compilation, because every guard needs it."""
TIMEOUT = 900.0
"""Seconds for the tests of one guard; compilation takes most of them."""


class Guard(NamedTuple):
    """An expression that prevents a wrong result, and the tests that fail without it."""

    regime: str
    what: str
    place: str
    """Module and function of the guard, such as "models/settling:Record.settled"."""
    mutation: Mutation
    """Change of the function that removes the guard."""
    tests: tuple[str, ...]
    """Tests that must fail without the guard."""

    @property
    def path(self) -> str:
        """Path of the source file, from the root of the project."""
        return f"tpd/{self.place.partition(':')[0]}.py"

    def taken_from(self, source: str) -> str:
        """Return the source of the module without the guard."""
        return mutated(source, self.place.partition(":")[2], self.mutation)


def _tests(module: str, *names: str) -> tuple[str, ...]:
    """Return identifiers for pytest of tests of a module such as "compiled/steady"."""
    folder, _, name = module.rpartition("/")
    return tuple(f"tests/{folder}/test_{name}.py::test_{test}" for test in names)


def _lost(name: str) -> tuple[str, ...]:
    """Return tests of the verdict on a periodic motion, in `tests/compiled/test_steady.py`."""
    return _tests("compiled/steady", f"compiled_code_and_jax_assign_the_same_status_to_each_case[{name}]")


def _kernel(case: str) -> tuple[str, ...]:
    return _tests(
        "compiled/symmetric_orbit_kernel", f"an_orbit_near_its_end_has_the_status_of_the_bifurcation[{case}]"
    )


def _ends(case: str) -> tuple[str, ...]:
    return _tests("models/smoothed_orbit", f"a_settled_motion_has_its_status_and_period[{case}]")


def _smoothed(name: str) -> tuple[str, ...]:
    return _tests("models/smoothed", name)


_OVERTURNS = "an_overturned_block_has_no_gradient"
_SADDLE = "initial_states_near_overturning_reach_an_attractor_or_have_a_status"
_ORBITS, _STEADY = "compiled/symmetric_orbit_kernel:_status", "compiled/columns:verdict_with.verdict"
_SETTLED = "models/smoothed_orbit:History.run"
# fmt: off
GUARDS = (
    Guard("fold", "orbits: no derivative if a multiplier of the half map is within 1e-6 of 1",
          _ORBITS, constant("NEAR_FOLD", -1.0), _kernel("0.9999999-1.0-near_fold")),
    Guard("fold", "steady_state: near_fold", _STEADY, never("NEAR_FOLD_STATUS"), _lost("what3-near_fold")),
    Guard("loss of symmetry", "steady_state: unstable if a multiplier exceeds 1",
          _STEADY, never("UNSTABLE"), _lost("what5-unstable")),
    Guard("loss of symmetry", "steady_state: symmetric only if both sides of the motion agree",
          "compiled/steady:steady_state", without_term("symmetric", "asymmetry"),
          _tests("compiled/steady", "a_motion_with_unequal_sides_is_not_called_symmetric")),
    Guard("grazing", "orbits: no derivative if the block almost stops above its base",
          _ORBITS, constant("GRAZING", -1.0), _kernel("0.5-1e-08-grazing")),
    Guard("grazing", "steady_state: grazing if an event is crossed too slowly",
          _STEADY, never("GRAZING_STATUS"), _lost("what1-grazing")),
    Guard("onset of sticking", "statuses: sticking if the block was held",
          "compiled/repetition:store_settled", nothing_true("stuck"),
          _tests("models/base", "an_unchanged_subclass_of_a_model_gives_equal_results[Piecewise]")),
    Guard("rattling to rest", "contact: an impact slower than the capture speed is rest",
          "compiled/contact:land", nothing_true("capture"),
          _tests("compiled/settle", "the_number_of_impacts_of_a_rattle_is_logarithmic_in_the_capture_speed",
                   "the_error_of_capture_is_below_the_square_of_its_speed")),
    Guard("period three and chaos", "steady_state: aperiodic if neighbouring motions separate",
          "compiled/steady:steady_state", never("APERIODIC_STATUS"),
          _tests("compiled/steady",
                   "the_derivative_of_a_chaotic_motion_grows_at_the_lyapunov_rate")),
    Guard("period three and chaos", "periodic_orbit: unstable if a multiplier exceeds 1",
          _STEADY, never("UNSTABLE"),
          _tests("answers/periodic_orbit", "continuation_follows_an_orbit_after_it_becomes_unstable")),
    Guard("motion that does not repeat",
          "steady_state: not_settled if Newton's method does not close the orbit",
          _STEADY, never("NOT_SETTLED"), _lost("what6-not_settled")),
    Guard("overturning", "every model: overturned if the tilt is beyond any return",
          _SETTLED, never("overturned"),
          (*_ends("periods5-overturned-1"), *_smoothed(_OVERTURNS))),
    Guard("near overturning", "steady_state: unstable on the saddle between rocking and overturning",
          _STEADY, never("UNSTABLE"), _tests("models/piecewise", _SADDLE)),
    Guard("no derivative without an orbit", "steady_state: derivatives only of settled motions that attract",
          "compiled/steady:steady_state", without_term("isolated", "rocks"),
          (*_tests("models/piecewise", _SADDLE),
           *_tests("compiled/steady", "a_motion_that_decays_slowly_is_not_settled_and_not_aperiodic"))),
    Guard("resonance without damping; very strong excitation",
          "every model: failed if a number is not finite",
          _SETTLED, never("failed"), _ends("periods6-failed-1")),
    Guard("slow excitation", "steady_state: event_bound if the period of a resting block was cut short",
          _STEADY, never("EVENT_BOUND"),
          _tests("models/piecewise", "too_long_a_period_has_the_status_event_bound")),
    Guard("smoothing too sharp", "Smoothed: sharpness within bounds",
          "core/checks:within", constant("low", -1.0),
          _smoothed("settings_out_of_range_are_rejected")),
    Guard("smoothed impacts", "Smoothed: e < 1 is rejected with nonlinear terms, and e = 0 with other terms",
          "models/smoothed:Smoothed.check", unchecked("e"),
          _smoothed("impacts_that_cannot_be_smoothed_are_rejected")),
    Guard("smoothed impacts", "smoothed_rates: NaN with nonlinear terms and a traced e < 1",
          "theory/equations:smoothed_rates", without_nan("decay"),
          _smoothed("smoothed_nonlinear_equations_with_impact_loss_are_nan")),
    Guard("32-bit floats", "every public function: 64 bits are required",
          "core/checks:require_x64", unrefused("RuntimeError"),
          _tests("answers/steady_state", "every_call_in_32_bits_is_rejected_by_name")),
    Guard("scales", "scene: omega0 is computed from the half height",
          "scene/scene:_rate", constant("half_height", 0.2),
          _tests("models/piecewise", "the_size_of_the_block_does_not_change_dimensionless_results")),
)
# fmt: on
MEASURES = tuple(dict.fromkeys(guard.place.partition(":")[0] for guard in GUARDS))


def _copied(root: Path) -> None:
    """Copy the working tree to `root`, with the compiled code."""
    listed = ["git", "ls-files", "-co", "--exclude-standard"]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\n")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            copyfile(ROOT / name, root / name)
    (ROOT / COMPILED).mkdir(parents=True, exist_ok=True)
    (root / COMPILED.parent).mkdir()
    (root / COMPILED).symlink_to((ROOT / COMPILED).resolve())


def _failing(root: Path, tests: tuple[str, ...]) -> list[bool]:
    """Return for each test whether it fails; a test that does not end counts as failed."""
    command = [sys.executable, "-m", "pytest", "-n", "0", "-q", "-rA", "-p", "no:cacheprovider", "-m", ""]
    env = {**os.environ, "PYTHONPATH": str(root), "XLA_FLAGS": QUICK, "COLUMNS": "500"}
    try:
        done = subprocess.run(
            [*command, *tests], cwd=root, env=env, capture_output=True, text=True, timeout=TIMEOUT
        )
    except subprocess.TimeoutExpired:
        return [True] * len(tests)
    said = re.findall(r"^(PASSED|FAILED) (\S+)", done.stdout, re.MULTILINE)
    ends = {test: [how for how, of in said if of == test or of.startswith(f"{test}[")] for test in tests}
    if not all(ends.values()):
        raise RuntimeError(f"did not run: {done.stdout[-1000:]}")
    return ["FAILED" in of for of in ends.values()]


def without(root: Path, guard: Guard) -> list[bool]:
    """Return which tests of a guard fail without the guard, in the copy at `root`."""
    source = root / guard.path
    whole = source.read_text(encoding="utf-8")
    source.write_text(guard.taken_from(whole), encoding="utf-8")
    try:
        return _failing(root, guard.tests)
    finally:
        source.write_text(whole, encoding="utf-8")


def run(quick: bool) -> list[dict[str, Any]]:
    """Return a row for each guard."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        _copied(Path(folder))
        for guard in [g for g in GUARDS if g.regime == "32-bit floats"] if quick else GUARDS:
            fails = without(Path(folder), guard)
            row = {"regime": guard.regime, "guard": guard.what, "place": guard.place}
            rows.append(row | {"tests": list(guard.tests), "fails": fails})
            print(f"{guard.what}: {fails}", file=sys.stderr, flush=True)
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Return the table of guards, and whether their tests fail without them."""
    cells = []
    for r in rows:
        tests = "<br>".join(f"`{test.removeprefix('tests/')}`" for test in r["tests"])
        fails = "<br>".join("yes" if fails else "**no**" for fails in r["fails"])
        cells.append((r["regime"], f"{r['guard']} (`{r['place']}`)", tests, fails))
    return stored.markdown(("regime", "guard", "test", "fails without it"), cells)
