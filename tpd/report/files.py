"""Files of a report in one folder: text, JSON, job file, tables, pictures and HTML page.

Results of other commands, such as those of an independent contact engine, can be added to the text and the
page later."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from html import escape
from itertools import groupby
from pathlib import Path
from typing import Any

from tpd.answers.response import Response
from tpd.core import checks, files
from tpd.core.progress import Progress, shown
from tpd.design.as_built import Details, TimeHistory
from tpd.design.as_built import details as compute
from tpd.design.design import Design
from tpd.report.blocks import Summary
from tpd.report.content import content, figures
from tpd.report.json import as_json
from tpd.report.render import html, text
from tpd.scene.quantities import UNITS

ENGINE, FRAGILITY = "Independent contact engine", "Fragility under earthquakes"
"""Titles of the sections that other commands add to a report."""
_MARKS = {ENGINE: "<!-- engine -->", FRAGILITY: "<!-- fragility -->"}
"""Comments in the HTML page before and after everything that a second run of a command replaces."""


def write(
    directory: Path,
    design: Design,
    details: Details,
    job_tables: dict[str, Any],
    job_toml: str,
    record_notes: Sequence[str] = (),
    *,
    overwrite: bool,
    then: Callable[[Summary], None] = lambda summary: None,
    warn: Callable[[str], None] = warnings.warn,
) -> list[Path]:
    """Write all files of a report and return their paths.

    Each file appears complete or not at all, even if the process is interrupted.

    Args:
        directory: folder of the report, which is made if it does not exist.
        design: the answer of `optimise`.
        details: further results that the report shows, from `tpd.details`.
        job_tables: the job as plain tables, for design.json; empty if no job file can describe the problem.
        job_toml: the job file that repeats the search, for scene.toml; empty if there is none.
        record_notes: notes of the reader on the files of the records.
        overwrite: whether the folder may contain files.
        then: function that is called with the summary when the numbers are written, before the first picture
            is drawn.
        warn: function that is called with a sentence for each picture that cannot be drawn, and on files
            in the folder that do not belong to the report.
    """
    project, folder = job_tables.get("project", {}), directory if job_toml else None
    report = content(design, details, job_toml, folder, project, files.today(), record_notes)
    results_json = as_json(design, details, report.summary, job_tables, record_notes)
    tables = {"report.txt": text(report), files.REPORT: results_json}
    tables |= {"scene.toml": job_toml} if job_toml else {}
    tables |= _tables(design, details)
    results = files.Results(directory, files.REPORT, overwrite=overwrite)
    written = [results.place(name, inside) for name, inside in tables.items()]
    # Pictures take longest and may fail. The numbers are therefore written, and the answer is printed, first.
    then(report.summary)
    # Matplotlib loads slowly. The numbers are written before, without it.
    from tpd.plots.results import draw

    names = figures(design, details)
    drawn = {name: results.draw(name, partial(draw, name, design, details), warn) for name in names}
    pictures = {name: picture for name, picture in drawn.items() if picture is not None}
    written += [directory / name for name in pictures]
    # The page is written last, so that a folder with a page contains a complete report.
    written.append(results.place("report.html", html(report, pictures)))
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

    The report has an HTML page, a text, all results as JSON, tables as CSV, and pictures. If a job file can
    describe the problem, the report also has the job file scene.toml, which repeats the search.

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
        ['report.txt', 'design.json', 'scene.toml', 'drawing.svg', 'report.html']
    """
    checks.instance("design", design, Design)
    checks.optional("details", details, Details)
    checks.flag("overwrite", overwrite)
    folder = files.path_of(folder)
    files.claim(folder, overwrite=overwrite)
    with shown(progress) as report:
        results = compute(design, progress=report) if details is None else details
    # No job file can describe a limit that the user defined, or motions that exist only in Python.
    try:
        job = design.problem.job
    except ValueError as error:
        warnings.warn(f"the report is written without scene.toml: {error}", stacklevel=2)
        return write(folder, design, results, {}, "", overwrite=overwrite)
    return write(folder, design, results, job.tables, job.toml, overwrite=overwrite)


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
    columns = {"time_s": histories[0].time}
    for h in histories:
        columns["with_tilt_rad" if h.with_pendulum else "without_tilt_rad"] = h.tilt
        # See `response_csv`: without a pendulum the bob angle has no meaning.
        if h.with_pendulum:
            columns["with_bob_rad"] = h.bob
    return files.as_table(columns)


def add_section(design: Path | None, title: str, content: str, warning: str = "") -> list[Path]:
    """Add the result of another command to a report, and return the paths of the files that were changed.

    A warning is added before the verdict, and a section at the end. They replace those of an earlier run.

    Args:
        design: folder of the report, or a file in it; None for a pendulum without a report.
        title: title of the section, `ENGINE` or `FRAGILITY`.
        content: text of the section.
        warning: text of the warning; empty without one.
    """
    written = []
    if design is None:
        return written
    directory = design if design.is_dir() else design.parent
    for name, add in (("report.txt", _add_to_text), ("report.html", _add_to_page)):
        path = directory / name
        if path.exists():
            changed = add(path.read_text(encoding="utf-8"), title, content, warning)
            written.append(files.place(path, changed))
    return written


def _add_to_text(report: str, title: str, content: str, warning: str) -> str:
    # A plain text has no marks: a section of an earlier run is recognised by its title, and the warning of an
    # engine by the name of the engine in the first line.
    first, *sections = re.split(rf"\n({ENGINE}|{FRAGILITY})\n-+\n", report.rstrip("\n"))
    added = dict(zip(sections[::2], sections[1::2], strict=True)) | {title: content}
    lines = first.rstrip("\n").split("\n")
    if title == ENGINE and "MuJoCo" in lines[0]:
        lines = lines[1:]
    head = [warning] if warning else []
    ends = (line for name, text in added.items() for line in ("", name, "-" * len(name), text.rstrip("\n")))
    return "\n".join([*head, *lines, *ends]) + "\n"


def _add_to_page(page: str, title: str, content: str, warning: str) -> str:
    # Everything between two marks comes from an earlier run.
    mark = _MARKS[title]
    page = re.sub(f"{mark}.*?{mark}\n", "", page, flags=re.DOTALL)
    if warning:
        head = f'{mark}<p class="danger">{escape(warning)}</p>{mark}\n'
        page = page.replace('<p class="verdict', head + '<p class="verdict', 1)
    section = f"<section>\n<h2>{title}</h2>\n{_as_html(content)}\n</section>"
    return page.replace("</body>", f"{mark}{section}{mark}\n</body>", 1)


def _as_html(content: str) -> str:
    """Return a text as paragraphs, and as tables where consecutive lines have three or more columns."""
    # Two or more spaces separate the columns of a table, see `tpd.core.formatting.aligned`.
    lines = [re.split(r"\s{2,}", escape(line.strip())) for line in content.splitlines()]
    out = list[str]()
    for is_table, group in groupby(lines, lambda cells: len(cells) > 2):
        rows = list(group)
        if not is_table:
            out.append(f"<p>{'<br>'.join(' '.join(cells) for cells in rows)}</p>")
            continue
        # The first heading of a table can be empty.
        count = max(map(len, rows))
        rows = [[""] * (count - len(cells)) + cells for cells in rows]
        tags = ("th", *("td" for _ in rows[1:]))
        cells = ("".join(f"<{tag}>{x}</{tag}>" for x in row) for tag, row in zip(tags, rows, strict=True))
        out.append("<table>" + "".join(f"<tr>{x}</tr>\n" for x in cells) + "</table>")
    return "\n".join(out)
