"""Files of a report in one directory: text, JSON, the job that repeats it, tables, pictures, the page, and in
these the answer of an independent engine."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

from tpd.answers.response import Response
from tpd.core import checks, files
from tpd.core.progress import Progress, shown
from tpd.design.as_built import Details, TimeHistory
from tpd.design.as_built import details as compute
from tpd.design.design import Design
from tpd.report.content import content, names
from tpd.report.json import as_json
from tpd.report.render import html, text
from tpd.scene.quantities import UNITS

_TITLE = "Independent contact engine"
_MARK = "<!-- engine -->"


def write(
    directory: Path,
    design: Design,
    details: Details,
    job_tables: dict[str, Any],
    job_toml: str,
    said: Sequence[str] = (),
    *,
    then: Callable[[], None] = lambda: None,
    warn: Callable[[str], None] = warnings.warn,
) -> list[Path]:
    """Write the whole report; each file appears complete or not at all. Returns the files.

    Args:
        directory: made if it does not exist.
        design: the answer of `optimise`.
        study: everything else that is shown, from `tpd.details`.
        job_tables: the job as plain tables, for design.json; empty where no job file says what was asked.
        job_toml: the job as a file that repeats the run, for scene.toml; empty where there is none.
        said: notes of the reader on the files of the records.
        then: called when the numbers are written, before the first picture is drawn.
        warn: called with a sentence for each picture that cannot be drawn.
    """
    named: dict[str, Any] = {
        "said": said,
        "name": job_tables.get("project", {}).get("name", ""),
        "date": files.today(),
    }
    report = content(design, details, job_toml, directory if job_toml else None, **named)
    written = [
        files.place(directory / name, inside)
        for name, inside in _words(design, details, job_tables, job_toml, said)
    ]
    written.insert(0, files.place(directory / "report.txt", text(report)))
    # Pictures take longest and may fail: the numbers are written, and the answer is printed, before them.
    then()
    drawn = {}
    for name in names(design, details):
        try:
            drawn[name] = draw(name, design, details)
        # Matplotlib raises errors of every kind.
        except Exception as error:
            warn(files.missing_picture(name, error))
        else:
            written.append(files.place(directory / name, drawn[name]))
    # Last, so that a page stands for a whole report.
    written.append(files.place(directory / "report.html", html(report, drawn)))
    return written


def write_report(
    design: Design,
    folder: str | Path,
    *,
    details: Details | None = None,
    overwrite: bool = False,
    progress: Progress | bool | None = None,
) -> list[Path]:
    """Write the report of a design: page, text, numbers, pictures and, if a job file can describe the
    question, the job file that repeats the search. Returns the files.

    Args:
        design: the answer of `optimise`.
        folder: directory of the report, which is made if it does not exist.
        study: the answer of `tpd.details`; computed here by default.
        overwrite: whether a report in the folder is replaced.
        progress: True for a bar on stderr, or called with (stage, done, of how many).

    Raises:
        ValueError: something other than a design, or a folder that already holds a report or cannot be
            written.
    """
    checks.instance("design", design, Design)
    checks.optional("study", details, Details)
    checks.flag("overwrite", overwrite)
    folder = files.path_of(folder)
    files.claim(folder, overwrite=overwrite)
    with shown(progress) as report:
        found = compute(design, progress=report) if details is None else details
    # A user's own limit, or motions that exist only in Python, are in no job file.
    try:
        job = design.problem.job
    except ValueError as error:
        warnings.warn(f"the report goes without scene.toml: {error}", stacklevel=2)
        return write(folder, design, found, {}, "")
    return write(folder, design, found, job.tables, job.toml)


def _words(
    design: Design, details: Details, job_tables: dict[str, Any], job_toml: str, said: Sequence[str]
) -> Iterator[tuple[str, str]]:
    """Names and contents of the files of numbers."""
    yield "design.json", as_json(design, details, job_tables, said)
    if job_toml:
        yield "scene.toml", job_toml
    if details.responses:
        yield "response.csv", response_csv(details.responses)
    if details.histories:
        yield "motion.csv", motion_csv(details.histories)
    if (trials := design.trials) is not None:
        head = ("mu", "lam", "zeta", "value", "trend", "overturned", "undecided", "feasible", *trials.names)
        columns = trials.value, trials.trend, trials.overturned, trials.undecided, trials.feasible
        rows = zip(trials.designs, *columns, trials.sizes, strict=True)
        yield "trials.csv", files.as_csv(head, ((*d, *(x.item() for x in more), *s) for d, *more, s in rows))


def draw(name: str, design: Design, details: Details) -> bytes:
    """Content of one of the files in `names`; `ValueError` for another name."""
    # A report in words does not wait for Matplotlib.
    from tpd.plots import animation, compare, drawing, landscape, response
    from tpd.plots.style import png, svg

    axes: Any
    scene, histories = design.scene, details.histories or ()
    what, _, kind = name.partition(".")
    match what:
        case "search":
            axes = landscape.plot_landscape(design)
        case "benefit":
            axes = compare.plot_benefit(design)
        case "conditions":
            axes = compare.plot_conditions(design)
        case "drawing":
            axes = drawing.plot_design(design)
        case "response":
            axes = response.plot_response(details.responses or (), scene.motion.frequency)
        case "motion":
            axes = response.plot_motions(histories, scene.block.slenderness, stroke_limit=design.stroke_limit)
        case "front":
            axes = compare.plot_front(details.front)
        case "animation":
            return animation.animate(scene, design.pendulum, histories)
        case _:
            raise ValueError(f"`name` must be one of {', '.join(names(design, details))}, but is {name!r}")
    figure = (axes if hasattr(axes, "figure") else axes[0]).figure
    return svg(figure) if kind == "svg" else png(figure)


def response_csv(responses: Sequence[Response]) -> str:
    """CSV with a row for every frequency: status, amplitude and share of the runs near it that overturn,
    without, and with, the pendulum.

    Args:
        responses: of the bare block and, if there is one, with the pendulum, over the same values. An
            amplitude is infinite where the block overturns.
    """
    name = responses[0].name
    columns = {f"{name}_{UNITS[name]}" if name in UNITS else name: responses[0].frequency}
    for label, r in zip(("without", "with"), responses, strict=False):
        columns |= {f"{label}_{n}": column for n, column in r.columns().items() if n != name}
    # The bare block's stroke is that of a bob too light to be felt, and means nothing.
    del columns["without_swing_rad"]
    return files.as_table(columns)


def motion_csv(histories: Sequence[TimeHistory]) -> str:
    """CSV with a row for every time: tilt without the pendulum and, if there is one, tilt and bob angle with
    it, by the exact solution. Cells are empty after the block has overturned.

    Args:
        histories: over the same times.
    """
    columns = {"time_s": histories[0].time}
    for h in histories:
        columns["with_tilt_rad" if h.with_pendulum else "without_tilt_rad"] = h.tilt
        # Without a pendulum the bob is one too light to be felt, and means nothing.
        if h.with_pendulum:
            columns["with_bob_rad"] = h.bob
    return files.as_table(columns)


def add_engine(directory: Path, verdict: Any) -> list[Path]:
    """Put the answer of an engine, an `EngineVerdict`, into the files of a report, in place of a former one:
    a warning before the verdict, and a section at the end. Return the files that were changed."""
    written = []
    for name, put in (("report.txt", _in_text), ("report.html", _in_page)):
        path = directory / name
        if path.exists():
            written.append(files.place(path, put(path.read_text(encoding="utf-8"), verdict)))
    return written


def _in_text(report: str, verdict: Any) -> str:
    # A second run replaces the first: its warning and its section are found by their words.
    lines = report.split(f"\n{_TITLE}\n")[0].rstrip("\n").split("\n")
    if "MuJoCo" in lines[0]:
        lines = lines[1:]
    head = [verdict.warning] if verdict.warning else []
    return "\n".join([*head, *lines, "", _TITLE, "-" * len(_TITLE), str(verdict)]) + "\n"


def _in_page(page: str, verdict: Any) -> str:
    # Marks stand around everything that a second run replaces.
    page = re.sub(f"{_MARK}.*?{_MARK}\n", "", page, flags=re.DOTALL)
    if verdict.warning:
        head = f'{_MARK}<p class="danger">{escape(verdict.warning)}</p>{_MARK}\n'
        page = page.replace('<p class="verdict', head + '<p class="verdict', 1)
    section = f"<section>\n<h2>{_TITLE}</h2>\n<pre>{escape(str(verdict))}</pre>\n</section>"
    return page.replace("</body>", f"{_MARK}{section}{_MARK}\n</body>", 1)
