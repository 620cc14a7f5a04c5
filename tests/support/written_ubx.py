"""UBX as a u-blox receiver writes it, from arrays, by the interface descriptions of M8 and F9; of
its own layouts, so that the reader's are tested against them."""

import numpy as np

PVT = np.dtype(
    "<u4,<u2,u1,u1,u1,u1,u1,u1,<u4,<i4,u1,u1,u1,u1,<i4,<i4,<i4,<i4,<u4,<u4,<i4,<i4,<i4,<i4,<i4,<u4,"
    "<u4,<u2,<u2,<u4,<i4,<i2,<u2"
)
PVT.names = (
    "iTOW year month day hour min sec valid tAcc nano fixType flags flags2 numSV lon lat height hMSL "
    "hAcc vAcc velN velE velD gSpeed headMot sAcc headAcc pDOP flags3 reserved0 headVeh magDec magAcc"
).split()
GPS_ZERO = np.datetime64("1980-01-06", "ms")
WEEK = 604_800_000
GPS = 1_400_000_000_000
"""ms of GPS time since its zero, Friday 2024-05-17 16:53:02 UTC."""


def frames(kind, payload):
    """(n, size + 8) whole frames of payloads (n, size); `kind` is 256 class + identifier."""
    n, size = payload.shape
    head = np.frombuffer(bytes([kind >> 8, kind & 255]) + size.to_bytes(2, "little"), np.uint8)
    body = np.concatenate([np.tile(head, (n, 1)), payload], axis=1)
    a = np.cumsum(body, axis=1, dtype=np.uint8)
    b = np.cumsum(a, axis=1, dtype=np.uint8)[:, -1:]
    sync = np.tile(np.frombuffer(b"\xb5b", np.uint8), (n, 1))
    return np.concatenate([sync, body, a[:, -1:], b], axis=1)


def rows(records):
    """(n, size) bytes of structured records."""
    return np.ascontiguousarray(records).view(np.uint8).reshape(len(records), -1)


def pvt_records(gps_ms, leap=18, **fields):
    """NAV-PVT at moments of GPS time, ms since its zero, with a valid fix in three dimensions where
    `fields` do not say otherwise."""
    gps_ms = np.asarray(gps_ms)
    records = np.zeros(len(gps_ms), PVT)
    utc = GPS_ZERO + (gps_ms - 1000 * leap).astype("timedelta64[ms]")
    day, month = utc.astype("datetime64[D]"), utc.astype("datetime64[M]")
    of_day = (utc - day).astype(int) // 1000
    records["iTOW"] = gps_ms % WEEK
    records["year"] = month.astype("datetime64[Y]").astype(int) + 1970
    records["month"] = month.astype(int) % 12 + 1
    records["day"] = (day - month).astype(int) + 1
    records["hour"], records["min"], records["sec"] = of_day // 3600, of_day // 60 % 60, of_day % 60
    records["valid"], records["fixType"], records["flags"] = 7, 3, 1
    records["hAcc"], records["vAcc"], records["sAcc"] = 1500, 2500, 100
    for name, values in fields.items():
        records[name] = values
    return records


def pvt(gps_ms, **fields):
    """The same as frames (n, 100)."""
    return frames(0x0107, rows(pvt_records(gps_ms, **fields)))


RELPOSNED = np.dtype(
    "u1,u1,<u2,<u4,<i4,<i4,<i4,<i4,<i4,<u4,i1,i1,i1,i1,<u4,<u4,<u4,<u4,<u4,<u4,<u4"
)
RELPOSNED.names = (
    "version reserved0 refStationId iTOW relPosN relPosE relPosD relPosLength relPosHeading reserved1 "
    "relPosHPN relPosHPE relPosHPD relPosHPLength accN accE accD accLength accHeading reserved2 flags"
).split()


FIRST_RELPOSNED = np.dtype("u1,u1,<u2,<u4,<i4,<i4,<i4,i1,i1,i1,u1,<u4,<u4,<u4,<u4")
FIRST_RELPOSNED.names = (
    "version reserved0 refStationId iTOW relPosN relPosE relPosD relPosHPN relPosHPE relPosHPD reserved1 "
    "accN accE accD flags"
).split()


