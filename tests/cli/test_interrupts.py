"""Ctrl-C ends a command at once; the first line of a command, and its output."""

import math
import os
import shlex
import signal
import subprocess
import sys

import pytest

import tpd
from tests.cli.conftest import call
from tpd.cli import new

PIPES = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
COMMAND = [sys.executable, "-m", "tpd", "optimise", "--out", "out"]
posix = pytest.mark.skipif(os.name != "posix", reason="signals are others")


@posix
@pytest.mark.mends("a command caught Ctrl-C, so that a shell script went on with its next line")
@pytest.mark.parametrize("moment", ["stderr", "stdout"])
def test_ctrl_c_ends_a_command_at_once(tmp_path, moment):
    """While modules are imported, and while a program compiles."""
    with subprocess.Popen(COMMAND, cwd=tmp_path, **PIPES) as run:
        line = getattr(run, moment).readline()
        run.send_signal(signal.SIGINT)
        # Both pipes end with the last process that holds them.
        out, err = run.communicate(timeout=60)
    # The first line does not wait for JAX.
    said = f"tpd {tpd.__version__}: searching for the pendulum of least rocking, for out\n"
    assert line == said if moment == "stderr" else said in err
    assert run.returncode == -signal.SIGINT, err
    for word in ("Traceback", "Exception ignored"):
        assert word not in out + err
    assert list(tmp_path.iterdir()) == []


HELD = """
import sys
from tpd.cli import main, new
def run(_):
    print("begun", flush=True)
    sum(range(10**15))
new.run = run
sys.argv = ["tpd", "new", "tower"]
main()
"""


@posix
def test_code_that_never_returns_to_python_is_ended_and_a_shell_has_status_130():
    """A sum runs in C, as a compiler does: Python's own answer to the signal would wait for its end."""
    # Processes in the background of a shell are begun with Ctrl-C ignored.
    script = f"{shlex.join([sys.executable, '-c', HELD])} & echo $!; wait $!; echo $?"
    with subprocess.Popen(["sh", "-c", script], **PIPES) as shell:
        lines = {shell.stdout.readline() for _ in range(2)}
        (number,) = (int(line) for line in lines if line != "begun\n")
        os.kill(number, signal.SIGINT)
        out, err = shell.communicate(timeout=30)
    assert (out, "Traceback" in err) == ("130\n", False)


@pytest.mark.mends("a command that was called in Python took Ctrl-C from its caller")
def test_in_python_ctrl_c_is_an_exception_and_the_answer_to_it_is_the_callers(monkeypatch):
    before = signal.getsignal(signal.SIGINT)

    def stop(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(new, "run", stop)
    with pytest.raises(KeyboardInterrupt):
        call("new tower")
    assert signal.getsignal(signal.SIGINT) is before


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
    assert lines == ["tpd: compiled code is not stored, s", "tpd: give DESIGN, or a pendulum by "]


TABLE = """
import sys, tpd.cli.interrupts as i
with i.lasting_output():
    for _ in range(20000):
        print("tilt 9.55\\xb0 \\xb1 2 m/s\\xb2")
    open("table.csv", "w", encoding="utf-8").write("numbers")
    print("done", file=sys.stderr)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no such devices")
@pytest.mark.mends(
    "a reader that had gone, or a full disk, ended a command with a traceback before its files"
)
def test_output_that_nobody_reads_does_not_end_the_work_and_a_full_disk_is_said(tmp_path):
    how = {"cwd": tmp_path, "stderr": subprocess.PIPE, "text": True}
    command = [sys.executable, "-c", TABLE]
    with subprocess.Popen(command, stdout=subprocess.PIPE, **how) as gone:
        gone.stdout.close()
        assert gone.stderr.read() == "done\n"
    assert gone.returncode == 0
    assert (tmp_path / "table.csv").read_text() == "numbers"
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, **how)
    assert done.stderr == "done\ntpd: cannot write to the standard output: No space left on device\n"
    assert done.returncode == 2
    for closed in (">&-", ">&- 2>&-"):
        done = subprocess.run(f"{shlex.join(command)} {closed}", shell=True, **how)
        assert (done.returncode, "Error" in done.stderr) == (0, False)


@pytest.mark.parametrize("set_to", [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0"}])
@pytest.mark.mends("letters that a terminal does not have ended a command with a traceback")
def test_letters_that_a_terminal_does_not_have_are_question_marks(tmp_path, set_to):
    env = os.environ | {"PYTHONCOERCECLOCALE": "0"} | set_to
    done = subprocess.run([sys.executable, "-c", TABLE], cwd=tmp_path, env=env, capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"done\n")
    assert done.stdout.splitlines()[0] == b"tilt 9.55? ? 2 m/s?"


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are text elsewhere")
@pytest.mark.mends("under LC_ALL=C a job could not name a file with a letter beyond ASCII")
def test_any_letter_may_be_in_a_path_under_any_locale(tmp_path):
    folder = tmp_path / "größe"
    folder.mkdir()
    rows = "".join(f"{0.01 * i:.2f},{0.3 * math.sin(0.08 * i):.6f}\n" for i in range(300))
    (folder / "häß.csv").write_text(f"time (s),acceleration (g)\n{rows}", encoding="utf-8")
    block = "width = 1.0\nheight = 6.0\nmass = 9000\nfriction = 0.0\nrestitution = 0.9595\n"
    job = f'[project]\nname = "Türmchen μ²"\n[block]\n{block}[motion]\nrecords = ["häß.csv"]\n'
    (folder / "jöb.toml").write_text(job, encoding="utf-8")
    env = os.environ | {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    words = ["export", "--scene", f"{folder}/jöb.toml", "--as", "csv", "--file", f"{folder}/mötion.csv"]
    done = subprocess.run([sys.executable, "-m", "tpd", *words], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "written: " in done.stdout
    assert (folder / "mötion.csv").read_text(encoding="utf-8").startswith("time_s,")
