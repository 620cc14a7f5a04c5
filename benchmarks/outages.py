"""Recorded outages with and without some of the sensors: what these are worth."""

from exogenous import THOR

AIR_DATA = [
    "thor75 with air data, horizontal RMSE",
    "thor75 with air data, largest error",
    "thor75 with air data over without",
    "thor75 with air data, errors beyond 3 std",
    "thor75-full with air data, horizontal RMSE",
    "thor75-full with air data, largest error",
    "thor75-full with air data over without",
    "thor75-full with air data, errors beyond 3 std",
]


def air_data():
    """[(value, note)] for `AIR_DATA`: medians of the closed loop over 62 windows of 30 s, and the mean
    share of true horizontal errors beyond three standard deviations."""
    return [*_of_flight("thor75"), *_of_flight("thor75-full")]


def _of_flight(name):
    rms, most, beyond = _scores(f"{name}-air")
    other, other_most, _ = _scores(name)
    return [
        (rms, f"without air data {other:.1f} m"),
        (most, f"without air data {other_most:.1f} m"),
        (max(rms / other, most / other_most), f"{rms / other:.2f} of the RMSE"),
        (beyond, ""),
    ]


def _scores(name):
    """(median horizontal RMSE, m, median largest horizontal error, m, share beyond 3 std)."""
    import strapdown as sd
    from strapdown_reproductions.common.example_recordings import DESCRIPTIONS

    made = sd.compare(sd.read(DESCRIPTIONS / f"{name}.toml"), "closed-loop", outages=THOR)
    scores = made.scores
    return (
        float(scores["horizontal_rmse_m"].median()),
        float(scores["horizontal_max_m"].median()),
        1 - float(scores["coverage_3"].mean()),
    )
