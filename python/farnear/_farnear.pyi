"""The compiled part. `farnear` gives what is of use to others; underscored names of it are for `farnear` itself."""

import datetime
import os
from typing import ClassVar, Literal, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

Image = Union[NDArray[np.uint8], NDArray[np.uint16], NDArray[np.float32], NDArray[np.float64]]
Mask = Union[NDArray[np.bool_], NDArray[np.uint8]]
Path = Union[str, "os.PathLike[str]"]

class FarnearError(ValueError):
    """What was given makes no sense; the message says what and why."""

class RigError(RuntimeError):
    """The rig, its camera or the way to them failed."""

class Optics:
    """Telecentric thin-lens geometry of a pair whose sensor moves; immutable.

    The normalised depth `alpha` is -1 at the far focus and +1 at the near focus.
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
    ) -> None:
        """One of `aperture_mm` and `f_number`, and one of `max_blur_px` (blur radius of an object at the near focus in the
        far-focused image, px) and `near_mm`, suffice. `psf` is `pillbox`, `gaussian:k=K` or `generalised:p=P,k=K`."""
    @staticmethod
    def load(path: Path) -> "Optics":
        """Reads an `optics.toml`."""
    @staticmethod
    def loads(text: str) -> "Optics":
        """Optics from the text of an `optics.toml`."""
    def dumps(self) -> str:
        """The text of an `optics.toml`."""
    def depth_mm(self, alpha: float) -> float:
        """Object distance of a normalised depth, mm."""
    def alpha(self, depth_mm: float) -> float:
        """Normalised depth of an object distance in mm."""
    def blur_px(self, alpha: float) -> tuple[float, float]:
        """Blur radii in the far and the near image, px; signed."""
    @property
    def focal_length_mm(self) -> float: ...
    @property
    def f_number(self) -> float: ...
    @property
    def pixel_um(self) -> float: ...
    @property
    def max_blur_px(self) -> float: ...
    @property
    def psf(self) -> str: ...
    @property
    def far_mm(self) -> float:
        """Object distance of the far focus."""
    @property
    def near_mm(self) -> float:
        """Object distance of the near focus."""
    @property
    def sensor_far_mm(self) -> float:
        """Lens to sensor for the far-focused image."""
    @property
    def sensor_near_mm(self) -> float:
        """Lens to sensor for the near-focused image."""

class Operators:
    """Rational operators for some optics; designing takes some ms (`design="thesis"` up to a second)."""

    def __init__(
        self,
        optics: Optics,
        *,
        family: Optional[Literal["watanabe", "raj", "ro", "gro", "ggro"]] = None,
        design: Literal["linear", "thesis"] = "linear",
        kernel_size: int = 7,
    ) -> None:
        """Without a family the one that belongs to the point spread function. `kernel_size` is in px: 5, 7, 9, 11 or 13."""
    @staticmethod
    def loads(text: str) -> "Operators":
        """Operators from the TOML that `farnear operators --out` writes."""
    def dumps(self) -> str:
        """The same TOML."""
    def kernel(self, name: Literal["prefilter", "gm1", "gp1", "gp2"]) -> NDArray[np.float64]:
        """A kernel, (kernel_size, kernel_size)."""
    @property
    def name(self) -> str: ...
    @property
    def nir_rms(self) -> float:
        """How well the cubic fits the normalised image ratio, root mean square."""
    @property
    def kernel_size(self) -> int: ...

class DepthMap:
    """A depth map with all that is known of it; arrays are (height, width)."""

    reason_words: ClassVar[dict[int, str]]
    """What the numbers in `reasons` mean."""
    @property
    def depth_mm(self) -> NDArray[np.float32]:
        """Object distance, mm; NaN where there is none."""
    @property
    def confidence(self) -> NDArray[np.float32]:
        """Probability that a depth is off by less than three of its standard deviations, 0 to 1; 0 where there is none."""
    @property
    def deviation_mm(self) -> NDArray[np.float32]:
        """Standard deviation of depth, mm, for the noise that the pair itself shows; NaN where there is none."""
    @property
    def reasons(self) -> NDArray[np.uint8]:
        """Why a pixel has no depth, as in `reason_words`; 0 where it has one."""
    @property
    def findings(self) -> list[str]:
        """What one should know before trusting the map."""
    @property
    def valid_fraction(self) -> float:
        """Part of the pixels that have a depth, 0 to 1."""

def depth(
    far: Image,
    near: Image,
    optics: Optics,
    *,
    operators: Optional[Operators] = None,
    method: Literal["ro", "whitened", "subbarao", "subbarao-fourier", "favaro"] = "ro",
    window: Union[int, Literal["adaptive", "safe"], None] = None,
    median_px: int = 3,
    fill: Union[bool, Literal["surface", "thesis"]] = False,
    low_texture: str = "energy",
    align: Literal["auto", "none", "optics", "shift", "similarity", "affine"] = "auto",
    balance: Literal["auto", "none", "gain", "local"] = "auto",
    min_confidence: float = 0.0,
    threads: int = 1,
) -> DepthMap:
    """Depth of a far- and a near-focused image, as `farnear depth` computes it.

    `far` and `near` are grey, (height, width), at least 16x16 px, of one size and one kind: `uint8` and `uint16` (full scale is where
    the camera clips) or floating point of any common scale (`float32` is not copied). `window` is the side in px (odd, to 63)
    over which evidence is summed, else adaptive for `whitened` and 7 for the others. `fill` gives regions of low texture a surface, as
    `"surface"` or in the thesis' order as `"thesis"`; `low_texture` is what counts as one, `"energy"` or the thesis' `"variance:T"`. `threads=0` takes all cores. Ctrl-C is
    heard when the map is done: 0.2 s for 640x480. Other threads of Python run meanwhile.

    Raises `FarnearError`: images of two sizes, kinds or scenes, a constant image, operators for another blur, windows that cannot be.
    """

def points_mm(depth_mm: NDArray[np.float32], optics: Optics) -> NDArray[np.float32]:
    """The point of the object that each pixel of a whole depth map sees, (height, width, 3) in mm as in the mesh of `farnear depth`: x to the
    right, y up, z towards the viewer, the lens at the origin; NaN where there is no depth."""

class Processor:
    """Depth of pair after pair by the bare run time: no alignment, no judging; some ms for 640x480."""

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
        self, far: NDArray[np.float32], near: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Depth in mm and confidence from texture and fit (0 to 1), each (height, width), of two images (height, width) of any
        common scale."""

