"""Compiled code is made in other processes."""

import ast
import os
import re
import signal
import socket
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path

import pytest

from tpd.compiled import compiling
from tpd.core import files


def test_the_package_waits_for_the_compiling_process_and_repeats_its_warnings(monkeypatch, tmp_path):
    lines = "import sys, time, warnings\n"
    lines += "if 'pytest' not in sys.modules: time.sleep(1); warnings.warn('it was damaged')\n"
    (tmp_path / "lonely.py").write_text(lines)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    monkeypatch.setattr(compiling, "_running", {})
    compiling.compile_beside(tmp_path, ("lonely",))
    monkeypatch.setitem(compiling._running, "other", None)
    with pytest.warns(UserWarning, match="^it was damaged$"):
        compiling.load("lonely")
    del sys.modules["lonely"]


ENDLESS = """
import os, socket, sys, time
if sys.argv[0] == "-c":
    told = socket.create_connection(("127.0.0.1", int(os.environ["TOLD"])))
    time.sleep(600)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals are others")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_process_that_compiles_ends_with_the_command(tmp_path, number):
    (tmp_path / "endless.py").write_text(ENDLESS)
    work = "import signal, sys, time; signal.signal(signal.SIGINT, signal.SIG_DFL)\n"
    work += "from pathlib import Path; from tpd.compiled import compiling\n"
    work += "compiling.compile_beside(Path(sys.argv[1]), ('endless',)); time.sleep(600)"
    with socket.create_server(("127.0.0.1", 0)) as told:
        told.settimeout(60.0)
        path = f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
        env = os.environ | {"PYTHONPATH": path, "TOLD": str(told.getsockname()[1])}
        with subprocess.Popen([sys.executable, "-c", work, str(tmp_path)], env=env) as command:
            begun, _ = told.accept()
            command.send_signal(number)
            assert command.wait(30) == -number
        with begun:
            begun.settimeout(30.0)
            # The connection ends with the process.
            assert begun.recv(1) == b""


def test_loading_waits_for_a_module_that_another_thread_imports(monkeypatch, tmp_path):
    (tmp_path / "slow.py").write_text("import time; time.sleep(0.3); LOADED = True")
    monkeypatch.syspath_prepend(tmp_path)

    def loaded(_):
        compiling.load("slow")
        return sys.modules["slow"].LOADED

    with ThreadPoolExecutor(2) as crew:
        assert list(crew.map(loaded, range(2))) == [True, True]
    del sys.modules["slow"]


def test_no_process_compiles_into_a_cache_that_others_can_write(monkeypatch, tmp_path):
    (tmp_path / "lonely.py").write_text("")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "store"))
    monkeypatch.setattr(compiling, "_running", running := {})
    monkeypatch.setattr(files, "_WARNINGS", set())
    (tmp_path / "store").mkdir()
    (tmp_path / "store").chmod(0o777)
    for words in (1, 0):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            compiling.compile_beside(tmp_path, ("lonely",))
        assert [f"other users can write to {tmp_path / 'store'};" in str(w.message) for w in said] == [
            True
        ] * words
    assert not running
    (tmp_path / "store").chmod(0o755)
    compiling.compile_beside(tmp_path, ("lonely",))
    assert running.pop("lonely")[0].wait() == 0
    compiling.compile_beside(tmp_path, ("lonely",))
    assert not running
    monkeypatch.setattr(compiling, "checksum", lambda *_: 1)
    with pytest.warns(UserWarning, match="belongs to another version and is compiled again"):
        compiling.compile_beside(tmp_path, ("lonely",))
    assert running.pop("lonely")[0].wait() == 0


def imported(module, known):
    """Files of the package that a module imports when it is loaded, and those that these import."""
    path = Path(find_spec(module).origin)
    if path not in known:
        known.add(path)
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith(
                ("tpd.compiled", "tpd.scene")
            ):
                whole = node.module in ("tpd.compiled", "tpd.scene")
                for name in node.names if whole else ():
                    imported(f"{node.module}.{name.name}", known)
                imported(node.module, known)
    return known


@pytest.mark.parametrize("module", compiling.HARMONIC)
def test_the_hash_of_stored_code_includes_all_imported_sources(module):
    others = imported(module, set()) - set(compiling.sources())
    assert {path.name for path in others} <= {"__init__.py"}


@pytest.mark.parametrize("module", sorted({*compiling.HARMONIC, *compiling.GROUND}))
def test_modules_of_the_compiling_process_do_not_import_jax(module):
    lines = "\n".join(path.read_text() for path in imported(module, set()))
    assert not re.findall(r"^(?:import|from) (?:jax|equinox|diffrax)\b", lines, re.M)
