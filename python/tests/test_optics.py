import pickle

import numpy as np
import pytest

import farnear


def test_the_rig_of_the_thesis_has_its_distances(optics):
    # The reference figures carry two and four decimals.
    assert optics.near_mm == pytest.approx(886.81, abs=6e-3)
    assert optics.sensor_far_mm == pytest.approx(52.8313, abs=1e-4)
    assert optics.depth_mm(optics.alpha(900.0)) == pytest.approx(900.0)
    assert optics.depth_mm(-1.0) == pytest.approx(optics.far_mm)
    assert optics.blur_px(1.0) == pytest.approx((optics.max_blur_px, 0.0))


def test_optics_are_values(optics):
    same = farnear.Optics(
        focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf="gaussian:k=0.4578"
    )
    assert same == optics == farnear.Optics.loads(optics.dumps())
    assert "933" in repr(optics)


def test_wrong_optics_are_named(optics, tmp_path):
    with pytest.raises(farnear.FarnearError, match="near_mm"):
        farnear.Optics(focal_length_mm=50, f_number=4, pixel_um=7.4, far_mm=933, near_mm=1000)
    broken = tmp_path / "optics.toml"
    broken.write_text(optics.dumps().replace("far_mm = 933.0", "far_mm = -1.0"))
    with pytest.raises(farnear.FarnearError, match="optics.toml.*-1"):
        farnear.Optics.load(broken)
    with pytest.raises(FileNotFoundError):
        farnear.Optics.load(tmp_path / "gone.toml")


def test_operators_go_through_their_text(optics):
    operators = farnear.Operators(optics, kernel_size=5)
    again = farnear.Operators.loads(operators.dumps())
    assert again.name == operators.name and "gro" in operators.name
    kernel = operators.kernel("gp1")
    assert kernel.shape == (5, 5) and kernel.dtype == np.float64
    assert np.array_equal(kernel, again.kernel("gp1"))
    assert np.allclose(kernel, kernel.T), "the point spread function is round"
    with pytest.raises(farnear.FarnearError, match="gaussian"):
        farnear.Operators(optics, family="ro")
    with pytest.raises(farnear.FarnearError, match="gm1"):
        operators.kernel("gm2")


def test_what_is_sent_to_other_processes_arrives(optics):
    assert pickle.loads(pickle.dumps(optics)) == optics
    operators = farnear.Operators(optics)
    assert pickle.loads(pickle.dumps(operators)).dumps() == operators.dumps()