class Correction:
    """A correction of field curvature, learned from depth maps of flat targets or loaded; immutable."""

    @staticmethod
    def fit(
        patterns: Sequence[tuple[NDArray[np.float32], float]],
        *,
        method: Literal["clsf", "clsf-blend", "clsf-full", "cdc", "two-step", "spline"] = "spline",
    ) -> "Correction":
        """Learns from pairs of a map (height, width) in mm and the target's true distance in mm; 20 to 30 through the working range
        are good. 24 maps of 640x480 take 0.1 s (`clsf`) to 1.2 s (`cdc`)."""
    @staticmethod
    def load(path: Path) -> "Correction":
        """Reads what `farnear calibrate correction --out` wrote."""
    @staticmethod
    def loads(text: str) -> "Correction": ...
    def dumps(self) -> str:
        """As `farnear correct --correction` reads it, TOML."""
    def apply(self, depth_mm: NDArray[np.float32]) -> NDArray[np.float32]:
        """The corrected map (height, width), mm; NaN stays, and what lies beyond what was learned becomes NaN."""
    @property
    def method(self) -> str: ...
    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the maps that it corrects."""
    @property
    def range_mm(self) -> tuple[float, float]:
        """True distances of the farthest and the nearest target, mm."""

def calibrate_psf(
    pairs: Sequence[tuple[Image, Image, Optional[float]]],
    optics: Optics,
    *,
    model: Literal["gaussian", "generalised"] = "gaussian",
) -> dict[str, object]:
    """The point spread function of a lens from pairs of flat, textured targets, all pairs together.

    A pair is its far- and near-focused image and the target's distance in mm, or None where it stands at the focus of the sharper one. Gives
    `psf` as `Optics` takes it, `residual`, the share of the images' energy that the model leaves over (0 to 1), and where each target stands (`alphas`).
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
    """What a camera would see of a known scene: the far and the near image, and the true depth in mm, each (height, width).

    `scene` is `plane:MM`, `staircase`, `slant`, `cone` or `sphere` with options such as `cone,texture=fractal,contrast=0.3`. Images
    are `uint8` or, for more than 8 bits, `uint16` over its whole range. The same seed gives the same images.
    """

