"""`tpd explore`: write an interactive page of a design."""

from __future__ import annotations

import argparse
import webbrowser
from pathlib import Path

from tpd.cli import common, terminal
from tpd.core import files
from tpd.design.job import Job
from tpd.design.stored_design import StoredDesign, read_design

_NAME = "explore.html"
"""Name of the page."""


def run(options: argparse.Namespace) -> int:
    """Write the page and print its path; return the exit status."""
    source: Path = options.source
    subject = Job.read(source) if source.suffix == ".toml" else read_design(source)
    folder = subject.path.parent if isinstance(subject, StoredDesign) else Path()
    out = folder / _NAME if options.out is None else options.out
    # Before the work: a page takes seconds.
    files.claim(out, overwrite=options.overwrite, is_file=True)
    job = subject.job if isinstance(subject, StoredDesign) else subject
    print("\n".join(job.all_messages), end="\n" if job.all_messages else "")
    with terminal.announced(f"computing the orbits and runs of the page {out}"):
        common.set_up_jax(job)
        # JAX must be set up before a module imports it.
        from tpd.explore.page import explore
        from tpd.report.files import add_to

        page = explore(subject)
    print(f"written: {files.place(out, page.html, files.REPORT, overwrite=options.overwrite)}")
    # The last file is the page of the report, and there is none beside a job file.
    if written := add_to(out.parent, page=out.name):
        print(f"linked from: {written[-1]}")
    if options.open and not webbrowser.open(out.resolve().as_uri()):
        print("no browser was found: open the page yourself")
    return terminal.SOUND
