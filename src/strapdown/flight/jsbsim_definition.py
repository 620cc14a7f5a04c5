"""An Aircraft written as a JSBSim aircraft definition (XML): the same forces and moments in
JSBSim's functions, written anew from the equations."""

import math
from pathlib import Path
from typing import Any, TypeAlias
from xml.sax.saxutils import escape

from ..checks import DataError
from ..fileio.files import replacing
from ..sim.jsbsim import FOOT
from ..typing import File
from .aircraft_model.parameters import Aircraft, aircraft as find

SLUG, POUND = 14.593902937206364, 4.4482216152605
"""kg, N."""
SLUG_WEIGHT = 32.174049
"""JSBSim's own pounds to the slug."""
CONTROLS = (
    "controls/elevator-rad",
    "controls/aileron-rad",
    "controls/rudder-rad",
    "controls/throttle",
)
"""Properties of the definition: positions of the controls, which act as they are set, without
lag or stop."""
Terms: TypeAlias = float | str | tuple[Any, ...]
"""A number, a property's name, or (operation, terms, ...)."""


def jsbsim_definition(aircraft: Aircraft | File, folder: File) -> Path:
    """Write an Aircraft (or that of a name) as folder/NAME/NAME.xml, a JSBSim aircraft definition;
    returns that path. Raises DataError where it cannot be written.

    It has mass and inertia, no ground contact and no engine of JSBSim's: forces and moments are
    functions of airspeed, flow angles, rates and `CONTROLS`, the propeller and its motor among
    them, in SI, turned into pounds and feet at their end. Mass and forces act at one point.
    """
    aircraft = find(aircraft)
    name = "".join(
        letter if letter.isascii() and letter.isalnum() else "_" for letter in aircraft.name
    )
    path = Path(folder) / name / f"{name}.xml"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(
            f"{path.parent}: cannot be made ({error.strerror}); choose another folder"
        ) from None
    with replacing(path) as part:
        part.write_text(_document(aircraft), encoding="utf-8")
    return path


def _document(aircraft: Aircraft) -> str:
    """The text of the definition."""
    quantities, axes = _equations(aircraft)
    here = "<x>0</x><y>0</y><z>0</z></location>"
    inertia = "".join(
        f'<{axis} unit="SLUG*FT2">{aircraft[name] / (SLUG * FOOT**2)!r}</{axis}>'
        for axis, name in (("ixx", "J_x"), ("iyy", "J_y"), ("izz", "J_z"), ("ixz", "J_xz"))
    )
    lines = [
        '<?xml version="1.0"?>',
        f'<fdm_config name="{escape(aircraft.name, {chr(34): "&quot;"})}" version="2.0" '
        f'release="ALPHA">',
        "<metrics>",
        f'<wingarea unit="M2">{aircraft["area"]!r}</wingarea><wingspan '
        f'unit="M">{aircraft["span"]!r}</wingspan>'
        f'<chord unit="M">{aircraft["chord"]!r}</chord>',
        f'<location name="AERORP" unit="M">{here}',
        f'<location name="VRP" unit="M">{here}',
        "</metrics>",
        '<mass_balance negated_crossproduct_inertia="false">',
        inertia,
        f'<emptywt unit="LBS">{aircraft["mass"] / SLUG * SLUG_WEIGHT!r}</emptywt>',
        f'<location name="CG" unit="M">{here}',
        "</mass_balance>",
        "<ground_reactions/>",
        '<flight_control name="direct">',
        *(f'<property value="0">{key}</property>' for key in CONTROLS),
        "</flight_control>",
        "<aerodynamics>",
        *(
            f'<function name="{name}">{_xml(terms)}</function>'
            for name, terms in quantities.items()
        ),
        *(
            f'<axis name="{axis}"><function name="craft/{axis}">{_xml(terms)}</function></axis>'
            for axis, terms in axes.items()
        ),
        "</aerodynamics>",
        "</fdm_config>",
        "",
    ]
    return "\n".join(lines)


def _xml(terms: Terms) -> str:
    """A number, a property's name, or (operation, terms, ...) as JSBSim writes them."""
    if isinstance(terms, str):
        return f"<p>{terms}</p>"
    if isinstance(terms, tuple):
        return f"<{terms[0]}>{''.join(map(_xml, terms[1:]))}</{terms[0]}>"
    return f"<v>{float(terms)!r}</v>"


