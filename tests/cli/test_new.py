"""`tpd new`: templates are whole job files, and nothing is overwritten."""

import re
import tomllib

import pytest

from tests.cli.conftest import call
from tpd.cli import new
from tpd.cli.grammar import KINDS
from tpd.design import job as jobs
from tpd.report import words

EACH = pytest.mark.parametrize("kind", KINDS)
PULSE, SHAKEN = ("pulse", "pulse_frequency", "pga"), ("records", "scales", "validation_share")
RECORDS = "--records el-centro loma-prieta --scales 2 3"


@EACH
def test_a_template_is_written_and_read_back_as_a_job(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call("new", kind).out.startswith(f"written: {kind}.toml\nnext: ")
    job = jobs.job_of(jobs.read(tmp_path / f"{kind}.toml"))
    assert jobs.job_of(tomllib.loads(job.toml)) == job
    # None is the neighbourhood of the motion.
    assert job.conditions is None
    assert job.full["project"]["name"]
    # The block lifts, and the comment on it has the right numbers.
    f, limit = job.scene.peak, job.scene.uplift
    assert f > limit
    assert f"with the frequency {f:.2f} g, above the {limit:.2f} g at which" in new.template(kind)
    assert words.origin(job.scene).endswith("with the paper's motion and losses") is (kind == "paper")


@EACH
def test_every_key_has_its_reason_and_those_commented_out_have_allowed_values(kind):
    text = new.template(kind)
    motion = text[text.index("[motion]") : text.index("[bob]")]
    whole = text.replace(motion, re.sub("# .*", "", motion))
    whole = re.sub(r"^# (?=\[|\w+ = )", "", whole, flags=re.MULTILINE)
    assert whole.count("\n[") == text.count("\n[") + 3
    assert len(jobs.job_of(tomllib.loads(whole)).conditions) == 18 * 16
    for line in text.splitlines():
        assert re.search(r"  # \w.{3}", line) or not re.match(r"(# )?\w+ = ", line), line
        assert len(line) <= 110


@EACH
def test_a_pulse_and_records_may_stand_in_place_of_the_harmonic(kind):
    text = new.template(kind)
    motion = text[text.index("[motion]") : text.index("[bob]")]
    own = [line for line in motion.splitlines() if line.startswith("# ")]
    assert [line.split()[1] for line in own] == [*PULSE, *SHAKEN]
    for keys in (PULSE, SHAKEN):
        chosen = "\n".join(line[2:] for line in own if line.split()[1] in keys)
        job = jobs.job_of(tomllib.loads(text.replace(motion, f"[motion]\n{chosen}\n")))
        assert job.kind == ("pulse" if keys is PULSE else "records")
        assert len(job.conditions) == len(job.motions) * len(job.conditions.scales)


@pytest.fixture
def asked(monkeypatch, tmp_path) -> dict:
    """Arguments of a search that is not begun, in an empty folder."""
    given = {}

    def search(problem, progress):
        given.update(problem.inputs)
        raise ValueError("the search begins")

    monkeypatch.setattr("tpd.cli.optimise.solve", search)
    monkeypatch.chdir(tmp_path)
    return given


@EACH
@pytest.mark.mends("a job file of `tpd new` was refused with records: `site.gravity` is for harmonics")
def test_every_template_goes_with_records(kind, asked, tmp_path):
    text = new.template(kind).replace("gravity = 9.80665", "gravity = 9.79")
    (tmp_path / "mine.toml").write_text(text)
    done = call("optimise --scene mine.toml", RECORDS)
    assert done.err.splitlines()[-1] == "tpd: the search begins"
    job = jobs.job_of(jobs.read(tmp_path / "mine.toml"))
    assert (asked["scene"].gravity, asked["scene"].block) == (9.79, job.scene.block)
    assert (asked["space"], asked["requirements"]) == (job.space, job.requirements)
    assert {x.name for x in asked["limits"]} == {x.name for x in job.limits} - {"worsening", "reserve"}


@pytest.mark.mends("widths in the scatter table of a job were refused with records")
def test_the_scatter_of_a_job_is_that_of_the_blocks_that_judge(asked, tmp_path):
    text = new.template("tower").replace("# [scatter]", "[scatter]").replace("# length = ", "length = ")
    (tmp_path / "tower.toml").write_text(text)
    assert call("optimise --scene tower.toml", RECORDS).status == 2
    assert (asked["ensemble"].length, asked["ensemble"].damping) == (0.02, 0.2)


@pytest.mark.mends("what conflicts between a job and records was not said")
def test_what_has_no_effect_on_records_is_named(asked, tmp_path):
    (tmp_path / "mine.toml").write_text(new.template("tower"))
    for options, sentence in (
        (f"{RECORDS} --searches 3", "`search.searches` requires a harmonic motion"),
        ("--records el-centro", "a design for records needs `motion.scales` (--scales)"),
    ):
        done = call("optimise --scene mine.toml", options)
        assert (done.status, len(done.err.splitlines()), asked) == (2, 1, {})
        assert sentence in done.err


def test_a_file_that_exists_is_left_alone(tmp_path):
    out = tmp_path / "mine.toml"
    assert call("new tower --out", str(out)).status == 0
    assert f"tpd optimise --scene {out}" in out.read_text()
    out.write_text("keep me")
    done = call("new statue --out", str(out))
    assert (done.status, done.out) == (2, "")
    assert done.err == f"tpd: {out} exists and is left as it is: name another file with --out\n"
    assert out.read_text() == "keep me"


@pytest.mark.mends("a full disk left half a job file, and a file in place of a folder was said to be the job")
def test_nothing_is_left_of_a_file_that_cannot_be_written(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    (tmp_path / "file").write_text("kept")
    done = call("new tower --out", str(tmp_path / "file" / "job.toml"))
    assert (done.status, done.err) == (2, f"tpd: cannot write {tmp_path}/file/job.toml: Not a directory\n")
    monkeypatch.setattr(new, "template", full)
    done = call("new tower --out", str(tmp_path / "job.toml"))
    assert (done.status, done.err) == (2, f"tpd: cannot write {tmp_path}/job.toml: No space left on device\n")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "kept"
