"""Compiled code is made by one process at a time."""

import subprocess
import sys
from importlib.util import find_spec

import pytest

from tpd.models import compiling

MODULE = "tpd.models.rows"
TRY = "import fcntl, sys; fcntl.flock(open(sys.argv[1]), fcntl.LOCK_EX | fcntl.LOCK_NB)"


def another_process():
    """Exit status of a process that asks for the lock without waiting for it."""
    done = subprocess.run([sys.executable, "-c", TRY, find_spec(MODULE).origin], capture_output=True)
    return done.returncode


def test_another_process_waits_while_a_module_is_compiled():
    pytest.importorskip("fcntl")
    with compiling._alone(MODULE):
        assert another_process() == 1
    assert another_process() == 0


def test_where_there_are_no_locks_a_module_is_loaded_all_the_same(monkeypatch, tmp_path):
    (tmp_path / "lonely.py").write_text("LOADED = True")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(compiling, "fcntl", None)
    compiling.load("lonely")
    assert sys.modules.pop("lonely").LOADED


def test_it_waits_for_the_process_that_compiles_a_module_and_for_no_other(monkeypatch, tmp_path):
    (tmp_path / "lonely.py").write_text("LOADED = True")
    monkeypatch.syspath_prepend(tmp_path)
    asked = []

    class Process:
        def __init__(self, name):
            self.name = name

        def wait(self):
            asked.append(self.name)

    monkeypatch.setattr(compiling, "_running", {name: Process(name) for name in ("lonely", "other")})
    compiling.load("lonely")
    assert sys.modules.pop("lonely").LOADED
    assert asked == ["lonely"]
