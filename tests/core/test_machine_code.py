"""Machine code that Numba has stored is loaded only as it was written."""

import contextlib
import os
import subprocess
import sys

import numba
import numpy as np
import pytest
from numba.core import caching, codegen, compiler

from tests.damage import WAYS, damage
from tpd import core
from tpd.core import machine_code
from tpd.exact.plant import compiled, stored


def cubed(x):
    return x * x * x


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A store of one's own."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    return tmp_path


def hits():
    """How often the code of a function that is asked for comes out of the store."""
    made = stored(cubed, numba.njit, "float64(float64)")
    assert made(3.0) == 27.0
    return sum(made.stats.cache_hits.values())


def files(folder, end):
    found = list(folder.rglob(f"*{end}"))
    assert found
    return found


@pytest.mark.mends("a damaged file of Numba's store ended every later process with a traceback of pickle")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("end", [".nbi", ".nbc", ".sum"])
def test_damaged_code_is_compiled_again_and_said(folder, end, way):
    assert [hits(), hits()] == [0, 1]
    for path in files(folder, end):
        damage(path, way)
    with pytest.warns(UserWarning, match="machine code in .* were damaged, and are compiled again") as said:
        assert hits() == 0
    assert len(said) == 1
    assert hits() == 1


SMALL = """
import numba
from tpd.core import machine_code
from tpd.exact.plant import compiled, stored

def cubed(x):
    return x * x * x

made = stored(cubed, numba.cfunc, "float64(float64)")
print(made.ctypes(3.0), made.cache_hits)
"""


def begun(folder):
    """A process that asks for the code of a function."""
    (folder / "small.py").write_text(SMALL)
    options = {"env": {**os.environ, "NUMBA_CACHE_DIR": str(folder / "store")}, "text": True}
    pipe = subprocess.PIPE
    return subprocess.Popen([sys.executable, str(folder / "small.py")], stdout=pipe, stderr=pipe, **options)


def ended(process):
    out, err = process.communicate()
    return process.returncode, out.strip(), err.count("were damaged")


@pytest.mark.mends("flipped bits in stored machine code ended the process, or were executed")
def test_of_processes_that_ask_at_once_one_compiles_and_flipped_bits_are_not_executed(tmp_path):
    processes = [begun(tmp_path) for _ in range(2)]
    assert sorted(map(ended, processes)) == [(0, "27.0 0", 0), (0, "27.0 1", 0)]
    for path in files(tmp_path, ".nbc"):
        damage(path, "flipped")
    assert ended(begun(tmp_path)) == (0, "27.0 0", 1)


def test_code_without_a_checksum_is_compiled_again_in_silence(folder):
    numba.njit("float64(float64)", cache=True, error_model="numpy")(cubed)
    assert [hits(), hits()] == [0, 1]


@pytest.mark.mends("machine code that another user had written was executed")
@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners of files here")
def test_code_of_another_user_is_not_executed(folder, monkeypatch):
    assert [hits(), hits()] == [0, 1]
    (path,) = files(folder, ".nbc")
    mine = core.files.belongs
    monkeypatch.setattr(core.files, "belongs", lambda p: p != path and mine(p))
    with pytest.warns(UserWarning, match="were damaged, and are compiled again"):
        assert hits() == 0


@pytest.mark.mends("machine code in a folder of others was executed")
@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners of files here")
def test_code_in_a_folder_of_others_is_not_executed_and_that_is_said_once(folder, monkeypatch):
    assert [hits(), hits()] == [0, 1]
    folder.chmod(0o777)
    monkeypatch.setattr(core.files, "_SAID", set())
    with pytest.warns(UserWarning, match=f"every run compiles anew: others may write to {folder};") as said:
        assert [hits(), hits()] == [0, 0]
    assert len(said) == 1


@pytest.mark.mends("a full disk stopped what the store was only to speed up")
def test_what_cannot_be_stored_is_compiled_all_the_same(folder, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "save", full)
    with pytest.warns(UserWarning, match="No space left on device"):
        assert hits() == 0


@pytest.mark.mends("without a home Numba made a folder with the name ~ where the command was given")
def test_without_a_home_nothing_is_stored_in_the_working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    monkeypatch.setattr(caching.InTreeCacheLocator, "from_function", lambda *_: None)
    with pytest.warns(UserWarning, match="there is no home"):
        assert hits() == 0
    assert not list(tmp_path.iterdir())


def new_wave():
    """A function of a number that calls others, new to Numba."""

    @compiled
    def grown(x):
        return np.array([1.0, np.exp(-x), np.exp(-2.0 * x)]) / (1.0 + x)

    @compiled
    def turned(x):
        room = grown(x)
        return np.sinh(room[1]) * x + room[2] if x > 0.5 else np.cos(room[1]) / x

    return lambda x: turned(x) + np.sqrt(abs(turned(2.0 * x) - grown(x)[1]))


def functions():
    """Those of Numba that are replaced meanwhile."""
    base, made, library = compiler.CompilerBase, compiler.Compiler, codegen.CPUCodeLibrary
    ends = library._optimize_final_module, library._finalize_final_module, codegen.JITCPUCodegen.set_env
    return [base.compile_extra, made.define_pipelines, *ends]


def values(made):
    return np.array([made.ctypes(x) for x in np.linspace(0.01, 3.0, 301)]).tobytes()


def test_an_entry_alone_gives_the_same_bits():
    before = functions()
    plainly = values(numba.cfunc("float64(float64)", error_model="numpy")(new_wave()))
    with contextlib.suppress(ZeroDivisionError), machine_code.entry_alone():
        assert all(now is not then for now, then in zip(functions(), before, strict=True))
        raise ZeroDivisionError
    assert functions() == before, "put back after an error as well"
    # New parts: Numba keeps what it has made of the first ones.
    again = new_wave()
    with machine_code.entry_alone():
        alone = numba.cfunc("float64(float64)", error_model="numpy")(again)
    assert values(alone) == plainly
    # The parts serve a later caller that is compiled as usual.
    assert values(numba.cfunc("float64(float64)", error_model="numpy")(again)) == plainly


@pytest.mark.parametrize("way", ["another version", "another function"])
def test_where_numba_is_another_it_compiles_as_usual(monkeypatch, way):
    if way == "another version":
        monkeypatch.setattr(numba, "__version__", "0.99.0")
    else:
        monkeypatch.delattr(codegen.JITCPUCodegen, "set_env")
    before = compiler.Compiler.define_pipelines
    with machine_code.entry_alone():
        assert compiler.Compiler.define_pipelines is before
