"""The compiled part. Docstrings are copies of those at run time: `python python/docstrings.py` writes them."""

import datetime
import os
from typing import Any, ClassVar, Literal, Optional, Protocol, Sequence, TypedDict, Union

import numpy as np
from numpy.typing import NDArray

class _ArrayLike(Protocol):
    def __array__(self) -> NDArray[Any]: ...

Image = Union[NDArray[np.integer[Any]], NDArray[np.floating[Any]], _ArrayLike]
Map = Image
Part = Union[tuple[int, int, int, int], tuple[int, int, int, int, int]]
Mask = Union[NDArray[np.bool_], NDArray[np.integer[Any]], _ArrayLike]
Path = Union[str, "os.PathLike[str]"]
Stack = Union[Sequence[Image], NDArray[Any]]
Numbers = Union[Sequence[float], NDArray[Any]]

__version__: str

class ShadowReport(TypedDict):
    beta_deg: float
    removed_fraction: float
    distance_m: float
    trustworthy: bool

class Recognition(TypedDict):
    activity: Optional[str]
    confidence: float
    outlier_score: float
    probabilities: dict[str, float]

class FarnearError(ValueError):
    """An argument or file cannot be used; the message states the value and what was expected."""

class DisconnectedError(FarnearError):
    """The neighbour graph of an embedding is disconnected: raise the number of neighbours."""

class RigError(RuntimeError):
    """The rig, its camera or the way to them failed."""

class Optics:
    """Thin-lens geometry of a pair whose sensor moves; immutable.

    The normalised depth `alpha` is -1 at the far focus and +1 at the near focus.

    Parameters
    ----------
    focal_length_mm : float
        Focal length, mm.
    pixel_um : float
        Pitch of the pixels, um.
    far_mm : float
        Distance from the lens to the far-focused plane, mm.
    aperture_mm, f_number : float, optional
        Diameter of the aperture in mm, or the f-number: give one of them.
    max_blur_px, near_mm : float, optional
        Blur radius in px of an object at the near focus in the far-focused image, or the distance of the near-focused plane in
        mm: give one of them.
    psf : str
        Point spread function: "pillbox", "gaussian:k=K", "generalised:p=P,k=K", "ring:inner=R", or `PsfFit.psf`.
    telecentric : bool, optional
        False if the magnification changes with focus.

    Examples
    --------
    >>> farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703)
    Optics(933.0000 to 886.8133 mm, blur up to 2.7030 px, pillbox)
    """

    def __init__(
        self,
        *,
        focal_length_mm: float,
        pixel_um: float,
        far_mm: float,
        aperture_mm: Optional[float] = None,
        f_number: Optional[float] = None,
        max_blur_px: Optional[float] = None,
        near_mm: Optional[float] = None,
        psf: str = "pillbox",
        telecentric: Optional[bool] = None,
    ) -> None: ...
    @staticmethod
    def load(path: Path) -> "Optics":
        """Read an `optics.toml` file."""
    @staticmethod
    def loads(text: str) -> "Optics":
        """Read optics from the text of an `optics.toml`. Without a `[psf]` a pill-box is assumed, which is a finding of `depth`."""
    def dumps(self) -> str:
        """Text of an `optics.toml` with these optics, without `[psf]` if their file named none."""
    def depth_mm(self, alpha: float) -> float:
        """Object distance in mm of a normalised depth (-1 at the far focus, +1 at the near focus)."""
    def alpha(self, depth_mm: float) -> float:
        """Normalised depth of an object distance in mm."""
    def blur_px(self, alpha: float) -> tuple[float, float]:
        """Signed blur radii (far image, near image) in px at a normalised depth."""
    @property
    def focal_length_mm(self) -> float:
        """Focal length of the lens, mm."""
    @property
    def f_number(self) -> float:
        """Focal length over the diameter of the aperture."""
    @property
    def pixel_um(self) -> float:
        """Pitch of the pixels, um."""
    @property
    def max_blur_px(self) -> float:
        """Blur radius of an object at one focus in the image focused at the other, px."""
    @property
    def psf(self) -> str:
        """Point spread function, as `Optics(psf=...)` accepts it."""
    @property
    def far_mm(self) -> float:
        """Object distance of the far focus, mm."""
    @property
    def near_mm(self) -> float:
        """Object distance of the near focus, mm."""
    @property
    def sensor_far_mm(self) -> float:
        """Distance from the lens to the sensor for the far-focused image, mm."""
    @property
    def sensor_near_mm(self) -> float:
        """Distance from the lens to the sensor for the near-focused image, mm."""

