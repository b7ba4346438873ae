"""The command starts fast, and what it compiles can be stored."""

import subprocess
import sys
import time

import pytest

import tpd


@pytest.mark.parametrize(
    "flag", ["--version", "--help", "optimise --help", "map --help", "response --help", "new --help"]
)
def test_help_and_version_do_not_wait_for_jax(flag):
    code = f"""
import sys
from tpd.cli import main
try:
    main({flag.split()})
except SystemExit:
    pass
for name in ("jax", "numpy", "optax", "matplotlib"):
    assert name not in sys.modules, name
"""
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    # Half of a second when nothing else runs; importing JAX alone takes one.
    assert time.perf_counter() - begin < 5.0
    if flag == "--version":
        assert done.stdout == f"tpd {tpd.__version__}\n"


def test_compiled_programs_can_be_stored():
    """A program that calls back to Python is compiled anew in every run."""
    code = """
from tpd.core import process
process.use_64_bits()
import equinox as eqx, jax
from tpd import Segmented, Smoothed, Terms, paper_scene, steady_state
from tpd.scene.parameters import as_arrays
p = as_arrays(paper_scene().parameters())
def amplitude(mu, model):
    return steady_state(eqx.tree_at(lambda q: q.mu, p, mu), model=model).amplitude
for model in (Smoothed(), Segmented(terms=Terms.nonlinear)):
    text = jax.jit(lambda mu: amplitude(mu, model)).lower(0.1).as_text()
    assert "while" in text
    assert "callback" not in text, model
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_first_line_does_not_wait_for_jax(tmp_path):
    """A quarter of a second and the start of Python when nothing else runs; importing JAX alone takes one."""
    command = [sys.executable, "-m", "tpd.cli", "response", "--out", "out"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as run:
        begin = time.perf_counter()
        assert run.stderr is not None
        line = run.stderr.readline()
        took = time.perf_counter() - begin
        run.kill()
    assert line == f"tpd {tpd.__version__}: following the motions over frequency, for out\n"
    assert took < 5.0


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
    lines = [line for line in done.stderr.splitlines() if "solving" not in line]
    assert [line[:35] for line in lines] == [
        "tpd: compiled code is not kept, so ",
        "tpd: give DESIGN, or a pendulum by ",
    ]
