"""Files of a report: text, JSON, the job that repeats it, tables, pictures and the page, in one directory."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tpd.core import files
from tpd.core.progress import Progress, shown
from tpd.design.ground.design import GroundDesign
from tpd.design.reading import job_of_design
from tpd.design.result import Design, DesignStatus
from tpd.design.study import Study
from tpd.design.study import study as compute
from tpd.report import ground, pictures
from tpd.report.content import content
from tpd.report.html import html
from tpd.report.json import as_json
from tpd.report.responses import motion_csv, response_csv
from tpd.report.text import text


def write(
    directory: Path, design: Design, study: Study, job_tables: dict[str, Any], job_toml: str
) -> list[Path]:
    """Write the whole report; each file appears complete or not at all. Returns the files.

    Args:
        directory: made if it does not exist.
        design: the answer of `optimise`.
        study: everything else that is shown, from `tpd.design.study.study`.
        job_tables: the job as plain tables, for design.json; empty where no job file says what was asked.
        job_toml: the job as a file that repeats the run, for scene.toml; empty where there is none.
    """
    named = {"name": job_tables.get("project", {}).get("name", ""), "date": files.today()}
    report = content(design, study, job_toml, directory if job_toml else None, **named)
    written = [
        files.place(directory / name, inside) for name, inside in _words(design, study, job_tables, job_toml)
    ]
    written.insert(0, files.place(directory / "report.txt", text(report)))
    # Numbers are safe on disk before the pictures, which take longest, are drawn.
    drawn = {}
    for name in pictures.names(design, study):
        drawn[name] = pictures.draw(name, design, study)
        written.append(files.place(directory / name, drawn[name]))
    if design.status is not DesignStatus.interrupted:
        # Last, so that a page stands for a whole report.
        written.append(files.place(directory / "report.html", html(report, drawn)))
    return written


def save(
    design: Design,
    folder: Path,
    *,
    study: Study | None,
    overwrite: bool,
    progress: Progress | bool | None,
) -> list[Path]:
    """See `Design.save`."""
    files.claim(folder, overwrite=overwrite)
    with shown(progress) as report:
        found = compute(design, progress=report) if study is None else study
    # A user's own limit, or motions that exist only in Python, are in no job file.
    try:
        job = job_of_design(design)
    except ValueError as error:
        warnings.warn(f"the report goes without scene.toml: {error}", stacklevel=3)
        return write(folder, design, found, {}, "")
    return write(folder, design, found, job.tables, job.toml)


def _words(
    design: Design, study: Study, job_tables: dict[str, Any], job_toml: str
) -> Iterator[tuple[str, str]]:
    """Names and contents of the files of numbers."""
    yield "design.json", as_json(design, study, job_tables)
    if job_toml:
        yield "scene.toml", job_toml
    if study.responses:
        yield "response.csv", response_csv(study.responses)
    if study.histories:
        yield "motion.csv", motion_csv(study.histories)
    if isinstance(design, GroundDesign):
        if design.searched is not None:
            yield "designs.csv", ground.designs_csv(design)
        if design.judged:
            yield "groups.csv", ground.groups_csv(design)
