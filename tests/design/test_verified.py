"""Statuses and typed reasons: a sentence for every kind, with its numbers and the condition."""

import pytest

from tpd.design.verified import ANSWERS, DesignStatus, Reason, ReasonKind, Step

SENTENCES = {
    ReasonKind.overturns: (
        {"step": Step.nonlinear},
        "by the nonlinear equations the block overturns from rest, or has no answer, and stands without the "
        "pendulum",
    ),
    ReasonKind.overturns_more: (
        {"step": Step.benefit, "value": 19.0, "reference": 3.0, "total": 64},
        "by the paired runs of the nonlinear equations the block overturns in 19 of 64 cases with the "
        "pendulum only, and in 3 without it only at 2.5 Hz",
    ),
    ReasonKind.breaks_limit: (
        {"step": Step.nonlinear, "limit": "offset", "value": 1.0364},
        "by the nonlinear equations the design exceeds the limit on offset by 0.036 of it at 2.5 Hz",
    ),
    ReasonKind.as_built: (
        {"step": Step.exact, "limit": "mass of the bob in kg", "value": 554.2, "reference": 500.0},
        "as built, the mass of the bob in kg is 554.2, and the limit is 500",
    ),
    ReasonKind.rocks_more: (
        {"step": Step.nonlinear, "value": 0.3568, "reference": 0.3361},
        "by the nonlinear equations the block tilts from rest to 35.7% of the slenderness, and to 33.6% "
        "without the pendulum",
    ),
    ReasonKind.too_little_benefit: (
        {"step": Step.benefit, "value": 0.034, "low": -0.01, "reference": 0.1},
        "by the paired runs of the nonlinear equations the mean tilt falls by 3.4% (at least -1.0% with 95 % "
        "confidence), and 10.0% is asked for",
    ),
    ReasonKind.rests_less: (
        {"step": Step.benefit, "value": 3.0, "reference": 19.0, "total": 64},
        "by the paired runs of the nonlinear equations the block ends at rest in 3 of 64 cases with the "
        "pendulum, and in 19 without it; 10% fewer are allowed",
    ),
    ReasonKind.worse_condition: (
        {"step": Step.benefit, "value": 0.3, "reference": 0.2, "total": 3},
        "by the paired runs of the nonlinear equations the mean tilt is 30.0% of the slenderness with the "
        "pendulum, and 20.0% without it at 2.5 Hz, and 2 other conditions are worse",
    ),
    ReasonKind.undecided: (
        {"step": Step.benefit, "value": 3.0, "total": 64},
        "by the paired runs of the nonlinear equations 3 of 64 cases have no answer, and the verdict hangs "
        "on it",
    ),
    ReasonKind.strikes: (
        {"step": Step.benefit, "value": 0.03, "reference": 0.01},
        "by the paired runs of the nonlinear equations the bob strikes a wall in 3.0% of the cases, and 1.0% "
        "is allowed",
    ),
}


@pytest.mark.parametrize("kind", ReasonKind)
def test_a_reason_makes_a_sentence(kind):
    given, sentence = SENTENCES[kind]
    assert str(Reason(kind=kind, condition="2.5 Hz", **given)) == sentence
    assert "2.5 Hz" not in str(Reason(kind=kind, **given))


@pytest.mark.parametrize(
    ("kind", "given", "missed"),
    [
        ("strikes", {"value": 0.27, "reference": 0.01}, 0.26),
        ("overturns_more", {"value": 30.0, "reference": 10.0, "total": 40}, 0.5),
        ("rests_less", {"value": 10.0, "reference": 30.0, "total": 40}, 0.425),
        ("worse_condition", {"value": 0.4, "reference": 0.3, "total": 2}, 0.1),
        ("breaks_limit", {"value": 1.2}, 0.2),
        ("as_built", {"value": 600.0, "reference": 500.0}, 0.2),
        ("rocks_more", {"value": 0.3, "reference": 0.2}, 0.5),
        ("overturns", {}, 1.0),
        # By what is asked for, or by what may be luck.
        ("too_little_benefit", {"value": 0.08, "low": 0.02, "reference": 0.1}, 0.02),
        ("too_little_benefit", {"value": 0.2, "low": -0.05, "reference": 0.1}, 0.05),
        ("too_little_benefit", {"value": -0.1, "low": -0.3, "reference": 0.1}, 0.3),
    ],
)
def test_by_how_much_a_requirement_is_missed(kind, given, missed):
    reason = Reason(step=Step.benefit, kind=ReasonKind[kind], **given)
    assert reason.shortfall == pytest.approx(missed)


def test_only_a_verified_design_or_none_needed_is_sound_and_every_status_has_a_remedy():
    sound = {status for status in DesignStatus if status.is_sound}
    assert sound == {DesignStatus.found, DesignStatus.no_uplift}
    assert all(status.remedy.endswith(".") for status in DesignStatus)
    # An answer opens with a sentence, a descent ends with words.
    assert all(s.value[:2].isupper() is (s.name in ANSWERS) for s in DesignStatus)
    assert all(s.value[0].islower() for s in (*DesignStatus,)[len(ANSWERS) :])