def relposned(gps_ms, vectors, flags=0x137, acc=60, version=1):
    """NAV-RELPOSNED of vectors (n, 3) in 0.1 mm with an accuracy in 0.1 mm: carrier solution fixed, base
    moving, where `flags` do not say otherwise."""
    records = np.zeros(len(gps_ms), RELPOSNED if version else FIRST_RELPOSNED)
    records["version"], records["flags"] = version, flags
    records["iTOW"] = np.asarray(gps_ms) % WEEK
    for axis, values in zip("NED", np.asarray(vectors).T):
        records[f"relPos{axis}"] = np.trunc(values / 100)
        records[f"relPosHP{axis}"] = values - 100 * records[f"relPos{axis}"]
        records[f"acc{axis}"] = acc
    return frames(0x013C, rows(records))


PROTECTION = np.dtype("u1,u1,i1,u1,u1,u1,u1,u1,<u4,<u4,<u4,<u4,<u4,<u4,<u4,<u4,<u2,<u2,<u4,<u4")
PROTECTION.names = (
    "version tmirCoeff tmirExp plPosValid plPosFrame plVelValid plVelFrame plTimeValid reserved iTOW plPos1 "
    "plPos2 plPos3 plVel1 plVel2 plVel3 plPosHorizOrient plVelHorizOrient plTime reserved2"
).split()


def protection(gps_ms, levels, valid=1):
    """NAV-PL of protection levels (n, 3) in m."""
    records = np.zeros(len(gps_ms), PROTECTION)
    records["version"], records["plPosValid"], records["plPosFrame"] = 1, valid, 1
    records["iTOW"] = np.asarray(gps_ms) % WEEK
    for k in range(3):
        records[f"plPos{k + 1}"] = np.round(1e3 * np.asarray(levels)[:, k])
    return frames(0x0162, rows(records))


def esf_raw(tag, gyro, accel, samples=1):
    """ESF-RAW of counts gyro (n, 3) and accel (n, 3) at tags (n,), some samples in each frame."""
    kinds = np.array([14, 13, 5, 16, 17, 18])
    counts = np.concatenate([gyro, accel], axis=1) & 0xFFFFFF
    words = np.empty((len(tag), 6, 2), "<u4")
    words[:, :, 0] = counts | kinds << 24
    words[:, :, 1] = np.asarray(tag)[:, None] % 2**32
    payload = words.reshape(len(tag) // samples, -1)
    return frames(0x1003, rows(np.concatenate([np.zeros((len(payload), 1), "<u4"), payload], 1)))


def esf_meas(tag, kinds, counts):
    """ESF-MEAS of counts (n, m) of m kinds at tags (n,), with the calibrated tag behind."""
    n, m = counts.shape
    words = np.empty((n, m + 3), "<u4")
    words[:, 0] = words[:, -1] = np.asarray(tag) % 2**32
    words[:, 1] = m << 11 | 1 << 3
    words[:, 2:-1] = counts & 0xFFFFFF | np.array(kinds) << 24
    return frames(0x1002, rows(words))


def drive(n=200, per_fix=10, dt=10, rng=None):
    """(bytes, tags, gyro, accel, moments, fixes) of n samples of ESF-RAW, a NAV-PVT after each
    `per_fix` of them, `dt` ms apart."""
    rng = rng or np.random.default_rng(3)
    tag = 5_000_000 + dt * np.arange(n)
    gyro = rng.integers(-(2**17), 2**17, (n, 3))
    accel = rng.integers(-900, 900, (n, 3)) + [0, 0, 10042]
    raw = esf_raw(tag, gyro, accel)
    many = n // per_fix
    moments = GPS + dt * per_fix * np.arange(many)
    k = np.arange(many)
    fixes = {"lat": 450000000 + 37 * k, "lon": -73000000 - 11 * k, "height": 200000 + 13 * k}
    fixes |= {"velN": 400 + k, "velE": -90 - k, "velD": 7 * k % 50}
    fixes |= {"hAcc": 900 + k, "vAcc": 1500 + k, "sAcc": 80 + k}
    both = [pvt(moments, **fixes), raw.reshape(many, -1)]
    return np.concatenate(both, axis=1).tobytes(), tag, gyro, accel, moments, fixes
