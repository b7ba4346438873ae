"""Draw the pictures of the guide from the stored results of the benchmarks, without measuring anything.

    .venv/bin/python -m tests.benchmarks.pictures

It writes precision-value.png, precision-gradient.png, bias.png, growth.png and, where `results/proof.json`
exists, proof.png into notebooks/pictures.
"""

import json

from tests.benchmarks import bias, growth
from tests.benchmarks import proof_runs as proof
from tests.benchmarks.precision import __main__ as precision
from tests.benchmarks.precision import chart
from tests.benchmarks.precision.scenes import SCENES


def main() -> None:
    """Draw every picture that has stored results, and name the others."""
    rows, _, _ = precision.stored()
    for kind in ("value", "gradient"):
        path = precision.PICTURES / f"precision-{kind}.png"
        chart.figure(rows, kind, [scene.name for scene in SCENES]).savefig(path, dpi=110)
        print(f"drawn: {path}")
    for benchmark in (bias, growth):
        benchmark.draw(json.loads(benchmark.RESULTS.read_text()), benchmark.PICTURE)
        print(f"drawn: {benchmark.PICTURE}")
    if proof.RESULTS.exists():
        proof.draw(proof.stored(), proof.PICTURE)
        print(f"drawn: {proof.PICTURE}")
    else:
        print(f"not drawn: {proof.PICTURE} has no stored results; `{proof.COMMAND}` measures them")


if __name__ == "__main__":
    main()