class Operators:
    """Rational operators designed for some optics; immutable. A design takes some ms, "thesis" up to a second.

    Parameters
    ----------
    optics : Optics
        The optics to design the operators for.
    family : {"watanabe", "raj", "ro", "gro", "ggro"}, optional
        Family of operators; by default the one that belongs to the point spread function.
    design : {"linear", "thesis"}
        Least squares, or the design of the thesis.
    kernel_size : int
        Side of the kernels, px: 5, 7, 9, 11 or 13.

    Examples
    --------
    >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703)
    >>> farnear.Operators(optics).kernel("gp1").shape
    (7, 7)
    """

    def __init__(
        self,
        optics: Optics,
        *,
        family: Optional[Literal["watanabe", "raj", "ro", "gro", "ggro"]] = None,
        design: Literal["linear", "thesis"] = "linear",
        kernel_size: int = 7,
    ) -> None: ...
    @staticmethod
    def loads(text: str) -> "Operators":
        """Read operators from the TOML that `farnear operators --out` writes."""
    def dumps(self) -> str:
        """TOML of the operators, as `farnear operators --out` writes it."""
    def kernel(self, name: Literal["prefilter", "gm1", "gp1", "gp2"]) -> NDArray[np.float64]:
        """Kernel "prefilter", "gm1", "gp1" or "gp2": float64, (kernel_size, kernel_size)."""
    @property
    def name(self) -> str:
        """Name of family and design."""
    @property
    def nir_rms(self) -> float:
        """Root mean square error with which the operators fit the normalised image ratio."""
    @property
    def kernel_size(self) -> int:
        """Side of the kernels, px."""

class DepthMap:
    """Depth map of a pair; arrays are (height, width). Can be pickled and copied.

    Attributes
    ----------
    depth_mm : array float32
        Object distance, mm; NaN where there is none.
    confidence : array float32
        Probability that the error is below three standard deviations, 0 to 1; 0 where there is no depth.
    deviation_mm : array float32
        Standard deviation of depth for the noise in the pair, mm; NaN where there is none.
    reasons : array uint8
        Why a pixel has no depth, see `reason_words`; 0 where it has one.
    findings : list of str
        What to know before trusting the map.
    valid_fraction : float
        Part of the pixels with a depth, 0 to 1.
    optics : Optics
        The optics of the map.
    part : (int, int, int, int), (int, int, int, int, int) or None
        Column and row of the map in its images, width and height of these, px, and the pixels per side that were averaged, if more
        than one; None if the map shows whole images.

    Examples
    --------
    >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf="gaussian:k=0.4578")
    >>> found = farnear.depth(*farnear.render(optics, "slant", width=160, height=120)[:2], optics)
    >>> found.depth_mm.shape, found.depth_mm.dtype.name
    ((120, 160), 'float32')
    """

    reason_words: ClassVar[dict[int, str]]
    @property
    def depth_mm(self) -> NDArray[np.float32]:
        """Object distance, mm, float32 (height, width); NaN where there is none."""
    @property
    def confidence(self) -> NDArray[np.float32]:
        """Probability that the error is below three standard deviations, 0 to 1, float32 (height, width)."""
    @property
    def deviation_mm(self) -> NDArray[np.float32]:
        """Standard deviation of depth for the noise in the pair, mm, float32 (height, width); NaN where there is none."""
    @property
    def reasons(self) -> NDArray[np.uint8]:
        """Why a pixel has no depth, uint8 (height, width), see `reason_words`; 0 where it has one."""
    @property
    def findings(self) -> list[str]:
        """What to know before trusting the map."""
    @property
    def valid_fraction(self) -> float:
        """Part of the pixels with a depth, 0 to 1."""
    @property
    def optics(self) -> Optics:
        """The optics of the map."""
    @property
    def part(self) -> Optional[Part]:
        """Place of the map in its images, as `points_mm` takes it; None if the map shows whole images."""
    @staticmethod
    def load(folder: Path) -> "DepthMap":
        """Read a folder that `farnear depth` or `DepthMap.save` wrote, with `depth.npy` or `depth.tiff` and `depth.toml`.

        Returns
        -------
        DepthMap
            `deviation_mm` is NaN where the folder has no `uncertainty.npy`.
        """
    def save(self, folder: Path) -> None:
        """Write a folder as `DepthMap.load` and `farnear measure` read it: `depth.npy`, `confidence.npy`, `uncertainty.npy`,
        `reason.png`, `view.png` and `depth.toml`. The folder is complete or absent.
        """
    def plane(self, region: Optional[tuple[int, int, int, int]] = None) -> Plane:
        """Fit a plane to the map by least squares along the optical axis.

        Parameters
        ----------
        region : (int, int, int, int), optional
            Column, row, width and height in px; by default the whole map.

        Returns
        -------
        Plane
            Distance, slopes, tilt, and what is left.
        """
    @property
    def _intrinsics_px(self) -> tuple[float, float, float]:
        """Principal distance, and column and row of the optical axis in the map, px; NaN for a lens without a scale."""
    def plot(self, ax: Optional[Any] = None) -> Any:
        """Plot the map with matplotlib: colours by depth in mm; returns the axes."""
    def to_xarray(self) -> Any:
        """The maps as an `xarray.Dataset` with dimensions (row, column) and units; needs xarray."""
    def _repr_html_(self) -> str:
        """Picture of the map for notebooks."""

