"""The run of a node: messages wait until it is known how the sensors stand, then a `LiveStream` uses them."""

from collections import Counter, deque
from collections.abc import Callable
from math import inf, nan
from typing import Any, NamedTuple

import numpy as np

import strapdown as sd
from strapdown import aiding
from strapdown.checks import DataError
from strapdown.core.loop.contract import INVALID, VALID, Status
from strapdown.engine.prepare import has_position
from strapdown.engine.verdict_process import VerdictProcess
from strapdown.filters import find
from strapdown.io.decoding.robots.ros_transforms import HERE, WORLD, Pose
from strapdown.typing import Array
from strapdown.units.time_scales import iso

from .conversions import (
    NO_STAMP,
    NO_STD,
    OTHER_CLOCK,
    BaseState,
    Increments,
    LocalFrame,
    RosClock,
    UnusedMessage,
    frame_of,
    reading_of,
    shown_state,
    stamp_of,
)
from .mounts import Mount, imu_mount_at, mount_at
from .parameters import NodeConfig, SourceInput

MAX_HELD = 20_000
"""Largest number of messages that wait for transforms."""
IMU = -1
"""In place of the number of a source."""
IMU_SILENT = 5.0
"""s without an IMU message after which that is reported."""
WAITING, LEFT_OUT = "while waiting for transforms", "of a source that is left out"
"""Reasons why messages are not used, beside those of `conversions`."""
OK, WARN, STALE = 0, 1, 3
"""Levels of a diagnostic_msgs/DiagnosticStatus."""
UNKNOWN_FIELD = (2e-5, 0.0, 4e-5)
"""T: stands for the Earth's field until the date is known."""
Lookup = Callable[[str], Pose | None]
"""Function of a frame: its pose in the base frame; None where tf does not know it."""


class NodeStatus(NamedTuple):
    """The content of a diagnostic_msgs/DiagnosticStatus."""

    level: int
    message: str
    values: list[tuple[str, str]]


class _Held(NamedTuple):
    """A message that waits."""

    source: int
    message: Any
    stamp: int  # ns


