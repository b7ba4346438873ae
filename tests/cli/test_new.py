"""`tpd new`: templates are complete job files, and nothing is overwritten."""

import io
import re
import tomllib

import pytest

from tests.cli.conftest import call
from tpd.cli import new
from tpd.cli.grammar import TEMPLATES
from tpd.core import files
from tpd.design import job as jobs
from tpd.report import words

EACH = pytest.mark.parametrize("kind", TEMPLATES)
PULSE, RECORD_KEYS = (
    ("pulse", "pulse_frequency", "pga"),
    ("records", "scales", "intensity", "validation_share"),
)
RECORDS = "--records el-centro loma-prieta --scales 2 3"


@EACH
def test_a_written_template_is_a_valid_job(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call("new", kind).out.startswith(f"written: {kind}.toml\nnext: ")
    job = jobs.job_of(jobs.read_tables(tmp_path / f"{kind}.toml"))
    assert jobs.job_of(tomllib.loads(job.toml)) == job
    # None stands for the default conditions around the motion.
    assert job.conditions is None
    assert job.full["project"]["name"]
    # The motion lifts the block, and the comment about it has the right numbers.
    f, limit = job.scene.peak, job.scene.uplift
    assert f > limit
    comment = f"the peak acceleration is {f:.2f} g, above the {limit:.2f} g that lift"
    assert comment in new.template(kind)
    assert words.origin(job.scene).endswith("with the paper's excitation and losses") is (kind == "paper")


@EACH
def test_every_key_has_a_comment_and_optional_keys_have_allowed_values(kind):
    text = new.template(kind)
    motion = text[text.index("[excitation]") : text.index("[bob]")]
    # A job has one kind of motion: the optional keys of the others stay comments.
    complete = text.replace(motion, re.sub("# .*", "", motion))
    complete = re.sub(r"^# (?=\[|\w+ = )", "", complete, flags=re.MULTILINE)
    assert complete.count("\n[") == text.count("\n[") + 2
    assert len(jobs.job_of(tomllib.loads(complete)).conditions) == 18 * 16
    for line in text.splitlines():
        assert re.search(r"  # \w", line) or not re.match(r"(# )?\w+ = ", line), line
        assert len(line) <= 110


@EACH
def test_defaults_in_template_comments_equal_the_defaults_of_the_package(kind):
    text = new.template(kind)
    (line,) = [line for line in text.splitlines() if re.match(r"(# )?restitution = ", line)]
    if line.startswith("# "):
        assert 'default "housner"' in line
        assert jobs.job_of(tomllib.loads(text)).scene.block.restitution == "housner"
    assert "no losses" not in line
    records = re.search(r"# records = (\[.*?\])  # (.*)", text)
    assert len(tomllib.loads(f"x = {records[1]}")["x"]) == 2
    assert records[2] == "two names; a design needs files or folders of 10 earthquakes"


@EACH
def test_template_losses_do_not_depend_on_the_width(kind):
    text = new.template(kind)
    changed = re.sub(
        r"^width = ([\d.]+)", lambda m: f"width = {1.02 * float(m[1]):.4g}", text, flags=re.MULTILINE
    )
    blocks = [jobs.job_of(tomllib.loads(t)).scene.block for t in (text, changed)]
    assert blocks[0].width != blocks[1].width
    assert blocks[0].restitution == blocks[1].restitution
    assert (blocks[0].restitution == 1.0) == (kind == "paper")


@EACH
def test_a_template_accepts_a_pulse_or_records_instead_of_the_harmonic(kind):
    text = new.template(kind)
    motion = text[text.index("[excitation]") : text.index("# [hazard]")]
    optional = [line for line in motion.splitlines() if re.match(r"# \w+ = ", line)]
    assert [line.split()[1] for line in optional] == [*PULSE, *RECORD_KEYS]
    for keys in (PULSE, RECORD_KEYS):
        chosen = "\n".join(line[2:] for line in optional if line.split()[1] in keys)
        job = jobs.job_of(tomllib.loads(text.replace(motion, f"[excitation]\n{chosen}\n")))
        assert job.kind == ("pulse" if keys is PULSE else "records")
        assert len(job.conditions) == len(job.motions) * len(job.conditions.scales)
        assert job.hazard is None


@EACH
def test_the_hazard_of_the_template_fits_the_records(kind):
    text = new.template(kind)
    motion = text[text.index("[excitation]") : text.index("[bob]")]
    lines = [line[2:] for line in motion.splitlines() if re.match(r"# (\w+ = |\[hazard)", line)]
    chosen = "\n".join(line for line in lines if line.split()[0] not in PULSE)
    job = jobs.job_of(tomllib.loads(text.replace(motion, f"[excitation]\n{chosen}\n")))
    assert job.hazard is job.conditions.hazard
    assert job.hazard.measure.unit == "g"
    # The rates in the template are those of the return periods in its comment.
    assert [1.0 / x for x in job.hazard.rates] == pytest.approx([72, 475, 2475], rel=0.02)


@pytest.fixture
def inputs(monkeypatch, tmp_path) -> dict:
    """Return the inputs of the search, which ends at its beginning, in an empty folder."""
    inputs = {}

    def search(problem, progress):
        inputs.update(problem.inputs)
        raise ValueError("the search begins")

    monkeypatch.setattr("tpd.cli.optimise.solve_problem", search)
    monkeypatch.chdir(tmp_path)
    return inputs


@EACH
def test_every_template_accepts_records(kind, inputs, tmp_path):
    text = new.template(kind).replace("gravity = 9.80665", "gravity = 9.79")
    (tmp_path / "mine.toml").write_text(text)
    done = call("optimise --scene mine.toml", RECORDS)
    assert done.err.splitlines()[-1] == "tpd: the search begins"
    job = jobs.job_of(jobs.read_tables(tmp_path / "mine.toml"))
    assert (inputs["scene"].gravity, inputs["scene"].block) == (9.79, job.scene.block)
    assert (inputs["space"], inputs["requirements"]) == (job.space, job.requirements)
    assert {x.name for x in inputs["limits"]} == {x.name for x in job.limits} - {"worsening", "reserve"}


def test_the_scatter_of_a_job_applies_to_the_validation_runs(inputs, tmp_path):
    text = new.template("tower").replace("# [scatter]", "[scatter]").replace("# length = ", "length = ")
    (tmp_path / "tower.toml").write_text(text)
    assert call("optimise --scene tower.toml", RECORDS).status == 2
    assert (inputs["ensemble"].length, inputs["ensemble"].damping) == (0.02, 0.2)


def test_keys_that_contradict_records_are_rejected(inputs, tmp_path):
    (tmp_path / "mine.toml").write_text(new.template("tower"))
    for options, message in (
        (f"{RECORDS} --searches 3", "`search.searches` requires a harmonic motion"),
        ("--records el-centro", "needs `excitation.scales` (--scales)"),
    ):
        done = call("optimise --scene mine.toml", options)
        assert (done.status, len(done.err.splitlines()), inputs) == (2, 1, {})
        assert message in done.err


def test_new_does_not_overwrite_a_file(tmp_path):
    out = tmp_path / "mine.toml"
    assert call("new tower --out", str(out)).status == 0
    assert f"tpd optimise --scene {out}" in out.read_text()
    out.write_text("keep me")
    done = call("new statue --out", str(out))
    assert (done.status, done.out) == (2, "")
    assert done.err == f"tpd: {out} exists and was not changed: choose another file with --out\n"
    assert out.read_text() == "keep me"


def test_a_failed_write_leaves_no_partial_file(tmp_path, monkeypatch):
    class Full(io.FileIO):
        def write(self, _):
            raise OSError(28, "No space left on device")

    (tmp_path / "file").write_text("kept")
    done = call("new tower --out", str(tmp_path / "file" / "job.toml"))
    assert (done.status, done.err) == (2, f"tpd: cannot use {tmp_path}/file/job.toml: Not a directory\n")
    monkeypatch.setattr(files, "open", Full, raising=False)
    job = tmp_path / "new" / "job.toml"
    done = call("new tower --out", str(job))
    assert (done.status, done.err) == (2, f"tpd: cannot use {job}: No space left on device\n")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "kept"