class Plane:
    """Plane through a depth map, as `DepthMap.plane` returns it. Can be pickled and copied.

    Attributes
    ----------
    z_mm : float
        Distance from the lens in the middle of the points, mm.
    slope_x, slope_y : float
        Slopes to the right and upwards, mm per mm; mm per px for optics of `calibrate_stack` without `object_pixel_um`.
    tilt_deg : float
        Angle to a plane perpendicular to the optical axis, degrees; NaN if slopes are per px.
    rms_mm : float
        Root mean square distance of the points from the plane along the axis, mm.
    peak_to_valley_mm : float
        Largest minus smallest of these distances, mm.
    """

    @property
    def z_mm(self) -> float:
        """-"""
    @property
    def slope_x(self) -> float:
        """-"""
    @property
    def slope_y(self) -> float:
        """-"""
    @property
    def tilt_deg(self) -> float:
        """-"""
    @property
    def rms_mm(self) -> float:
        """-"""
    @property
    def peak_to_valley_mm(self) -> float:
        """-"""

def depth(
    far: Image,
    near: Image,
    optics: Optics,
    *,
    operators: Optional[Operators] = None,
    method: Optional[Literal["whitened", "ro", "subbarao", "subbarao-fourier", "favaro"]] = None,
    window: Union[int, Literal["adaptive"], None] = None,
    median_px: int = 3,
    fill: Union[bool, Literal["surface", "thesis"]] = False,
    low_texture: str = "energy",
    align: Literal["auto", "none", "optics", "shift", "similarity", "affine"] = "auto",
    balance: Literal["auto", "none", "gain", "local"] = "auto",
    min_confidence: float = 0.0,
    white_level: Optional[int] = None,
    bin: Union[int, Literal["auto"]] = 1,
    threads: int = 1,
) -> DepthMap:
    """Depth map of a far- and a near-focused image, as `farnear depth --bin 1` computes it.

    Parameters
    ----------
    far, near : array (height, width)
        Grey images of one size and one kind, at least 16x16 px. In `uint8` and `uint16` values from `white_level` on are saturated;
        other integers and floating point numbers have any common scale. `float32` is not copied. Masked pixels have no depth.
    optics : Optics
        The optics of the pair.
    operators : Operators, optional
        Operators for method "ro"; by default they are designed for the optics.
    method : {"whitened", "ro", "subbarao", "subbarao-fourier", "favaro"}, optional
        Whitened (least noise), rational operators, or a baseline; by default rational operators if `operators` are given, else
        whitened.
    window : int or "adaptive", optional
        Side in px (odd, up to 63) of the window over which evidence is summed; "adaptive" is for "whitened", whose default it
        is. Else the default is 7.
    median_px : int
        Side of the median filter, px, odd; 1 = none.
    fill : bool or {"surface", "thesis"}
        Fill regions of low texture by a surface, or in the order of the thesis.
    low_texture : str
        Criterion of low texture: "energy", or "variance:T" as in the thesis.
    align : {"auto", "none", "optics", "shift", "similarity", "affine"}
        Alignment of the near image with the far one.
    balance : {"auto", "none", "gain", "local"}
        Equalisation of brightness.
    min_confidence : float
        Least confidence of a depth, 0 to 1.
    white_level : int, optional
        Code of a saturated pixel in `uint8` and `uint16`, e.g. 4095 for 12 bits; by default the largest of the type.
    bin : int or "auto"
        Side in px, up to 16, of the squares of pixels that are averaged into one; "auto" chooses it as `farnear depth` does.
    threads : int
        Threads; 0 = one per core.

    Returns
    -------
    DepthMap
        Depth in mm, confidence, standard deviation and reasons, each (height, width) of the averaged image; its `optics` are those
        of the averaged pixels.

    Raises
    ------
    FarnearError
        Images of two sizes, kinds or scenes, a constant image, operators for other optics, values out of range.

    Notes
    -----
    By default pixels are not averaged, except by optics of `calibrate_stack`. For a largest blur of more than 4.5 px `findings`
    states how many pixels to average.

    640x480 take 0.2 s. Other Python threads run meanwhile; Ctrl-C takes effect when the map is done.

    Examples
    --------
    >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf="gaussian:k=0.4578")
    >>> far, near, truth = farnear.render(optics, "slant", width=160, height=120)
    >>> farnear.depth(far, near, optics).depth_mm.shape
    (120, 160)
    """

