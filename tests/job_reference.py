"""Write the reference of the job file, `notebooks/guide/job_file.md`, from the tables of its keys.

    .venv/bin/python -m tests.job_reference

`tpd.design.tables` has the keys, and the docstrings of their fields are the descriptions.
"""

from __future__ import annotations

import json
from pathlib import Path

from tpd.design.tables import EXCITATIONS, TABLES, Key, json_schema

PAGE = Path(__file__).parents[1] / "notebooks" / "guide" / "job_file.md"
HEAD = """\
# Job file

*For engineers: after this page you can state every key of a job file.*

This page lists all keys of a job file, as `python -m tests.job_reference` writes them. `tpd new chimney`
writes a job file with comments, and the [tutorial](tutorial.md) shows how to use it.

- **Required keys.** A block that is not the block of the paper needs `width`, `height`, `mass` and an
  excitation. It also needs `cavity_width`, unless `[limits]` has `clearance = false`. All other keys have
  defaults.
- **Options.** An option on the command line replaces the key of the file. If an option states another kind
  of excitation, the keys of the previous kind are removed.
- **Bad input.** A key that has no effect is rejected. A value that is plausible only in another unit is
  rejected with a question, for example a damping ratio above 2 or a base acceleration above 10 g.
- **Editors** can complete and check a job file with the schema `job.schema.json` in `tpd/design`.

Units are m, kg, s, Hz and rad.
"""
NOTES = {
    "project": "Words for titles.",
    "block": "The structure. [What to measure](measuring.md) explains how to find the values.",
    "frame": "A [frame](cavity.md) above the block instead of a cavity. Its mass belongs to the block.",
    "excitation": "The motion of the base. [Which excitation?](excitation.md) explains the choice.",
    "records": "Facts about [records](records.md) that their files do not state.",
    "hazard": "The seismic hazard of the site, from which annual rates of overturning follow.",
    "bob": "The bob as built. [Cavity, hinge and top](cavity.md) explains the choice.",
    "site": "Place of the structure.",
    "space": "Bounds of the search, for the equivalent point mass.",
    "conditions": "Excitations for which the design must work ([many conditions](many_conditions.md)).",
    "scatter": "Uncertain quantities in the search: relative half width of each.",
    "starts": "Initial states in the search.",
    "limits": "[Limits](validation.md#limits) of the design. `false` removes a limit.",
    "alternatives": "Measures without a pendulum, which the answer compares.",
    "requirements": "Requirements for a recommendation ([validation](validation.md#validation)).",
    "search": "Settings of the [first stage](stages.md#three-stages).",
    "ensemble": "The [validation runs](validation.md#what-a-run-is), and uncertain quantities in these runs.",
}
"""First sentences of the sections, by table."""


def default_of(key: Key) -> str:
    """Default of a key as in a file, with the kinds of excitation for which it is different."""
    values = [(value, f" ({kind})" * (key.kinds != (kind,))) for kind, value in key.defaults.items()]
    # A key of one kind of excitation has one default.
    if key.default is not None and (not key.kinds or key.defaults.keys() != set(key.kinds)):
        values.insert(0, (key.default, ""))
    return ", ".join(f"{json.dumps(value)}{kind}" for value, kind in values)


def text() -> str:
    """The whole page."""
    lines, tables = [HEAD], json.loads(json_schema())["properties"]
    for table, keys in TABLES.items():
        lines += [f"## `[{table}]`", "", NOTES[table], "", "| key | description | option | default |"]
        lines += ["|---|---|---|---|"]
        for name, key in keys.items():
            properties = tables[table]["properties"][name]
            needs = [" or ".join(EXCITATIONS[kind] for kind in key.kinds), key.need.words]
            only = " and ".join(filter(None, needs))
            said = properties["description"].replace("|", "\\|") + f" *Only with {only}.*" * bool(only)
            option = f"`{properties['option']}`" if "option" in properties else ""
            # A block without a size is the paper's, whose numbers are no defaults of another block.
            default = "required" if key.is_required else default_of(key)
            lines += [f"| `{name}` | {said} | {option} | {default} |"]
        lines += [""]
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(text(), encoding="utf-8")
