"""Edits of an installation in a description, with numbers in the form of the file."""

from typing import NamedTuple

from ...data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING, CalibrationParameter


class Edit(NamedTuple):
    """One key of a section, with a new value."""

    source: int | None  # [[source]], from 0; None: [imu]
    of: CalibrationParameter
    # s to add to the offset; m of all three axes; roll, pitch, heading, rad; a factor
    value: tuple[float, ...]
    std: tuple[float, ...]  # of the value, by component; 0 where it was not estimated

    @property
    def key(self) -> str:
        """The key of the section that changes."""
        return self.of.key


def edit_text(edit: Edit) -> str:
    """Return an edit as text, with the digits of the file."""
    of, least = edit.of, min(std for std in edit.std if std)
    own = edit.std if of is LEVER_ARM else [least] * len(edit.value)
    numbers = [
        number(x * of.factor, (std or least) * of.factor, of.digits)
        for x, std in zip(edit.value, own)
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
    """Return the standard deviations of the estimated components by name."""
    of = edit.of
    return ", ".join(
        f"{name} +- {round_std(std * of.factor)} {of.unit}"
        for name, std in zip(of.components, edit.std)
        if std
    )


def number(value: float, std: float, least: int) -> str:
    """Return a number with the digits that are significant by its standard deviation, but at least
    `least` decimals."""
    text = f"{value:.{max(least, _digits(std))}f}"
    return text if float(text) else text.lstrip("-")


def round_std(std: float) -> str:
    """Return a standard deviation with its significant digits."""
    return f"{std:.{_digits(std)}f}"


def _digits(std: float) -> int:
    """Number of decimals of a standard deviation: one significant digit, two where the first is
    1."""
    magnitude, first = f"{std:.1e}".split("e")[1], f"{std:.0e}"[0]
    return max(0, -int(magnitude) + (first == "1"))
