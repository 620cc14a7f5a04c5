"""What reading must end in: functions of the paths of a case and of whether also what takes longer is
tried. They give what is wrong, "" where nothing is, and raise DataError of what is refused; whatever
else they raise is wrong."""

import json
import zlib

import numpy as np

CRASHED, MEMORY = "report this to its author", "needs more memory than there is"
"""What the registry says of a reader that raises anything else than DataError."""
MAX = 3000
"""Characters of a complaint that is still one line for people, its paths included."""


def complaint(text):
    """What is wrong with a complaint."""
    if CRASHED in text or MEMORY in text or len(text.splitlines()) > 1:
        return text
    if not text.isprintable():
        return f"the complaint has control characters: {text!r}"
    return f"the complaint has {len(text)} characters: {text}" if len(text) > MAX else ""


def judged(look, paths, also_slow):
    """What is wrong with how these paths are read; refused in a line they are well."""
    from strapdown.checks import DataError

    try:
        return look(paths, also_slow)
    except DataError as error:
        return complaint(str(error))


def rising(t, strictly=True):
    step = np.diff(t)
    return np.isfinite(t).all() and bool(np.all(step > 0 if strictly else step >= 0))


def broken_seal(paths):
    """What is wrong where NetCDF files were read that are not what was written."""
    import h5py

    from strapdown.fileio.checksum import FOUND

    for path in paths:
        if path.suffix != ".nc" or not h5py.is_hdf5(path):  # which another reader knows
            continue
        content = path.read_bytes()
        found = list(FOUND.finditer(content))
        if not found or found[-1].end() < len(content):
            with h5py.File(path) as file:
                if "checksum" in file.attrs:
                    return f"{path.name} is read without its checksum"
        elif int(found[-1][1], 16) != zlib.crc32(content[: found[-1].start()]):
            return f"{path.name} is read in spite of its checksum"
    return ""


def wrong_aiding(source):
    """What is wrong with a source of fixes."""
    from strapdown.aiding import find

    if not find(source.kind).recorded:
        return ""
    m, name = len(source.t), source.name or source.kind
    if source.t.shape != (m,) or source.y.ndim != 2 or source.std.ndim != 2:
        return f"{name}: shapes {source.t.shape}, {source.y.shape}, {source.std.shape}"
    if len(source.y) != m or len(source.std) != m or not rising(source.t, strictly=False):
        return f"{name}: lengths differ, or times do not rise"
    if np.isinf(source.y).any() or not (np.isfinite(source.std) & (source.std > 0)).all():
        return f"{name}: an infinite value, or a deviation that is not above 0"
    if source.kind == "position" and (np.abs(source.y[:, 0]) > np.pi / 2).any():
        return f"{name}: a latitude beyond the pole"
    return ""


def wrong_trajectory(truth):
    """What is wrong with a reference."""
    n = len(truth.t)
    parts = {"lla": 3, "v_n": 3, "q_nb": 4}
    for part, width in parts.items():
        values = getattr(truth, part)
        if values is not None and (values.shape != (n, width) or np.isinf(values).any()):
            return f"reference: {part} has shape {values.shape} or infinite values"
    if truth.q_nb is not None and n:
        norm = np.linalg.norm(truth.q_nb, axis=1)
        if (np.abs(norm - 1)[np.isfinite(norm)] > 1e-3).any():
            return "reference: a quaternion that is no rotation"
    return "" if rising(truth.t) else "reference: times do not rise"


def wrong_recording(recording):
    """What is wrong with a Recording."""
    import strapdown as sd

    if not isinstance(recording, sd.Recording):
        return f"read gives a {type(recording).__name__}"
    imu, n = recording.imu, len(recording.imu.t)
    if not (imu.t.shape == imu.dt.shape == (n,) and imu.dtheta.shape == imu.dv.shape == (n, 3)):
        return "the arrays of the IMU have other shapes"
    if not all(np.isfinite(values).all() for values in imu):
        return "the IMU of the recording is not finite"
    if not rising(imu.t) or not (imu.dt > 0).all():
        return "the times of the recording do not rise"
    wrong = [wrong_aiding(each) for each in recording.sources]
    if recording.reference is not None:
        wrong.append(wrong_trajectory(recording.reference))
    if recording.meta.get("epoch") is not None and recording.utc.shape != (n,):
        wrong.append("UTC has another shape")
    repr(recording)
    return next(filter(None, wrong), "")