class FocusStack:
    """Depth from a focus stack, as `focus_stack` returns it; arrays are float32 (height, width). Can be pickled and copied.

    Attributes
    ----------
    depth : array float32
        Object distance in mm, or the number of the sharpest image, from 1, if the distances were not given. NaN = unreliable.
    unit : str
        "mm" or "image".
    reliability : array float32
        How clear and how well fitted the maximum of sharpness is, 0 to 1.
    all_in_focus : array float32
        Each pixel from the image in which it is sharpest: 0 to 1 for uint8 and uint16, else in the scale of the images. 0 where no
        image shows the pixel.
    moved_px : float or None
        Farthest that alignment moved a pixel, px; None without alignment.
    left_out : list of int
        Indices in `images` of those that were not used, see `findings`.
    findings : list of str
        What to know before trusting the map.
    """

    @property
    def depth(self) -> NDArray[np.float32]:
        """-"""
    @property
    def unit(self) -> Literal["mm", "image"]:
        """-"""
    @property
    def reliability(self) -> NDArray[np.float32]:
        """-"""
    @property
    def all_in_focus(self) -> NDArray[np.float32]:
        """-"""
    @property
    def moved_px(self) -> Optional[float]:
        """-"""
    @property
    def left_out(self) -> list[int]:
        """-"""
    @property
    def findings(self) -> list[str]:
        """-"""

def focus_stack(
    images: Stack,
    *,
    focused_at_mm: Optional[Numbers] = None,
    measure: str = "modified-laplacian",
    smoothing_px: float = 1.0,
    window_px: int = 9,
    fit_points: int = 11,
    median_px: int = 9,
    guided_px: float = 10.0,
    min_reliability: float = 0.1,
    align: Literal["none", "shift", "similarity", "affine"] = "none",
    use_all: bool = False,
) -> FocusStack:
    """Depth and all-in-focus image of a stack of images at different focus, as `farnear focus-stack` computes them.

    Parameters
    ----------
    images : sequence of array (height, width)
        At least three grey images of one size and one kind, in the order of their focus. NaN and black borders count as not
        seen.
    focused_at_mm : sequence of float, optional
        Object distance in mm at which each image is sharp, ascending or descending.
    measure : str
        Focus measure, for example "modified-laplacian" or "tenengrad".
    smoothing_px : float
        Standard deviation of the Gaussian applied to the images first, px; 0 = none.
    window_px : int
        Side of the window of the focus measure, px, odd.
    fit_points : int
        Points of the sharpness curve that the maximum is fitted to, odd.
    median_px : int
        Side of the median filter, px, odd; 1 = none.
    guided_px : float
        Standard deviation of the edge-preserving filter, px; 0 = none.
    min_reliability : float
        Depths below this reliability are NaN, 0 to 1.
    align : {"none", "shift", "similarity", "affine"}
        Alignment of the images.
    use_all : bool
        Use all images, also those that show another scene, are turned or shaken.

    Returns
    -------
    FocusStack
        Depth in mm, reliability and all-in-focus image, each (height, width).

    Examples
    --------
    >>> images = [np.random.default_rng(i).random((32, 32)) for i in range(3)]
    >>> farnear.focus_stack(images, focused_at_mm=[300, 310, 320]).unit
    'mm'
    """

def points_mm(depth_mm: Map, optics: Optics, *, part: Optional[Part] = None) -> NDArray[np.float32]:
    """Object point that each pixel of a depth map sees.

    Parameters
    ----------
    depth_mm : array (height, width)
        Depth map, mm; NaN, or a depth within the focal length such as 0, where a pixel has none. With optics of
        `calibrate_stack`, whose depths may be relative, NaN only.
    optics : Optics
        The optics of the map; those of `calibrate_stack` need its `object_pixel_um`.
    part : (int, int, int, int) or (int, int, int, int, int), optional
        `DepthMap.part`: column and row of the map in its images, width and height of these, px, and the pixels per side that were
        averaged; by default the map shows whole images.

    Returns
    -------
    array float32 (height, width, 3)
        x to the right, y up, z towards the viewer, mm; the origin is the lens. NaN where there is no depth.

    Examples
    --------
    >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703)
    >>> farnear.points_mm(np.full((4, 6), 900.0), optics).shape
    (4, 6, 3)
    """

