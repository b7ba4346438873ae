"""Ctrl-C: exit status 130, no traceback, and nothing in the way of a new run; the first line of a command."""

import signal
import subprocess
import sys

import pytest

import tpd

PIPES = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
COMMAND = [sys.executable, "-m", "tpd.cli", "optimise", "--out", "out"]


@pytest.mark.parametrize(("moment", "times"), [("stderr", 1), ("stdout", 1), ("stdout", 2)])
def test_ctrl_c_ends_a_run_in_order(tmp_path, moment, times):
    """While modules are imported, while a program compiles, and twice at once."""
    with subprocess.Popen(COMMAND, cwd=tmp_path, **PIPES) as run:
        line = getattr(run, moment).readline()
        for _ in range(times):
            run.send_signal(signal.SIGINT)
        out, err = run.communicate(timeout=60)
    # The first line does not wait for JAX.
    said = f"tpd {tpd.__version__}: searching for the pendulum of least rocking, for out\n"
    assert line == said if moment == "stderr" else said in err
    assert run.returncode == 130, err
    assert "tpd: interrupted" in err
    for word in ("Traceback", "Exception ignored"):
        assert word not in out + err
    assert list(tmp_path.iterdir()) == []


def test_a_command_that_does_not_answer_is_ended_and_says_how_to_go_on(tmp_path):
    (tmp_path / "out").mkdir()
    work = """
import time, tpd.cli.interrupts as i
from pathlib import Path
with i.watched(Path("out")):
    Path("out", ".tpd-part-x").touch()
    Path("out", i.UNFINISHED).touch()
    print("begun", flush=True)
    while True:
        try:
            time.sleep(60.0)
        except KeyboardInterrupt:
            pass
"""
    with subprocess.Popen([sys.executable, "-c", work], cwd=tmp_path, **PIPES) as run:
        assert run.stdout.readline() == "begun\n"
        run.send_signal(signal.SIGINT)
        err = run.communicate(timeout=60)[1]
    assert run.returncode == 130
    assert "tpd: interrupted\ngo on with the same command and --resume" in err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["unfinished.npz"]


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_the_command_ends_with_the_process_that_waits_for_it(number, status):
    work = "import os, time, tpd.cli.interrupts as i\nwith i.watched(None):\n"
    work += "    print(os.getpid(), flush=True)\n    time.sleep(60.0)\n"
    with subprocess.Popen([sys.executable, "-c", work], **PIPES) as run:
        run.stdout.readline()
        run.send_signal(number)
        # The end of the pipe is that of the command.
        assert run.communicate(timeout=30)[0] == ""
    assert run.returncode == status


def test_the_exit_status_is_that_of_the_command():
    work = "import os, tpd.cli.interrupts as i\nwith i.watched(None):\n    {}\n"
    for end, status in (("raise SystemExit(3)", 3), ("os.kill(os.getpid(), 9)", 137)):
        assert subprocess.run([sys.executable, "-c", work.format(end)]).returncode == status


HOMELESS = """
import os, pwd, sys
for name in ("HOME", "XDG_CACHE_HOME", "JAX_COMPILATION_CACHE_DIR"):
    os.environ.pop(name, None)
def nobody(user): raise KeyError(user)
pwd.getpwuid = nobody
sys.argv = ["tpd", "check"]
from tpd.cli import main
sys.exit(main())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no such users")
@pytest.mark.mends("without a home a command ended with a traceback; its warnings had lines of code")
def test_a_warning_is_a_sentence_and_a_user_needs_no_home():
    done = subprocess.run([sys.executable, "-c", HOMELESS], capture_output=True, text=True)
    assert done.returncode == 2
    lines = [line[:35] for line in done.stderr.splitlines() if "solving" not in line]
    assert lines == ["tpd: compiled code is not kept, so ", "tpd: give DESIGN, or a pendulum by "]