def recording(paths, also_slow):
    """`read`, and `inspect` where there is time."""
    import strapdown as sd
    from strapdown.io.inspection import inspect

    refused = None
    try:
        wrong = wrong_recording(sd.read(*paths)) or broken_seal(paths)
    except sd.DataError as error:
        wrong, refused = complaint(str(error)), error
    if also_slow and not wrong:
        lines = inspect(*paths).lines
        wrong = next((line for line in lines if CRASHED in line or len(line.splitlines()) > 1), "")
    if refused and not wrong:
        raise refused
    return wrong


def solution(paths, also_slow):
    import strapdown as sd

    found = sd.read_solution(paths[0])
    n, fixes = len(found.t), found.innovations
    m = len(fixes.t)
    shapes = {
        "lla": (found.trajectory.lla, (n, 3)),
        "v_n": (found.trajectory.v_n, (n, 3)),
        "std": (found.trajectory.std, (n, 15)),
        "b_a": (found.b_a, (n, 3)),
        "b_g": (found.b_g, (n, 3)),
        "status": (found.status, (n,)),
        "innovation": (fixes.innovation, (m, 3)),
        "nis": (fixes.nis, (m,)),
        "source": (fixes.source, (m,)),
        "accepted": (fixes.accepted, (m,)),
    }
    for name, (values, shape) in shapes.items():
        if values is not None and np.shape(values) != shape:
            return f"{name} has shape {np.shape(values)}, not {shape}"
    if not rising(found.t, strictly=False):
        return "times do not rise"
    if not np.isin(found.status, range(4)).all():
        return "a status that there is none of"
    if m and not ((fixes.source >= 0) & (fixes.source < len(fixes.names))).all():
        return "a source that there is none of"
    found.table(), found.counts(), found.verdict, found.utc, found.seconds(0)
    repr(found), found._repr_html_()
    return broken_seal(paths)


def campaign(paths, also_slow):
    import strapdown as sd

    found = sd.Campaign.open(paths[0])
    repr(found)
    for table in (found.runs, found.summary):
        if not len(table):
            return "a table without rows"
    ends = set(found.runs["end"]) - {"survived", "lost", "inconsistent", "quarantined"}
    if ends:
        return f"ends {ends}"
    for cell in found.cells:
        curves, filters = found.curves(cell), len(found.manifest["filters"])
        rows = len(curves["t"])
        if not rising(curves["t"]) or curves["rmse"].shape != (filters, rows, 15):
            return "curves of other times or shapes"
        found.numbers(cell), found.parameters(cell)
        if also_slow:
            found.arrays(cell).close()
    return broken_seal(sorted(paths[0].glob("chunks/*/*.nc")))


def scenario(paths, also_slow):
    """Also as the flight of an advice."""
    import strapdown as sd
    from strapdown.experiments.advice.mission import mission

    found = sd.scenario(str(paths[0]))
    json.dumps(found.describe())
    numbers = [found.duration, found.rate, found.motion.end]
    if also_slow:
        numbers.append(mission(str(paths[0]), 60.0).duration)
    return "" if all(each > 0 for each in numbers) else f"numbers {numbers}"


def grade(paths, also_slow):
    import strapdown as sd

    found = sd.imu(str(paths[0]))
    numbers = np.r_[tuple(found.noise()), np.ravel(found.bias_std())]
    return "" if (numbers >= 0).all() else f"numbers {numbers}"


def aircraft(paths, also_slow):
    import strapdown as sd

    found = sd.flight.aircraft(str(paths[0]))
    if also_slow:
        sd.flight.trim(found, 25.0)
    return ""


def plan(paths, also_slow):
    from strapdown.flight.plan import flight_plan, route

    table, seconds = route(flight_plan(paths[0]), (0.0, 0.0, 0.0), 9.8)
    return "" if np.isfinite(table.tolist()).all() and seconds > 0 else "a route that is not finite"


def calibration(paths, also_slow):
    from strapdown.io.calibration_file import read_corrections

    for name, found in read_corrections(paths[0]).items():
        at = found.at(np.array([-40.0, 20.0, 85.0]))[0]
        if not (np.isfinite(at).all() and np.isfinite(found.matrix).all()):
            return f"{name} is not finite"
    return ""


def noise(paths, also_slow):
    """Of a recording whose sources the file names."""
    from flat_noise import RECORDING

    from strapdown.io.noise_file import with_noise

    for a in with_noise(RECORDING, paths[0]).sources:
        if not (np.isfinite(a.std).all() and (a.std > 0).all()):
            return f"{a.name}: deviations that are not above 0"
        if a.correlated and not (np.isfinite(a.correlated.std).all() and a.correlated.time > 0):
            return f"{a.name}: correlated errors {a.correlated}"
    return ""
