"""Numba's machine code: its cache, and parts that are translated with their entrance alone."""

import importlib.util
import os
import subprocess
import sys

import numba
import numpy as np
import pytest
from numba.core import caching, codegen, typed_passes
from numba.core.compiler_lock import global_compiler_lock

from tests.damage import damage
from tpd import core
from tpd.compiled.plant import compiled
from tpd.core import machine_code
from tpd.core.machine_code import stored


def cubed(x):
    return x * x * x


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A cache of one's own."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(core.files, "_WARNINGS", set())
    return tmp_path


def hits():
    """How often the code of a function comes out of the cache."""
    made = stored(cubed, numba.njit, "float64(float64)")
    assert made(3.0) == 27.0
    return sum(made.stats.cache_hits.values())


@pytest.mark.parametrize(("end", "way"), [(".nbi", "cut"), (".nbi", "empty"), (".nbc", "zeroed")])
def test_damaged_code_is_compiled_again_with_a_warning(folder, end, way):
    assert [hits(), hits()] == [0, 1]
    (path,) = folder.rglob(f"*{end}")
    damage(path, way)
    with pytest.warns(UserWarning, match="machine code in .* were damaged, and are compiled again") as said:
        assert hits() == 0
    assert len(said) == 1
    assert hits() == 1


SMALL = """
from tpd.compiled.custom_call import entrance

def nothing(a, first, last):
    pass

print(entrance(nothing).cache_hits)
"""


def test_only_one_of_several_processes_compiles(tmp_path):
    (tmp_path / "small.py").write_text(SMALL)
    env, pipe = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}, subprocess.PIPE
    options = {"env": env, "cwd": tmp_path, "stdout": pipe, "stderr": pipe, "text": True}
    command = [sys.executable, "-c", "import small"]
    processes = [subprocess.Popen(command, **options) for _ in range(2)]
    assert sorted(process.communicate() for process in processes) == [("0\n", ""), ("1\n", "")]


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners of files here")
@pytest.mark.parametrize("way", ["mode", "owner"])
def test_code_in_a_folder_of_other_users_is_not_executed_and_gives_one_warning(folder, monkeypatch, way):
    assert [hits(), hits()] == [0, 1]
    (place,) = {path.parent for path in folder.rglob("*.nbc")}
    if way == "mode":
        place.chmod(0o777)
        reason = f"other users can write to {place};"
    else:
        user = os.getuid()
        monkeypatch.setattr(os, "getuid", lambda: user + 1)
        reason = f"{folder} belongs to another user;"
    with pytest.warns(UserWarning, match=f"every run compiles it: {reason}") as said:
        assert [hits(), hits()] == [0, 0]
    assert len(said) == 1


@pytest.mark.parametrize(
    ("owner", "name", "why"),
    [
        (caching.IndexDataCacheFile, "save", "No space left on device"),
        # All folders that Numba tries, as with a home that is read-only.
        (caching._CacheLocator, "ensure_cache_path", "no locator available"),
    ],
)
def test_code_that_cannot_be_stored_is_compiled_with_a_warning(folder, monkeypatch, owner, name, why):
    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(owner, name, refuse)
    with pytest.warns(UserWarning, match=why) as said:
        assert hits() == 0
    assert len(said) == 1


def new_wave(kind):
    """A function of a number, new to Numba, that calls another one; and the other one."""

    @kind
    def grown(x):
        return np.array([1.0, np.exp(-x), np.exp(-2.0 * x)]) / (1.0 + x)

    @kind
    def turned(x):
        clearance = grown(x)
        return np.sinh(clearance[1]) * x + clearance[2] if x > 0.5 else np.cos(clearance[1]) / x

    return (lambda x: turned(x) + np.sqrt(abs(turned(2.0 * x) - grown(x)[1]))), turned


def test_a_part_is_compiled_once_with_its_entry_and_gives_equal_bits():
    answers, translated = [], []
    for kind in (compiled, numba.njit(error_model="numpy")):
        wave, part = new_wave(kind)
        part.compile((numba.float64,))
        (found,) = part.overloads.values()
        with global_compiler_lock:
            translated.append(found.library.get_pointer_to_function(found.fndesc.mangled_name) != 0)
        made = numba.cfunc("float64(float64)", error_model="numpy")(wave)
        answers.append(np.array([made.ctypes(x) for x in np.linspace(0.01, 3.0, 301)]).tobytes())
    assert answers[0] == answers[1]
    # With another version of Numba parts may be translated as well: compiling then takes twice as long.
    assert translated == [False, True]


HIDDEN = [(numba, "_dynfunc"), (codegen, "JITCodeLibrary"), (typed_passes, "NativeLowering")]
"""Private names of Numba that parts need when the module is imported."""


def compiled_by(pipeline):
    """Return the numbers of a function whose parts are compiled with these options."""
    wave, _ = new_wave(numba.njit(error_model="numpy", no_cpython_wrapper=True, **pipeline))
    made = numba.cfunc("float64(float64)", error_model="numpy")(wave)
    return np.array([made.ctypes(x) for x in (0.1, 1.0, 2.0)]).tobytes()


@pytest.mark.parametrize(("owner", "name"), HIDDEN, ids=[name for _, name in HIDDEN])
def test_the_usual_compiler_of_numba_is_used_if_a_private_name_is_missing(owner, name, monkeypatch):
    expected = compiled_by({})
    with monkeypatch.context() as hidden:
        hidden.setitem(sys.modules, "numba._dynfunc", None)
        hidden.delattr(owner, name)
        # Import the module once more, under another name.
        spec = importlib.util.find_spec(machine_code.__name__)
        copy = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(copy)
    assert compiled_by(copy.PIPELINE) == expected
    assert not copy._can_compile_parts()
    assert machine_code._can_compile_parts()


def test_without_a_home_or_numbas_cache_code_is_compiled_every_time(folder, monkeypatch):
    for name in ("home", "cache"):
        with monkeypatch.context() as hidden:
            hidden.chdir(folder)
            hidden.setattr(core.files, "_WARNINGS", set())
            if name == "home":
                hidden.setattr(numba.config, "CACHE_DIR", "")
                hidden.setattr(os.path, "expanduser", lambda path: path)
            else:
                hidden.delattr(numba.core, "caching")
                hidden.setitem(sys.modules, "numba.core.caching", None)
            words = "there is no home" if name == "home" else "every run compiles it"
            with pytest.warns(UserWarning, match=words):
                assert hits() == 0
        assert not list(folder.iterdir())
