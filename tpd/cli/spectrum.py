"""`tpd spectrum`: overturning spectrum of a pulse, or rocking spectrum of a record."""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

import numpy as np

from tpd.answers.spectra import OverturningSpectrum, overturning_spectrum, rocking_spectrum
from tpd.cli import common, outputs
from tpd.cli.terminal import SOUND, print_answer
from tpd.core import checks, files
from tpd.core.progress import Bar
from tpd.scene.ground_motion import Pulse


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
    block = scene.block
    how: dict[str, Any] = {"gravity": float(scene.gravity)}
    with Bar() as bar:
        how["progress"] = partial(bar, "blocks")
        # A pulse can be varied in frequency and size, a record cannot: its spectrum varies the block instead.
        if is_pulse:
            how["frequency_ratios"] = np.linspace(0.25, options.to or 10.0, options.points)
            how["acceleration_ratios"] = np.linspace(0.5, options.sizes_to or 10.0, options.points)
            spectrum = overturning_spectrum(block, scene.excitation, pendulum, **how)
        else:
            how["periods"] = np.linspace(0.5, options.to or 12.0, options.points)
            if pendulum is not None:
                # Blocks of all sizes have a pendulum of the same ratios.
                how |= {"mass_ratio": pendulum.mass / block.mass, "damping_ratio": pendulum.damping_ratio}
                how["length_ratio"] = pendulum.length / block.centroid
                how["hinge_ratio"] = pendulum.hinge_in(block) / block.centroid
            spectrum = rocking_spectrum(block, scene.excitation, **how)
    counts, total, lines = spectrum.undecided().tolist(), spectrum.cases[0].size, list[str]()
    content: dict[str, Any] = {"undecided": counts}
    if isinstance(spectrum, OverturningSpectrum):
        content["survived"] = shares = spectrum.safe().tolist()
        cases = (
            f"{_share(x, n, total)} {name}"
            for x, n, name in zip(shares, counts, common.CASES[: len(counts)], strict=True)
        )
        lines.append(f"pulses under which the block does not overturn: {', '.join(cases)}")
    if open_ := [f"{n} of {total} {x}" for n, x in zip(counts, common.CASES, strict=False) if n]:
        lines.append(f"{'pulses' if is_pulse else 'blocks'} without a solution: {', '.join(open_)}")
    if lines:
        print_answer("", *lines)
    tables = {
        "spectrum.csv": files.as_table(spectrum.columns()),
        "spectrum.json": files.as_json(common.json_inputs(scene, pendulum, job) | content),
    }
    pictures = {"spectrum.png": partial(outputs.plot, spectrum)}
    outputs.write(options.out, tables.items(), pictures, overwrite=options.overwrite)
    return SOUND


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
