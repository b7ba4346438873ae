"""Ctrl-C at random moments: exit status 130, no traceback, and nothing in the way of a new run."""

import random
import signal
import subprocess
import sys
import time

import pytest

JOB = """
[space]
mass_ratio = [0.1, 0.4]
[conditions]
band = [2.3, 2.7]
frequencies = 3
[search]
searches = 4
steps = 4
screening = 12
[ensemble]
size = 16
periods = 20
"""
MOMENTS = [moment / 100 for moment in sorted(random.Random(5).sample(range(20, 1000), 20))]
"""Seconds from the start at which the runs are interrupted."""


def interrupted(folder, after: float, twice: float | None = None) -> tuple:
    """Exit status, stdout, stderr and the time (s) from Ctrl-C to the end, of a run that gets one after so
    many seconds, and a second one `twice` seconds later; 0 where it had ended before."""
    arguments = [sys.executable, "-m", "tpd.cli", "optimise", "--scene", "job.toml", "--out", "out"]
    run = subprocess.Popen(arguments, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        run.wait(timeout=after)
    except subprocess.TimeoutExpired:
        run.send_signal(signal.SIGINT)
        begin = time.monotonic()
    else:
        return run.returncode, *run.communicate(), 0.0
    if twice is not None:
        time.sleep(twice)
        run.send_signal(signal.SIGINT)
    out, err = run.communicate(timeout=300)
    return run.returncode, out, err, time.monotonic() - begin


def check(folder, status: int, out: str, err: str, took: float) -> None:
    """One run, wherever it was interrupted."""
    assert "Traceback" not in out + err, err
    assert "Exception ignored" not in err, err
    # The run had ended before, or its answer was written when the signal came.
    if took == 0.0 or status in (0, 3):
        assert status in (0, 3), err
        assert (folder / "out" / "report.html").exists()
        return
    assert status == 130, (status, out, err)
    # Where the machine is busy, it takes a moment to end a process.
    assert took < 5.0, (took, err)
    left = {path.name for path in (folder / "out").iterdir()} if (folder / "out").exists() else {"none"}
    # All of an answer, the searches that a new run goes on with, or nothing.
    assert left, "an empty directory is left"
    assert not any(name.startswith(".tpd-part") for name in left), left
    again = "report.txt" in left or "unfinished.npz" in left
    assert again or left == {"none"}, left


@pytest.mark.slow
@pytest.mark.parametrize("after", MOMENTS)
def test_ctrl_c_at_any_moment_ends_a_run_in_order(tmp_path, after):
    (tmp_path / "job.toml").write_text(JOB)
    check(tmp_path, *interrupted(tmp_path, after))


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
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": tmp_path}
    with subprocess.Popen([sys.executable, "-c", work], **pipes) as run:
        assert run.stdout.readline() == "begun\n"
        run.send_signal(signal.SIGINT)
        err = run.communicate(timeout=60)[1]
    assert run.returncode == 130
    assert "tpd: interrupted\ngo on with the same command and --resume" in err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["unfinished.npz"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL], ids=["SIGTERM", "SIGKILL"])
def test_the_command_ends_with_the_process_that_waits_for_it(tmp_path, number):
    work = "import os, time, tpd.cli.interrupts as i\nwith i.watched(None):\n"
    work += "    print(os.getpid(), flush=True)\n    time.sleep(60.0)\n"
    how = {"stdout": subprocess.PIPE, "text": True, "cwd": tmp_path}
    with subprocess.Popen([sys.executable, "-c", work], **how) as run:
        run.stdout.readline()
        run.send_signal(number)
        # The end of the pipe is that of the command.
        assert run.communicate(timeout=30)[0] == ""
    assert run.returncode == (143 if number == signal.SIGTERM else -9)


def test_the_exit_status_is_that_of_the_command(tmp_path):
    work = "import os, tpd.cli.interrupts as i\nwith i.watched(None):\n    {}\n"
    for end, status in (("raise SystemExit(3)", 3), ("os.kill(os.getpid(), 9)", 137)):
        assert subprocess.run([sys.executable, "-c", work.format(end)], cwd=tmp_path).returncode == status


def test_a_second_ctrl_c_ends_a_run_at_once(tmp_path):
    (tmp_path / "job.toml").write_text(JOB)
    status, out, err, took = interrupted(tmp_path, 2.0, 0.2)
    assert (status, took < 2.0) == (130, True), (took, err)
    assert "Traceback" not in out + err
    assert not (tmp_path / "out").exists()
