"""Runs the tests of mended faults on the package as it was before, and sees each of them fail.

    .venv/bin/python -m tests.benchmarks.mended

Such a test carries the mark `mends("what was wrong")`. The package of the revision BEFORE is put in front of
the present one, with the present tests. Exits with 1 if a marked test passes there, or none is run. Tests
that fail by a name that was not there yet are listed: they show less than those that fail by an assertion.
Needs the project's history.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
BEFORE = "9c7ee10"
"""Last revision with all the faults."""
NEW = ("ImportError", "ModuleNotFoundError", "AttributeError", "NameError", "TypeError")
"""Errors of a test that asks for what was not there yet."""


def main(arguments: list[str] | None = None) -> int:
    """Print the marked tests that pass on the former package; return their number, 1 at most."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--before", default=BEFORE, help="revision of the package (default %(default)s)")
    parser.add_argument("tests", nargs="*", default=["tests"], help="files to look in (default: all)")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(
            ["git", "-C", ROOT, "archive", options.before, "tpd"], check=True, capture_output=True
        )
        subprocess.run(["tar", "-x", "-C", folder], input=archive.stdout, check=True)
        for name in ("tests", "notebooks", "README.md", "pyproject.toml"):
            Path(folder, name).symlink_to(ROOT / name)
        # The marked tests alone, each to its end; those that are slow as well.
        command = [sys.executable, "-m", "pytest", "-m", "mends", "-n", "2", "-q", "-rpfE", "--no-header"]
        done = subprocess.run(
            [*command, "--tb=no", *options.tests],
            cwd=folder,
            # In narrow terminals pytest leaves out the reasons.
            env={**os.environ, "PYTHONPATH": folder, "COLUMNS": "500"},
            capture_output=True,
            text=True,
        )
    lines = done.stdout.splitlines()
    passed = [line for line in lines if line.startswith("PASSED")]
    weak = [line for line in lines if line.startswith("ERROR") or line.partition(" - ")[2].startswith(NEW)]
    if done.returncode not in (0, 1):
        print(done.stdout[-2000:].strip() or "none was run")
        return 1
    print(lines[-1])
    if weak:
        print("\n".join(["fail by a new name, or before they begin:", *weak]))
    print("\n".join(passed) or "every one of them fails without its mend")
    return 1 if passed else 0


if __name__ == "__main__":
    sys.exit(main())
