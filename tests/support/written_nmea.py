"""NMEA 0183 as receivers write it, from arrays."""

import numpy as np


def sentence(body):
    """$body*checksum and the end of line."""
    check = 0
    for byte in body.encode():
        check ^= byte
    return f"${body}*{check:02X}\r\n"


def angle(degrees, width, marks):
    """ddmm.mmmmmmm,H"""
    whole, size = int(abs(degrees)), abs(degrees)
    minutes = f"{60 * (size - whole):010.7f}"
    return f"{whole:0{width}d}{minutes},{marks[int(degrees < 0)]}"


def time_of(moment):
    """hhmmss.ss of numpy's datetime64."""
    of_day = int((moment - moment.astype("datetime64[D]")) / np.timedelta64(1, "ms"))
    seconds = of_day // 1000
    return (
        f"{seconds // 3600:02d}{seconds // 60 % 60:02d}{seconds % 60:02d}.{of_day % 1000 // 10:02d}"
    )


def gga(moment, lat, lon, altitude, separation=47.2, quality=4, hdop=0.8, talker="GN"):
    """GGA of one fix."""
    where = f"{angle(lat, 2, 'NS')},{angle(lon, 3, 'EW')}"
    apart = f"{separation:.3f},M" if separation is not None else ",M"
    return sentence(
        f"{talker}GGA,{time_of(moment)},{where},{quality},12,{hdop:.2f},{altitude:.3f},M,{apart},,"
    )


def rmc(moment, lat, lon, knots, course, mode="A", status="A", date=None, talker="GN"):
    """RMC of one fix; `course` None is empty."""
    day = str(moment.astype("datetime64[D]")) if date is None else date
    date = f"{day[8:10]}{day[5:7]}{day[2:4]}"
    where = f"{angle(lat, 2, 'NS')},{angle(lon, 3, 'EW')}"
    angle_text = "" if course is None else f"{course:.2f}"
    return sentence(
        f"{talker}RMC,{time_of(moment)},{status},{where},{knots:.3f},{angle_text},{date},,,{mode},V"
    )


def gst(moment, north, east, up):
    """GST of one fix."""
    return sentence(f"GNGST,{time_of(moment)},1.0,,,,{north:.3f},{east:.3f},{up:.3f}")


GSV = "".join(
    sentence(f"GPGSV,7,{i},28,02,25,181,42,06,45,146,45,12,19,292,47,13,17,209,4{i},1")
    for i in range(1, 8)
)
"""A flood of satellites in view, as each epoch has it."""
