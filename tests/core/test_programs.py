import inspect
import os
import subprocess
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.damage import WAYS, damage
from tpd import Parameters
from tpd.core import programs
from tpd.core.parameters import as_arrays
from tpd.core.programs import Program
from tpd.core.status import Status, names_of
from tpd.design.screening import _moved
from tpd.models.piecewise import Piecewise

ROOT = Path(__file__).parents[2]
HUNG = Parameters(nu=0.25, mu=0.2, lam=0.8, zeta=0.1, k=0.05, f=0.5, xi=3.5)
TRACED: list[tuple[int, ...]] = []


def doubled(x):
    TRACED.append(x["a"].shape)
    return {"twice": 2.0 * x["a"], "sum": jnp.sum(x["a"])}


def shifted_by(step):
    def shifted(x):
        TRACED.append(x.shape)
        return x + step

    return shifted


class Step(NamedTuple):
    """A type of its own that a function closes over."""

    size: float

    def __radd__(self, x):
        return x + self.size


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of one's own for programs, for one test, with those of the functions here."""
    before = list(programs._folder)
    monkeypatch.setattr(programs, "_SOURCES", frozenset({"tests"}))
    programs.keep_in(tmp_path / "kept")
    TRACED.clear()
    yield tmp_path / "kept"
    programs._folder[:] = before


def ask():
    return Program(doubled)({"a": np.arange(3.0)})


def test_a_kept_program_is_not_traced_again(folder):
    first, second = ask(), ask()
    assert len(TRACED) == 1
    assert jax.tree.structure(first) == jax.tree.structure(second)
    np.testing.assert_array_equal(first["twice"], [0.0, 2.0, 4.0])
    np.testing.assert_array_equal(second["twice"], [0.0, 2.0, 4.0])
    assert float(second["sum"]) == 3.0
    assert len(list(folder.iterdir())) == 1


def test_what_was_begun_is_waited_for_and_made_once(folder):
    program, x = Program(doubled), {"a": np.arange(3.0)}
    program.begin(x)
    program.begin(x)
    np.testing.assert_array_equal(program(x)["twice"], [0.0, 2.0, 4.0])
    other = Program(doubled)
    other.begin(x)
    np.testing.assert_array_equal(other(x)["twice"], [0.0, 2.0, 4.0])
    # The second one was in the store.
    assert len(TRACED) == 1


def judged(x):
    TRACED.append(x.shape)
    return Status.where(x > 0.0, Status.rocking, Status.rest)


def test_a_status_comes_back_from_the_store(folder):
    x = np.array([1.0, -1.0])
    first, second = Program(judged, mapped=True)(x), Program(judged, mapped=True)(x)
    assert len(TRACED) == 1
    assert list(names_of(second)) == list(names_of(first)) == ["rocking", "rest"]


def test_shapes_types_and_what_a_function_closes_over_are_told_apart(folder):
    for step, value in ((1.0, 1.0), (2.0, 2.0), (1.0, 1.0)):
        np.testing.assert_array_equal(Program(shifted_by(step))(np.zeros(2)), [value] * 2)
    assert len(TRACED) == 2
    Program(shifted_by(1.0))(np.zeros(3))
    Program(shifted_by(1.0))(np.zeros(2, int))
    assert len(TRACED) == 4
    Program(shifted_by(1.0), mapped=True)(np.zeros(2))
    assert TRACED[4:] == [()]
    assert len(list(folder.iterdir())) == 5


def test_a_function_that_no_words_tell_apart_is_not_kept(folder):
    weights = np.ones(2)
    Program(lambda x: x)(np.zeros(2))
    Program(shifted_by(weights))(np.zeros(2))
    assert list(folder.iterdir()) == []


def test_a_function_of_others_and_what_is_made_of_their_types_is_not_kept(folder, monkeypatch):
    Program(shifted_by(Step(1.0)))(np.zeros(2))
    monkeypatch.setattr(programs, "_SOURCES", frozenset({"tpd"}))
    ask()
    assert list(folder.iterdir()) == []


def test_a_function_is_the_same_behind_a_check_of_types_and_another_behind_a_transformation():
    known = programs._identity(_moved)
    assert known == "tpd.design.screening._moved[]"
    assert programs._identity(inspect.unwrap(_moved)) == known
    assert programs._identity(jax.vmap(_moved)) is None
    assert programs._identity(jax.vmap(inspect.unwrap(_moved))) is None


