"""What the commands share: the pendulum of the options, what is said of a job, and how programs are kept."""

import os
import subprocess
import sys

import pytest

from tpd import Pendulum, paper_scene
from tpd.cli import common, parser
from tpd.design.job import job_of

MAP = "--x mu 0.01 0.2 --y lam 0.1 1.5"


def pendulum(command: str, varied: tuple[str, ...] = ()) -> Pendulum | None:
    """The pendulum of a command for the paper's block."""
    return common.pendulum(parser().parse_args(command.split()), paper_scene().block, varied)


def test_a_pendulum_is_given_in_si_units_or_in_ratios():
    hung = pendulum("response --pendulum-mass 0.8112 --length-ratio 0.5")
    assert hung == Pendulum(mass=0.8112, length=0.1, damping_ratio=0.1)
    assert pendulum("response --mass-ratio 0.05 --pendulum-length 0.1").mass == pytest.approx(0.8112)
    assert pendulum("response") is None
    # What a map varies need not be given.
    assert pendulum(f"map {MAP}", ("mu", "lam")).damping_ratio == 0.1
    with pytest.raises(ValueError, match="half of the pendulum is missing: give --pendulum-length or"):
        pendulum("response --pendulum-mass 1")


def test_ground_motions_are_said_with_their_sizes_and_a_harmonic_by_its_scene():
    two = {"motion": {"records": ["el-centro", "loma-prieta"], "scales": [2, 3]}}
    assert common.motions(job_of(two))[0] == "2 records, each at pga_star 2, 3"
    assert common.motions(job_of({})) == ("", ())


def test_compiled_programs_can_be_stored():
    """A program that calls back to Python is compiled anew in every run."""
    code = """
from tpd.core import process
process.use_64_bits()
import equinox as eqx, jax
text = jax.jit(lambda x: eqx.error_if(x, x < 0.0, "negative")).lower(0.1).as_text()
assert "callback" not in text
"""
    env = {name: value for name, value in os.environ.items() if name != "EQX_ON_ERROR"}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
