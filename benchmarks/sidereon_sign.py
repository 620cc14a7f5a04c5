"""The signs of sidereon's biases: how the error dynamics couple them, and how a correction applies them.

    python benchmarks/sidereon_sign.py          # with the extra `ranking`

An error of a bias, true less estimated, must turn up in velocity and attitude (estimated less true) with a
positive sign, since the bias is subtracted from the sample. Here a covariance of bias alone is propagated, and a
fix is used whose position error is correlated with one bias; the product of both signs is positive where the
correction goes the right way.
"""

import numpy as np

RADIUS = 6378137.0
"""m: on the equator."""
BLOCKS = {"accelerometer": (9, 3), "gyro": (12, 6)}
"""First error state of each bias, and of what it drives: velocity, attitude."""


def _filter(P):
    import sidereon as s

    nav = s.NavState(0.0, [RADIUS, 0.0, 0.0], [0.0] * 3, np.eye(3))
    state = s.InsFilterState.from_covariance(nav, s.ErrorStateLayout.FIFTEEN, P)
    spec = s.ImuSpec(1e-9, 1e-9, 1e-12, 1e-12, 1e6, 1e6)
    return s.InertialFilter.with_config(state, s.InertialFilterConfig(spec))


def dynamics(sensor):
    """Sign with which the error state of a bias drives that of velocity or attitude."""
    import sidereon as s

    bias, driven = BLOCKS[sensor]
    P = np.diag(np.full(15, 1e-12))
    P[bias, bias] = 1e-4
    run = _filter(P)
    run.propagate(s.ImuSample.increment(0.01, [0.098, 0.0, 0.0], [0.0] * 3, 0.01))
    return int(np.sign(np.asarray(run.state.covariance)[driven, bias]))


def correction(sensor):
    """Sign of (bias added to the estimate) over (what is taken off velocity or attitude) where a
    fix moves both error states alike."""
    import sidereon as s

    bias, driven = BLOCKS[sensor]
    changed = []
    for state in (bias, driven):
        P = np.eye(15)
        P[1, state] = P[state, 1] = 0.5
        run = _filter(P)
        run.update_loose(
            s.GnssFixMeasurement.position(
                0.0, [RADIUS, 0.01, 0.0], np.eye(3) * 1e-4, 10, fix_status=s.GnssFixStatus.FIXED
            )
        )
        nav = run.state.nominal
        turned = np.asarray(nav.attitude_body_to_ecef)[2, 1]  # about the first axis
        found = {
            3: nav.velocity_ecef_mps[0],
            6: turned,
            9: nav.accel_bias_mps2[0],
            12: nav.gyro_bias_rps[0],
        }
        changed.append(found[state])
    return int(np.sign(-changed[0] * changed[1]))


if __name__ == "__main__":
    for name in BLOCKS:
        signs = dynamics(name), correction(name)
        print(
            f"{name} bias: drives with {signs[0]:+d}, is corrected with {signs[1]:+d}:",
            "right" if signs[0] == signs[1] else "wrong",
        )
