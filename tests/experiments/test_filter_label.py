"""Labels of filters: options, parameters of the installation, and the text that they come back
to."""

import pytest

from strapdown.checks import DataError
from strapdown.experiments.filter_label import labelled_filter, parse_label

pytestmark = pytest.mark.short


@pytest.mark.parametrize(
    ("text", "options", "estimate", "label"),
    [
        ("closed-loop", {}, None, "closed-loop"),
        ("closed-loop:estimate=none", {}, (), "closed-loop:estimate=none"),
        (
            "periodic-reset: interval=5, estimate=clock+GNSS position lever-arm",
            {"interval": 5.0},
            ("clock", "GNSS position lever-arm"),
            "periodic-reset:estimate=clock+GNSS position lever-arm,interval=5",
        ),
    ],
)
def test_a_label_comes_back_to_one_text(text, options, estimate, label):
    found = parse_label(text)
    assert (found.options, found.estimate, found.label) == (options, estimate, label)
    assert parse_label(label) == found


def test_a_list_of_names_is_what_their_text_is():
    assert labelled_filter("mekf", {"estimate": ["clock", "scale"]}) == parse_label(
        "mekf:estimate=clock+scale"
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("closed-loop:estimate=", "estimate is ''"),
        ("closed-loop:estimate=clock+", "estimate is ''"),
        ("closed-loop:estimate=3", "names joined by +"),
        ("closed-loop:estimate=clock=0.05", "a label takes only names: give priors in estimate="),
        ("mekf:estimate=leverarm", "did you mean 'lever-arm'"),
        ("fixed-gain:estimate=clock", "fixed-gain cannot estimate clock; these can: "),
    ],
)
def test_a_label_that_estimates_nothing_known_is_refused(text, said):
    with pytest.raises(DataError, match=said.replace("+", r"\+")):
        parse_label(text)
