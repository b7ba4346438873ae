"""64-bit floats, no silent rank promotion, and types checked by beartype, with the shapes of jaxtyping."""

import ctypes
import gc
import os
import pkgutil
import warnings
from importlib import import_module
from pathlib import Path

import jax
import pytest

from tests import type_checks

# A worker holds millions of objects of compiled programs: searching them for garbage took 5 % of the time.
gc.set_threshold(50_000, 20, 100)
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")
# What one worker has compiled, the other need not, nor the commands that tests run, nor a later run.
COMPILED = str(Path(__file__).parents[1] / ".pytest_cache" / "compiled")
os.environ |= {"JAX_COMPILATION_CACHE_DIR": COMPILED, "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.5"}
jax.config.update("jax_compilation_cache_dir", COMPILED)
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)
# JAX keeps no program that calls back to Python to raise an exception: as in the commands, errors within
# programs give NaN.
os.environ["EQX_ON_ERROR"] = "nan"

type_checks.install()

# Most of the tests' time goes into compiling. XLA ends the process at a flag that it does not know, and JAX
# 0.11.2 has dropped the flag of the emitters.
FLAGS = "--xla_backend_optimization_level=0", "--xla_cpu_use_fusion_emitters=false"
KNOWN = FLAGS if jax.__version_info__ < (0, 11, 2) else FLAGS[:1]
os.environ["XLA_FLAGS"] = " ".join((os.environ.get("XLA_FLAGS", ""), *KNOWN))

# After the hook, which checks what is imported from then on.
compiling = import_module("tpd.compiled.compiling")
# The hook parses what is imported, and Python 3.11 cannot parse in two threads at once. A thread of the
# package loads compiled code: everything else is imported before.
for module in pkgutil.walk_packages(import_module("tpd").__path__, "tpd."):
    # An entrance compiles its code when it is imported.
    if not module.name.endswith(("_entry", "__main__")):
        import_module(module.name)


def pytest_configure(config):
    """Compile the code of motions by events beside the first tests, once for both workers."""
    if config.option.numprocesses and not hasattr(config, "workerinput"):
        Path(COMPILED).mkdir(parents=True, exist_ok=True)
        entries = *compiling.HARMONIC, *compiling.GROUND
        with warnings.catch_warnings():
            # Code that was edited is made anew, which need not be said.
            warnings.simplefilter("ignore")
            compiling.compile_beside(Path(COMPILED), entries)


TESTS = Path(__file__).parent
LONGEST = (
    "test_notebooks",
    "design/test_corrections",
    "models/test_smoothed",
    "browser/test_page",
    "test_nonlinear_derivatives",
    "cli/test_optimise",
    "browser/test_rocking",
    "design/test_optimise",
    "test_examples",
)
"""Modules that go first, so that no worker is left alone with one at the end."""


MOST_MEMORY = 1.3e9
"""Bytes of a process from which on its compiled programs are dropped after a module. These would also reach
the 65 530 memory maps that Linux allows, beyond which the compiler crashes."""


@pytest.fixture(autouse=True, scope="module")
def little_memory():
    """Drop what was compiled where a worker holds too many programs."""
    yield
    pages = Path("/proc/self/statm")
    if pages.exists() and int(pages.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") > MOST_MEMORY:
        jax.clear_caches()
        gc.collect()
        # The freed blocks lie between others, so that the C library keeps them if not asked.
        ctypes.CDLL(None).malloc_trim(0)


def pytest_collection_modifyitems(items):
    """The longest modules first; within a module everything stays in order."""
    rank = {TESTS / f"{name}.py": i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path, len(rank)))


@pytest.fixture
def raises_within_programs(monkeypatch):
    """Errors found while a program runs are raised, as they are outside of the commands."""
    monkeypatch.setattr("equinox._errors.EQX_ON_ERROR", "raise")
    # Programs that another test has compiled give NaN.
    jax.clear_caches()
