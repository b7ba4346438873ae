"""The answer of `optimise` in a few lines for the terminal, from the summary of a design."""

from __future__ import annotations

from pathlib import Path

from tpd.design.as_built import Details, build_of
from tpd.design.design import Design
from tpd.report.blocks import MOST
from tpd.report.render import in_lines
from tpd.report.summary import summary


def answer(
    design: Design, details: Details | None = None, directory: Path | None = None, most: int = MOST
) -> str:
    """Return the answer for the terminal: verdict, pendulum, benefit and active limits.

    Args:
        design: the answer of `optimise`.
        details: the answer of `tpd.details`. Without this argument, rows that need further runs are left out.
        directory: folder of the report, for the commands at the end.
        most: largest number of lines.
    """
    # The pendulum as built needs only a few motions, so it is always shown.
    details = Details(build=build_of(design)) if details is None else details
    return in_lines(summary(design, details, directory), most)
