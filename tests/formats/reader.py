"""Checks that every reader has to pass: what is written is read, and damaged files are refused in one
sentence, or read to the same numbers if nothing that is read is touched."""

from __future__ import annotations

import gzip
import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.formats.synthetic import FORMATS, Format, shaking
from tpd import Record
from tpd.formats.text import NUMBER, UnreadableRecord

DATA = Path(__file__).parent / "data"
PACKAGED = Path(__file__).parents[2] / "tpd" / "records" / "data"
FORM = {form.name: form for form in FORMATS}
DAMAGES = 40
RUBBISH = ("abc", "NaN", "nan", "inf", "1e30", "-1e30", "****", "--", "1.2.3", "0x1F", "")


def read(folder: Path, text: str | bytes, name: str = "a.txt", **how) -> Record:
    """The record of a file of that content."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return Record.read(path, **how)


def check_what_is_written(form: Format, folder: Path) -> None:
    """Whatever the numbers and the name of the file, they are read digit by digit."""

    @settings(max_examples=25, deadline=None)
    @given(data=st.data())
    def check(data):
        dt = data.draw(st.sampled_from((0.005, 0.01, 0.02)), label="dt")
        seconds = data.draw(st.integers(1, 2), label="seconds")
        n = round(seconds / dt) if form.name == "knet" else data.draw(st.integers(2, 60), label="n")
        unit = st.floats(-1.0, 1.0, allow_nan=False).map(lambda x: round(x, 7))
        few = data.draw(st.lists(unit, min_size=2, max_size=12), label="values")
        printed = form.printed(form.size * np.resize(few, n))
        path = folder / "record.bin"
        path.write_text(form.write(printed, dt), newline="")
        record = Record.read_all(path, baseline="none")[0]
        assert abs(record.dt / dt - 1.0) < 1e-14
        np.testing.assert_allclose(record.acceleration, np.array(printed) * form.factor, rtol=1e-15)

    check()


@dataclass
class File:
    """A sound file, and another of the same shape."""

    name: str
    text: str
    other: str

    @property
    def first(self) -> int:
        """The line of the first sample, from 0: the first one of the longest run of lines of numbers only."""
        lines = self.text.splitlines()
        plain = [bool(line.strip()) and not re.sub(rf"{NUMBER}|[\s,]", "", line) for line in lines]
        ends = [-1, *(i for i, here in enumerate([*plain, False]) if not here)]
        return max(pairwise(ends), key=lambda run: run[1] - run[0])[0] + 1


def real(name: str) -> File:
    """A file of an agency, from the tests or from the package."""
    path = next(p for p in (DATA / name, PACKAGED / name) if p.exists())
    data = path.read_bytes()
    text = (gzip.decompress(data) if name.endswith(".gz") else data).decode("ascii")
    return File(name.removesuffix(".gz"), text, text)


def written(form: Format) -> File:
    """A file of a format."""
    return File(form.name, *(form.write(form.size * shaking(100, seed), 0.01) for seed in (0, 1)))


def check(folder: Path, *names: str) -> None:
    """Both checks for each format, and that of damages for each file of an agency."""
    for name in names:
        if name in FORM:
            check_what_is_written(FORM[name], folder)
        check_damaged(written(FORM[name]) if name in FORM else real(name), folder)


# A table states no number of rows: rows lost at its ends, or anywhere in a column, are not seen.
TABLES = ("table", "column")


def cut(file: File, rng: np.random.Generator) -> str:
    """End somewhere; a table in the middle of a row."""
    while True:
        text = file.text[: int(rng.integers(0, len(file.text.rstrip("\x1a\r\n"))))]
        if file.name not in TABLES or not text.endswith("\n"):
            return text


def lose_lines(file: File, rng: np.random.Generator) -> str:
    lines = file.text.splitlines(keepends=True)
    low, high = 0, len(lines) - 3
    if file.name == "table":
        low = file.first + 1
    if file.name == "column":
        high = 1
    at = int(rng.integers(low, high))
    count = 1 if file.name in TABLES else int(rng.integers(1, 4))
    return "".join(lines[:at] + lines[at + count :])


def _instead(text: str, one: re.Match[str], i: int, new: str) -> str:
    """The text with a group of a match replaced by something of the same width, if it fits."""
    return text[: one.start(i)] + new.rjust(one.end(i) - one.start(i)) + text[one.end(i) :]


def spoil_a_number(file: File, rng: np.random.Generator) -> str:
    """Rubbish instead of a number, of the header or of a sample."""
    lines = file.text.splitlines(keepends=True)
    first, last = (0, max(1, file.first)) if rng.random() < 0.5 else (file.first, len(lines) - 2)
    at = int(rng.integers(first, last))
    places = list(re.finditer(NUMBER, lines[at]))
    if places:
        new = str(rng.choice(RUBBISH if first else [word for word in RUBBISH if word]))
        lines[at] = _instead(lines[at], places[int(rng.integers(len(places)))], 0, new)
    return "".join(lines)


def remove_the_unit(file: File, rng: np.random.Generator) -> str:
    units = r"cm/sec/sec|cm/sec2|cm/s\^2|mm/s/s|m/s\^2|\(gal\)|\(g\)|units of g\b|sec and g\b"
    places = list(re.finditer(units, file.text, flags=re.IGNORECASE))
    if not places:
        return file.text
    new = str(rng.choice(["", "?", "furlong", "V", "counts"]))
    return _instead(file.text, places[int(rng.integers(len(places)))], 0, new)


def change_the_step(file: File, rng: np.random.Generator) -> str:
    """Another step in one place; where a format states it once, only nonsense can be seen."""
    head = "".join(file.text.splitlines(keepends=True)[: file.first])
    patterns = r"DT=\s*([\d.]+)|dt = ([\d.]+)|INTERVAL_S: ([\d.]+)|at ([\d.]+) sec inter|of\s+([\d.]+) +s"
    patterns += r"|(0\.2000000E\+03|1\.0000000E\+02)|at (\d+) pts|at (\d+) samples|(\d+)Hz|apart at +([\d.]+)"
    places = list(re.finditer(patterns, head, flags=re.IGNORECASE | re.MULTILINE))
    if not places:
        return file.text
    one = places[int(rng.integers(len(places)))]
    i = next(i for i, group in enumerate(one.groups(), 1) if group)
    wrong = ["0", "-1", "nan", "1e9", "x"]
    if file.name not in ("peer", "column"):
        wrong += [f"{2 * float(one[i]):g}", f"{0.5 * float(one[i]):g}"]
    return _instead(file.text, one, i, str(rng.choice(wrong)))


def mix_two(file: File, rng: np.random.Generator) -> str:
    """Lines of another file, or of another place of the same, among the samples."""
    lines, others = file.text.splitlines(keepends=True), file.other.splitlines(keepends=True)
    low = file.first + 1
    start = int(rng.integers(low, len(lines) - 4))
    count = int(rng.integers(1, 9))
    at = int(rng.integers(low, len(lines) - 3))
    if file.name == "column":
        # Rows of another table with times, which a column has not.
        others = [f"0.01,{line}" for line in others]
    return "".join(lines[:at] + others[start : start + count] + lines[at:])


def rubbish(file: File, rng: np.random.Generator) -> str:
    """Bytes of no text somewhere."""
    at = int(rng.integers(0, len(file.text)))
    noise = "".join(chr(int(c)) for c in rng.integers(0, 32, size=4) if chr(int(c)) not in "\t\n\r\f\v\x1a")
    return file.text[:at] + noise + "\x00" + file.text[at:]


KINDS = cut, lose_lines, spoil_a_number, remove_the_unit, change_the_step, mix_two, rubbish


def numbers(path: Path) -> list[tuple[float, list[float]]]:
    """Steps and samples of all records of a file."""
    return [(record.dt, record.acceleration.tolist()) for record in Record.read_all(path, baseline="none")]


def check_damaged(file: File, folder: Path) -> None:
    """No damage of any kind is half read, and at least half of them are refused."""
    path = folder / "record.txt"
    path.write_text(file.text, newline="")
    sound = numbers(path)
    seed = damaged = refused = 0
    while damaged < DAMAGES:
        seed += 1
        kind = KINDS[seed % len(KINDS)]
        text = kind(file, np.random.default_rng(seed))
        if text == file.text:
            # The format has nothing of this kind.
            continue
        damaged += 1
        path.write_text(text, newline="", encoding="utf-8")
        try:
            read = numbers(path)
        except UnreadableRecord as error:
            # What the file contains may follow the sentence.
            said, *preview = str(error).split("\n")
            assert said.startswith("record.txt: ")
            assert all(line.startswith("  ") for line in preview)
            assert len(said) < 300
            refused += 1
        else:
            assert read == sound, (file.name, kind.__name__, seed)
    assert refused >= 0.5 * DAMAGES, (file.name, refused)