class Processor:
    """Depth of pair after pair with fixed settings: no alignment, no validation; some ms for 640x480.

    Parameters
    ----------
    optics : Optics
        The optics of the pairs; those of `calibrate_stack`, or with a `[distortion]`, are for `depth`.
    operators : Operators, optional
        By default they are designed for the optics.
    smoothing_px : int
        Side of the window over which evidence is summed, px, odd.
    median_px : int
        Side of the median filter, px, odd; 1 = none.
    fill : bool or {"surface", "thesis"}
        Fill regions of low texture.
    low_texture : str
        Criterion of low texture: "energy" or "variance:T".
    threads : int
        Threads; 0 = one per core.

    Notes
    -----
    Several threads may share a processor; their pairs are computed one after the other.

    Examples
    --------
    >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703)
    >>> far, near, truth = farnear.render(optics, "slant", width=160, height=120)
    >>> depth_mm, confidence = farnear.Processor(optics).run(far, near)
    """

    def __init__(
        self,
        optics: Optics,
        *,
        operators: Optional[Operators] = None,
        smoothing_px: int = 7,
        median_px: int = 3,
        fill: Union[bool, Literal["surface", "thesis"]] = False,
        low_texture: str = "energy",
        threads: int = 1,
    ) -> None: ...
    def run(
        self, far: Image, near: Image
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Depth map and confidence of a pair.

        Parameters
        ----------
        far, near : array (height, width)
            Images of one size and any common scale, of any numeric type.

        Returns
        -------
        depth_mm, confidence : array float32 (height, width)
            Depth in mm, and confidence from texture and fit, 0 to 1. Masked pixels and those whose windows contain them have no depth.
        """

class Correction:
    """Correction of field curvature, fitted to depth maps of flat targets or loaded; immutable.

    Examples
    --------
    >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf="gaussian:k=0.4578")
    >>> targets = []
    >>> for mm in (932, 921, 910, 899, 888):
    ...     far, near, _ = farnear.render(optics, f"plane:{mm}", width=160, height=120, elliptical_distortion=True)
    ...     targets.append((farnear.depth(far, near, optics).depth_mm, mm))
    >>> farnear.Correction.fit(targets, method="clsf")
    Correction(clsf, 120x160, 932 to 888 mm)
    """

    @staticmethod
    def fit(
        patterns: Sequence[tuple[Map, float]],
        *,
        method: Literal["clsf", "clsf-blend", "clsf-full", "cdc", "two-step", "spline"] = "spline",
    ) -> "Correction":
        """Fit a correction to flat targets.

        Parameters
        ----------
        patterns : sequence of (depth_mm, true_mm)
            Depth map (height, width) in mm of a flat target, and the target's true distance in mm; 20 to 30 through the working range
            are good. 24 maps of 640x480 take 0.1 s (clsf) to 1.2 s (cdc).
        method : {"clsf", "clsf-blend", "clsf-full", "cdc", "two-step", "spline"}
            Form of the correction.
        """
    @staticmethod
    def load(path: Path) -> "Correction":
        """Read a file that `farnear calibrate correction --out` wrote."""
    @staticmethod
    def loads(text: str) -> "Correction":
        """Read a correction from the TOML that `farnear calibrate correction --out` writes."""
    def dumps(self) -> str:
        """TOML of the correction, as `farnear correct --correction` reads it."""
    def apply(self, depth_mm: Map) -> NDArray[np.float32]:
        """Correct a depth map. `depth_mm` is (height, width) in mm. Returns float32 (height, width) in mm; NaN stays NaN, and depths beyond the fitted range become NaN."""
    @property
    def method(self) -> str:
        """Method of the correction."""
    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the maps that it corrects."""
    @property
    def range_mm(self) -> tuple[float, float]:
        """True distances in mm of the farthest and the nearest target."""
    @property
    def findings(self) -> list[str]:
        """Targets whose error stays unusually large after the correction, for example because of a wrong distance. Empty after `load`."""

