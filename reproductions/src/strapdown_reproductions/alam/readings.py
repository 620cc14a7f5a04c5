"""Readings of the points that Alam et al. leave open or print twice: the two-stage model, the XKF,
the observer's law of the accelerometer bias and its gains; and the filters of each.

Models, forms and laws are combined. Gains are not published: with the printed law they are varied
one at a time, with the printed model and the affine XKF, whose stage 2 uses the observer's
attitude.
"""

from typing import Any, NamedTuple

from strapdown.filters.observer.gains import BY_NORM, DEFAULTS

LETTER, SPIRIT, CHARITY = WORDS = ("letter", "spirit", "charity")
"""Kinds of readings: the paper's words and symbols; its meaning or citation; a correction that
makes it consistent."""
EKF, NLO, XKF = "EKF", "NLO", "XKF"
GAINS = tuple(BY_NORM)
"""The gains that the library's default law has other values of."""


class Variant(NamedTuple):
    """A filter with its options."""

    filter: str
    options: dict[str, Any] = {}


class ReadingPart(NamedTuple):
    """A reading of one point: suffix of its filters' names, their options, the kind of reading."""

    name: str
    options: dict[str, Any]
    word: str


class AlamReading(NamedTuple):
    """A reading of all points: its name and kind, and the labels of the three filters."""

    name: str
    word: str
    ekf: str
    nlo: str
    xkf: str


RAW_DOWN = {"level": "raw", "velocity": "down"}
MODELS = (
    ReadingPart("", RAW_DOWN, LETTER),
    ReadingPart("full velocity", {"level": "raw"}, SPIRIT),
    ReadingPart("bias-free levelling, full velocity", {}, SPIRIT),
)
"""(6) levels by the accelerometers as they are; (10) has z with all of the velocity, its prediction
and the text with the downward one."""
FORMS = {
    "": ("xkf-two-stage-as-printed", ReadingPart("", {}, LETTER)),
    "affine": ("xkf-two-stage", ReadingPart("affine", {}, SPIRIT)),
    "affine, own attitude": (
        "xkf-two-stage",
        ReadingPart("affine, own attitude", {"attitude": "stage-1"}, SPIRIT),
    ),
}
"""2.3: the transition matrix at the observer; the affine filter of Johansen & Fossen (2017), to
which it refers, with the observer's attitude in (8) or that of its own stage 1."""
NORM = {"bias_law": "norm"}
LAWS = (ReadingPart("", NORM, LETTER), ReadingPart("bias by xi", {}, CHARITY))
"""Laws of the accelerometer bias: the printed one, corrected so that it adapts, and the
library's."""
ONE_AT_A_TIME = (
    ReadingPart("law by xi alone", BY_NORM | {"bias_law": "xi"}, CHARITY),
    *(
        ReadingPart(f"{name} of the library", NORM | {name: DEFAULTS[name]}, CHARITY)
        for name in GAINS
    ),
    ReadingPart(
        "all gains of the library", NORM | {name: DEFAULTS[name] for name in GAINS}, CHARITY
    ),
)


def label_of(name: str, *parts: str) -> str:
    """Return the label of a filter with the names of its parts."""
    return ", ".join(filter(None, (name, *parts)))


def _cross_readings() -> tuple[list[AlamReading], dict[str, Variant]]:
    """(readings, {label: variant} of their filters)."""
    readings, variants = [], {}
    crossed = [(model, form, law) for law in LAWS for form in FORMS for model in MODELS]
    alone = [(MODELS[0], "affine", law) for law in ONE_AT_A_TIME]
    for model, form, law in crossed + alone:
        filter, own = FORMS[form]
        word = max((part.word for part in (model, own, law)), key=WORDS.index)
        ekf, nlo = label_of(EKF, model.name), label_of(NLO, law.name)
        xkf = label_of(XKF, own.name, model.name, law.name)
        variants[ekf] = Variant("two-stage-ekf", model.options)
        variants[nlo] = Variant("nlo", law.options)
        variants[xkf] = Variant(filter, model.options | own.options | law.options)
        name = label_of(own.name, model.name, law.name) or "as printed"
        readings.append(AlamReading(name, word, ekf, nlo, xkf))
    return readings, variants


READINGS, VARIANTS = _cross_readings()
PRINTED = READINGS[0]
"""The letter in all points."""
