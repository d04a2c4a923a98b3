"""Depth maps in other people's viewers, where those are installed."""

import numpy as np
import pytest

import farnear
from farnear.viewers import RerunView, to_open3d, watch


@pytest.fixture(scope="module")
def found(slant, optics):
    far, near, _ = slant
    return farnear.depth(far, near, optics)


def test_points_lie_on_the_rays_of_their_pixels(optics):
    depth_mm = np.full((3, 5), 910, np.float32)
    depth_mm[0, 0] = np.nan
    points = farnear.points_mm(depth_mm, optics)
    # A pixel of pitch p sees p (z - F) / F of the object.
    step_mm = 7.4e-3 * (910 - 50) / 50
    assert np.isnan(points[0, 0]).all()
    assert points[1, 2] == pytest.approx([0, 0, -910])
    assert points[2, 4] == pytest.approx([2 * step_mm, -step_mm, -910], rel=1e-6)


def test_open3d_gets_the_pixels_with_a_depth(found, slant, optics):
    pytest.importorskip("open3d")
    far = slant[0]
    cloud = to_open3d(found, optics, far, min_confidence=0.5)
    keep = np.isfinite(found.depth_mm) & (found.confidence >= 0.5)
    assert 0 < len(cloud.points) == keep.sum()
    assert np.asarray(cloud.points)[:, 2] == pytest.approx(-found.depth_mm[keep])
    assert np.asarray(cloud.colors)[:, 0] == pytest.approx(far[keep] / 255)
    with pytest.raises(farnear.FarnearError, match="the image is"):
        to_open3d(found, optics, far[:, 1:])


def test_rerun_gets_the_pairs_of_a_rig(emulated_rig, optics, tmp_path):
    pytest.importorskip("rerun")
    recording = tmp_path / "pairs.rrd"
    with RerunView(optics, save=str(recording)) as view:
        for number, found in enumerate(watch(emulated_rig, view, optics)):
            assert found.valid_fraction > 0.9
            if number == 1:
                break
    # Two pairs of 640x480: two images, two maps of floats and a cloud.
    assert recording.stat().st_size > 2 * 640 * 480 * 10


def test_a_viewer_that_is_not_installed_is_named(monkeypatch, optics):
    import importlib

    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(farnear.FarnearError, match="pip install rerun-sdk"):
        RerunView(optics)
