"""The newest state as MAVLink, for an autopilot: ODOMETRY, VISION_POSITION_ESTIMATE and GPS_INPUT of one
companion computer, with its HEARTBEAT. Local positions count from the first state that was sent."""

from collections.abc import Sequence
from math import hypot, inf
from typing import Any

import numpy as np

from ...core.loop.contract import DOUBTFUL, INVALID
from ...core.mathematics.belief import VEL
from ...core.mathematics.rotation import matrix_to_euler, matrix_to_quaternion
from ...extras import optional_import
from ...geometry.geodesy import displacement
from ...sensor_models.geoid import undulation
from ...typing import Array
from ...units.time_scales import WEEK, gps_from_unix
from .output_formats import Shown
from .pose import pose_covariance

BEAT = 1.0
"""s between two HEARTBEAT."""
SYSTEM, COMPONENT = 1, 197
"""Numbers of the autopilot, and of the computer beside it that estimates an odometry (MAV_COMP_ID)."""
NO_DOP = 2 | 4
"""GPS_INPUT_IGNORE_FLAG_HDOP and _VDOP."""
FIX = 3
"""fix_type of a fix in three dimensions."""
UPPER = np.triu_indices(6)


class MavLinkOutput:
    """Makes messages of states. Nothing goes out of a state without position, velocity and attitude, or
    of an invalid one, so that the autopilot notices."""

    def __init__(self, messages: Sequence[str]) -> None:
        with optional_import("MAVLink"):
            from pymavlink.dialects.v20 import common
        self._common: Any = common
        self._link: Any = common.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
        makers = {
            "ODOMETRY": self._odometry,
            "VISION_POSITION_ESTIMATE": self._position,
            "GPS_INPUT": self._gps,
        }
        self._makers = [makers[name] for name in messages]
        self._origin: Array | None = None
        self._beat = -inf

    def __call__(self, it: Shown) -> bytes:
        """Return the messages of a state."""
        made = [] if abs(it.t - self._beat) < BEAT else [self._heartbeat(it.t)]
        state = it.state
        known = all(np.isfinite(each).all() for each in (state.lla, state.v_n, state.C_nb))
        if known and it.status != INVALID:
            if self._origin is None:
                self._origin = state.lla.copy()
            made += [make(it) for make in self._makers]
        return b"".join(message.pack(self._link) for message in made)

    def _heartbeat(self, t: float) -> Any:
        self._beat = t
        common = self._common
        return common.MAVLink_heartbeat_message(
            common.MAV_TYPE_ONBOARD_CONTROLLER,
            common.MAV_AUTOPILOT_INVALID,
            0,
            0,
            common.MAV_STATE_ACTIVE,
            3,
        )

    def _odometry(self, it: Shown) -> Any:
        """Position and attitude in the local frame, velocity and rate in the body."""
        state, q = it.state, np.empty(4)
        matrix_to_quaternion(state.C_nb, q)
        assert self._origin is not None  # this state's, at least
        of_body = np.zeros((6, 6))
        of_body[:3, :3] = state.C_nb.T @ state.P[VEL, VEL] @ state.C_nb
        return self._common.MAVLink_odometry_message(
            _microseconds(it),
            self._common.MAV_FRAME_LOCAL_NED,
            self._common.MAV_FRAME_BODY_FRD,
            *displacement(state.lla, self._origin).tolist(),
            q.tolist(),
            *(state.C_nb.T @ state.v_n).tolist(),
            *state.omega.tolist(),
            pose_covariance(it.state)[UPPER].tolist(),
            of_body[UPPER].tolist(),
            it.alignments % 256,
            self._common.MAV_ESTIMATOR_TYPE_GPS_INS,
            50 if it.status == DOUBTFUL else 100,
        )

    def _position(self, it: Shown) -> Any:
        assert self._origin is not None  # this state's, at least
        return self._common.MAVLink_vision_position_estimate_message(
            _microseconds(it),
            *displacement(it.state.lla, self._origin).tolist(),
            *matrix_to_euler(it.state.C_nb),
            pose_covariance(it.state)[UPPER].tolist(),
            it.alignments % 256,
        )

    def _gps(self, it: Shown) -> Any:
        state = it.state
        lat, lon = (1e7 * np.degrees(state.lla[:2])).tolist()
        above = float(undulation(state.lla[:1], state.lla[1:2])[0])
        std = np.sqrt(np.diag(state.P)[:6]).tolist()
        yaw = round(100 * np.degrees(matrix_to_euler(state.C_nb)[2]) % 36000) or 36000
        gps = max(float(gps_from_unix(it.moment.timestamp())), 0.0) if it.moment else 0.0
        return self._common.MAVLink_gps_input_message(
            _microseconds(it),
            0,
            NO_DOP,
            round(1000 * (gps % WEEK)),
            int(gps // WEEK),
            FIX,
            round(lat),
            round(lon),
            float(state.lla[2]) - above,
            0.0,
            0.0,
            *state.v_n.tolist(),
            hypot(*std[3:]),
            hypot(*std[:2]),
            std[2],
            0,
            yaw,
        )


def _microseconds(it: Shown) -> int:
    """Return the UNIX time of a state, us; without an absolute clock its own time."""
    return max(round(1e6 * (it.moment.timestamp() if it.moment else it.t)), 0)
