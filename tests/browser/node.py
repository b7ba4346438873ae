"""Run the modules of the page in Node.js, without a page."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

import tpd

MODULES = Path(tpd.__file__).parent / "explore"
needs_node = pytest.mark.skipif(
    shutil.which("node") is None, reason="needs Node.js (Debian: apt-get install nodejs)"
)


def run(module: str, names: str, function: str, inputs: Any) -> Any:
    """Return what a function in JavaScript makes of inputs; some names of a module are imported.

    Args:
        module: name of the module in `tpd/explore`.
        names: what it exports, with commas.
        function: in JavaScript, of the inputs.
        inputs: anything that JSON can hold. Numbers that JSON does not have come back as None.
    """
    path = (MODULES / f"{module}.mjs").as_uri()
    script = f"""
import {{ readFileSync }} from "node:fs";
import {{ {names} }} from "{path}";
const answer = ({function})(JSON.parse(readFileSync(0, "utf8")));
process.stdout.write(JSON.stringify(answer));
"""
    command = ["node", "--input-type=module", "--eval", script]
    done = subprocess.run(command, input=json.dumps(inputs), capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
