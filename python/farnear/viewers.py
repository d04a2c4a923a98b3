"""Depth maps in other people's viewers, where those are installed: Open3D's point clouds, Rerun's time line."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Iterator, Optional, Union

import numpy as np
from numpy.typing import NDArray

from ._farnear import DepthMap, FarnearError, Optics, depth, points_mm

if TYPE_CHECKING:
    import open3d

    from .rig import Rig

__all__ = ["RerunView", "watch", "to_open3d"]

Pixels = Union[NDArray[np.uint8], NDArray[np.uint16], NDArray[np.float32], NDArray[np.float64]]


def _imported(name: str) -> Any:
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = {"rerun": "rerun-sdk"}.get(name, name)
        raise FarnearError(f"{package} is not installed here; `pip install {package}` installs it") from error


def _grey(image: Pixels) -> NDArray[np.float64]:
    """Grey values over the whole of their type; of floats over their brightest."""
    full = np.iinfo(image.dtype).max if np.issubdtype(image.dtype, np.integer) else max(float(image.max()), 1e-9)
    return np.clip(image / full, 0.0, 1.0)


def to_open3d(
    found: DepthMap, optics: Optics, image: Optional[Pixels] = None, *, min_confidence: float = 0.0
) -> "open3d.geometry.PointCloud":
    """Point cloud of a depth map.

    Parameters
    ----------
    found : DepthMap
        The map, mm.
    optics : Optics
        Optics of the map.
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
    cloud.points = open3d.utility.Vector3dVector(points_mm(found.depth_mm, optics)[keep].astype(np.float64))
    if image is not None:
        _check_size(image, found)
        grey = _grey(image)[keep]
        cloud.colors = open3d.utility.Vector3dVector(np.repeat(grey[:, None], 3, axis=1))
    return cloud


class RerunView:
    """Pairs on Rerun's time line: both images, depth, confidence and point cloud (mm); a context manager.

    Parameters
    ----------
    optics : Optics
        Optics of the pairs.
    name : str
        Name of the recording.
    save : str, optional
        Recording (`.rrd`) to write instead of opening the viewer.
    """

    def __init__(self, optics: Optics, *, name: str = "farnear", save: Optional[str] = None) -> None:
        self._rerun = _imported("rerun")
        self._optics = optics
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
        recording.set_time("pair", sequence=self._pairs)
        if board_us is not None:
            recording.set_time("board", duration=board_us * 1e-6)
        self._pairs += 1
        for name, image in (("far", far), ("near", near)):
            recording.log(f"images/{name}", rerun.Image(np.round(255 * _grey(image)).astype(np.uint8), color_model="L"))
        recording.log("depth", rerun.DepthImage(np.nan_to_num(found.depth_mm), meter=1000.0))
        recording.log("confidence", rerun.Tensor(found.confidence, dim_names=("row", "column")))
        keep = np.isfinite(found.depth_mm) & (found.confidence >= min_confidence)
        shade = np.round(255 * _grey(far)[keep]).astype(np.uint8)
        points = points_mm(found.depth_mm, self._optics)[keep]
        recording.log("cloud", rerun.Points3D(points, colors=np.repeat(shade[:, None], 3, axis=1)))

    def close(self) -> None:
        """Finish the recording."""
        self._recording.flush()
        self._recording.disconnect()

    def __enter__(self) -> RerunView:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def watch(rig: Rig, view: RerunView, optics: Optics, *, seconds: Optional[float] = None) -> Iterator[DepthMap]:
    """Capture and show pairs.

    Parameters
    ----------
    rig : Rig
        A rig with a camera.
    view : RerunView
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
