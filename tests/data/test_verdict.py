"""Verdicts: what reasons come to, as text, as plain values and of several results together."""

import json

import pytest
from synthetic import DOUBTFUL, LATE, TRUSTED, TURNED, WORSE, WRONG

from strapdown.data.verdict import Reason, SetUpBound, Untested, Verdict, together

pytestmark = pytest.mark.short


GEOID = Untested(
    "height above the geoid", "one source", "record a barometer", ("height",), "height"
)
BRIEF = Untested("innovations", "fewer than 20 fixes")
ARM = SetUpBound("lever arm", "lever arm of gnss", 0.512, "m", "down")


def test_the_weightiest_reason_decides_and_is_said_first():
    assert (TRUSTED.word, DOUBTFUL.word, WRONG.word) == ("trusted", "doubtful", "not to be trusted")
    assert [verdict.trusted for verdict in (TRUSTED, DOUBTFUL, WRONG)] == [True, False, False]
    assert WRONG.reasons == (TURNED, LATE, WORSE)
    assert WRONG.line.startswith("not to be trusted: axes of the IMU: the course is 89.7 deg")
    assert "time stamps of gnss velocity: innovations" in str(WRONG)
    assert Verdict.of([LATE._replace(weight=0.9)]).trusted


def test_plain_values_and_back():
    assert Verdict.from_dict(WRONG.as_dict()) == WRONG
    limited = Verdict.of([LATE], [BRIEF, GEOID], bounds=[ARM])
    assert Verdict.from_dict(json.loads(json.dumps(limited.as_dict()))) == limited
    with pytest.raises(ValueError, match="good"):
        Verdict.from_dict({"word": "good", "reasons": [], "untested": [], "bounds": []})
    assert Reason("new cause", "", "").what == "new cause"  # of a later version


def test_results_that_agree_are_said_together_the_gravest_first():
    lighter = LATE._replace(weight=3.5, seen="less")
    verdicts = {
        "a": TRUSTED,
        "b": Verdict.of([lighter, WORSE], [BRIEF]),
        "c": Verdict.of([LATE], [GEOID]),
        "d": DOUBTFUL,
    }
    (first, wrong), (second, doubtful), (third, right) = together(verdicts)
    assert (first, second, third) == (["b", "c"], ["d"], ["a"])
    assert wrong == Verdict("not to be trusted", (LATE, WORSE), (BRIEF, GEOID))
    assert doubtful == DOUBTFUL and right == TRUSTED
    assert len(together({"a": WRONG, "c": verdicts["c"]})) == 2  # their first causes differ


def test_what_is_not_vouched_for_is_said_first():
    verdict = Verdict.of([], [BRIEF, GEOID], bounds=[ARM])
    assert verdict.trusted and verdict.untested == (GEOID, BRIEF)
    assert verdict.vouched == ("horizontal position", "velocity", "roll and pitch", "heading")
    assert verdict.lines[1] == (
        "  not tested: height above the geoid: one source; record a barometer (height depends on it)"
    )
    assert verdict.lines[-1] == "  smaller errors would not show: lever arm of gnss down: 0.51 m"
    assert Verdict.of([LATE], [BRIEF]).vouched == ()


def test_of_several_results_the_widest_bound_counts():
    wide = ARM._replace(size=2.0)
    ((_, verdict),) = together(
        {"a": Verdict.of([], bounds=[ARM]), "b": Verdict.of([], bounds=[wide])}
    )
    assert verdict.bounds == (wide,)
