"""Depth maps in other people's viewers, where those are installed: Open3D's point clouds, Rerun's time line, Foxglove live."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Iterator, Optional, Union

import numpy as np
from numpy.typing import NDArray

from ._farnear import DepthMap, FarnearError, Optics, depth, points_mm
from .recording import FRAME, camera_matrix, points_if_known, points_m

if TYPE_CHECKING:
    import open3d

    from .rig import Rig

__all__ = ["FoxgloveView", "RerunView", "watch", "to_open3d"]

Pixels = Union[NDArray[np.uint8], NDArray[np.uint16], NDArray[np.float32], NDArray[np.float64]]


def _imported(name: str) -> Any:
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = {"rerun": "rerun-sdk", "foxglove": "foxglove-sdk"}.get(name, name)
        raise FarnearError(f"{package} is not installed here; `pip install {package}` installs it") from error


def _grey(image: Pixels) -> NDArray[np.float64]:
    """Grey values over the whole of their type; of floats over their brightest. 0 for masked pixels and NaN."""
    values = np.ma.filled(image.astype(np.float64), np.nan)
    if np.issubdtype(image.dtype, np.integer):
        full = float(np.iinfo(image.dtype).max)
    else:
        full = float(np.max(values, initial=1e-9, where=np.isfinite(values)))
    return np.nan_to_num(np.clip(values / full, 0.0, 1.0))


def to_open3d(
    found: DepthMap, image: Optional[Pixels] = None, *, min_confidence: float = 0.0
) -> "open3d.geometry.PointCloud":
    """Point cloud of a depth map.

    Parameters
    ----------
    found : DepthMap
        The map, mm.
    image : array (height, width), optional
        Grey values of the points.
    min_confidence : float
        Least confidence of a point, 0 to 1.

    Returns
    -------
    open3d.geometry.PointCloud
        Points in mm: x to the right, y up, z towards the viewer; the origin is the lens.
    """
    open3d = _imported("open3d")
    keep = np.isfinite(found.depth_mm) & (found.confidence >= min_confidence)
    cloud = open3d.geometry.PointCloud()
    cloud.points = open3d.utility.Vector3dVector(points_mm(found.depth_mm, found.optics, part=found.part)[keep].astype(np.float64))
    if image is not None:
        _check_size(image, found)
        grey = _grey(image)[keep]
        cloud.colors = open3d.utility.Vector3dVector(np.repeat(grey[:, None], 3, axis=1))
    return cloud


class RerunView:
    """Pairs on Rerun's time line: both images, depth, confidence and point cloud (mm); a context manager.

    The cloud is missing for a lens of `calibrate_stack` without `object_pixel_um`.

    Parameters
    ----------
    name : str
        Name of the recording.
    save : str, optional
        Recording (`.rrd`) to write instead of opening the viewer.
    """

    def __init__(self, *, name: str = "farnear", save: Optional[str] = None) -> None:
        self._rerun = _imported("rerun")
        self._pairs = 0
        self._recording = self._rerun.RecordingStream(name)
        if save is None:
            self._recording.spawn()
        else:
            self._recording.save(save)

    def show(
        self, far: Pixels, near: Pixels, found: DepthMap, *, board_us: Optional[int] = None, min_confidence: float = 0.0
    ) -> None:
        """Add a pair at its number and, if given, at the board's time.

        Parameters
        ----------
        far, near : array (height, width)
            The images.
        found : DepthMap
            Their depth, mm.
        board_us : int, optional
            Time of the exposure by the board's clock, us.
        min_confidence : float
            Least confidence of a point, 0 to 1.
        """
        rerun, recording = self._rerun, self._recording
        _check_size(far, found)
        points = points_if_known(found)
        recording.set_time("pair", sequence=self._pairs)
        if board_us is not None:
            recording.set_time("board", duration=board_us * 1e-6)
        self._pairs += 1
        for name, image in (("far", far), ("near", near)):
            recording.log(f"images/{name}", rerun.Image(np.round(255 * _grey(image)).astype(np.uint8), color_model="L"))
        recording.log("depth", rerun.DepthImage(np.nan_to_num(found.depth_mm), meter=1000.0))
        recording.log("confidence", rerun.Tensor(found.confidence, dim_names=("row", "column")))
        if points is None:
            return
        keep = np.isfinite(found.depth_mm) & (found.confidence >= min_confidence)
        shade = np.round(255 * _grey(far)[keep]).astype(np.uint8)
        recording.log("cloud", rerun.Points3D(points[keep], colors=np.repeat(shade[:, None], 3, axis=1)))

    def close(self) -> None:
        """Finish the recording."""
        self._recording.flush()
        self._recording.disconnect()

    def __enter__(self) -> RerunView:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class FoxgloveView:
    """Pairs live in Foxglove: a WebSocket server with both images, depth and points in metres; a context manager.

    Open a connection to `ws://localhost:8765` in Foxglove. Topics are those of `McapRecording`.

    Parameters
    ----------
    host, port : str, int
        Address to listen at; port 0 takes a free one. The server has no password.
    """

    def __init__(self, *, host: str = "127.0.0.1", port: int = 8765) -> None:
        foxglove = _imported("foxglove")
        self._messages = _imported("foxglove.messages")
        channels = _imported("foxglove.channels")
        self._context = foxglove.Context()
        self._server = foxglove.start_server(name="farnear", host=host, port=port, context=self._context)

        def channel(kind: str, topic: str) -> Any:
            return getattr(channels, f"{kind}Channel")(f"/farnear/{topic}", context=self._context)

        images = ("far/image", "near/image", "depth/image", "confidence/image")
        self._images = {topic: channel("RawImage", topic) for topic in images}
        self._calibration = channel("CameraCalibration", "depth/camera_info")
        self._points = channel("PointCloud", "points")

    @property
    def port(self) -> int:
        """Port of the server."""
        return int(self._server.port)

    def show(
        self, far: Pixels, near: Pixels, found: DepthMap, *, board_us: Optional[int] = None, min_confidence: float = 0.0
    ) -> None:
        """Send a pair to all viewers.

        Parameters
        ----------
        far, near : array uint8 or uint16 (height, width)
            The images.
        found : DepthMap
            Their depth, mm.
        board_us : int, optional
            Time of the exposure by the board's clock, us; by default the present time.
        min_confidence : float
            Least confidence of a point, 0 to 1.
        """
        messages = self._messages
        _check_size(far, found)
        _check_size(near, found)
        points = points_m(found)
        height, width = found.depth_mm.shape
        ns = time.time_ns() if board_us is None else 1000 * board_us
        stamp = {"timestamp": messages.Timestamp(ns // 10**9, ns % 10**9), "frame_id": FRAME}

        def image(topic: str, pixels: NDArray[Any], encoding: str) -> None:
            pixels = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder("<"))
            size = {"width": width, "height": height, "step": pixels.strides[0]}
            self._images[topic].log(messages.RawImage(**stamp, **size, encoding=encoding, data=pixels.tobytes()), log_time=ns)

        for name, pixels in (("far", far), ("near", near)):
            if pixels.dtype == np.uint8:
                image(f"{name}/image", pixels, "mono8")
            else:
                image(f"{name}/image", np.round(65535 * _grey(pixels)).astype(np.uint16), "mono16")
        image("depth/image", found.depth_mm * np.float32(1e-3), "32FC1")
        image("confidence/image", found.confidence, "32FC1")
        if points is None:
            return
        k = camera_matrix(found)
        p = [*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0]
        size = {"width": width, "height": height}
        self._calibration.log(messages.CameraCalibration(**stamp, **size, K=k, P=p), log_time=ns)
        keep = np.isfinite(found.depth_mm) & (found.confidence >= min_confidence)
        kind = messages.PackedElementFieldNumericType.Float32
        fields = [messages.PackedElementField(name=name, offset=4 * index, type=kind) for index, name in enumerate("xyz")]
        cloud = messages.PointCloud(**stamp, point_stride=12, fields=fields, data=points[keep].tobytes())
        self._points.log(cloud, log_time=ns)

    def close(self) -> None:
        """Stop the server."""
        self._server.stop()

    def __enter__(self) -> FoxgloveView:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def watch(rig: Rig, view: Union[FoxgloveView, RerunView], optics: Optics, *, seconds: Optional[float] = None) -> Iterator[DepthMap]:
    """Capture and show pairs.

    Parameters
    ----------
    rig : Rig
        A rig with a camera.
    view : FoxgloveView or RerunView
        Where to show them.
    optics : Optics
        Optics of the pairs.
    seconds : float, optional
        Duration, s; by default until the loop ends.

    Yields
    ------
    DepthMap
        Depth of each pair, mm, (height, width).
    """
    until = None if seconds is None else time.monotonic() + seconds
    while until is None or time.monotonic() < until:
        far, near = rig.capture_pair(optics)
        found = depth(far.image, near.image, optics)
        view.show(far.image, near.image, found, board_us=far.record["strobe_start_us"])
        yield found


def _check_size(image: Pixels, found: DepthMap) -> None:
    if image.shape != found.depth_mm.shape:
        raise FarnearError(f"the image is {image.shape}, the depth map {found.depth_mm.shape}; give the pair's own image")
