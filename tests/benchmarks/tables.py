"""What the benchmarks print and how they take the time."""

import statistics
import sys
import time

import jax


def timed(function, repeats=1):
    """Median seconds of a call."""
    seconds = []
    for _ in range(repeats):
        begun = time.perf_counter()
        jax.block_until_ready(function())
        seconds.append(time.perf_counter() - begun)
    return statistics.median(seconds)


def table(head, rows):
    """A Markdown table."""
    print("\n| " + " | ".join(head) + " |\n" + "|---" * len(head) + "|")
    for row in rows:
        print("| " + " | ".join(str(cell) for cell in row) + " |")
    sys.stdout.flush()
