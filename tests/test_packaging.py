"""What is installed: dependencies, licence, and a package that runs from a wheel."""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import version
from pathlib import Path

from tests.measures import ROOT

TOP = ROOT.parent
PROJECT = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))["project"]
BOUNDS = {re.split(r"[<>=]", text)[0]: text for text in PROJECT["dependencies"]}


def numbers(text: str) -> list[int]:
    return [int(x) for x in re.findall(r"\d+", text)]


def test_every_dependency_has_a_lower_bound_that_the_installed_version_keeps():
    low, high = map(numbers, re.fullmatch(r"jax>=([\d.]+),<([\d.]+)", BOUNDS["jax"]).groups())
    assert low == [0, 10]
    assert numbers(version("jax")) < high
    for name, text in BOUNDS.items():
        low = re.search(r">=([\d.]+)", text)
        assert low, text
        assert numbers(version(name)) >= numbers(low[1]), text


def test_the_licence_is_stated_in_metadata_and_pages():
    assert PROJECT["license"] == "BSD-3-Clause"
    (name,) = PROJECT["license-files"]
    text = (TOP / name).read_text(encoding="utf-8")
    assert text.startswith("BSD 3-Clause License\n\nCopyright (c) 2026, the tpd authors\n")
    assert "DISCLAIMED" in text
    assert PROJECT["authors"] == [{"name": "the tpd authors"}]
    assert PROJECT["keywords"]
    assert PROJECT["classifiers"]
    # An expression of a licence allows no classifier of a licence beside it.
    assert not [x for x in PROJECT["classifiers"] if x.startswith("License")]
    assert f"[BSD-3-Clause]({name})" in (TOP / "README.md").read_text(encoding="utf-8")


IN_A_WHEEL = """
import sys
import tpd
from tpd.cli import main
from tpd.compiled.compiling import checksum, compile_beside, sources
assert ".whl" in tpd.__file__
assert [path.suffix for path in sources()] == [".whl"]
compile_beside(None, ("tpd.compiled.run_entry",))
peak = round(float(tpd.records.el_centro().pga), 3)
print(peak, tpd.Scene.__name__, checksum() > 0)
sys.exit(main(["new", "chimney", "--out", sys.argv[1]]))
"""


def test_the_package_can_be_imported_from_a_wheel(tmp_path):
    wheel = tmp_path / "tpd-0.2.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as file:
        for path in sorted(ROOT.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                file.write(path, path.relative_to(TOP))
    # The folder of the tests is not on the import path, which may contain the source of the package.
    call = [sys.executable, "-P", "-c", IN_A_WHEEL, str(tmp_path / "job.toml")]
    done = subprocess.run(
        call, env={**os.environ, "PYTHONPATH": str(wheel)}, cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("3.127 Scene True\nwritten: ")
    assert Path(tmp_path / "job.toml").read_text(encoding="utf-8").startswith("# Masonry chimney")
