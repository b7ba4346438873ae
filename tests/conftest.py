"""64-bit floats, no silent rank promotion, and jaxtyping shapes checked by beartype."""

import os
from pathlib import Path

import jax
import pytest
from jaxtyping import install_import_hook

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")
# What one worker has compiled, the other need not, nor the commands that tests run, nor a later run.
COMPILED = str(Path(__file__).parents[1] / ".pytest_cache" / "compiled")
os.environ |= {"JAX_COMPILATION_CACHE_DIR": COMPILED, "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.5"}
jax.config.update("jax_compilation_cache_dir", COMPILED)
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)

install_import_hook("tpd", "beartype.beartype")

TESTS = Path(__file__).parent
LONGEST = (
    "design/test_optimise",
    "analysis/test_symmetric_orbits",
    "test_notebooks",
    "analysis/test_bifurcations",
    "analysis/test_periodic_orbit",
    "analysis/test_steady_state",
    "models/test_piecewise",
    "cli/test_optimise",
)
"""Modules that go first, so that no worker is left alone with one at the end."""


_MAPS = 20_000
"""Memory maps of a process from which on compiled programs are dropped: Linux allows 65 530, and the compiler
crashes beyond."""


@pytest.fixture(autouse=True, scope="module")
def few_memory_maps():
    """Drop what was compiled where a worker holds too many programs."""
    yield
    maps = Path("/proc/self/maps")
    if maps.exists() and maps.read_text().count("\n") > _MAPS:
        jax.clear_caches()


def pytest_collection_modifyitems(items):
    """The longest modules first; within a module everything stays in order."""
    rank = {TESTS / f"{name}.py": i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path, len(rank)))
