"""Run the benchmarks, list their results, and write the pages and pictures with them.

    python -m tests.benchmarks                 list all benchmarks
    python -m tests.benchmarks NAME ...        run benchmarks, store their results and write the pages
    python -m tests.benchmarks --stale         run those whose modules have changed since, except long ones
    python -m tests.benchmarks --quick NAME ...  run a small size and print the results; store nothing
    python -m tests.benchmarks --draw          write tables and pictures again from the stored results
    python -m tests.benchmarks --mark          mark results as older than the code, and draw the pages again
    python -m tests.benchmarks regret --scenes statue column --spaces own --seeds 0 1    run a part
    python -m tests.benchmarks regret --long   search longer for better designs to compare with

Do not use the machine for other work meanwhile. Each benchmark runs in a process of its own.
"""

import argparse
import datetime
import subprocess
import sys
import time

import jax

jax.config.update("jax_enable_x64", True)

from tests.benchmarks import stored  # noqa: E402


def listed() -> str:
    """Return a line for each benchmark: name, question, and version, date and age of its result."""
    lines = []
    for name in stored.NAMES:
        found = stored.read(name)
        said = "none"
        if found is not None:
            days = (datetime.date.today() - datetime.date.fromisoformat(found.about["date"])).days
            old = ", STALE" if stored.is_stale(name) else ""
            said = f"{found.about['commit']} of {found.about['date']}, {days} days old{old}"
        lines.append(f"{name:12} {said:38} {stored.module(name).QUESTION}")
    return "\n".join(lines)


def main() -> int:
    """Run, list or draw benchmarks; return 1 if a benchmark failed."""
    known = ", ".join(stored.NAMES)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=known)
    parser.add_argument("--stale", action="store_true")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--draw", action="store_true")
    parser.add_argument("--mark", action="store_true")
    parser.add_argument("--long", action="store_true")
    parser.add_argument("--scenes", nargs="+", default=())
    parser.add_argument("--spaces", nargs="+", default=())
    parser.add_argument("--seeds", nargs="+", default=(), type=int)
    asked = parser.parse_args()
    part = {key: value for key in ("scenes", "spaces", "seeds", "long") if (value := getattr(asked, key))}
    if part and asked.names != ["regret"]:
        parser.error(f"--{' and --'.join(part)} can be used only with `regret`, and with no other benchmark")
    names = list(asked.names)
    if unknown := set(names) - set(stored.NAMES):
        parser.error(f"there is no benchmark {', '.join(sorted(unknown))}; there are {known}")
    if asked.stale:
        names += [n for n in stored.NAMES if stored.is_stale(n) and n not in (*stored.LONG, *names)]
    if len(names) == 1:
        begun = time.perf_counter()
        rows = stored.module(names[0]).run(asked.quick, **part)
        if asked.quick:
            print(stored.module(names[0]).table(stored.plain(rows)))
        else:
            stored.store(names[0], rows, time.perf_counter() - begun)
            stored.draw(names)
        print(f"{names[0]}: {time.perf_counter() - begun:.0f} s", file=sys.stderr, flush=True)
        return 0
    failed = []
    for name in names:
        command = [sys.executable, "-m", "tests.benchmarks", name, *(["--quick"] if asked.quick else [])]
        if subprocess.run(command, check=False, cwd=stored.ROOT).returncode:
            failed.append(name)
    if asked.mark:
        print("older than the code:", ", ".join(stored.mark()) or "none")
    if asked.draw or asked.mark:
        stored.draw()
    if not (names or asked.draw or asked.mark):
        print(listed())
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
