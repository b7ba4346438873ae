"""Files of a report in one folder: text, JSON, job file, tables, pictures and HTML page.

The content of text and page is also stored as data. Later commands add their results to the data, and both
are rendered again."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import msgspec
from msgspec.structs import replace

from tpd.answers.response import Response
from tpd.core import checks, files
from tpd.core.progress import Progress, bar_for
from tpd.design.as_built import Details, TimeHistory
from tpd.design.as_built import details as compute
from tpd.design.design import Design
from tpd.report.blocks import MOST, Figure, Report, Section
from tpd.report.content import content, figures
from tpd.report.json import as_json
from tpd.report.render import html, text
from tpd.scene.quantities import UNITS

DATA, TEXT, PAGE = "report.json", "report.txt", "report.html"
"""Names of the files with the content of the report as data, as text and as a page."""


def write(
    directory: Path,
    design: Design,
    details: Details,
    *,
    overwrite: bool,
    lines: int = MOST,
    then: Callable[[Report], None] = lambda report: None,
    warn: Callable[[str], None] = warnings.warn,
) -> list[Path]:
    """Write all files of a report and return their paths.

    Each file appears complete or not at all, even if the process is interrupted.

    Args:
        directory: folder of the report, which is made if it does not exist.
        design: the answer of `optimise`.
        details: further results that the report shows, from `tpd.details`.
        overwrite: whether the folder may contain files.
        lines: largest number of lines of the summary on the terminal.
        then: function that is called with the report when the numbers are written, before the first picture
            is drawn.
        warn: function that is called with a sentence for each picture that cannot be drawn, and on files
            in the folder that do not belong to the report.
    """
    report, job = content(design, details, directory, files.today(), lines), design.problem.job
    results_json = as_json(design, details, report.summary)
    tables = {TEXT: text(report), files.REPORT: results_json, DATA: data(report)}
    tables |= {"scene.toml": job.toml} if job else {}
    tables |= _tables(design, details)
    results = files.Results(directory, files.REPORT, overwrite=overwrite)
    written = [results.place(name, inside) for name, inside in tables.items()]
    # Pictures take longest and may fail. The numbers are therefore written, and the answer is printed, first.
    then(report)
    # Matplotlib loads slowly. The numbers are written before, without it.
    from tpd.plots.results import draw

    names = figures(design, details)
    drawn = {name: results.draw(name, partial(draw, name, design, details), warn) for name in names}
    pictures = {name: picture for name, picture in drawn.items() if picture is not None}
    written += [directory / name for name in pictures]
    # The page is written last, so that a folder with a page contains a complete report.
    written.append(results.place(PAGE, html(report, pictures)))
    if remaining := results.remaining:
        warn(remaining)
    return written


def write_report(
    design: Design,
    folder: str | Path,
    *,
    details: Details | None = None,
    overwrite: bool = False,
    progress: Progress | bool | None = None,
) -> list[Path]:
    """Write the report of a design into a folder, and return the paths of its files.

    The report has an HTML page, a text, all results as JSON, tables as CSV, and pictures. The report of a
    design that was made from a `Job` also has the job file scene.toml, which repeats the search.

    Args:
        design: the answer of `optimise`.
        folder: folder of the report, which is made if it does not exist.
        details: the answer of `tpd.details`; by default the function computes it.
        overwrite: whether to replace a report in the folder.
        progress: True for a bar on stderr, or a function that is called with (stage, done, total).

    Raises:
        ValueError: `design` is not a design, or the folder contains a report or cannot be written.

    Example:
        >>> import tempfile
        >>> import tpd
        >>> statue = tpd.Block(width=0.5, height=1.5, mass=900.0, cavity_width=0.4, restitution=0.9)
        >>> pulse = tpd.Pulse(kind="one-sine", acceleration=1.0, frequency=2.0)
        >>> weak = tpd.Conditions.records([pulse], [0.5])
        >>> design = tpd.optimise(statue, conditions=weak, validation_share=0.0)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     paths = tpd.write_report(design, folder)
        >>> [path.name for path in paths]
        ['report.txt', 'design.json', 'report.json', 'drawing.svg', 'report.html']
    """
    checks.instance("design", design, Design)
    checks.optional("details", details, Details)
    checks.flag("overwrite", overwrite)
    folder = files.path_of(folder)
    files.claim(folder, overwrite=overwrite)
    with bar_for(progress) as report:
        results = compute(design, progress=report) if details is None else details
    return write(folder, design, results, overwrite=overwrite)


def _tables(design: Design, details: Details) -> dict[str, str]:
    """Return the contents of the tables of numbers by the names of their files."""
    tables = {}
    if details.responses:
        tables["response.csv"] = response_csv(details.responses)
    if details.histories:
        tables["motion.csv"] = motion_csv(details.histories)
    # The rows of this table are the dots in the picture of the search.
    if (trials := design.trials) is not None:
        columns = dict(zip(("mu", "lam", "zeta"), trials.designs.T, strict=True))
        sizes = ("value", "trend", "overturned", "undecided", "feasible")
        columns |= {name: getattr(trials, name) for name in sizes}
        columns |= zip(trials.names, trials.sizes.T, strict=True)
        tables["trials.csv"] = files.as_table(columns)
    return tables


def response_csv(responses: Sequence[Response]) -> str:
    """Return a CSV table of responses without and with the pendulum, with a row for each frequency.

    The columns are the status, the settled amplitude and swing (rad), and the share of the runs near the
    frequency that overturn with its 95 % interval. An amplitude is infinite where the block overturns.

    Args:
        responses: responses without and, if there is one, with the pendulum, over the same values.
    """
    name = responses[0].name
    columns = {f"{name}_{UNITS[name]}" if name in UNITS else name: responses[0].frequency}
    for label, r in zip(("without", "with"), responses, strict=False):
        # The frequency is the same in both responses and has one column.
        columns |= {f"{label}_{n}": column for n, column in r.columns().items() if n != name}
    # Without a pendulum the equations still have a bob, whose mass is zero. Its swing has no meaning.
    del columns["without_swing_rad"]
    return files.as_table(columns)


def motion_csv(histories: Sequence[TimeHistory]) -> str:
    """Return a CSV table of motions from rest by the exact model, with a row for each time.

    The columns are the time (s), the tilt without the pendulum and, if there is a pendulum, the tilt and the
    bob angle with it (rad). Cells are empty after the block has overturned.

    Args:
        histories: motions without and, if there is one, with the pendulum, over the same times.
    """
    columns = {"time_s": histories[0].times}
    for h in histories:
        own = {"without_tilt_rad": h.tilt}
        columns |= own if h.swing is None else {"with_tilt_rad": h.tilt, "with_bob_rad": h.swing}
    return files.as_table(columns)


def add_to(folder: Path | None, section: Section | None = None, page: str = "") -> list[Path]:
    """Add the answer of another command to a report, render it again, and return its files.

    The report remains as it was if its data cannot be read or rendered.

    Args:
        folder: folder of the report, or a file in it; None for a pendulum without a report.
        section: section with the answer, which replaces one with the same title.
        page: name of the file with the interactive page.

    Raises:
        ValueError: the data of the report, or a picture of it, is damaged.
    """
    if folder is None:
        return []
    folder = folder if folder.is_dir() else folder.parent
    try:
        stored = (folder / DATA).read_bytes()
    except FileNotFoundError:
        return []
    try:
        report = msgspec.json.decode(stored, type=Report)
    except msgspec.MsgspecError:
        raise ValueError(f"{folder / DATA} is not the data of a report: run the job again") from None
    # A section replaces that of an earlier run of the same command, at the same place.
    sections = {x.title: x for x in (*report.added, *([section] if section else []))}
    report = replace(report, added=tuple(sections.values()), page=page or report.page)
    # The pictures are files of the report. One that was removed is left out of the page.
    blocks = (*report.figures, *(block for part in report.sections for block in part.blocks))
    paths = {folder / block.name for block in blocks if isinstance(block, Figure)}
    pictures = {path.name: path.read_bytes() for path in paths if path.exists()}
    # All files are rendered before the first is written.
    rendered = {DATA: data(report), TEXT: text(report), PAGE: html(report, pictures)}
    return [files.place(folder / name, content, files.REPORT) for name, content in rendered.items()]


def data(report: Report) -> str:
    """Return the data of a report as JSON."""
    # Cells can be scalars of NumPy, which only the hook can encode.
    return files.as_json(msgspec.to_builtins(report, enc_hook=lambda x: x.item()))
