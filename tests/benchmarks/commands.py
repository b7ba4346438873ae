"""Measure the time of commands without compiled code, and again with the code that the first call stored."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.benchmarks.stored import ROOT, columns

QUESTION = "How long does a command take, the first time and later?"
MEASURES = "compiled", "models", "design"
SEED = None
PENDULUM = "--mass-ratio 0.03459 --length-ratio 0.10426 --pendulum-damping 0.5981"
COMMANDS = {
    "tpd optimise": "optimise --scene chimney.toml --out design --overwrite",
    "tpd check": f"check --scene chimney.toml {PENDULUM}",
    "tpd response": "response --out response --overwrite",
    "tpd map": "map --x mu 0.01 0.3 --y lam 0.1 1.5 --points 60 --out map --overwrite",
}


def run(quick: bool) -> list[dict[str, Any]]:
    """Run each command with empty folders for compiled code; Python's bytecode is present."""
    rows = []
    for name in list(COMMANDS)[3 if quick else 0 :]:
        with tempfile.TemporaryDirectory() as folder:
            home = Path(folder)
            env = {name: x for name, x in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
            env |= {"HOME": folder, "XDG_CACHE_HOME": folder, "PYTHONPATH": str(ROOT)}
            env["NUMBA_CACHE_DIR"] = f"{home}/numba"

            def call(words: str, env: dict[str, str] = env, home: Path = home) -> float:
                command, begun = [sys.executable, "-m", "tpd", *words.split()], time.perf_counter()
                done = subprocess.run(command, cwd=home, env=env, capture_output=True, text=True)
                if done.returncode not in (0, 3):
                    raise RuntimeError(f"tpd {words}: {done.stderr[-500:]}")
                return time.perf_counter() - begun

            call("new chimney")
            first, *later = (call(COMMANDS[name]) for _ in range(2 if quick else 3))
            rows.append({"command": name, "first": first, "later": min(later)})
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Return the table of times in seconds."""
    return columns(rows, command="`{command}`", **{"first, s": "{first:.1f}", "later, s": "{later:.1f}"})