class PsfFit:
    """A calibrated point spread function, as `calibrate_psf` returns it. Can be pickled and copied.

    Attributes
    ----------
    optics : Optics
        The given optics with the point spread function that was found.
    psf : str
        The point spread function as `Optics(psf=...)` accepts it.
    verdict : str
        "good"; "loose" if `k` is open by more than 1 %; "unexplained" if more is left than noise.
    findings : list of str
        What to know before trusting the fit.
    k : float
        Width over blur radius; of a free profile that of a Gaussian with the same second moment.
    standard_error_k, standard_error_p : float or None
        Standard errors of `k` and of the exponent `p`, where the pairs determine them.
    residual : float
        Energy of the images that the model leaves over, 0 to 1.
    noise_residual : float
        What noise alone leaves over, 0 to 1.
    alphas : list of float
        Normalised depth of the target in each pair: -1 at the far focus, +1 at the near focus.
    otf : list of (float, float, float)
        Of a free profile: frequency times blur radius (rad), value, standard error.
    """

    @property
    def optics(self) -> Optics:
        """-"""
    @property
    def psf(self) -> str:
        """-"""
    @property
    def verdict(self) -> Literal["good", "loose", "unexplained"]:
        """-"""
    @property
    def findings(self) -> list[str]:
        """-"""
    @property
    def k(self) -> float:
        """-"""
    @property
    def standard_error_k(self) -> Optional[float]:
        """-"""
    @property
    def standard_error_p(self) -> Optional[float]:
        """-"""
    @property
    def residual(self) -> float:
        """-"""
    @property
    def noise_residual(self) -> float:
        """-"""
    @property
    def alphas(self) -> list[float]:
        """-"""
    @property
    def otf(self) -> list[tuple[float, float, float]]:
        """-"""

def calibrate_psf(
    pairs: Sequence[tuple[Image, Image, Optional[float]]],
    optics: Optics,
    *,
    model: Literal["gaussian", "generalised", "free"] = "gaussian",
    align: Literal["auto", "none", "optics", "shift", "similarity", "affine"] = "auto",
) -> PsfFit:
    """Fit the point spread function of a lens to pairs of flat, textured targets, all pairs together.

    Parameters
    ----------
    pairs : sequence of (far, near, distance_mm)
        Far- and near-focused image of one kind, each (height, width), and the distance of the target in mm, or None if the
        target is at the focus of the sharper image.
    optics : Optics
        The optics; their own point spread function is ignored.
    model : {"gaussian", "generalised", "free"}
        `k` of a Gaussian, `p` and `k` of a generalised Gaussian, or any round profile.
    align : {"auto", "none", "optics", "shift", "similarity", "affine"}
        How each near image is aligned with its far image first.

    Returns
    -------
    PsfFit
        With `optics`, `psf`, `verdict` and standard errors.

    Examples
    --------
    >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf="gaussian:k=0.4578")
    >>> pairs = [(*farnear.render(optics, f"plane:{mm}")[:2], mm) for mm in (933.0, 887.0)]
    >>> farnear.calibrate_psf(pairs, optics).verdict
    'good'
    """

class StackFit:
    """Lens calibrated by `calibrate_stack`; errors are those on parts of the target that were left out of the fit. Can be pickled
    and copied.

    Attributes
    ----------
    optics : Optics
        The lens, for `depth`.
    verdict : str
        "good", or what to change.
    findings : list of str
        What to know before trusting the lens.
    pair_step : int
        Slices from the far to the near image of a pair.
    bin : int
        Pixels per side that are averaged into one.
    robust_mm, rms_mm, bias_mm : float
        1.4826 times the median, root mean square and mean of the error, mm.
    slope : float
        Slope of measured over true depth.
    fill : float
        Part of the pixels with a depth, 0 to 1.
    within_three : float
        Part of the errors within three predicted standard deviations, 0 to 1.
    by_depth : array (n, 4), float64
        Rows of normalised depth (-1 far plane, 1 near plane), mean error, root mean square error and predicted standard deviation, mm.
    response : array (m, 2), float64
        Rows of measured and true normalised depth: the correction that `depth` applies.
    """

    @property
    def optics(self) -> Optics:
        """-"""
    @property
    def verdict(self) -> str:
        """-"""
    @property
    def findings(self) -> list[str]:
        """-"""
    @property
    def pair_step(self) -> int:
        """-"""
    @property
    def bin(self) -> int:
        """-"""
    @property
    def robust_mm(self) -> float:
        """-"""
    @property
    def rms_mm(self) -> float:
        """-"""
    @property
    def bias_mm(self) -> float:
        """-"""
    @property
    def slope(self) -> float:
        """-"""
    @property
    def fill(self) -> float:
        """-"""
    @property
    def within_three(self) -> float:
        """-"""
    @property
    def by_depth(self) -> NDArray[np.float64]:
        """-"""
    @property
    def response(self) -> NDArray[np.float64]:
        """-"""

