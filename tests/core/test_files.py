"""Output files: whole or absent, not overwritten; tables, JSON and the date of a report."""

import errno
import io
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest

from tpd.cli import outputs
from tpd.core import files


def test_a_file_is_written_completely_or_not_at_all(tmp_path, monkeypatch):
    path = files.place(tmp_path / "a" / "b.txt", "first")
    assert path.read_text() == "first"
    assert path.stat().st_mode & 0o777 == 0o644

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(type(path), "replace", full)
    with pytest.raises(OSError, match="No space left"):
        files.place(path, "second")
    assert [p.name for p in path.parent.iterdir()] == ["b.txt"]
    assert path.read_text() == "first"


def test_a_directory_with_files_is_overwritten_only_on_request(tmp_path):
    out = tmp_path / "out"
    files.claim(out, overwrite=False)
    files.place(out / f"{files._PART}x", "left by a run that was killed")
    files.claim(out, overwrite=False)
    files.place(out / "design.json", "{}")
    with pytest.raises(ValueError, match=r"already contains files: choose another directory with --out"):
        files.claim(out, overwrite=False)
    files.claim(out, overwrite=True)
    with pytest.raises(ValueError, match=r"design.json is a file, not a directory"):
        files.claim(out / "design.json", overwrite=True)
    with pytest.raises(ValueError, match="cannot write to"):
        files.claim(out / "design.json" / "below", overwrite=True)


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners of files here")
def test_a_folder_of_compiled_code_is_private_to_the_user(tmp_path):
    store = tmp_path / "home" / ".cache" / "tpd" / "compiled"
    before = os.umask(0o002)
    try:
        files.check_own(store)
    finally:
        os.umask(before)
    assert store.stat().st_mode & 0o777 == 0o700


def test_infinite_and_missing_numbers_are_words_in_json_and_empty_in_csv():
    found = json.loads(files.as_json({"b": [math.inf, math.nan], "a": (1.5, {"x": -math.inf})}))
    assert found == {"a": [1.5, {"x": "-infinite"}], "b": ["infinite", "nan"]}
    table = files.as_table({"x": np.array([0.1, np.nan]), "word": np.array(["a,b", "c"])})
    assert table == 'x,word\n0.1,"a,b"\n,c\n'


def test_a_table_has_empty_cells_for_missing_numbers_and_no_lists():
    rows = [(math.nan, ["first note", "second"], 1), (np.float64("nan"), [], None), (math.inf, ("x",), "y")]
    assert files.as_csv(["a", "b", "c"], rows) == "a,b,c\n,first note; second,1\n,,\ninf,x,y\n"
    # A spreadsheet would evaluate these names of files.
    names = ["=1+1.csv", "@a", "-b", "+c", "d-e"]
    assert files.as_csv(["x"], [[x] for x in names]) == "x\n'=1+1.csv\n'@a\n'-b\n'+c\nd-e\n"


