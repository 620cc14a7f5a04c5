"""Samples and measurements from MAVLink, as an autopilot sends them: HIGHRES_IMU or SCALED_IMU, GPS_RAW_INT,
SYSTEM_TIME. Times are those since its start; body axes are forward, right, down."""

from collections.abc import Sequence
from math import cos, nan, radians, sin
from typing import Any

import numpy as np

from ...checks import DataError
from ...engine.stream import Measurement, Sample
from ...extras import optional_import
from ...sensor_models.geoid import undulation
from ...units.constants import STANDARD_GRAVITY
from ...units.time_scales import gps_from_unix
from .input_formats import Clock, Decoder, check_moment
from .line_formats import MAX_GAP

UNIX = 1e15
"""us: larger times are UNIX times, smaller ones those since the start."""
ACCEL, GYRO = 0x07, 0x38
"""Bits of HIGHRES_IMU.fields_updated."""
NO_COURSE = 65535
THREE_DIMENSIONS = 3
"""Least fix_type that is used."""


class MavLink(Decoder):
    """MAVLink of one autopilot; messages of other systems are counted as bad. GPS_RAW_INT without
    accuracies is bad too, since nothing tells its standard deviations."""

    def __init__(self, clock: Clock, kinds: Sequence[str]) -> None:
        super().__init__()
        with optional_import("MAVLink"):
            from pymavlink.dialects.v20 import common
        self._clock, self._kinds = clock, kinds
        self._parser: Any = common.MAVLink(None)
        self._parser.robust_parsing = True
        self._system, self._last, self._imu = 0, nan, ""
        self._ahead = nan  # s, UNIX time less that since the start

    def feed(self, piece: bytes) -> list[Sample | Measurement]:
        """As of Decoder."""
        found: list[Sample | Measurement] = []
        for message in self._parser.parse_buffer(piece) or ():
            name = message.get_type()
            if name == "BAD_DATA":
                self._refuse("bytes that are no message")
            elif name in ("HIGHRES_IMU", "SCALED_IMU", "GPS_RAW_INT", "SYSTEM_TIME"):
                self._system = self._system or message.get_srcSystem()
                if message.get_srcSystem() != self._system:
                    self._refuse(f"system {message.get_srcSystem()} sends, too")
                elif name == "SYSTEM_TIME":
                    self._set_clock(message)
                elif name == "GPS_RAW_INT":
                    found += self._fixes(message)
                else:
                    found += self._sample(name, message)
        return found

    def _refuse(self, why: str) -> None:
        self.bad, self.why = self.bad + 1, self.why or why

    def _set_clock(self, message: Any) -> None:
        if message.time_unix_usec <= UNIX:
            return
        ahead = message.time_unix_usec / 1e6 - message.time_boot_ms / 1e3
        try:
            check_moment(start := float(gps_from_unix(ahead)))
        except DataError as error:
            self._refuse(f"SYSTEM_TIME: {error}")
            return
        self._ahead = ahead
        if self._clock.epoch is None:
            self._clock.epoch = start

    def _sample(self, name: str, message: Any) -> list[Sample]:
        """Return the sample of a message, with the rates that it has at its end."""
        if name == "HIGHRES_IMU":
            if message.fields_updated & (ACCEL | GYRO) != ACCEL | GYRO:
                return []
            t, size, turn = message.time_usec / 1e6, 1.0, 1.0
        elif self._imu == "HIGHRES_IMU":
            return []
        else:
            t, size, turn = message.time_boot_ms / 1e3, STANDARD_GRAVITY / 1e3, 1e-3
        if name != self._imu:
            self._imu, self._last = name, nan
        last, self._last = self._last, t
        dt = t - last
        if not 0 < dt <= MAX_GAP:
            if dt == dt:  # the first one has none before
                self._refuse(f"{name} {dt:.4g} s after the one before, so its length is unknown")
            return []
        gyro = (message.xgyro, message.ygyro, message.zgyro)
        accel = (message.xacc, message.yacc, message.zacc)
        x, y, z = (turn * dt * value for value in gyro)
        a, b, c = (size * dt * value for value in accel)
        return [Sample(t, dt, (x, y, z), (a, b, c))]

    def _fixes(self, message: Any) -> list[Measurement]:
        """Return position and horizontal velocity of a fix."""
        t = message.time_usec / 1e6
        if message.time_usec > UNIX:
            t -= self._ahead
        if message.fix_type < THREE_DIMENSIONS:
            return []
        if t != t:
            self._refuse("GPS_RAW_INT has UNIX time, and no SYSTEM_TIME came")
            return []
        if not (message.h_acc and message.v_acc):
            self._refuse("GPS_RAW_INT has no accuracies; send MAVLink 2")
            return []
        lat, lon = radians(message.lat / 1e7), radians(message.lon / 1e7)
        height = message.alt_ellipsoid / 1e3
        if not message.alt_ellipsoid:
            height = message.alt / 1e3 + float(undulation(np.array([lat]), np.array([lon]))[0])
        level, vertical = message.h_acc / 1e3, message.v_acc / 1e3
        fixes = {"position": ((lat, lon, height), (level, level, vertical))}
        if message.vel_acc and message.cog != NO_COURSE:
            speed, course = message.vel / 1e2, radians(message.cog / 1e2)
            std = message.vel_acc / 1e3
            fixes["velocity"] = (speed * cos(course), speed * sin(course), nan), (std, std, nan)
        return [
            Measurement(t, self._kinds.index(kind), y, std)
            for kind, (y, std) in fixes.items()
            if kind in self._kinds
        ]
