"""Recordings in MCAP with ROS 2 messages, as Foxglove, ROS 2 and Rerun open them; needs the package `mcap-ros2-support`."""

from __future__ import annotations

import os
import time
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import NDArray

from ._farnear import DepthMap, FarnearError, points_mm

__all__ = ["McapRecording"]

FRAME = "farnear_optical_frame"
_RULE = "=" * 80
_TIME = f"{_RULE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_HEADER = f"{_RULE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{_TIME}"
_IMAGE = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n" + _HEADER
)
_INFO = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\nfloat64[9] r\n"
    "float64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n"
    f"{_HEADER}{_RULE}\nMSG: sensor_msgs/RegionOfInterest\nuint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"
)
_CLOUD = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\nuint32 point_step\n"
    "uint32 row_step\nuint8[] data\nbool is_dense\n"
    f"{_HEADER}{_RULE}\nMSG: sensor_msgs/PointField\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n"
)


def camera_matrix(found: DepthMap) -> list[float]:
    """Camera matrix of a map, row by row, px.

    Rays of a telecentric lens meet in its front focus, so a pixel of pitch p sees p (z - F) / F: as a pinhole at the front focus
    with the focal length F / p. Without telecentricity the pinhole is the lens, as far away as the sensor of the far image.
    """
    focal_px, column, row = found._intrinsics_px
    return [focal_px, 0.0, column, 0.0, focal_px, row, 0.0, 0.0, 1.0]


def points_if_known(found: DepthMap) -> Optional[NDArray[np.float32]]:
    """Points of a map in mm, (height, width, 3); None if the lens was calibrated without the size of a pixel at the target."""
    try:
        return points_mm(found.depth_mm, found.optics, part=found.part)
    except FarnearError:  # of a map `points_mm` raises it for this reason only
        return None


def points_m(found: DepthMap) -> Optional[NDArray[np.float32]]:
    """Points of a map in m, (height, width, 3): x to the right, y down, z away from the lens; None as `points_if_known`."""
    points = points_if_known(found)
    if points is None:
        return None
    return np.ascontiguousarray(points * np.array([1e-3, -1e-3, -1e-3], np.float32)).astype("<f4")


class McapRecording:
    """MCAP file of pairs: both images, depth in metres, camera info and point cloud of each; a context manager.

    Topics: `/farnear/far/image` and `/farnear/near/image` (sensor_msgs/Image, mono8 or mono16), `/farnear/depth/image` (32FC1, m,
    NaN = no depth), `/farnear/confidence/image` (32FC1, 0 to 1), `/farnear/depth/camera_info`, `/farnear/points` (PointCloud2, m; x to
    the right, y down, z away from the lens, as ROS has it). The last two are missing for a lens of `calibrate_stack` without
    `object_pixel_um`.

    Depth is measured from the lens, while rays of a telecentric lens meet in its front focus: the point cloud is exact; a cloud that a
    viewer computes from the depth image as of a pinhole is wider by F / (z - F). Both are exact without telecentricity.

    Parameters
    ----------
    path : path
        The file to write.
    overwrite : bool
        Replace an existing file; by default it raises FileExistsError.
    """

    def __init__(self, path: Union[str, os.PathLike[str]], *, overwrite: bool = False) -> None:
        try:
            from mcap_ros2.writer import Writer
        except ImportError as error:
            message = "mcap-ros2-support is not installed; `pip install mcap-ros2-support` installs it"
            raise FarnearError(message) from error
        self._file = open(path, "wb" if overwrite else "xb")
        self._writer: Any = Writer(self._file)
        schema = self._writer.register_msgdef
        self._image = schema("sensor_msgs/msg/Image", _IMAGE)
        self._info = schema("sensor_msgs/msg/CameraInfo", _INFO)
        self._cloud = schema("sensor_msgs/msg/PointCloud2", _CLOUD)

    def add(self, far: NDArray[Any], near: NDArray[Any], found: DepthMap, *, time_ns: Optional[int] = None) -> None:
        """Add a pair.

        Parameters
        ----------
        far, near : array uint8 or uint16 (height, width)
            The images.
        found : DepthMap
            Their depth.
        time_ns : int, optional
            Time stamp, ns since 1970; by default now.
        """
        stamp = time.time_ns() if time_ns is None else int(time_ns)
        header = {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": FRAME}
        height, width = found.depth_mm.shape

        def write(topic: str, schema: Any, message: dict[str, Any]) -> None:
            message = {"header": header, "height": height, "width": width, **message}
            self._writer.write_message(f"/farnear/{topic}", schema, message, log_time=stamp, publish_time=stamp)

        def image(topic: str, pixels: NDArray[Any], encoding: str) -> None:
            pixels = np.ascontiguousarray(pixels).astype(pixels.dtype.newbyteorder("<"))
            write(topic, self._image, {"encoding": encoding, "is_bigendian": 0, "step": pixels.strides[0], "data": pixels.tobytes()})

        for name, pixels in (("far", far), ("near", near)):
            if pixels.shape != (height, width) or pixels.dtype.newbyteorder("=") not in (np.dtype("u1"), np.dtype("u2")):
                raise FarnearError(f"{name} is {pixels.dtype} of {pixels.shape}; expected uint8 or uint16 of {(height, width)}")
        points = points_m(found)
        for name, pixels in (("far", far), ("near", near)):
            image(f"{name}/image", pixels, "mono8" if pixels.dtype == np.uint8 else "mono16")
        image("depth/image", found.depth_mm * np.float32(1e-3), "32FC1")
        image("confidence/image", found.confidence, "32FC1")
        if points is None:
            return
        k = camera_matrix(found)
        write(
            "depth/camera_info",
            self._info,
            {
                "distortion_model": "plumb_bob",
                "d": [0.0] * 5,
                "k": k,
                "r": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
                "p": [*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0],
                "binning_x": 1,
                "binning_y": 1,
                "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
            },
        )
        fields = [{"name": name, "offset": 4 * index, "datatype": 7, "count": 1} for index, name in enumerate("xyz")]
        data = points.tobytes()
        cloud = {"fields": fields, "is_bigendian": False, "point_step": 12, "row_step": 12 * width, "data": data, "is_dense": False}
        write("points", self._cloud, cloud)

    def close(self) -> None:
        """Finish the file."""
        self._writer.finish()
        self._file.close()

    def __enter__(self) -> McapRecording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
