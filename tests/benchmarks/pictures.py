"""Draw the pictures of the guide from the stored results of the benchmarks, without measuring anything.

    .venv/bin/python -m tests.benchmarks.pictures

It writes precision-value.png and precision-gradient.png, with -all.png beside each, bias.png,
bias-impacts.png, growth.png and, where `results/proof.json` exists, proof.png into notebooks/pictures.
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
    for path in chart.save(rows, [scene.name for scene in SCENES], precision.PICTURES):
        print(f"drawn: {path}")
    for benchmark in (bias, growth):
        benchmark.draw(json.loads(benchmark.RESULTS.read_text()), benchmark.PICTURE)
        print(f"drawn: {benchmark.PICTURE}")
    bias.draw_impacts(json.loads(bias.RESULTS.read_text())["impacts"], bias.PICTURE_OF_IMPACTS)
    print(f"drawn: {bias.PICTURE_OF_IMPACTS}")
    if proof.RESULTS.exists():
        proof.draw(proof.stored(), proof.PICTURE)
        print(f"drawn: {proof.PICTURE}")
    else:
        print(f"not drawn: {proof.PICTURE} has no stored results; `{proof.COMMAND}` measures them")


if __name__ == "__main__":
    main()
