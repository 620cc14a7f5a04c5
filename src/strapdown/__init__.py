"""strapdown: aided inertial navigation, from IMU, GNSS and other records to position, velocity,
attitude and biases with honest uncertainties.

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

import lazy_loader

from .data.operations import provide

__version__ = "0.1.0"
# the names in __init__.pyi: `import strapdown` costs nothing
__getattr__, _dir, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ = [*__all__, "__version__"]
# what values can do through rooms above them
provide(
    {
        "clean": f"{__name__}.preprocessing.fixes:clean_recording",
        "errors": f"{__name__}.evaluation.metrics:errors",
        "at": f"{__name__}.evaluation.other_instants:at",
        "save solution": f"{__name__}.io.solution:write_solution",
        "save recording": f"{__name__}.io:write_recording",
        "installation": f"{__name__}.installation.states:estimated_installation",
        "judge": f"{__name__}.verdict.judge:judge",
        "card": f"{__name__}.pages.notebook.cards:card_of",
        "figure": f"{__name__}.pages.notebook.plots:figure_of",
        "frame": f"{__name__}.pages.notebook.labelled:frame_of",
        "dataset": f"{__name__}.pages.notebook.labelled:dataset_of",
    }
)


def __dir__() -> list[str]:
    return sorted(__all__)
