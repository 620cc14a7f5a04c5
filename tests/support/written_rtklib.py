"""Solutions as RTKLIB writes them, from arrays (solution.c of RTKLIB)."""

import numpy as np

NAMES = {
    "llh": ("latitude(deg)", "longitude(deg)", "height(m)"),
    "dms": ("latitude(d'\")", "longitude(d'\")", "height(m)"),
    "xyz": ("x-ecef(m)", "y-ecef(m)", "z-ecef(m)"),
    "enu": ("e-baseline(m)", "n-baseline(m)", "u-baseline(m)"),
}
DEVIATIONS = {
    "llh": ("sdn(m)", "sde(m)", "sdu(m)", "sdne(m)", "sdeu(m)", "sdun(m)"),
    "xyz": ("sdx(m)", "sdy(m)", "sdz(m)", "sdxy(m)", "sdyz(m)", "sdzx(m)"),
    "enu": ("sde(m)", "sdn(m)", "sdu(m)", "sden(m)", "sdnu(m)", "sdue(m)"),
}
VELOCITY = ("vn(m/s)", "ve(m/s)", "vu(m/s)", "sdvn", "sdve", "sdvu", "sdvne", "sdveu", "sdvun")
DEVIATIONS["dms"] = DEVIATIONS["llh"]


def pos(
    moments,
    place,
    deviations,
    form="llh",
    scale="GPST",
    weeks=False,
    head="",
    separator=" ",
    moved=None,
):
    """Text of a .pos with positions (n, 3) and deviations (n, 6) at numpy's datetimes64; `moved` are
    velocities with their deviations (n, 9)."""
    names = (*NAMES[form], "Q", "ns", *DEVIATIONS[form], "age(s)", "ratio")
    if moved is not None:
        names += VELOCITY
    lines = [head] if head else []
    lines.append("%  " + separator.join((scale, *names)))
    moved = np.empty((len(moments), 0)) if moved is None else moved
    for moment, where, std, motion in zip(moments, place, deviations, moved):
        cells = [f"{each:.9f}" if form == "llh" else f"{each:.4f}" for each in where]
        if form == "dms":
            cells = [*(_dms(each) for each in where[:2]), f"{where[2]:.4f}"]
        cells += ["1", "9", *(f"{each:.4f}" for each in std), "0.00", "3.5"]
        cells += [f"{each:.5f}" for each in motion]
        lines.append(separator.join([_time(moment, weeks), *cells]))
    return "\n".join(lines) + "\n"


def _time(moment, weeks):
    if weeks:
        ms = int((moment - np.datetime64("1980-01-06", "ms")) / np.timedelta64(1, "ms"))
        return f"{ms // 604_800_000} {ms % 604_800_000 / 1000:.3f}"
    return str(moment.astype("datetime64[ms]")).replace("-", "/").replace("T", " ")


def _dms(degrees):
    size = round(abs(degrees) * 3600e5)
    whole, rest = divmod(size, 3600 * 10**5)
    sign = "-" if degrees < 0 else ""
    return f"{sign}{whole} {rest // (60 * 10**5):02d} {rest % (60 * 10**5) / 1e5:08.5f}"