def _equations(a: Aircraft) -> tuple[dict[str, Terms], dict[str, Terms]]:
    """({property: terms} in the order in which they are computed, {axis of JSBSim: terms in lbf
    and lbf ft}) of the aircraft `a`."""
    elevator, aileron, rudder, _ = CONTROLS
    alpha, beta, V, qS = "aero/alpha-rad", "aero/beta-rad", "craft/V", "craft/qS"
    p, q, r = (f"velocities/{axis}-aero-rad_sec" for axis in "pqr")

    def times(name: str, factor: Terms) -> Terms:
        return ("product", a[name], factor)

    half_chord, half_span = (
        ("quotient", a["chord"] / 2, ("max", V, 1e-6)),
        ("quotient", a["span"] / 2, ("max", V, 1e-6)),
    )

    def coefficient(axis: str) -> Terms:
        """The linear derivatives of side force or of a moment about x or z."""
        turning = ("sum", times(f"C_{axis}_p", p), times(f"C_{axis}_r", r))
        return (
            "sum",
            a[f"C_{axis}_0"],
            times(f"C_{axis}_beta", beta),
            times(f"C_{axis}_aileron", aileron),
            times(f"C_{axis}_rudder", rudder),
            ("product", half_span, turning),
        )

    quantities = {
        "craft/rho": _density(a),
        V: ("product", FOOT, "velocities/vt-fps"),
        qS: ("product", 0.5 * a["area"], "craft/rho", V, V),
        "craft/CL-linear": ("sum", a["C_L_0"], times("C_L_alpha", alpha)),
        "craft/stalled": _stalled_share(a, alpha),
        "craft/CL": (
            "sum",
            ("product", ("difference", 1, "craft/stalled"), "craft/CL-linear"),
            (
                "product",
                2,
                "craft/stalled",
                ("abs", ("sin", alpha)),
                ("sin", alpha),
                ("cos", alpha),
            ),
            times("C_L_elevator", elevator),
            ("product", half_chord, times("C_L_q", q)),
        ),
        "craft/CD": (
            "sum",
            a["C_D_p"],
            (
                "quotient",
                ("pow", "craft/CL-linear", 2),
                math.pi * a["oswald"] * a["span"] ** 2 / a["area"],
            ),
            times("C_D_elevator", elevator),
            ("product", half_chord, times("C_D_q", q)),
        ),
        **_propeller(a, V),
    }
    pitch = (
        "sum",
        a["C_m_0"],
        times("C_m_alpha", alpha),
        times("C_m_elevator", elevator),
        ("product", half_chord, times("C_m_q", q)),
    )
    forward = (
        "difference",
        ("product", "craft/CL", ("sin", alpha)),
        ("product", "craft/CD", ("cos", alpha)),
    )
    downward = (
        "sum",
        ("product", "craft/CL", ("cos", alpha)),
        ("product", "craft/CD", ("sin", alpha)),
    )
    newton, newton_metre = 1 / POUND, 1 / (POUND * FOOT)
    return quantities, {
        "X": ("product", newton, ("sum", ("product", qS, forward), "craft/thrust")),
        "Y": ("product", newton, qS, coefficient("Y")),
        "Z": ("product", -newton, qS, downward),
        "ROLL": (
            "product",
            newton_metre,
            ("difference", ("product", a["span"], qS, coefficient("l")), "craft/torque"),
        ),
        "PITCH": ("product", newton_metre, a["chord"], qS, pitch),
        "YAW": ("product", newton_metre, a["span"], qS, coefficient("n")),
    }


def _density(a: Aircraft) -> Terms:
    """kg/m^3: the aircraft's constant one, not JSBSim's atmosphere; where it is 0 the standard
    atmosphere in the formula that the aircraft has."""
    if a["density"] > 0:
        return a["density"]
    height = ("min", ("max", ("product", FOOT, "position/geod-alt-ft"), -5000), 11000)
    geopotential = ("quotient", height, ("sum", 1, ("quotient", height, 6356766)))
    return (
        "product",
        1.225,
        ("pow", ("difference", 1, ("product", 2.25577e-5, geopotential)), 4.25588),
    )


def _stalled_share(a: Aircraft, alpha: str) -> Terms:
    """Share of the flat plate in the lift: Beard & McLain's sigmoid in its own form, bounded so
    that its exponentials do not overflow."""
    up = (
        "exp",
        ("min", 300, ("product", -a["stall_blend"], ("difference", alpha, a["stall_alpha"]))),
    )
    down = ("exp", ("min", 300, ("product", a["stall_blend"], ("sum", alpha, a["stall_alpha"]))))
    return ("quotient", ("sum", 1, up, down), ("product", ("sum", 1, up), ("sum", 1, down)))


def _propeller(a: Aircraft, V: str) -> dict[str, Terms]:
    """Thrust (N), torque (N m) and turns per second of the propeller in balance with its motor:
    both torques are quadratic in the turns."""
    D, rho, K, R = a["diameter"], "craft/rho", a["motor_constant"], a["resistance"]
    C_T, C_Q = ([a[f"C_{letter}_{i}"] for i in range(3)] for letter in "TQ")

    def moment(coefficients: list[float]) -> Terms:
        return (
            "sum",
            ("product", coefficients[0] * D * D, "craft/turns", "craft/turns"),
            ("product", coefficients[1] * D, "craft/turns", V),
            ("product", coefficients[2], V, V),
        )

    root = ("difference", ("pow", "craft/b", 2), ("product", 4, "craft/a", "craft/c"))
    turns = (
        "max",
        0,
        (
            "quotient",
            ("difference", ("sqrt", ("max", 0, root)), "craft/b"),
            ("product", 2, "craft/a"),
        ),
    )
    return {
        "craft/a": ("product", C_Q[0] * D**5, rho),
        "craft/b": ("sum", ("product", C_Q[1] * D**4, rho, V), 2 * math.pi * K * K / R),
        "craft/c": (
            "difference",
            ("product", C_Q[2] * D**3, rho, V, V),
            (
                "product",
                K,
                ("difference", ("product", a["voltage"] / R, CONTROLS[3]), a["idle_current"]),
            ),
        ),
        "craft/turns": turns,
        "craft/thrust": ("product", rho, D * D, moment(C_T)),
        "craft/torque": ("product", rho, D**3, moment(C_Q)),
    }
