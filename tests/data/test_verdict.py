"""Verdicts: what reasons come to, as text, as plain values and of several results together."""

import pytest
from synthetic import DOUBTFUL, LATE, TRUSTED, TURNED, WORSE, WRONG

from strapdown.data.verdict import Reason, Verdict, together

pytestmark = pytest.mark.short


def test_the_weightiest_reason_decides_and_is_said_first():
    assert (TRUSTED.word, DOUBTFUL.word, WRONG.word) == ("trusted", "doubtful", "not to be trusted")
    assert [verdict.trusted for verdict in (TRUSTED, DOUBTFUL, WRONG)] == [True, False, False]
    assert WRONG.reasons == (TURNED, LATE, WORSE)
    assert WRONG.line.startswith("not to be trusted: axes of the IMU: the course is 89.7 deg")
    assert "time stamps of gnss velocity: innovations" in str(WRONG)
    assert Verdict.of([LATE._replace(weight=0.9)]).trusted


def test_plain_values_and_back():
    assert Verdict.from_dict(WRONG.as_dict()) == WRONG
    with pytest.raises(ValueError, match="good"):
        Verdict.from_dict({"word": "good", "reasons": [], "untested": []})
    assert Reason("new cause", "", "").what == "new cause"  # of a later version


def test_results_that_agree_are_said_together_the_gravest_first():
    lighter = LATE._replace(weight=3.5, seen="less")
    verdicts = {
        "a": TRUSTED,
        "b": Verdict.of([lighter, WORSE], ["x"]),
        "c": Verdict.of([LATE], ["y"]),
        "d": DOUBTFUL,
    }
    (first, wrong), (second, doubtful), (third, right) = together(verdicts)
    assert (first, second, third) == (["b", "c"], ["d"], ["a"])
    assert wrong == Verdict("not to be trusted", (LATE, WORSE), ("x", "y"))
    assert doubtful == DOUBTFUL and right == TRUSTED
    assert len(together({"a": WRONG, "c": verdicts["c"]})) == 2  # their first causes differ
