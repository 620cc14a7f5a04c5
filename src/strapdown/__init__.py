"""strapdown: aided inertial navigation, from IMU, GNSS and other records to position, velocity, attitude and biases with honest uncertainties.

Conventions
-----------
Frames      navigation frame n is NED, body frame b is forward-right-down, e is ECEF, i is inertial; heights are ellipsoidal (WGS-84).
Attitude    C_nb takes b to n; Hamilton quaternions q_nb, scalar first; Euler angles ZYX: roll, pitch, heading (clockwise from true north).
Names       vec_a is a vector in frame a; omega_ie_n is the rate of e against i, in n; single letters (F, G, H, P, Q, R) as in the books.
Units       SI, radians, seconds in functions and arrays; degrees in tables and plots, where each column says its unit.
Force       the specific force of a level body at rest is -g on z.
IMU         samples are increments: row k is the integral over (t[k] - dt[k], t[k]].
Errors      delta = true - estimate; attitude error in n, q_true = dq (x) q_est; position errors in metres NED.
States      0-14: position, velocity, attitude, accelerometer bias, gyro bias.
"""
import importlib

__version__ = "0.1.0"

_PUBLIC = {
    "Aiding": "data", "DataError": "data", "Recording": "recording", "Solution": "data", "Trajectory": "data",
    "Belief": "core.contract", "Imu": "core.contract", "Noise": "core.contract", "Start": "core.contract",
    "fuse": "engine.batch", "smooth": "engine.smoothing", "Fix": "engine.stream", "Sample": "engine.stream", "Stream": "engine.stream",
    "align": "alignment.initial", "calibrate": "calibration.fitting", "Calibration": "calibration.fitting",
    "static_attitude": "alignment.static_attitude", "geomagnetic_field": "sensor_models.geomagnetism",
    "ImuSpec": "sensor_models.imu", "grade": "sensor_models.imu", "grades": "sensor_models.imu",
    "read": "io", "write_recording": "io", "write_solution": "io.solution", "read_solution": "io.solution",
    "report": "reports.page", "errors": "evaluation.metrics", "rms": "evaluation.metrics", "outages": "evaluation.metrics", "simulate": "sim.synthesis",
    "fly": "flight.fly", "Flight": "flight.fly", "FlightPlan": "flight.plan",
    "Scenario": "sim.scenario", "scenario": "sim.scenario", "scenarios": "sim.scenario", "Study": "experiments.monte_carlo.study", "Campaign": "experiments.monte_carlo.campaign",
    "Aircraft": "flight.aircraft.parameters", "aircraft": "flight.aircraft.parameters", "trim": "flight.aircraft.trim", "linearise": "flight.aircraft.modes",
    "compare": "experiments.outages.compare", "Comparison": "experiments.outages.result",
}
__all__ = [*_PUBLIC, "__version__"]


def __getattr__(name):
    """Public names are imported on first use: `import strapdown` costs nothing."""
    if name in _PUBLIC:
        return getattr(importlib.import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return sorted(__all__)
