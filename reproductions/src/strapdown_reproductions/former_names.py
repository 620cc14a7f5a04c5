"""Modules under the names that documentation of version 0.1 showed, when they were
`strapdown.papers`."""

MOVED = {
    "alam_convergence": "strapdown_reproductions.alam.convergence",
    "alam_runs": "strapdown_reproductions.alam.runs",
    "fossen_cases": "strapdown_reproductions.fossen.cases",
    "fossen_intro": "strapdown_reproductions.fossen.intro",
    "fossen_signals": "strapdown_reproductions.fossen.signals",
    "hager_bryne": "strapdown_reproductions.hager_bryne.main",
    "mollaei_cells": "strapdown_reproductions.mollaei.cells",
    "mollaei_metrics": "strapdown_reproductions.mollaei.metrics",
    "mollaei_runs": "strapdown_reproductions.mollaei.runs",
    "mollaei_six": "strapdown_reproductions.mollaei.six_state.filters",
    "recordings_cases": "strapdown_reproductions.recordings.cases",
    "recordings_table": "strapdown_reproductions.recordings.table",
}
"""{module as it was called, below `strapdown.papers`: as it is called now}."""
