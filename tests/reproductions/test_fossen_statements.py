"""What the chapter states besides its case studies, against closed forms; the recorded flight; and the
concordance, whose references must lead somewhere."""

from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from strapdown.filters.ahrs_aided.fixed_gain import poles
from strapdown_reproductions.common.concordance import concordance, missing_references
from strapdown_reproductions.fossen import cases, claims, flight_picture, signals, statements
from strapdown_reproductions.fossen.concordance import entries


@pytest.mark.short
def test_the_static_attitude_errs_by_the_angle_of_the_acceleration():
    """A coordinated turn is banked by atan(v rate / g), and its force points along the body's down."""
    found = statements.static().set_index("motion")
    bank = np.degrees(np.arctan(statements.SPEED * statements.RATE / 9.82))
    assert found.loc["coordinated turn", "tilt_deg"] == pytest.approx(bank, rel=0.01)
    assert found.loc["coordinated turn", "acceleration_m_s2"] == pytest.approx(6.0, rel=1e-3)
    assert found.loc["at rest", "tilt_deg"] < 1e-6
    share = np.degrees(found.loc["signal 2", "acceleration_m_s2"] / 9.82)
    assert 0.5 * share < found.loc["signal 2", "tilt_deg"] < share


@pytest.mark.short
def test_the_observer_converges_at_its_poles(monkeypatch):
    """From a small error about the vertical, of a field across it: error and bias are those of the linear
    system e' = b - k e, b' = -ki k e, where b is the bias that is left."""
    k, ki = cases.OBSERVER_GAINS["k2"], cases.OBSERVER_GAINS["ki"]
    monkeypatch.setattr(signals, "GYRO_BIAS", (0.0, 0.0, 1e-3))
    monkeypatch.setattr(statements, "OBSERVED", 4.0)
    monkeypatch.setattr(statements, "STEP", 1e-3)
    start = Rotation.from_rotvec([0.0, 0.0, 0.01]).as_matrix()[None]
    left = statements.observer(start, np.array([1.0, 0.0, 0.0]))
    F = np.array([[-k, 1.0], [-ki * k, 0.0]])
    expected = expm(4.0 * F) @ [0.01, 1e-3]
    assert left[0] == pytest.approx(np.degrees(abs(expected[0])), rel=5e-3)


@pytest.mark.short
def test_from_far_away_it_comes_home_with_the_field_across_the_vertical():
    found = statements.stability([1, 2, 3])
    far = found[found["start_deg"] == 170.0].set_index("field")["off_deg"]
    assert far["projected"].max() < 1e-4 and far["whole"].max() < 0.1


@pytest.mark.short
@pytest.mark.parametrize("gains", [(0.7, 0.14, 0.008), (0.1, 0.02, 0.01)])
def test_the_poles_of_F_are_those_of_the_observer(gains):
    """The second set is beyond Hurwitz's bound k1 k2 > k3."""
    F = statements.error_dynamics(*gains)
    found = np.sort_complex(np.linalg.eigvals(F))
    np.testing.assert_allclose(found, np.sort_complex(poles(*gains)), atol=1e-12)
    assert (found.real.max() < 0) == (gains[0] * gains[1] > gains[2])


@pytest.mark.short
def test_hurwitz_gains_settle_and_diverge_in_a_turn_twice_too_fast():
    found = statements.gains(range(3))
    assert (found[found["hurwitz"]]["left"] < 0.01).all()
    assert (found[~found["hurwitz"]]["left"] > 1).all()
    assert (found[found["hurwitz"]]["turning_1_s"] > 0).all()
    slow = np.linalg.eigvals(statements.error_dynamics(0.7, 0.14, 0.008, 1e-4)).real.max()
    assert slow < 0


@pytest.mark.short
def test_four_elements_have_three_errors():
    found = statements.quaternion(range(10))
    assert found["smallest"].max() < 1e-12
    assert found["length"].to_list() == pytest.approx([np.hypot(1, 0.05) - 1] * 10, rel=1e-9)


def test_on_the_recorded_flight_gnss_tells_the_force(data_folder):
    """2.6 against 12 deg of an axis; the recording is in the data folder."""
    found = statements.flight()
    rms = statements.flight_rms(found)
    assert rms["gnss"] == pytest.approx(2.64, abs=0.1) and rms["gravity"] == pytest.approx(
        12.3, abs=0.5
    )
    assert found["second"].min() >= 200 and found["second"].max() < 600 and len(found) > 390


@pytest.mark.short
def test_a_flight_that_is_not_there_leaves_no_rows(tmp_path):
    assert statements.flight(tmp_path).empty
    assert np.isnan(statements.flight_rms(statements.flight(tmp_path))["gnss"])


@pytest.mark.short
def test_the_picture_has_a_line_for_each_reference_vector():
    """And says their rms; a tilt beyond the top stays at it."""
    seconds = np.arange(200.0, 210.0)
    flown = pd.DataFrame({"second": seconds, "gnss_deg": 2.0, "gravity_deg": 50.0})
    found = ElementTree.fromstring(flight_picture.draw_flight(flown))
    lines = found.findall("{*}polyline")
    heights = [{point.split(",")[1] for point in line.get("points").split()} for line in lines]
    assert heights == [{f"{flight_picture.y_of(tilt):.1f}"} for tilt in (30.0, 2.0)]
    texts = [text.text for text in found.findall("{*}text")]
    assert "reference by GNSS velocity: 2° rms" in texts
    assert "reference by gravity alone: 50° rms" in texts


@pytest.mark.short
def test_every_entry_of_the_concordance_leads_somewhere():
    found = [{"claim": "", "source": "", "verdict": "partly"}] * len(claims.CLAIMS)
    everything = entries(found)
    assert missing_references(everything) == []
    sections = {entry.printed.split(",")[0] for entry in everything}
    assert {f"14.{k}" for k in ("1", "1.1", "1.2", "1.3", "2.1", "2.2", "2.3")} <= sections
    assert {f"14.{k}" for k in ("3", "3.1", "3.2", "3.3", "4", "4.1", "4.2", "4.3")} <= sections
    assert concordance(everything).count("\n") == len(everything) + 2
