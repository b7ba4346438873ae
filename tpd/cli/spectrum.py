"""`tpd spectrum`: overturning spectrum of a pulse, or rocking spectrum of a record."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.spectra import OverturningSpectrum, RockingSpectrum, overturning_spectrum, rocking_spectrum
from tpd.cli import common, outputs
from tpd.cli.terminal import SOUND, print_answer
from tpd.core import checks, files
from tpd.core.progress import Bar
from tpd.scene.ground_motion import Pulse
from tpd.scene.scene import Pendulum, Scene


def run(options: argparse.Namespace, case: common.Case) -> int:
    """Compute the spectrum, print a summary, write a table and a picture, and return the exit status."""
    job, pendulum = case
    checks.count("--points", options.points, least=2)
    for flag, value in (("--to", options.to), ("--sizes-to", options.sizes_to)):
        if value is not None:
            checks.positive(flag, value)
    scene = job.under(job.shaking)
    is_pulse = isinstance(scene.excitation, Pulse)
    if not is_pulse and options.sizes_to is not None:
        raise ValueError("--sizes-to has an effect on the spectrum of a pulse, but the job has a record")
    # The motion of the job gives only the kind of the pulse.
    motion = f"{scene.excitation.kind} pulses of all frequencies and accelerations" if is_pulse else ""
    common.print_header(scene, pendulum, motion, job.messages)
    with Bar() as bar:
        how = {"gravity": float(scene.gravity), "progress": partial(bar, "blocks")}
        # A pulse can be varied in frequency and size, a record cannot: its spectrum varies the block instead.
        compute = _overturning if is_pulse else _rocking
        spectrum, content = compute(options, scene, pendulum, how)
    tables = {
        "spectrum.csv": files.as_table(spectrum.columns()),
        "spectrum.json": files.as_json(common.json_inputs(scene, pendulum, job) | content),
    }
    pictures = {"spectrum.png": partial(outputs.plot, spectrum)}
    outputs.write(options.out, tables.items(), pictures, overwrite=options.overwrite)
    return SOUND


def _overturning(
    options: argparse.Namespace, scene: Scene, pendulum: Pendulum | None, how: dict[str, Any]
) -> tuple[OverturningSpectrum, dict[str, Any]]:
    """Compute and print the spectrum of a pulse; return the spectrum and its numbers for the JSON file."""
    spectrum = overturning_spectrum(
        scene.block,
        scene.excitation,
        pendulum,
        frequency_ratios=np.linspace(0.25, options.to or 10.0, options.points),
        acceleration_ratios=np.linspace(0.5, options.sizes_to or 10.0, options.points),
        **how,
    )
    shares, undecided = spectrum.safe().tolist(), spectrum.undecided().tolist()
    total = spectrum.without_pendulum.size
    # Pulses without a result are neither safe nor overturned, so they are counted beside the share.
    stands = (_share(share, n, total) for share, n in zip(shares, undecided, strict=True))
    cases = (f"{share} {name}" for share, name in zip(stands, common.CASES, strict=False))
    line = f"pulses under which the block does not overturn: {', '.join(cases)}"
    print_answer("", line, *_undecided_line("pulses", undecided, total))
    return spectrum, {"survived": shares, "undecided": undecided}


def _share(safe: float, undecided: int, total: int) -> str:
    """Return the share of all pulses under which the block does not overturn, as text.

    Args:
        safe: share of the pulses with a solution.
        undecided: number of pulses without a solution. Each may overturn the block or not, so the share
            is a range.
        total: number of pulses.
    """
    if not undecided:
        return f"{100 * safe:.1f} %"
    # `safe` is NaN if no pulse has a solution.
    low = 0.0 if undecided == total else safe * (1.0 - undecided / total)
    return f"{100 * low:.1f} to {100 * (low + undecided / total):.1f} %"


def _undecided_line(noun: str, counts: Iterable[int], total: int) -> list[str]:
    """Return a line with the number of runs without a solution in each case; empty if there are none."""
    cases = [f"{n} of {total} {name}" for n, name in zip(counts, common.CASES, strict=False) if n]
    return [f"{noun} without a solution: {', '.join(cases)}"] if cases else []


def _rocking(
    options: argparse.Namespace, scene: Scene, pendulum: Pendulum | None, how: dict[str, Any]
) -> tuple[RockingSpectrum, dict[str, Any]]:
    """Compute the spectrum of a record; return the spectrum and its numbers for the JSON file."""
    block = scene.block
    if pendulum is not None:
        # Blocks of all sizes have a pendulum of the same ratios.
        how = how | {"mass_ratio": pendulum.mass / block.mass, "damping_ratio": pendulum.damping_ratio}
        how["length_ratio"] = pendulum.length / block.centroid
        how["hinge_ratio"] = pendulum.hinge_in(block) / block.centroid
    periods = np.linspace(0.5, options.to or 12.0, options.points)
    spectrum = rocking_spectrum(block, scene.excitation, periods=periods, **how)
    undecided = spectrum.undecided().tolist()
    if lines := _undecided_line("blocks", undecided, spectrum.periods.size):
        print_answer("", *lines)
    return spectrum, {"undecided": undecided}
