"""Depth maps in other people's viewers, where those are installed."""

import numpy as np
import pytest

import farnear
from farnear.viewers import FoxgloveView, RerunView, _grey, to_open3d, watch


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


def test_holes_of_integer_maps_have_no_point(optics, learned):
    depth_mm = np.full((3, 5), 910, np.uint16)
    depth_mm[0, 0] = 0
    points = farnear.points_mm(depth_mm, optics)
    assert np.isnan(points[0, 0]).all() and np.isfinite(points).all(axis=2).sum() == 14
    # Depths of `calibrate_stack` are relative.
    scaled = farnear.Optics.loads(learned.dumps().replace("scale_known = false", "scale_known = true"))
    relative = farnear.points_mm(depth_mm.astype(np.float32) - 911, scaled)
    assert np.isfinite(relative).all()


def test_pixels_without_a_value_are_black_and_the_others_keep_their_grey():
    values = np.array([[1.0, np.nan], [2.0, -1.0]])
    for image in (values, values.astype(np.float32), np.ma.masked_invalid(values)):
        assert np.array_equal(_grey(image), [[0.5, 0.0], [1.0, 0.0]])
    codes = np.ma.masked_greater(np.array([[51, 255]], np.uint8), 100)
    assert np.array_equal(_grey(codes), [[0.2, 0.0]])


def test_open3d_gets_the_pixels_with_a_depth(found, slant, optics):
    pytest.importorskip("open3d")
    far = slant[0]
    cloud = to_open3d(found, far, min_confidence=0.5)
    keep = np.isfinite(found.depth_mm) & (found.confidence >= 0.5)
    assert 0 < len(cloud.points) == keep.sum()
    assert np.asarray(cloud.points)[:, 2] == pytest.approx(-found.depth_mm[keep])
    assert np.asarray(cloud.colors)[:, 0] == pytest.approx(far[keep] / 255)
    with pytest.raises(farnear.FarnearError, match="the image is"):
        to_open3d(found, far[:, 1:])


def test_rerun_gets_the_pairs_of_a_rig(emulated_rig, optics, tmp_path):
    pytest.importorskip("rerun")
    recording = tmp_path / "pairs.rrd"
    with RerunView(save=str(recording)) as view:
        for number, found in enumerate(watch(emulated_rig, view, optics)):
            assert found.valid_fraction > 0.9
            if number == 1:
                break
    # Two pairs of 640x480: two images, two maps of floats and a cloud.
    assert recording.stat().st_size > 2 * 640 * 480 * 10


def test_foxglove_gets_a_pair_over_its_own_protocol(found, slant):
    pytest.importorskip("foxglove")
    client = pytest.importorskip("websockets.sync.client")
    import json

    far, near, _ = slant
    with FoxgloveView(port=0) as view:
        with client.connect(f"ws://127.0.0.1:{view.port}", subprotocols=["foxglove.sdk.v1"], max_size=None) as viewer:
            channels = {}
            while len(channels) < 6:
                message = json.loads(viewer.recv(timeout=20))
                channels.update({channel["topic"]: channel for channel in message.get("channels", [])})
            depth = channels["/farnear/depth/image"]
            assert depth["schemaName"] == "foxglove.RawImage" and depth["encoding"] == "protobuf"
            viewer.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": depth["id"]}]}))
            message = ""
            for _ in range(100):  # until the server has taken the subscription
                view.show(far, near, found)
                try:
                    message = viewer.recv(timeout=0.2)
                    break
                except TimeoutError:
                    continue
    # An opcode, the subscription's id, a time of 8 bytes, and the message with the map.
    assert message[0] == 1 and int.from_bytes(message[1:5], "little") == 7
    assert (found.depth_mm * np.float32(1e-3)).tobytes() in message


def test_viewers_show_maps_of_a_lens_without_scale(without_scale, learned, slant, tmp_path):
    far, near, _ = slant
    pytest.importorskip("rerun")
    with RerunView(save=str(tmp_path / "pairs.rrd")) as view:
        view.show(far, near, without_scale)
    pytest.importorskip("foxglove")
    with FoxgloveView(port=0) as view:
        view.show(far, near, without_scale)


def test_a_viewer_that_is_not_installed_is_named(monkeypatch, optics):
    import importlib

    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(farnear.FarnearError, match="pip install rerun-sdk"):
        RerunView()
