"""`tpd record`: description of ground motion records before they are used."""

import numpy as np
import pytest

from tests.cli.conftest import call
from tests.formats.reader import DATA
from tpd import Record
from tpd.records import el_centro
from tpd.records.intensity import spectral_acceleration

SINE = 3.0 * np.sin(2.0 * np.pi * np.arange(201) / 100)
"""Acceleration: two periods of 1 s, m/s^2."""


@pytest.fixture
def table(tmp_path):
    """Return a function that writes the accelerations as a table in a unit and returns its name."""

    def write(unit: str, factor: float = 1.0, name: str = "quake.csv") -> str:
        lines = (f"{0.01 * i:.2f},{factor * a:.6f}" for i, a in enumerate(SINE))
        (tmp_path / name).write_text("\n".join([f"time (s),N ({unit})", *lines, ""]))
        return str(tmp_path / name)

    return write


def test_a_record_is_described_in_a_few_lines_without_a_picture(table, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    done = call("record", table("m/s2"))
    assert (done.status, done.err) == (0, "")
    lines = done.out.splitlines()
    # The file is shown as the message on a table that is not understood shows it.
    assert lines[6:9] == [
        "contents of the file:",
        "  line 1    time (s),N (m/s2)",
        "  line 2    0.00,0.000000",
    ]
    assert lines[9].split()[:5] == ["column", "smallest", "largest", "mean", "step"]
    assert lines[10].split()[:5] == ["1", "0", "2", "1", "0.01"]
    assert len(lines) == 12
    assert lines[0].startswith("record: quake.csv, 201 samples of 0.01 s, 2 s long, PGA 0.3059 g")
    assert "0.3059 g = 3 m/s^2" in lines[1]
    # The velocity begins at zero, so that its peak is twice the amplitude. The base ends at a displacement.
    assert float(lines[2].split()[3]) == pytest.approx(3.0 / np.pi, rel=1e-3)
    assert float(lines[3].split()[3]) == pytest.approx(3.0 / np.pi, rel=1e-3)
    sizes = [spectral_acceleration(Record(SINE.round(6), 0.01), t) / 9.80665 for t in (0.2, 2.0)]
    assert f"{sizes[0]:.4g} g at 0.2 s" in lines[5]
    assert f"{sizes[1]:.4g} g at 2 s" in lines[5]
    assert "warning" not in done.out
    assert [p.name for p in tmp_path.iterdir()] == ["quake.csv"]


@pytest.mark.parametrize(("unit", "shown"), [("g", "3 g"), ("mm/s2", "0.0003059 g")])
def test_an_implausible_pga_gets_a_warning(table, unit, shown):
    done = call("record", table(unit))
    assert done.status == 0
    assert done.out.splitlines()[1] == (
        "warning: the PGA is implausible (usual are 0.001 to 2 g). Check the unit and the samples: "
        f"quake.csv ({shown})"
    )


def test_a_folder_has_a_line_for_each_record_and_lists_files_without_motion(tmp_path):
    done = call("record", str(DATA), "el-centro", out=tmp_path / "out")
    lines = done.out.splitlines()
    assert lines[1].startswith(
        "left out: README.md (no motion); coalinga_1983_cut.V2, channel 1 (UP) (vertical"
    )
    head = next(i for i, line in enumerate(lines) if line.startswith("record "))
    rows = [line for line in lines[head + 1 :] if not line.startswith("written: ")]
    assert len(rows) == 6
    assert "baseline removed" in next(
        row for row in rows if row.startswith("ridgecrest_2019_cut.RAW, channel 0")
    )
    table = done.rows("records.csv")
    assert [row["source"] for row in table] == [row.split("  ")[0] for row in rows]
    assert float(table[-1]["pga_g"]) == pytest.approx(float(el_centro().pga) / 9.80665, rel=1e-12)
    assert {f"record_{i}.png" for i in range(1, 7)} < done.files.keys()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("nothing.csv", "the file does not exist"),
        ("elcentro", "; did you mean `el-centro`?"),
        ("el-centro --dt 0.5", "`excitation.dt` requires a file of a record"),
        (f"{DATA}/coalinga_1983_cut.V2 --channel 7", "the file has the channels 0: 90 DEG"),
        (f"{DATA}/README.md", "README.md"),
    ],
)
def test_invalid_record_input_is_rejected_in_one_sentence(words, message, tmp_path):
    done = call("record", words, out=tmp_path / "out")
    assert (done.status, done.out, done.files) == (2, "", {})
    sentence, *preview = done.err.splitlines()
    assert message in sentence
    # The first lines of a text may follow the sentence.
    assert all(line.startswith("  line ") for line in preview)


def test_the_channels_of_a_file_of_an_agency_are_shown_and_those_of_a_rejected_table(tmp_path):
    done = call("record", str(DATA / "coalinga_1983_cut.V2"))
    shown = done.out.partition("contents of the file:\n")[2].splitlines()
    assert shown[0] == "  channels in m/s^2:"
    assert [line.split()[:2] for line in shown[2:]] == [["0", "90"], ["1", "UP"], ["2", "0"]]
    (tmp_path / "a.csv").write_text("time,aT (g)\n0.00,0.1\n0.01,0.2\n0.02,0.1\n")
    done = call("record", str(tmp_path / "a.csv"))
    assert (done.status, done.out) == (2, "")
    sentence, *shown = done.err.splitlines()
    assert sentence.endswith("; try these options: --columns time=1 'NAME2 (UNIT)=2'")
    assert shown[:2] == ["  line 1    time,aT (g)", "  line 2    0.00,0.1"]


def test_a_file_name_with_dollar_signs_can_be_a_plot_title(table, tmp_path):
    path = tmp_path / "$1_$2.csv"
    table("m/s2", name=path.name)
    # Without a component the name of the file is the title.
    path.write_text(path.read_text().replace(",N (", ",acc ("))
    done = call("record", str(path), out=tmp_path / "out")
    assert (done.status, done.err) == (0, "")
    assert done.files.keys() == {"records.csv", "record_1.png"}