def calibrate_stack(
    images: Stack,
    *,
    step_mm: float,
    object_pixel_um: Optional[float] = None,
    far_mm: Optional[float] = None,
    pair_step: Optional[int] = None,
    bin: Optional[int] = None,
) -> StackFit:
    """Calibrate a lens from a z-stack of a flat, textured target, tilted or not, as `farnear calibrate stack` does.

    Parameters
    ----------
    images : sequence of array (height, width)
        Slices of one size and one kind, one stage step apart, the one with the farthest focus first.
    step_mm : float
        Distance between neighbouring slices, mm (0.5 um is 0.0005). Steps in degrees, dioptres or volts give depths in that unit.
    object_pixel_um : float, optional
        Side of a pixel at the target, um; without it point clouds have any scale.
    far_mm : float, optional
        Distance of the far-focused plane of a pair, mm; without it depth is relative.
    pair_step : int, optional
        Slices from the far to the near image of a pair; by default for a largest blur of 2 to 3 px.
    bin : int, optional
        Pixels per side that are averaged into one; by default chosen with `pair_step`.

    Returns
    -------
    StackFit
        With `optics`, `verdict` and errors in mm. Pairs are `images[i]` (far) and `images[i + pair_step]` (near), for `method="whitened"`.

    Raises
    ------
    FarnearError
        Too few slices, slices of two sizes or kinds, no focus, blur that is too small.
    """

def render(
    optics: Optics,
    scene: str = "staircase",
    *,
    width: int = 640,
    height: int = 480,
    noise: Literal["none", "8bit", "12bit"] = "8bit",
    seed: int = 1,
    elliptical_distortion: bool = False,
) -> tuple[Union[NDArray[np.uint8], NDArray[np.uint16]], Union[NDArray[np.uint8], NDArray[np.uint16]], NDArray[np.float32]]:
    """Render what a camera exposes of a known scene.

    Parameters
    ----------
    optics : Optics
        The lens, its focus pair and the pixels.
    scene : str
        "plane:MM", "staircase", "slant", "cone" or "sphere", with options such as "cone,texture=fractal,contrast=0.3".
    width, height : int
        Size of the images, px.
    noise : {"none", "8bit", "12bit"}
        Noise and quantisation of the camera.
    seed : int
        Seed of texture and noise; the same seed gives the same images.
    elliptical_distortion : bool
        Whether the lens has field curvature.

    Returns
    -------
    far, near : array uint8 or uint16 (height, width)
        The images; with more than 8 bits `uint16` over its full range.
    truth : array float32 (height, width)
        True depth of each pixel, mm.

    Examples
    --------
    >>> optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703)
    >>> far, near, truth = farnear.render(optics, "plane:900", width=64, height=48)
    >>> far.shape, far.dtype.name, float(truth[0, 0])
    ((48, 64), 'uint8', 900.0)
    """

def sun_position(
    time: Union[str, datetime.datetime],
    latitude_deg: float,
    longitude_deg: float,
    *,
    model: Literal["psa", "almanac", "thesis", "spa"] = "psa",
) -> tuple[float, float]:
    """Position of the sun, without refraction.

    Parameters
    ----------
    time : str or datetime.datetime
        Time with its time zone.
    latitude_deg, longitude_deg : float
        Place, degrees; north and east are positive.
    model : {"psa", "almanac", "thesis", "spa"}
        Formulas: PSA+, an almanac, the thesis, or NREL's SPA.

    Returns
    -------
    elevation_deg, azimuth_deg : float
        Elevation above the horizon, and azimuth clockwise from north, degrees.

    Examples
    --------
    >>> elevation_deg, azimuth_deg = farnear.sun_position("2014-06-23T11:30:00Z", 52.38, -1.56)
    >>> round(elevation_deg)
    60
    """

def remove_shadow(
    mask: Mask,
    camera: str,
    *,
    elevation_deg: float,
    azimuth_deg: float,
    method: Literal["hybrid", "thesis"] = "hybrid",
) -> tuple[NDArray[np.bool_], ShadowReport]:
    """Remove the shadow of the one person in a mask.

    Parameters
    ----------
    mask : array bool or uint8 (height, width)
        Person with shadow; 0 = background.
    camera : str
        Text of a camera file (`farnear shadow remove --help`).
    elevation_deg, azimuth_deg : float
        Position of the sun, degrees.
    method : {"hybrid", "thesis"}
        How the shadow is cut.

    Returns
    -------
    mask : array bool (height, width)
        The person without shadow.
    report : dict
        `beta_deg`, `removed_fraction`, `distance_m` of the person, and whether the cut is `trustworthy`.
    """

def centroid_distance(mask: Mask, *, scaling: Literal["keep-aspect", "stretch"] = "keep-aspect") -> NDArray[np.float32]:
    """Centroid distances of a silhouette: its descriptor; takes 20 us.

    Parameters
    ----------
    mask : array bool or uint8 (height, width)
        The silhouette, px; 0 = background.
    scaling : {"keep-aspect", "stretch"}
        How the silhouette is scaled to the frame.

    Returns
    -------
    array float32 (360,)
        Distance from the centroid to the outermost pixel, one a degree anticlockwise from the right, in units of the frame's side.

    Examples
    --------
    >>> farnear.centroid_distance(np.ones((40, 20), bool)).shape
    (360,)
    """

