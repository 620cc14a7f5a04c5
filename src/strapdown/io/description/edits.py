"""Edits of an installation in a description, with numbers as the file has them."""

from typing import NamedTuple

from ...data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING, CalibrationParameter


class Edit(NamedTuple):
    """One key of a section, with a new value."""

    source: int | None  # [[aiding]], from 0; None: [imu]
    of: CalibrationParameter
    # s to add to the offset; m of all three axes; roll, pitch, heading, rad; a factor
    value: tuple[float, ...]
    sd: tuple[float, ...]  # of the value, by component; 0 of one that was not estimated

    @property
    def key(self) -> str:
        """The key of the section that changes."""
        return self.of.key


def edit_text(edit: Edit) -> str:
    """Return an edit in words, with the digits of the file."""
    of, least = edit.of, min(sd for sd in edit.sd if sd)
    own = edit.sd if of is LEVER_ARM else [least] * len(edit.value)
    numbers = [
        number(x * of.factor, (sd or least) * of.factor, of.digits)
        for x, sd in zip(edit.value, own)
    ]
    if of is CLOCK:
        return f"time: add {'' if edit.value[0] < 0 else '+'}{numbers[0]} s to offset"
    if of is LEVER_ARM:
        return f"lever_arm = [{', '.join(numbers)}]"
    if of is MOUNTING:
        angles = ", ".join(f"{name} = {text}" for name, text in zip(of.components, numbers))
        return f'mounting = {{ {angles}, unit = "deg" }}'
    return f"scale: multiply by {numbers[0]}"


def deviations(edit: Edit) -> str:
    """The standard deviations of the components that were estimated, by name."""
    of = edit.of
    return ", ".join(
        f"{name} +- {round_std(sd * of.factor)} {of.unit}"
        for name, sd in zip(of.components, edit.sd)
        if sd
    )


def number(value: float, sd: float, least: int) -> str:
    """A number with the digits that its standard deviation leaves it, and `least` behind the point
    anyway."""
    text = f"{value:.{max(least, _digits(sd))}f}"
    return text if float(text) else text.lstrip("-")


def round_std(sd: float) -> str:
    """A standard deviation with the digits that count."""
    return f"{sd:.{_digits(sd)}f}"


def _digits(sd: float) -> int:
    """Behind the point of a standard deviation: one that counts, two where the first is 1."""
    magnitude, first = f"{sd:.1e}".split("e")[1], f"{sd:.0e}"[0]
    return max(0, -int(magnitude) + (first == "1"))
