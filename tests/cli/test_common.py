"""The pendulum of the options."""

import pytest

from tpd import Pendulum, paper_scene
from tpd.cli import common, parser

MAP = ("--x", "mu", "0.01", "0.2", "--y", "lam", "0.1", "1.5")


def pendulum(*command: str, varied: tuple[str, ...] = ()) -> Pendulum | None:
    """The pendulum of a command for the paper's block."""
    return common.pendulum(parser().parse_args([*command]), paper_scene().block, varied)


def test_a_pendulum_is_given_in_si_units_or_in_ratios():
    hung = pendulum("response", "--pendulum-mass", "0.8112", "--length-ratio", "0.5")
    assert hung == Pendulum(mass=0.8112, length=0.1, damping_ratio=0.1)
    hung = pendulum("response", "--mass-ratio", "0.05", "--pendulum-length", "0.1")
    assert hung is not None
    assert hung.mass == pytest.approx(0.8112)
    assert pendulum("response") is None


def test_a_quantity_that_a_map_varies_need_not_be_given():
    hung = pendulum("map", *MAP, varied=("mu", "lam"))
    assert hung is not None
    assert hung.damping_ratio == 0.1


def test_half_a_pendulum_is_refused():
    with pytest.raises(ValueError, match="half of the pendulum is missing: give --pendulum-length or"):
        pendulum("response", "--pendulum-mass", "1")
