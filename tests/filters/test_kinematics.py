"""The position error of an open loop far from the truth: what each kinematics leaves out,
against two mechanizations and against hand-made products."""

import numpy as np
import pytest

from strapdown.core.loop.contract import InitialState, Noise, compile_kernel
from strapdown.core.mathematics.earth import radii
from strapdown.core.mathematics.error_state import X
from strapdown.core.mathematics.mechanization import mechanize
from strapdown.filters import find
from strapdown.filters.ins import open_loop
from strapdown.geometry.geodesy import displacement

pytestmark = pytest.mark.short
DEG, SECONDS, DT = np.pi / 180, 10.0, 0.05
# true - INS: 50 km too high, falling behind at 100 m/s
ERROR = np.array([1e3, 2e3, 50e3, 20.0, -15.0, 100.0, *[0.0] * 9])
NOISE = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
INCREMENT = np.array([0, 0, 0, 0.1, 0.2, -9.7]) * DT


def ins_behind(lla, error):
    """The INS position from which `error` in metres at the INS leads to `lla`."""
    ins = lla + [0.0, 0.0, error[2]]
    for _ in range(20):
        R_M, R_N = radii(ins[0])
        ins[0], ins[1] = (
            lla[0] - error[0] / (R_M + ins[2]),
            lla[1] - error[1] / ((R_N + ins[2]) * np.cos(ins[0])),
        )
    return ins


def left_out(kinematics):
    """True position and velocity less those of the open loop after SECONDS, and the error state
    halfway."""
    start = InitialState(
        0.0,
        (48 * DEG, 0.2, 3000.0),
        (60.0, -50.0, 2.0),
        (0.1, 0.05, 1.0),
        (0.0,) * 3,
        (0.0,) * 3,
        (1.0,) * 15,
    )
    loop = find("open-loop")
    compile_kernel(loop.predict)
    belief = loop.start(start, NOISE, kinematics=kinematics)
    lla, v, C = np.array(start.lla), np.array(start.v_n), belief.C_nb.copy()
    belief.workspace[open_loop.LLA], belief.workspace[open_loop.V], belief.workspace[X] = (
        ins_behind(lla, ERROR),
        v - ERROR[3:6],
        ERROR,
    )
    steps, middle = round(SECONDS / DT), None
    for k in range(steps):
        mechanize(lla, v, C, INCREMENT[:3], INCREMENT[3:], DT, np.zeros(3))
        loop.predict(belief, INCREMENT, DT, NOISE)
        middle = belief.workspace[X].copy() if k == steps // 2 else middle
    return displacement(lla, belief.lla), v - belief.v_n, middle


def test_second_order_leaves_out_what_gravity_and_velocity_do_and_nothing_of_position():
    position, velocity, _ = left_out("second-order")
    assert np.all(np.abs(velocity) < 0.02)  # half the second derivative of gravity: 1.8e-3 m/s^2
    # position errs as the velocity makes it
    np.testing.assert_allclose(position, velocity * SECONDS / 2, atol=0.006)


@pytest.mark.parametrize(
    "kinematics, north, east",
    [
        ("metres", lambda x, tan: x[5] * x[0], lambda x, tan: (x[5] + tan * x[3]) * x[1]),
        ("geodetic", lambda x, tan: -x[3] * x[2], lambda x, tan: -(x[2] + tan * x[0]) * x[4]),
    ],
)
def test_linear_kinematics_leave_out_products_of_position_and_velocity_errors(
    kinematics, north, east
):
    best, _, x = left_out("second-order")
    position, _, _ = left_out(kinematics)
    R_M, R_N = radii(48 * DEG)
    expected = (
        np.array([north(x, np.tan(48 * DEG)) / R_M, east(x, np.tan(48 * DEG)) / R_N]) * SECONDS
    )
    np.testing.assert_allclose((position - best)[:2], expected, rtol=0.02)
    assert abs((position - best)[2]) < 1e-4


def test_an_unknown_kinematics_is_refused():
    with pytest.raises(
        ValueError, match="kinematics is 'exact'; it must be one of second-order, metres, geodetic"
    ):
        find("open-loop").start(
            InitialState(
                0.0, (0.8, 0.2, 0.0), (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (1.0,) * 15
            ),
            NOISE,
            kinematics="exact",
        )
