"""MCAP recordings, read back by the readers of the format's own authors."""

import numpy as np
import pytest

import farnear
from farnear.recording import McapRecording


def test_a_recording_is_read_by_another_reader(optics, slant, tmp_path):
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_ros2.decoder")
    far, near, truth = slant
    found = farnear.depth(far, near, optics)
    path = tmp_path / "pairs.mcap"
    with McapRecording(path) as recording:
        for number in range(2):
            recording.add(far, near, found, time_ns=1_700_000_000_250_000_000 + number * 10**9)
    messages = {}
    with open(path, "rb") as file:
        for _, channel, message, decoded in reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()]).iter_decoded_messages():
            messages.setdefault(channel.topic, []).append((message.log_time, decoded))
    assert len(messages) == 6 and all(len(of_topic) == 2 for of_topic in messages.values())
    for of_topic in messages.values():
        assert [time for time, _ in of_topic] == [1_700_000_000_250_000_000, 1_700_000_001_250_000_000]
        assert of_topic[0][1].header.stamp.sec == 1_700_000_000 and of_topic[0][1].header.stamp.nanosec == 250_000_000
    height, width = far.shape
    depth = messages["/farnear/depth/image"][0][1]
    assert (depth.height, depth.width, depth.encoding, depth.step) == (height, width, "32FC1", 4 * width)
    metres = np.frombuffer(bytes(depth.data), "<f4").reshape(height, width)
    assert np.nanmedian(np.abs(1000 * metres - truth)) < 1
    pixels = np.frombuffer(bytes(messages["/farnear/far/image"][0][1].data), np.uint8).reshape(height, width)
    assert np.array_equal(pixels, far)
    info = messages["/farnear/depth/camera_info"][0][1]
    assert info.k[0] == pytest.approx(50 / 7.4e-3) and info.k[2] == pytest.approx((width - 1) / 2)
    cloud = messages["/farnear/points"][0][1]
    assert [field.name for field in cloud.fields] == ["x", "y", "z"] and cloud.point_step == 12
    points = np.frombuffer(bytes(cloud.data), "<f4").reshape(height, width, 3)
    assert np.allclose(points[..., 2], metres, equal_nan=True, atol=1e-5)
    # The intrinsics hold from the front focus on: x = (u - cx) (z - F) / f.
    row, column = np.argwhere(np.isfinite(metres))[1000]
    expected = (column - info.k[2]) * (metres[row, column] - 0.05) / info.k[0]
    assert points[row, column, 0] == pytest.approx(expected, rel=1e-3, abs=1e-6)


def test_images_may_have_any_byte_order(optics, slant, tmp_path):
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_ros2.decoder")
    far, near = (image.astype(np.uint16) * 257 for image in slant[:2])
    with McapRecording(tmp_path / "pairs.mcap") as recording:
        recording.add(far.astype(">u2"), near, farnear.depth(far, near, optics))
    with open(tmp_path / "pairs.mcap", "rb") as file:
        messages = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()]).iter_decoded_messages()
        image = next(decoded for _, channel, _, decoded in messages if channel.topic == "/farnear/far/image")
    assert image.encoding == "mono16" and not image.is_bigendian
    assert np.array_equal(np.frombuffer(bytes(image.data), "<u2").reshape(far.shape), far)


def test_images_that_do_not_fit_are_refused(optics, slant, tmp_path):
    pytest.importorskip("mcap_ros2.writer")
    far, near, _ = slant
    with McapRecording(tmp_path / "pairs.mcap") as recording:
        with pytest.raises(farnear.FarnearError, match="near"):
            recording.add(far, near[1:], farnear.depth(far, near, optics))


def test_a_lens_without_scale_has_no_cloud_and_no_camera_info(without_scale, slant, tmp_path):
    reader = pytest.importorskip("mcap.reader")
    pytest.importorskip("mcap_ros2.writer")
    path = tmp_path / "pairs.mcap"
    with McapRecording(path) as recording:
        recording.add(*slant[:2], without_scale)
    with open(path, "rb") as file:
        topics = {channel.topic for _, channel, _ in reader.make_reader(file).iter_messages()}
    assert topics == {f"/farnear/{name}/image" for name in ("far", "near", "depth", "confidence")}


def test_an_existing_file_is_kept(tmp_path):
    pytest.importorskip("mcap_ros2.writer")
    path = tmp_path / "pairs.mcap"
    path.write_bytes(b"an earlier recording")
    with pytest.raises(FileExistsError):
        McapRecording(path)
    assert path.read_bytes() == b"an earlier recording"
    McapRecording(path, overwrite=True).close()
    assert path.read_bytes() != b"an earlier recording"
