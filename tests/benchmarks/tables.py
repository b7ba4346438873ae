"""Tables that the benchmarks print, results that they store, and times that they take."""

import json
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


def compact(content):
    """JSON of a dictionary of results with one line for each record of a list or entry of a table."""
    parts = [f"{json.dumps(key)}: {_records(value)}" for key, value in content.items()]
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _records(value):
    if isinstance(value, dict):
        lines = [f"{json.dumps(key)}: {_line(of)}" for key, of in value.items()]
        return "{\n" + ",\n".join(lines) + "\n}" if lines else "{}"
    if isinstance(value, list) and any(isinstance(of, dict | list | str) for of in value):
        return "[\n" + ",\n".join(map(_line, value)) + "\n]"
    return _line(value)


def _line(value):
    # NaN and infinity are no JSON: whoever calls has replaced them.
    return json.dumps(value, allow_nan=False)
