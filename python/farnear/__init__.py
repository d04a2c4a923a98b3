"""Depth from defocus, corrections, people, and the farnear rig.

Images and maps are numpy arrays (height, width); depth is in mm, NaN where there is none. See docs/python.md.
"""

from ._farnear import (
    Correction,
    DepthMap,
    FarnearError,
    FocusStack,
    Operators,
    Optics,
    Plane,
    Processor,
    PsfFit,
    Recogniser,
    RigError,
    __version__,
    calibrate_psf,
    centroid_distance,
    depth,
    focus_stack,
    points_mm,
    remove_shadow,
    render,
    sun_position,
    synthetic_masks,
)

__all__ = [
    "Correction",
    "DepthMap",
    "FarnearError",
    "FocusStack",
    "Operators",
    "Optics",
    "Plane",
    "Processor",
    "PsfFit",
    "Recogniser",
    "RigError",
    "__version__",
    "calibrate_psf",
    "centroid_distance",
    "depth",
    "focus_stack",
    "points_mm",
    "remove_shadow",
    "render",
    "sun_position",
    "synthetic_masks",
]