@pytest.mark.mends("a damaged program was compiled again without a word")
@pytest.mark.parametrize("way", WAYS)
def test_a_file_that_is_not_whole_is_made_again_and_said(folder, way):
    ask()
    (path,) = folder.iterdir()
    damage(path, way)
    with pytest.warns(UserWarning, match="programs in .* were damaged, and are compiled again") as said:
        np.testing.assert_array_equal(ask()["twice"], [0.0, 2.0, 4.0])
    assert len(said) == 1
    assert len(TRACED) == 2
    ask()
    assert len(TRACED) == 2


@pytest.mark.mends("a damaged program that JAX's cache had as well was never kept again")
def test_a_damaged_program_is_kept_again_though_jax_has_stored_it(folder):
    name, before = "jax_persistent_cache_min_compile_time_secs", 0.5
    # A function that no earlier run of this test has left in JAX's cache.
    function = shifted_by(time.time())
    jax.config.update(name, 0.0)
    try:
        Program(function)(np.zeros(2))
        (path,) = folder.iterdir()
        damage(path, "cut")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            Program(function)(np.zeros(2))
    finally:
        jax.config.update(name, before)
    Program(function)(np.zeros(2))
    assert len(TRACED) == 2


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners of files here")
def test_what_others_can_write_is_not_executed(folder):
    ask()
    (path,) = folder.iterdir()
    path.chmod(0o666)
    ask()
    assert len(TRACED) == 2
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)
    programs.keep_in(folder)
    assert programs._folder == []


def test_code_that_is_refused_is_compiled_again_and_said(folder, monkeypatch):
    ask()

    def refuse(*_):
        raise RuntimeError("no such feature")

    monkeypatch.setattr(programs, "deserialize_and_load", refuse)
    with pytest.warns(UserWarning, match="no such feature"):
        ask()
    assert len(TRACED) == 2


def test_nothing_is_kept_without_a_folder(tmp_path):
    before, programs._folder[:] = list(programs._folder), []
    TRACED.clear()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ask(), ask()
    programs._folder[:] = before
    assert len(TRACED) == 2
    assert list(tmp_path.iterdir()) == []


def test_what_comes_out_of_jax_s_own_cache_is_not_kept(folder, monkeypatch):
    ask()
    (path,) = folder.iterdir()
    path.unlink()
    compiled = jax.stages.Lowered.compile

    def found(lowered, **options):
        jax.monitoring.record_event("/jax/compilation_cache/cache_hits")
        return compiled(lowered, **options)

    monkeypatch.setattr(jax.stages.Lowered, "compile", found)
    np.testing.assert_array_equal(ask()["twice"], [0.0, 2.0, 4.0])
    assert list(folder.iterdir()) == []


def test_a_program_that_does_not_run_is_compiled_again(folder, monkeypatch):
    ask()

    def broken(*_):
        raise RuntimeError("function not found")

    monkeypatch.setattr(programs, "deserialize_and_load", lambda *_: broken)
    with pytest.warns(UserWarning, match="function not found"):
        np.testing.assert_array_equal(ask()["twice"], [0.0, 2.0, 4.0])


def solved(x):
    TRACED.append(x.shape)
    return jnp.linalg.solve(jnp.eye(3) + x * jnp.ones((3, 3)), jnp.ones(3))


LATER = """
import sys
from pathlib import Path
import jax
import numpy as np
jax.config.update("jax_enable_x64", True)
from tpd import Parameters
from tpd.core import programs
from tpd.core.parameters import as_arrays
from tests.core import test_programs
programs._SOURCES = frozenset({"tests"})
programs.keep_in(Path(sys.argv[1]))
print(programs.Program(getattr(test_programs, sys.argv[2]))(np.array(0.5)), len(test_programs.TRACED))
"""


def settled(f):
    TRACED.append(f.shape)
    p = as_arrays(HUNG)
    return Piecewise(max_periods=20).settle(replace(p, f=f), jnp.zeros(4)).amplitude


@pytest.mark.parametrize("function", [solved, settled])
def test_a_program_that_calls_known_code_runs_in_a_process_that_traces_none(folder, function):
    found = Program(function)(np.array(0.5))
    assert len(list(folder.iterdir())) == 1
    arguments = [sys.executable, "-c", LATER, str(folder), function.__name__]
    later = subprocess.run(arguments, cwd=ROOT, capture_output=True, text=True, check=True)
    assert later.stdout.strip() == f"{found} 0"


def called_back(x):
    TRACED.append(x.shape)
    return jax.pure_callback(np.sin, jax.ShapeDtypeStruct((), float), x)


def test_a_program_that_calls_code_of_others_is_not_kept(folder):
    # What it calls lives in this process only.
    for _ in range(2):
        Program(called_back)(np.array(0.5))
    assert len(TRACED) == 2
    assert not list(folder.iterdir())