def isomap(
    samples: NDArray[np.float32], *, neighbours: int = 5, dimensions: int = 2
) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.float32]]:
    """Isomap of float32 samples (n, features). Returns coordinates (n, dimensions), eigenvalues (dimensions) and path lengths (n, n)."""

class Rbf:
    """Gaussian radial basis functions on all samples (n, features), solved with a ridge for targets (n, d)."""

    def __init__(
        self, samples: NDArray[np.float32], targets: NDArray[np.float32], *, gamma: float, ridge: float = 1e-3
    ) -> None: ...
    def embed(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        """Coordinates, float32 (m, d), of samples, float32 (m, features)."""
    @property
    def condition(self) -> float:
        """Condition number of the system that was solved."""

def synthetic_masks(
    activity: str, *, subject: int = 0, azimuth_deg: float = 90.0, rate_hz: float = 15.0
) -> NDArray[np.bool_]:
    """Silhouettes of a synthetic person.

    Parameters
    ----------
    activity : str
        walk, drop, crouch, peer, mobile, place, bag, shoot, gun or dig.
    subject : int
        Number of the person; the same number is always the same person.
    azimuth_deg : float
        Direction of view, degrees; 0 = from the front.
    rate_hz : float
        Frames per second, 1 to 1000.

    Returns
    -------
    array bool (frames, height, width)
        Masks, 10 mm a pixel.

    Examples
    --------
    >>> farnear.synthetic_masks("walk").ndim
    3
    """

class Recogniser:
    """Recogniser of activities of people, from the masks of a clip.

    Parameters
    ----------
    model : path
        A recogniser of the package ("everyday", "everyday-order-free"), or a file.

    Examples
    --------
    >>> answer = farnear.Recogniser("everyday").recognise(farnear.synthetic_masks("walk"))
    >>> sorted(answer["probabilities"])[0] in farnear.Recogniser("everyday").activities
    True
    """

    def __init__(self, model: Path = "everyday") -> None: ...
    @property
    def activities(self) -> list[str]:
        """Activities that it can answer."""
    def recognise(
        self, *views: Union[Sequence[Mask], NDArray[np.bool_]], among: Optional[Sequence[str]] = None
    ) -> Recognition:
        """Activity in the masks of a clip.

        Parameters
        ----------
        *views : sequence of array bool (height, width), or array (frames, height, width)
            Masks of the clip, from one view or several; masks of 100x100 px are taken as cropped.
        among : sequence of str, optional
            Restrict the answer to these activities.

        Returns
        -------
        dict
            `activity` (None = unknown), `confidence` (its probability, 0 to 1), `outlier_score` (above 1 = unknown),
            and `probabilities` by name.
        """

class RigClient:
    """A board on a serial port, connected."""

    def __init__(self, port: str) -> None: ...
    def home(self, axes: Optional[Sequence[str]] = None) -> dict[str, float]:
        """Homes axes at the same time, all that have a home switch where none are named; gives their encoders' shifts in um."""
    def ensure_homed(self) -> None:
        """Homes what is not homed."""
    def move_to(self, targets_um: dict[str, float]) -> dict[str, float]:
        """Moves axes at the same time, um; gives where they have come to, um."""
    def status(self) -> dict[str, object]:
        """What the board says of itself now."""
    def info(self) -> dict[str, object]:
        """Who the board is and how far it goes."""
    def stop(self) -> None:
        """Stops all motion along the ramps."""
    def halt(self) -> None:
        """Emergency stop; raises an alarm."""
    def clear_alarm(self, number: int) -> None:
        """Clears an alarm by its number."""
    def expose(
        self,
        camera: str,
        shots: Sequence[tuple[str, float]],
        *,
        exposure_us: int = 5000,
        wait_s: float = 30.0,
        light: Optional[tuple[float, float]] = None,
    ) -> list[tuple[NDArray[np.uint16], int, dict[str, object]]]:
        """Runs programs of positions (axis, um) on the board; gives an image with its record for each."""
    def capture_pair(
        self,
        camera: str,
        optics: Optics,
        *,
        exposure_us: int = 5000,
        wait_s: float = 30.0,
        light: Optional[tuple[float, float]] = None,
        subtract_ambient: bool = False,
        average: int = 1,
        auto_exposure: bool = False,
    ) -> tuple[tuple[NDArray[np.uint16], int, dict[str, object]], tuple[NDArray[np.uint16], int, dict[str, object]]]:
        """A far- and a near-focused image for some optics: homes where needed, brings the stage near, exposes both by piezo."""
