"""Files of a report: text, JSON, the job that repeats it, pictures and the page, in one directory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tpd.core import files
from tpd.design.result import DesignStatus, HarmonicDesign
from tpd.design.study import Study
from tpd.report import pictures
from tpd.report.content import content
from tpd.report.html import html
from tpd.report.json import as_json
from tpd.report.responses import motion_csv, response_csv
from tpd.report.text import text


def write(
    directory: Path, design: HarmonicDesign, study: Study, job_tables: dict[str, Any], job_toml: str
) -> list[Path]:
    """Write the whole report; each file appears complete or not at all. Returns the files.

    Args:
        directory: made if it does not exist.
        design: the answer of `optimise`.
        study: everything else that is shown, from `tpd.design.study.study`.
        job_tables: the job as plain tables, for design.json.
        job_toml: the job as a file that repeats the run, for scene.toml.
    """
    named = {"name": job_tables.get("project", {}).get("name", ""), "date": files.today()}
    report = content(design, study, job_toml, directory, **named)
    written = [
        files.place(directory / "report.txt", text(content(design, study, directory=directory, **named))),
        files.place(directory / "design.json", as_json(design, study, job_tables)),
        files.place(directory / "scene.toml", job_toml),
    ]
    if study.responses:
        written.append(files.place(directory / "response.csv", response_csv(study.responses)))
    if study.histories:
        written.append(files.place(directory / "motion.csv", motion_csv(study.histories)))
    # Numbers are safe on disk before the pictures, which take longest, are drawn.
    drawn = {}
    for name in pictures.names(design, study):
        drawn[name] = pictures.draw(name, design, study)
        written.append(files.place(directory / name, drawn[name]))
    if design.status is not DesignStatus.interrupted:
        # Last, so that a page stands for a whole report.
        written.append(files.place(directory / "report.html", html(report, drawn)))
    return written
