"""Inputs, in the workspace, of a filter that computes with the controls; the loop sets them before
each sample."""

from ..core.compile.workspace import Slots

TOLD = Slots()
BY_MODEL = TOLD.number("BY_MODEL")  # 1 where the model is to predict, 0 where the IMU
CONTROLS = TOLD.array("CONTROLS", 4)  # mid-sample: elevator, aileron, rudder (rad), throttle
WIND = TOLD.array("WIND", 3)  # the wind that the filter is told, m/s, NED
SECONDS = TOLD.number("SECONDS")  # of the sample
TOLD_SIZE = TOLD.size
