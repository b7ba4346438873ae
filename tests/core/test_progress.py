"""Progress in a pipe and on a terminal, and what an argument `progress` may be."""

import io
import time

from tpd.core.progress import COMPILING, Bar, bar_for, count_for, unreported


class Terminal(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_progress_in_a_pipe_is_plain_lines_with_stage_count_and_time():
    out = io.StringIO()
    with Bar(out, every=0.0) as bar:
        time.sleep(0.7)
        bar("searching", 0, 64)
        time.sleep(0.7)
        bar("searching", 12, 64)
        time.sleep(0.7)
    lines = out.getvalue().splitlines()
    assert lines[0].startswith(f"tpd: {COMPILING}, ")
    assert lines[0].endswith(" s")
    assert any(line.startswith(f"tpd: searching, {COMPILING} 0 of 64, ") for line in lines)
    assert lines[-1].startswith("tpd: searching 12 of 64, ")
    assert "\r" not in out.getvalue()


def test_short_work_prints_no_progress_to_a_pipe_and_a_bar_to_a_terminal():
    for out in (io.StringIO(), Terminal()):
        with Bar(out) as bar:
            assert (COMPILING in out.getvalue()) == out.isatty()
            bar("searching", 12, 64)
            bar("verifying", 1, 2)
        assert [word in out.getvalue() for word in ("searching", "verifying")] == [out.isatty()] * 2


def test_the_argument_progress_is_true_or_a_function():
    seen = []
    with bar_for(True) as bar, count_for(True, "mapping") as count:
        assert isinstance(bar, Bar)
        count(1, 2)
    with bar_for(lambda *x: seen.append(x)) as report, count_for(seen.append, "mapping") as own:
        report("searching", 1, 2)
        assert own == seen.append
    assert seen == [("searching", 1, 2)]
    for nothing in (None, False):
        with bar_for(nothing) as report, count_for(nothing, "mapping") as count:
            assert report is unreported
            report("searching", 1, 2)
            count(1, 2)
