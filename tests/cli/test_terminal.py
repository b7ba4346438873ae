"""Ctrl-C ends a command at once; first message of a command, warnings and standard streams."""

import math
import os
import shlex
import signal
import subprocess
import sys
import time

import pytest

import tpd
from tests.cli.conftest import call
from tpd.cli import new, terminal

PIPES = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
COMMAND = [sys.executable, "-m", "tpd", "optimise", "--out", "out"]
posix = pytest.mark.skipif(os.name != "posix", reason="signals differ")


@posix
@pytest.mark.parametrize("lines", [1, 4])
def test_ctrl_c_ends_a_command_without_traceback_or_files(tmp_path, lines):
    """Interrupt while modules are imported, and while a program compiles."""
    with subprocess.Popen(COMMAND, cwd=tmp_path, **PIPES) as run:
        first, *_ = [run.stderr.readline() for _ in range(lines)]
        run.send_signal(signal.SIGINT)
        # The pipes end only when no process has them open any more.
        out, err = run.communicate(timeout=60)
    # The first message appears before JAX is imported.
    message = f"tpd {tpd.__version__}: searching for the best pendulum (report: out)\n"
    assert first == message
    assert run.returncode == -signal.SIGINT, err
    for word in ("Traceback", "Exception ignored"):
        assert word not in out + err
    assert list(tmp_path.iterdir()) == []


BUSY = """
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
def test_ctrl_c_ends_compiled_code_with_status_130():
    """A sum runs in C, as a compiler does. Python itself would handle the signal only after its end."""
    # A shell starts processes in the background with Ctrl-C ignored.
    script = f"{shlex.join([sys.executable, '-c', BUSY])} & echo $!; wait $!; echo $?"
    with subprocess.Popen(["sh", "-c", script], **PIPES) as shell:
        lines = {shell.stdout.readline() for _ in range(2)}
        (number,) = (int(line) for line in lines if line != "begun\n")
        os.kill(number, signal.SIGINT)
        out, err = shell.communicate(timeout=30)
    assert (out, "Traceback" in err) == ("130\n", False)


def test_ctrl_c_raises_keyboard_interrupt_for_a_caller_in_python(monkeypatch):
    before = signal.getsignal(signal.SIGINT)

    def stop(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(new, "run", stop)
    with pytest.raises(KeyboardInterrupt):
        call("new tower")
    assert signal.getsignal(signal.SIGINT) is before


def test_progress_messages_stop_before_the_result(monkeypatch, capsys):
    for name, seconds in {"EVERY": 0.0, "TICK": 0.02, "_FIRST_MESSAGE": 0.0}.items():
        monkeypatch.setattr(terminal, name, seconds)
    with terminal.announced("working"):
        time.sleep(0.2)
        terminal.print_answer("answer", "in two lines")
        time.sleep(0.1)
        out, err = capsys.readouterr()
        time.sleep(0.2)
    assert out == "answer\nin two lines\n"
    assert "tpd: working, 0 s\n" in err
    assert capsys.readouterr() == ("", "")


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
def test_a_warning_is_one_sentence_without_a_home_folder():
    done = subprocess.run([sys.executable, "-c", HOMELESS], capture_output=True, text=True)
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if "checking" not in line]
    assert [line.split()[:2] for line in lines] == [["tpd:", "compiled"], ["tpd:", "a"]]
    assert lines[1].startswith("tpd: a pendulum is missing: give DESIGN, or ")


TABLE = """
import sys, tpd.cli.terminal as i
with i.lasting_output():
    for _ in range(20000):
        print("tilt 9.55\\xb0 \\xb1 2 m/s\\xb2")
    open("table.csv", "w", encoding="utf-8").write("numbers")
    print("done", file=sys.stderr)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no such devices")
def test_a_closed_pipe_is_ignored_and_a_full_disk_is_reported(tmp_path):
    how = {"cwd": tmp_path, "stderr": subprocess.PIPE, "text": True}
    command = [sys.executable, "-c", TABLE]
    with subprocess.Popen(command, stdout=subprocess.PIPE, **how) as process:
        process.stdout.close()
        assert process.stderr.read() == "done\n"
    assert process.returncode == 0
    assert (tmp_path / "table.csv").read_text() == "numbers"
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, **how)
    assert done.stderr == "done\ntpd: cannot write to the standard output: No space left on device\n"
    assert done.returncode == 2
    for closed in (">&-", ">&- 2>&-"):
        done = subprocess.run(f"{shlex.join(command)} {closed}", shell=True, **how)
        assert (done.returncode, "Error" in done.stderr) == (0, False)


@pytest.mark.parametrize("set_to", [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0"}])
def test_characters_outside_the_encoding_are_printed_as_question_marks(tmp_path, set_to):
    env = os.environ | {"PYTHONCOERCECLOCALE": "0"} | set_to
    done = subprocess.run([sys.executable, "-c", TABLE], cwd=tmp_path, env=env, capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"done\n")
    assert done.stdout.splitlines()[0] == b"tilt 9.55? ? 2 m/s?"


@pytest.mark.skipif(sys.platform != "linux", reason="other systems store names of files as text")
def test_a_path_can_contain_any_character_under_any_locale(tmp_path):
    folder = tmp_path / "größe"
    folder.mkdir()
    rows = "".join(f"{0.01 * i:.2f},{0.3 * math.sin(0.08 * i):.6f}\n" for i in range(300))
    (folder / "häß.csv").write_text(f"time (s),acceleration (g)\n{rows}", encoding="utf-8")
    block = "width = 1.0\nheight = 6.0\nmass = 9000\nfriction = 0.0\nrestitution = 0.9595\n"
    job = f'[project]\nname = "Türmchen μ²"\n[block]\n{block}[excitation]\nrecords = ["häß.csv"]\n'
    (folder / "jöb.toml").write_text(job, encoding="utf-8")
    env = os.environ | {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    words = ["export", "--scene", f"{folder}/jöb.toml", "--as", "csv", "--out", f"{folder}/mötion.csv"]
    done = subprocess.run([sys.executable, "-m", "tpd", *words], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "written: " in done.stdout
    assert (folder / "mötion.csv").read_text(encoding="utf-8").startswith("time_s,")
