"""The options of a run are declared once: signatures, documentation and refusals come from there."""

import inspect
from typing import get_type_hints

import pytest
from support.recordings import flight

import strapdown as sd
from strapdown.checks import DataError
from strapdown.engine.options import (
    OPTIONS,
    RunOptions,
    SetUpOptions,
    SourceOptions,
    run_options,
    takes,
)
from strapdown.experiments.advice.advise import advise
from strapdown.experiments.monte_carlo.study import CAMPAIGN_OPTIONS, CampaignOptions

pytestmark = pytest.mark.short
TAKEN = {
    sd.fuse: RunOptions,
    sd.smooth: RunOptions,
    sd.Stream: RunOptions,
    sd.compare: SourceOptions,
    sd.diagnose: SetUpOptions,
    sd.tune: SetUpOptions,
    sd.calibrate_installation: SetUpOptions,
}


def test_every_type_has_a_default_and_a_meaning():
    assert set(RunOptions.__annotations__) == set(OPTIONS)
    assert set(CampaignOptions.__annotations__) == set(CAMPAIGN_OPTIONS)
    assert set(run_options()) == set(OPTIONS)
    for option in (*OPTIONS.values(), *CAMPAIGN_OPTIONS.values()):
        assert option.type and option.meaning.endswith(".")


@pytest.mark.parametrize("call", TAKEN, ids=lambda call: call.__name__)
def test_signature_and_documentation_have_every_option(call):
    parameters = inspect.signature(call).parameters
    for name, option in OPTIONS.items():
        taken = name in TAKEN[call].__annotations__
        if taken:
            assert parameters[name].default == option.default
            assert parameters[name].annotation == get_type_hints(TAKEN[call])[name]
            assert parameters[name].kind is inspect.Parameter.KEYWORD_ONLY
            text = inspect.getdoc(call)
            assert f"\n{name} : " in text and option.meaning in " ".join(text.split())
            assert text.index("Other Parameters") < text.index("\nRaises\n")
        else:
            assert name == "options" or name not in parameters
    assert not any(each.kind is inspect.Parameter.VAR_KEYWORD for each in parameters.values())
    positional = [
        each for each in parameters.values() if each.kind is inspect.Parameter.POSITIONAL_OR_KEYWORD
    ]
    assert len(positional) <= 2


def test_those_of_a_study_too():
    for call in (sd.Study.run, advise):
        assert set(CAMPAIGN_OPTIONS) < set(inspect.signature(call).parameters)


@pytest.mark.parametrize("call", TAKEN, ids=lambda call: call.__name__)
def test_what_no_one_has_is_refused_in_one_line(call):
    with pytest.raises(DataError, match=f"^{call.__name__} has no option 'everything'[^\n]*$"):
        call(flight(2.0), everything=2)


def test_an_option_of_another_function_is_refused():
    for call in (sd.compare, sd.diagnose, sd.tune):
        with pytest.raises(DataError, match="has no option 'every'"):
            call(flight(2.0), every=2)


def test_a_refusal_says_what_was_meant():
    with pytest.raises(DataError, match="no option 'estimates'; did you mean 'estimate'"):
        sd.fuse(flight(2.0), estimates=["clock"])
    with pytest.raises(DataError, match=r"given as options=\{'interval': \.\.\.\}"):
        sd.fuse(flight(2.0), "periodic-reset", interval=3.0)
    with pytest.raises(DataError, match="options is 'interval=3'; it must be a table"):
        sd.fuse(flight(2.0), options="interval=3")


def test_a_function_may_have_options_of_its_own():
    @takes(SetUpOptions)
    def doubled(x, *, twice=True, **given):
        """Double."""
        return (2 * x if twice else x), given

    assert doubled(2, imu="tactical") == (4, {"imu": "tactical"})
    assert [*inspect.signature(doubled).parameters][:4] == ["x", "twice", "imu", "start"]
    assert inspect.getdoc(doubled).startswith(
        "Double.\n\nOther Parameters\n----------------\nimu :"
    )
