"""Files of a command: numbers before pictures, and one message for a picture that cannot be drawn."""

from matplotlib.figure import Figure

from tpd.cli import outputs


def test_numbers_are_written_before_pictures_and_a_failed_picture_gets_one_message(tmp_path, capsys):
    def fails():
        assert (tmp_path / "a.csv").read_text() == "1\n"
        raise ValueError("no colours")

    def draws():
        return Figure().subplots()

    outputs.write(
        tmp_path,
        [("a.csv", "1\n")],
        {"b.png": fails, "c.png": draws, "d.gif": lambda: b"GIF"},
        overwrite=False,
    )
    out, err = capsys.readouterr()
    assert out.splitlines() == [f"written: {tmp_path / name}" for name in ("a.csv", "c.png", "d.gif")]
    assert err == "tpd: b.png is not drawn: no colours\n"
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")