class Navigator:
    """A filter on messages of ROS.

    Parameters
    ----------
    config : NodeConfig
        From `parameters.config_of`.
    lookup : callable
        Function of the name of a frame that returns its Pose in the base frame, None where unknown.
    tell : callable
        Function called with each line that the user should see.
    show : callable
        Function called with each BaseState that is due.

    Raises
    ------
    DataError
        If the filter, the IMU or an option is unknown or out of range.
    """

    def __init__(
        self,
        config: NodeConfig,
        lookup: Lookup,
        tell: Callable[[str], object],
        show: Callable[[BaseState], object],
    ) -> None:
        self.config, self._lookup, self._tell, self._show = config, lookup, tell, show
        if not has_position(find(config.filter)):
            raise DataError(
                f"filter: {config.filter} has no position, which an Odometry needs; give another one"
            )
        self._check_fields()
        self.unused: Counter[tuple[str, str]] = Counter()  # (source or "imu", reason)
        self._told: set[tuple[str, str]] = set()
        self.restarts = 0
        self._frame = None if config.origin is None else LocalFrame(np.array(config.origin))
        self._verdicts = VerdictProcess(config.verdict_every)
        self._said = ""  # the last message of a NodeStatus
        # refuses and compiles before the first message comes
        self._stream({}, Mount.none(), None)
        self._wait()

    def _check_fields(self) -> None:
        for each in self.config.sources:
            if each.kind == "magnetic-field" and each.field is None and self.config.place is None:
                raise DataError(
                    f"{each.name}.field is missing; give it in T north, east, down, or give place"
                )

    def _wait(self) -> None:
        """Begin without messages."""
        self.live: sd.LiveStream | None = None
        self._last_arrival: int | None = None
        self.waits_for = f"the first IMU message on {self.config.imu.topic}"
        self._held: deque[_Held] = deque()
        self._frames: dict[int, str] = {}
        self._first_imu = 0
        self._due = -inf

    def restart(self, reason: str) -> None:
        """Begin from the next messages as at the start, in the same world frame."""
        self.restarts += 1
        self._tell(f"{reason}: beginning anew")
        self._wait()

    # ---- messages

    def take_imu(self, message: Any, now: int) -> None:
        """Take a sensor_msgs/Imu that came at `now`, ns of the node's clock."""
        self._last_arrival = now
        self._take(IMU, message, now if self.config.imu.stamp == "arrival" else stamp_of(message))

    def take(self, source: int, message: Any, now: int) -> None:
        """Take a message of the source with this number in the configuration."""
        arrival = self.config.sources[source].stamp == "arrival"
        self._take(source, message, now if arrival else stamp_of(message))

    def _take(self, source: int, message: Any, stamp: int) -> None:
        if self.live is not None:
            self._use(source, message, stamp)
            return
        if not stamp:
            self._leave(source, NO_STAMP)
            return
        if len(self._held) == MAX_HELD:
            self._leave(self._held.popleft().source, WAITING)
        self._held.append(_Held(source, message, stamp))
        if frame := frame_of(message):
            self._frames.setdefault(source, frame)
        if source == IMU:
            self._first_imu = self._first_imu or stamp
            self._begin(stamp)

    def _leave(self, source: int, reason: str) -> None:
        """Count a message that is not used, and tell the first one."""
        name = "imu" if source == IMU else self.config.sources[source].name
        self.unused[name, reason] += 1
        if (name, reason) not in self._told:
            self._told.add((name, reason))
            self._tell(f"{name}: message {reason} not used{REMEDIES.get(reason, '').format(name)}")

    # ---- the begin

    def _begin(self, stamp: int) -> None:
        """Build the stream once it is known how the sensors stand."""
        imu = self._imu_mount()
        if imu is None:
            return
        mounts = {k: self._mount(k) for k in range(len(self.config.sources))}
        missing = [k for k, mount in mounts.items() if mount is None]
        waited = (stamp - self._first_imu) * 1e-9
        if missing and waited < self.config.tf_within:
            self.waits_for = self._lacks(missing[0])
            return
        for k in missing:
            self._tell(f"{self._lacks(k)}: missing for {waited:.0f} s; begun without it")
        self._clock, self._arm = RosClock(self._first_imu), imu.arm
        self._increments = Increments(imu)
        self._mounts = {k: mount for k, mount in mounts.items() if mount is not None}
        self._places = {k: place for place, k in enumerate(self._mounts)}
        self.live = self._stream(self._mounts, imu, self._clock)
        self.waits_for = ""
        held, self._held = self._held, deque()
        for each in held:
            self._take(*each)

    def _imu_mount(self) -> Mount | None:
        own = self.config.imu
        if own.mount is not None:
            return own.mount
        frame = own.frame or self._frames.get(IMU, "")
        pose = self._pose(frame)
        self.waits_for = f"the transform {self.config.base_frame} -> {frame}"
        if not frame:
            self.waits_for = "imu.frame or imu.lever_arm, since the IMU's messages name no frame"
        return None if pose is None else imu_mount_at(pose)

    def _mount(self, source: int) -> Mount | None:
        own = self.config.sources[source]
        if own.mount is not None:
            return own.mount
        frame = own.frame or self._frames.get(source, "")
        if not frame or WORLD.search(frame):
            return None
        pose = self._pose(frame)
        return None if pose is None else mount_at(pose)

    def _pose(self, frame: str) -> Pose | None:
        return HERE if frame == self.config.base_frame else self._lookup(frame) if frame else None

    def _lacks(self, source: int) -> str:
        """Say what is missing of a source."""
        own = self.config.sources[source]
        frame = own.frame or self._frames.get(source, "")
        if not frame:
            return f"{own.name}: a message on {own.topic} with its frame (or {own.name}.frame)"
        if WORLD.search(frame):
            return f"{own.name}: {own.name}.frame, since {frame} is fixed to the ground"
        return f"{own.name}: the transform {self.config.base_frame} -> {frame}"

    def _stream(
        self, mounts: dict[int, Mount], imu: Mount, clock: RosClock | None
    ) -> sd.LiveStream:
        """Return the stream with these sources; without a clock, one with all for a trial."""
        own = self.config
        numbers = range(len(own.sources)) if clock is None else mounts
        sources = [
            self._source(own.sources[k], mounts.get(k, imu).arm - imu.arm, clock) for k in numbers
        ]
        return sd.LiveStream(
            own.filter,
            sources=sources,
            imu=own.imu.grade,
            vehicle=own.vehicle,
            start=None if clock is None else self._start(clock),
            lag=own.lag,
            replay=own.replay,
            align_within=own.align_within,
            history=own.history,
            options=own.options,
            estimate=own.estimate,
            on_event=lambda t, text: self._tell(f"{t:.2f} s: {text}"),
        )

    def _start(self, clock: RosClock) -> sd.InitialState | None:
        place, heading = self.config.place, self.config.heading
        measured = any(each.kind == "position" for each in self.config.sources)
        lla = () if place is None or measured else place
        rph = () if heading is None else (nan, nan, heading)
        if not (lla or rph):
            return None
        t = clock.time(self.config.imu.topic, self._first_imu)
        return sd.InitialState(t, lla=lla, rph=rph)

    def _source(self, own: SourceInput, arm: Array, clock: RosClock | None) -> sd.Source:
        kind = aiding.find(own.kind)
        width = len(kind.quantities)
        parameters: tuple[float, ...] = ()
        if kind.parameters in ("antenna", "reference"):
            parameters = tuple(arm.tolist())
        elif kind.parameters == "field":
            parameters = own.field or self._earth_field(own, clock)
        return sd.Source(
            own.kind,
            np.empty(0),
            np.empty((0, width)),
            np.empty((0, width)),
            parameters=parameters,
            gate=own.gate,
            name=own.name,
            robust=own.robust,
            adaptive=own.adaptive,
        )

    def _earth_field(self, own: SourceInput, clock: RosClock | None) -> tuple[float, ...]:
        if clock is None:
            return UNKNOWN_FIELD
        if clock.epoch is None:
            raise DataError(f"{own.name}.field is missing; stamps without a date do not give it")
        assert self.config.place is not None  # `_check_fields` asks for it
        return tuple(sd.geomagnetic_field(iso(clock.epoch)[:10], *self.config.place).field)

    # ---- in use

    def _use(self, source: int, message: Any, stamp: int) -> None:
        """Give a message to the stream."""
        assert self.live is not None
        if source != IMU and source not in self._places:
            self._leave(source, LEFT_OUT)
            return
        topic = (self.config.imu if source == IMU else self.config.sources[source]).topic
        try:
            t = self._clock.time(topic, stamp)
            if source == IMU:
                self._use_imu(self._increments.sample(t, message))
                return
            own = self.config.sources[source]
            y, std = reading_of(own.kind, message, self._mounts[source], own.std)
        except UnusedMessage as error:
            self._leave(source, str(error))
            return
        self.live.step(sd.Measurement(t, self._places[source], y, std))

    def _use_imu(self, sample: sd.Sample | None) -> None:
        live = self.live
        if live is None or sample is None:
            return
        live.step(sample)
        if live.started and self._is_due(live.t):
            self._emit(live)

    def _is_due(self, t: float) -> bool:
        every = 1 / self.config.rate
        if self._due - 2 * every < t < self._due - 1e-6:
            return False
        self._due = (t if abs(t - self._due) > every else self._due) + every
        return True

    def _emit(self, live: sd.LiveStream) -> None:
        state, stamp = live.belief, self._clock.stamp(live.t)
        if self._frame is None and np.isfinite(state.lla).all() and live.status != INVALID:
            self._frame = LocalFrame(np.array(state.lla))
        if self._frame is not None:
            shown = shown_state(stamp, live.status, state, self._arm, self._frame)
            if shown is not None:
                self._show(shown)

    # ---- reports

    def diagnosis(self, now: int) -> NodeStatus:
        """Return what a diagnostic_msgs/DiagnosticStatus says at `now`, ns of the node's clock; tell
        its message where it has changed."""
        found = self._diagnosis(now)
        if found.message != self._said:
            self._said = found.message
            self._tell(found.message)
        return found

    def _diagnosis(self, now: int) -> NodeStatus:
        live = self.live
        values = [(f"{name}: unused, {why}", str(n)) for (name, why), n in self.unused.items()]
        values.append(("restarts", str(self.restarts)))
        if self._last_arrival is None or now - self._last_arrival > IMU_SILENT * 1e9:
            return NodeStatus(STALE, f"no IMU message on {self.config.imu.topic}", values)
        if live is None or live.waits_for:
            waits = self.waits_for if live is None else live.waits_for
            return NodeStatus(WARN, f"waiting: {waits}", values + self._of_live(live))
        name, silent = Status(live.status).name.lower(), live.silent
        values += self._of_live(live)
        if live.status == VALID and not silent:
            return NodeStatus(OK, name, values)
        said = "".join(f"; {each} is silent" for each in silent)
        return NodeStatus(WARN, name + said, values)

    def _of_live(self, live: sd.LiveStream | None) -> list[tuple[str, str]]:
        if live is None:
            return []
        names = [self.config.sources[k].name for k in self._mounts]
        values = [("status", Status(live.status).name.lower()), ("filter", self.config.filter)]
        values.append(("alignments", str(live.alignments)))
        for name, (accepted, rejected) in zip(names, live.counts()):
            values += [(f"{name}: accepted", str(accepted)), (f"{name}: rejected", str(rejected))]
        values += [(f"{name}: silent, s", f"{s:.1f}") for name, s in live.silent.items()]
        values += [(f"dropped, {why}", str(n)) for why, n in live.dropped_by.items() if n]
        if live.events:
            values.append(("last event", live.events[-1][1]))
        return values + self._of_verdict(live)

    def _of_verdict(self, live: sd.LiveStream) -> list[tuple[str, str]]:
        """Return the newest verdict, and have another one made where it is due."""
        if not self.config.verdict_every:
            return []
        self._verdicts.look(live.stream)
        found = []
        if newest := self._verdicts.newest:
            found += [("verdict", newest.verdict.line), ("verdict: on", newest.span)]
        if self._verdicts.error:
            found.append(("verdict: failed", self._verdicts.error))
        return found

    def close(self) -> None:
        """End the process that makes verdicts."""
        self._verdicts.close()


REMEDIES = {
    NO_STD: "; give {}.std",
    NO_STAMP: "; let its driver stamp it, or give {}.stamp: arrival",
    OTHER_CLOCK: "; synchronise its driver, or give {}.stamp: arrival",
}
"""{reason why a message is not used: what to do}."""