def sun_position(
    time: Union[str, datetime.datetime],
    latitude_deg: float,
    longitude_deg: float,
    *,
    model: Literal["psa", "almanac", "thesis", "spa"] = "psa",
) -> tuple[float, float]:
    """Elevation above the horizon and azimuth clockwise from north, degrees, without refraction. `time` needs its zone."""

def remove_shadow(
    mask: Mask,
    camera: str,
    *,
    elevation_deg: float,
    azimuth_deg: float,
    method: Literal["hybrid", "thesis"] = "hybrid",
) -> tuple[NDArray[np.bool_], dict[str, float]]:
    """Takes the shadow of the one person in a mask (height, width) off, for a sun and a camera that stand so.

    `camera` is the text of a camera file (`farnear shadow remove --help`). Gives the mask without shadow and what was done: `beta_deg`,
    `removed_fraction`, `distance_m` of the person, and whether the cut is `trustworthy`.
    """

def centroid_distance(mask: Mask, *, scaling: Literal["keep-aspect", "stretch"] = "keep-aspect") -> NDArray[np.float32]:
    """The descriptor of a silhouette (height, width): 360 distances from its centroid to its outermost pixels, one a degree
    anticlockwise from the right, in units of the side of the frame that it is scaled to; 20 us."""

def isomap(
    samples: NDArray[np.float32], *, neighbours: int = 5, dimensions: int = 2
) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.float32]]:
    """Coordinates (n, dimensions), eigenvalues (dimensions), path lengths (n, n) of samples (n, features)."""

class Rbf:
    """Gaussian radial basis functions on all samples (n, features), solved with a ridge for targets (n, d)."""

    def __init__(
        self, samples: NDArray[np.float32], targets: NDArray[np.float32], *, gamma: float, ridge: float = 1e-3
    ) -> None: ...
    def embed(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        """(m, d) of samples (m, features)."""
    @property
    def condition(self) -> float:
        """Condition number of the system that was solved."""

def synthetic_masks(
    activity: str, *, subject: int = 0, azimuth_deg: float = 90.0, rate_hz: float = 15.0
) -> NDArray[np.bool_]:
    """Silhouettes (frames, height, width), 10 mm a pixel, of a person made by a program: walk, drop, crouch, peer, mobile, place, bag, shoot, gun
    or dig, seen from `azimuth_deg` (0 = from the front). A number of `subject` is always the same person."""

class Recogniser:
    """What a person does: a recogniser that comes with the package ("everyday", "everyday-order-free"), or a file of one's own."""

    def __init__(self, model: Path = "everyday") -> None: ...
    @property
    def activities(self) -> list[str]:
        """What it can answer."""
    def recognise(
        self, *views: Union[Sequence[Mask], NDArray[np.bool_]], among: Optional[Sequence[str]] = None
    ) -> dict[str, object]:
        """The activity in the masks (frames, height, width) of a clip, from one view or several; masks of 100x100 are taken for cut out.

        Gives `activity` (None = unknown), `confidence` (its probability), `strangeness` (above 1 = unknown) and `probabilities` by name; with
        `among` only these activities can be.
        """

class RigClient:
    """A connected board; use `farnear.rig.Rig`."""

    def __init__(self, port: str) -> None: ...
    def home(self, axes: Optional[Sequence[str]] = None) -> dict[str, float]: ...
    def ensure_homed(self) -> None: ...
    def move_to(self, targets_um: dict[str, float]) -> dict[str, float]: ...
    def status(self) -> dict[str, object]: ...
    def info(self) -> dict[str, object]: ...
    def stop(self) -> None: ...
    def halt(self) -> None: ...
    def clear_alarm(self, number: int) -> None: ...
    def expose(
        self, camera: str, shots: Sequence[tuple[str, float]], *, exposure_us: int = 5000, wait_s: float = 30.0
    ) -> list[tuple[NDArray[np.uint16], int, dict[str, object]]]: ...
    def capture_pair(
        self, camera: str, optics: Optics, *, exposure_us: int = 5000, wait_s: float = 30.0
    ) -> tuple[tuple[NDArray[np.uint16], int, dict[str, object]], tuple[NDArray[np.uint16], int, dict[str, object]]]: ...
