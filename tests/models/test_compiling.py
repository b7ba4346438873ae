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


def test_where_there_are_no_locks_a_module_is_loaded_all_the_same(monkeypatch):
    monkeypatch.setattr(compiling, "fcntl", None)
    monkeypatch.delitem(sys.modules, MODULE, raising=False)
    compiling.load(MODULE)
    assert MODULE in sys.modules
