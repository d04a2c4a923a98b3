import pickle
import shutil
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest

import farnear

MODEL = Path(__file__).resolve().parents[2] / "host" / "recognition" / "models" / "everyday-cut-out.fnm"
CAMERA = """
[camera]
height_m = 0.8
azimuth_deg = 140.0
pitch_deg = 0.0
focal_length_mm = 4.0
pixel_um = 6.0
"""


def person(shadow):
    """Somebody upright, and a shadow that lies to the right."""
    mask = np.zeros((480, 640), bool)
    mask[140:330, 300:340] = True
    mask[110:145, 310:330] = True
    if shadow:
        for row in range(300, 330):
            mask[row, 340 : 340 + 6 * (330 - row)] = True
    return mask


def test_the_sun_stands_where_it_does():
    text = farnear.sun_position("2014-06-23T11:30:00Z", 52.38, -1.56)
    zone = timezone(timedelta(hours=1))
    assert farnear.sun_position(datetime(2014, 6, 23, 12, 30, tzinfo=zone), 52.38, -1.56) == text
    reference = farnear.sun_position("2014-06-23T11:30:00Z", 52.38, -1.56, model="spa")
    assert text == pytest.approx(reference, abs=0.05)
    with pytest.raises(farnear.FarnearError, match="95"):
        farnear.sun_position("2014-06-23T11:30:00Z", 95, 0)
    with pytest.raises(farnear.FarnearError, match="RFC 3339"):
        farnear.sun_position(datetime(2014, 6, 23), 0, 0)  # without its zone


def test_a_shadow_is_cut_off():
    # The camera looks north-west and the sun stands to its left, behind it: the shadow falls to the right.
    clean, said = farnear.remove_shadow(person(True), CAMERA, elevation_deg=30, azimuth_deg=130)
    assert clean.dtype == bool and clean.shape == (480, 640)
    assert not (clean & ~person(True)).any(), "nothing is added"
    assert 0 <= said["removed_fraction"] < 1 and isinstance(said["trustworthy"], bool)
    with pytest.raises(farnear.FarnearError, match="64x48|64 x 48|48"):
        farnear.remove_shadow(np.ones((48, 64), bool), CAMERA, elevation_deg=30, azimuth_deg=130)
    with pytest.raises(farnear.FarnearError, match="empty|no subject|nobody"):
        farnear.remove_shadow(np.zeros((480, 640), bool), CAMERA, elevation_deg=30, azimuth_deg=130)


@pytest.mark.parametrize(
    "wrong", [{"elevation_deg": 91}, {"elevation_deg": float("nan")}, {"azimuth_deg": float("inf")}], ids=str
)
def test_a_sun_that_cannot_be_is_refused_by_its_angle(wrong):
    (name,) = wrong
    with pytest.raises(farnear.FarnearError, match=name):
        farnear.remove_shadow(person(True), CAMERA, **{"elevation_deg": 30, "azimuth_deg": 130, **wrong})


def test_a_recogniser_of_a_file_is_unpickled_in_another_folder(tmp_path, monkeypatch):
    if not MODEL.is_file():
        pytest.skip("the sources are not there")
    shutil.copy(MODEL, tmp_path / "own.fnm")
    monkeypatch.chdir(tmp_path)
    pickled = pickle.dumps(farnear.Recogniser("own.fnm"))
    monkeypatch.chdir(tmp_path.parent)
    assert pickle.loads(pickled).activities


def test_descriptors_follow_the_shape():
    mask = person(False)
    found = farnear.centroid_distance(mask)
    assert found.shape == (360,) and found.dtype == np.float32
    moved = farnear.centroid_distance(np.roll(mask, 50, axis=1).astype(np.uint8) * 255)
    assert np.array_equal(found, moved), "the place in the picture says nothing"
    assert found[90] > 2 * found[0], "taller than wide"
    with pytest.raises(farnear.FarnearError, match="empty"):
        farnear.centroid_distance(np.zeros((10, 10), bool))
    with pytest.raises(TypeError, match="bool"):
        farnear.centroid_distance(mask.astype(float))
