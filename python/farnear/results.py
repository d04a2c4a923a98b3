"""Depth maps in matplotlib and xarray, where those are installed."""

from __future__ import annotations

from typing import Any, Optional

from ._farnear import DepthMap, FarnearError

__all__ = ["plot", "to_xarray"]


def plot(found: DepthMap, ax: Optional[Any] = None) -> Any:
    """Plot a depth map with matplotlib.

    Parameters
    ----------
    found : DepthMap
        The map, mm.
    ax : matplotlib axes, optional
        Where to plot; by default the current axes.

    Returns
    -------
    matplotlib axes
    """
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise FarnearError("matplotlib is not installed; `pip install matplotlib` installs it") from error
    axes = pyplot.gca() if ax is None else ax
    picture = axes.imshow(found.depth_mm, cmap="viridis_r")
    axes.figure.colorbar(picture, ax=axes, label="distance from the lens (mm)")
    axes.set_xlabel("column (px)")
    axes.set_ylabel("row (px)")
    return axes


def to_xarray(found: DepthMap) -> Any:
    """Maps of (row, column) in px with their units as an `xarray.Dataset`.

    `depth` and `deviation` are in mm, `confidence` is 0 to 1, `reason` a number of `DepthMap.reason_words`. A map of a part of its
    images has the attribute `part`, as `DepthMap.part`.
    """
    try:
        import xarray
    except ImportError as error:
        raise FarnearError("xarray is not installed; `pip install xarray` installs it") from error
    dimensions = ("row", "column")
    attributes: dict[str, Any] = {"optics": found.optics.dumps(), "findings": "; ".join(found.findings)}
    if found.part is not None:
        attributes["part"] = found.part
    return xarray.Dataset(
        {
            "depth": (dimensions, found.depth_mm, {"units": "mm", "long_name": "distance from the lens"}),
            "deviation": (dimensions, found.deviation_mm, {"units": "mm", "long_name": "standard deviation of depth"}),
            "confidence": (dimensions, found.confidence, {"units": "1"}),
            "reason": (dimensions, found.reasons, {"flag_meanings": str(found.reason_words)}),
        },
        attrs=attributes,
    )