def test_the_date_of_a_report_can_be_set_by_the_environment(monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    assert files.today() == "2023-11-14"
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    assert len(files.today()) == 10
    for bad in ("soon", "1e400", "9" * 30):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", bad)
        with pytest.raises(ValueError, match="`SOURCE_DATE_EPOCH` must be a whole number of seconds"):
            files.today()


class Small(io.FileIO):
    """A file on a disk with space for some bytes, which count over all files."""

    space = 0

    def write(self, data):
        Small.space -= len(data)
        if Small.space < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


@pytest.mark.parametrize("space", [0, 100, 500, 700])
def test_a_full_disk_leaves_no_part_of_a_result(tmp_path, monkeypatch, space):
    (tmp_path / "mine.txt").write_text("keep me")
    monkeypatch.setattr(files, "open", Small, raising=False)
    tables = [("a.csv", "x" * 100), ("b.json", "x" * 200)]
    for out in (tmp_path / "new" / "out", tmp_path):
        Small.space = space
        with pytest.raises(OSError, match="No space left") as refused:
            outputs.write(out, tables, {"c.png": lambda: b"x" * 400}, overwrite=True)
        assert Path(refused.value.filename).parent == out
        assert [p.name for p in tmp_path.iterdir()] == ["mine.txt"]
    Small.space = 10_000
    outputs.write(tmp_path / "new" / "out", tables, {"c.png": lambda: b"x" * 400}, overwrite=True)
    assert {p.name for p in (tmp_path / "new" / "out").glob("[!.]*")} == {"a.csv", "b.json", "c.png"}


def test_files_of_an_earlier_result_are_removed_and_other_files_are_reported(tmp_path, capsys):
    def write(main, *pictures):
        pictures = dict.fromkeys(pictures, lambda: b"picture")
        outputs.write(tmp_path, [(main, "1\n")], pictures, overwrite=True)
        return capsys.readouterr().err

    assert write("a.json", "a.png", "b.png", "c.png") == ""
    (tmp_path / "mine.txt").write_text("keep me")
    (tmp_path / "c.png").write_bytes(b"changed by a user")
    assert write("other.json", "d.png").count("a.json, a.png, b.png, c.png, mine.txt") == 1
    # A result replaces only results of its kind, and a file that a user has changed is not removed.
    err = write("a.json", "a.png")
    assert err.endswith("contains files that are not of this run: c.png, d.png, mine.txt, other.json\n")
    files.claim(tmp_path, overwrite=True)
    assert (tmp_path / "c.png").read_bytes() == b"changed by a user"
    # A damaged list, or one from elsewhere, removes nothing outside of the folder.
    outside = tmp_path.parent / "outside.txt"
    outside.write_text("1\n")
    listed = json.loads((tmp_path / files._LIST).read_text())
    listed["../outside.txt"] = listed["a.json"]
    (tmp_path / files._LIST).write_text(json.dumps(listed))
    write("a.json")
    assert outside.exists()
    assert not (tmp_path / "a.png").exists()
    (tmp_path / files._LIST).write_text("no list")
    assert "d.png" in write("a.json")


@pytest.mark.parametrize("is_file", [False, True])
def test_a_path_that_cannot_exist_is_rejected_before_the_work(tmp_path, is_file):
    (tmp_path / "file").write_text("")
    long = "x" * 300
    reasons = {long: "name too long", "file/a": "Not a directory", f"new/{long}": "name too long"}
    for path, reason in reasons.items():
        with pytest.raises(ValueError, match=f"cannot write to .*{reason}"):
            files.claim(tmp_path / path, overwrite=True, is_file=is_file)
        with pytest.raises(OSError, match=reason) as refused:
            files.place(tmp_path / path, "content")
        assert refused.value.filename == str(tmp_path / path)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_results_that_appear_during_the_work_are_not_replaced(tmp_path):
    out, file, link = (tmp_path / name for name in ("out", "model.xml", "link"))
    files.claim(out, overwrite=False)
    outputs.write(out, [("a.json", "first")], {}, overwrite=False)
    for name in ("a.json", "b.json"):
        with pytest.raises(ValueError, match="out already contains files: choose another directory"):
            outputs.write(out, [(name, "second")], {}, overwrite=False)
    assert [(x.name, x.read_text()) for x in out.glob("[!.]*")] == [("a.json", "first")]
    # Without its files the folder is free again, although their list remains.
    (out / "a.json").unlink()
    files.claim(out, overwrite=False)
    outputs.write(out, [("b.json", "third")], {}, overwrite=False)
    files.claim(file, overwrite=False, is_file=True)
    file.write_text("first")
    link.symlink_to(tmp_path / "nothing")
    for path in (file, link):
        with pytest.raises(ValueError, match="exists already: choose another name with --out"):
            files.claim(path, overwrite=False, is_file=True)
        with pytest.raises(ValueError, match="exists already: choose another name with --out"):
            files.place(path, "second", overwrite=False)
    assert file.read_text() == "first"
    assert not link.exists()
    # A name that exists is meant, whatever its characters are.
    (tmp_path / "a\nb").write_text("")
    assert files.path_of(tmp_path / "a\nb").exists()


def test_a_full_disk_and_a_dangling_link_are_reported_before_the_work(tmp_path, monkeypatch):
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    with pytest.raises(ValueError, match="link is a file, not a directory"):
        files.claim(tmp_path / "link", overwrite=True)

    class Full(io.BytesIO):
        def write(self, _):
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files.tempfile, "TemporaryFile", lambda **_: Full())
    with pytest.raises(ValueError, match=r"cannot write to .*out: No space left on device"):
        files.claim(tmp_path / "out", overwrite=False)


def test_a_tilde_in_a_path_is_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert files.path_of("~/größe") == tmp_path / "größe"
    assert files.path_of(Path("~")) == tmp_path
    # Of a user that there is not nothing is known.
    for plain in ("~nobody.of.this.name/a", "a/~", "a~"):
        assert files.path_of(plain) == Path(plain)


def test_file_names_in_any_encoding_are_written_as_utf_8(tmp_path):
    # As Python reads the names under a locale without these letters, and one that is not in UTF-8.
    ours, others = os.fsencode("größe").decode("ascii", "surrogateescape"), "\udcfc"
    assert files.readable(ours) == "größe"
    assert files.place(tmp_path / "a", f"{ours} {others}").read_text(encoding="utf-8") == "größe ?"
    assert json.loads(files.as_json({"event": ours})) == {"event": "größe"}
