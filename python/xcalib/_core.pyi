from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, overload

from numpy import float32, float64, intp, uint8
from numpy.typing import ArrayLike, NDArray

class InputError(ValueError):
    """Input that cannot be used; the message names the file or argument and what was expected."""

class DecodeError(InputError):
    """A file that cannot be decoded: truncated, or not what its name says."""

class Lens:
    """What a lens does to a pinhole's image: OpenCV's models and coefficients.

    brown: k1 k2 p1 p2 [k3 [k4 k5 k6]]; fisheye: k1 k2 k3 k4; none. Points are normalized:
    (X/Z, Y/Z) before the lens, and what the intrinsic matrix takes to pixels after it.
    """

    def __init__(self, model: str = "none", coefficients: Sequence[float] = []) -> None:
        """Raises ValueError where the model is unknown, or has not so many coefficients."""
    @staticmethod
    def parse(option: str, word: str) -> Lens | None:
        """The lens of a word as --source-lens takes it, 'brown:K1,K2,P1,P2'; None for 'auto'.
        InputError, naming the option, otherwise.
        """
    @property
    def model(self) -> str:
        """'none', 'brown' or 'fisheye'."""
    @property
    def coefficients(self) -> list[float]:
        """As many as were given."""
    @property
    def bends(self) -> bool:
        """Whether it does anything."""
    @property
    def max_radius(self) -> float:
        """Points farther from the axis, before the lens, have no image."""
    def distort(self, points: NDArray[Any]) -> NDArray[float64]:
        """(N, 2) where the lens shows points (N, 2); NaN where nowhere."""
    def undistort(self, points: NDArray[Any]) -> NDArray[float64]:
        """(N, 2) points that the lens shows at (N, 2); NaN where none."""
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...

class Pinhole:
    """A pinhole camera, Eq. (intrinsic) of the paper, and its lens.

    Pixel centres lie at integer coordinates; all lengths in pixels. Fields may be set.
    """

    width: int
    """[px]"""
    height: int
    """[px]"""
    fx: float
    """[px]"""
    fy: float
    """[px]"""
    cx: float
    """[px]"""
    cy: float
    """[px]"""
    skew: float
    """[px]"""
    lens: Lens
    """Lens between (X/Z, Y/Z) and K."""

    def __init__(
        self,
        width: int,
        height: int,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        skew: float = 0.0,
        lens: Lens | None = None,
    ) -> None:
        """Raises ValueError where a size is below 1, a focal length not > 0, or a value not
        finite.
        """
    @staticmethod
    def from_hfov(width: int, height: int, hfov_deg: float, lens: Lens | None = None) -> Pinhole:
        """Square pixels and the principal point at the centre; hfov_deg in (0, 180), and no
        wider than what the lens shows.
        """
    @staticmethod
    def from_K(width: int, height: int, K: NDArray[Any], lens: Lens | None = None) -> Pinhole:
        """Of a (3, 3) intrinsic matrix [px], as OpenCV has it."""
    @property
    def K(self) -> NDArray[float64]:
        """(3, 3) float64 intrinsic matrix [px], read-only."""
    @property
    def hfov_deg(self) -> float:
        """Horizontal field of view, 2 atan(width / (2 fx)) without a lens [deg]."""
    @property
    def vfov_deg(self) -> float:
        """Vertical field of view [deg]."""
    def resized(self, width: int, height: int) -> Pinhole:
        """The same camera behind an image of another size [px]."""

class RelativeDepth:
    """Relative inverse depth r in metres: D = 1 / (scale r + shift).

    A rig that was calibrated with it has its translation in the unit that the scale stands
    for.
    """
    def __init__(self, scale: float, shift: float) -> None:
        """Raises ValueError where the scale is not > 0, or a value not finite."""
    @property
    def scale(self) -> float:
        """> 0"""
    @property
    def shift(self) -> float:
        """[1/m], if the scale is of metres."""

class ExpectedError:
    """How far the registered source is expected to lie from where it belongs [px of the
    reference when its width is 640 px].
    """
    @property
    def median(self) -> float:
        """Half of the pixels are no farther off."""
    @property
    def p95(self) -> float:
        """95 % of the pixels are no farther off."""
    def __iter__(self) -> Iterator[float]: ...

class Verdict:
    """Is a calibration to be trusted, and how far off is it?"""
    @property
    def trusted(self) -> bool:
        """Found, plausible, and the expected error within the tolerance."""
    @property
    def found(self) -> bool:
        """Two calibrations that share no frame agree."""
    @property
    def reason(self) -> str:
        """Why it is, or is not, to be trusted."""
    @property
    def advice(self) -> str:
        """What to do next; empty where it is trusted."""
    @property
    def expected_error(self) -> ExpectedError:
        """ExpectedError over the depths that the footage has."""
    @property
    def by_depth(self) -> dict[float, ExpectedError]:
        """ExpectedError by depth [m], nearest first; empty for relative depth."""
    @property
    def frames(self) -> int:
        """Number of pairs that it rests on."""
    @property
    def date(self) -> str:
        """Of the calibration, YYYY-MM-DD (UTC)."""
    @property
    def software(self) -> str:
        """That made it, and its version."""
    def line(self) -> str:
        """Reason and advice."""
    def error_at(self, depth: float) -> ExpectedError:
        """ExpectedError at a depth [m], in proportion to inverse depth between those of
        by_depth; NaN where there is none, or the depth is not positive.
        """

class Rig:
    """A reference and a source camera, fixed to each other.

    `R` and `t` take points of the reference camera to the source camera: X_S = R X_R + t.
    """

    reference: Pinhole
    """Pinhole that gives the pixel grid."""
    source: Pinhole
    """Pinhole whose images are registered."""
    R: NDArray[float64]
    """(3, 3) float64 rotation, source_from_reference; read-only, but set whole."""
    t: NDArray[float64]
    """(3,) float64 translation, source_from_reference [m]; read-only, but set whole."""
    relative_depth: RelativeDepth | None
    """RelativeDepth it was calibrated with, or None: metric depth."""
    source_mirrored: bool
    """Whether the source image is a mirror image: u = cx - fx X/Z + skew Y/Z."""

    def __init__(
        self,
        reference: Pinhole,
        source: Pinhole,
        R: ArrayLike | None = None,
        t: ArrayLike | None = None,
    ) -> None:
        """R: (3, 3) rotation, default identity. t: (3,) [m], default zero. ValueError otherwise."""
    @property
    def quaternion_wxyz(self) -> NDArray[float64]:
        """(4,) float64 unit quaternion of R."""
    @property
    def verdict(self) -> Verdict | None:
        """Verdict of the calibration that estimated it, or None where it is not known."""
    @property
    def mount(self) -> str:
        """How the source image is turned against the reference's, in words: 'upright' up to 15
        deg of roll, 'upside down', 'turned by 90 deg clockwise', 'mirrored', ...
        """
    @property
    def infinite_homography(self) -> NDArray[float64]:
        """(3, 3) float64, K_S R K_R^-1: where points at infinity go, lenses aside."""
    def resized(
        self, reference_width: int, reference_height: int, source_width: int, source_height: int
    ) -> Rig:
        """The same rig behind images of other sizes [px]."""
    def save(self, path: str | PathLike[str]) -> None:
        """Writes the rig file, whole or not at all. OSError names the path."""
    @staticmethod
    def load(path: str | PathLike[str]) -> Rig:
        """Reads a rig file. OSError where it cannot be read; ValueError, with the path, the
        field and what was expected, where it is not a rig.
        """
    def fitted(
        self, reference_width: int, reference_height: int, source_width: int, source_height: int
    ) -> Rig:
        """The rig for images of these sizes [px]: itself, or resized where both have its
        aspects, to within a pixel. Raises InputError where one has not.
        """
    def transfer(
        self, points: ArrayLike, depth: NDArray[Any] | ArrayLike, beyond: bool = False
    ) -> NDArray[float64]:
        """Points (N, 2) of the reference image in the source image: (N, 2) [px].

        depth: the frame's map (h, w) float32 [m], a number [m], or one of each point, (N,).
        NaN where there is none: outside of the source image (beyond: only where the camera
        cannot see), or the depth unknown. What the source sees something nearer in front of
        is given: FrameTransfer says so.
        """
    def transfer_back(
        self, points: ArrayLike, depth: NDArray[Any] | ArrayLike, beyond: bool = False
    ) -> NDArray[float64]:
        """Points (N, 2) of the source image in the reference image: (N, 2) [px].

        depth: the frame's map (h, w) float32 [m] of the reference, or of each point its depth
        in the reference camera, a number or (N,). With a map it is what is in front that
        counts. NaN where there is none: outside of the reference image (beyond: given too
        where depth is a number), depth unknown, or between a near and a far surface.
        """

class FrameTransfer:
    """Points from either image of a frame to the other, through its depth.

    Codes are those of a mask: 0 valid, 1 outside (or nothing there that the reference shows),
    2 occluded (the source sees something nearer; the point is given), 3 no depth, and 4
    ambiguous (between a near and a far surface).
    """
    def __init__(self, rig: Rig, depth: NDArray[Any]) -> None:
        """depth: (h, w) float32 [m], of any size of the reference's aspect, 0 unknown."""
    def to_source(
        self, points: ArrayLike
    ) -> tuple[NDArray[float64], NDArray[float64], NDArray[uint8]]:
        """(points, depths, codes) of reference points (N, 2): (N, 2) [px], which lie beyond the
        image where they are outside; depth in the reference camera (N,) [m]; (N,) uint8.
        """
    def to_reference(
        self, points: ArrayLike
    ) -> tuple[NDArray[float64], NDArray[float64], NDArray[uint8]]:
        """The same of source points (N, 2); NaN where not valid."""
    def inverse_map(self, width: int, height: int) -> NDArray[float32]:
        """(height, width, 2) float32 of the source's size: reference coordinates of each source
        pixel [px], NaN where there are none. The inverse of Registrar.map().
        """

class SearchOptions:
    """The global search that starts a calibration."""

    mode: str
    """auto (full without an initial rig, local with one), full, local or off."""
    max_fov_ratio: float
    """Largest ratio of the two fields of view, either way, in tangents; > 1."""
    max_roll_deg: float
    """[deg], in [0, 180]."""
    min_overlap: float
    """Geometric mean of the shares of both images' edges, in (0, 1)."""
    map_width: int
    """Width searched at [px], >= 32."""
    candidates: int
    """Peaks refined before one is chosen, >= 1."""

    def __init__(self, **kwargs: Any) -> None: ...
    def validate(self) -> None:
        """Raises ValueError naming the field, its value and the allowed range."""

class AdamOptions:
    """The published schedule. Keyword arguments set fields."""

    epochs: int
    """>= 1"""
    batch: int
    """Pairs, >= 1."""
    learning_rate: float
    """Learning rate of stage 1, > 0."""
    fine_learning_rate: float
    """Learning rate of stage 2, > 0."""
    decay: float
    """Factor of either with each step, in (0, 1]."""
    fine_from: float
    """Share of all steps at which stage 2 begins, in [0, 1]."""
    translation_scales: int
    """Scales of Eq. (translation), 1 to 3."""

    def validate(self) -> None:
        """Raises ValueError naming the field, its value and the allowed range."""

    def __init__(self, **kwargs: Any) -> None: ...

class Tolerance:
    """The expected error up to which a calibration is trusted [px of the
    reference when its width is 640 px].
    """
    def __init__(self, **kwargs: Any) -> None: ...
    median: float
    """Over the footage's own depths, > 0."""
    p95: float
    """Of 95 % of them, > 0."""
    @staticmethod
    def parse(option: str, text: str) -> Tolerance:
        """'2,5' as an option gives it, or '2': 95 % within 2.5 times the median. InputError
        names the option.
        """

class CalibrationOptions:
    """Options of calibrate(). Keyword arguments set fields."""

    max_frames: int
    """Pairs used, spread over the footage; >= 1."""
    seed: int
    """Seed of the frame choice."""
    num_threads: int
    """0 uses every core."""
    working_width: int
    """References are reduced by a whole factor to at most this width [px]."""
    max_iterations: int
    """Per stage and level; >= 1."""
    prior_weight: float
    """gamma of Eq. (total_loss), in stage 1; >= 0."""
    flow: str
    """The flow term: 'auto' (where nothing is searched), 'on' (after a search too) or 'off'."""
    flow_weight: float
    """lambda of Eq. (total_loss); > 0."""
    flow_rounds: int
    """Times at most that a stage at a level estimates flow; >= 1."""
    reference_camera: Pinhole | None
    """Known intrinsics, frozen, or None."""
    source_camera: Pinhole | None
    """Known intrinsics, frozen, or None."""
    reference_lens: Lens | None
    """Lens of the reference's images, frozen. None: that of reference_camera or of the initial
    rig, or none.
    """
    source_lens: Lens | None
    """Lens of the source's images, frozen. None: that of source_camera or of the initial rig;
    else k1 and k2 are estimated and kept where unseen frames gain.
    """
    reference_hfov_deg: float | None
    """Horizontal field of view to assume [deg], or None to search it."""
    optimize_reference: bool
    """Free the reference's intrinsics too; they are coupled with the source's. The solver 'adam'
    always does.
    """
    optimize_lens: bool
    """Free k1 and k2 of the source's lens, from source_lens where it is given, and keep them
    whether or not unseen frames gain; the solver 'adam' has a lens so only.
    """
    relative_depth: RelativeDepth | None
    """RelativeDepth that the depth maps were made with: the shift is estimated, the scale kept,
    and the rig has both. None: metric depth.
    """
    mount: str
    """How the source image is turned: 'auto' (upright, and where that is not found any),
    'upright', degrees clockwise as '90', 'mirrored', or both as 'mirrored-90'.
    """
    search: SearchOptions
    """SearchOptions."""
    tolerance: Tolerance
    """Tolerance."""
    solver: str
    """'ceres', or 'adam' as published, which searches nothing."""
    adam: AdamOptions
    """AdamOptions."""

    def __init__(self, **kwargs: Any) -> None: ...
    def validate(self) -> None:
        """Raises ValueError naming the field, its value and the allowed range."""

class LevelReport:
    """One solve: a stage at a level of the pyramid."""
    @property
    def factor(self) -> int:
        """Reduction of the working images."""
    @property
    def stage(self) -> int:
        """1 or 2, as in the paper."""
    @property
    def width(self) -> int:
        """[px]"""
    @property
    def height(self) -> int:
        """[px]"""
    @property
    def iterations(self) -> int:
        """Iterations of Levenberg-Marquardt."""
    @property
    def initial_cost(self) -> float:
        """Eq. (image_loss), and, where they act, the flow term and the prior."""
    @property
    def final_cost(self) -> float:
        """The same at the end."""
    @property
    def nec(self) -> float:
        """Mean over the pairs, weighted by c_i."""
    @property
    def aligned(self) -> float:
        """The same, beyond what chance gives."""
    @property
    def valid_share(self) -> float:
        """Share of the reference's edge energy that the source covers."""
    @property
    def condition_number(self) -> float:
        """Condition number of the normal equations, columns scaled to unit norm."""
    @property
    def seconds(self) -> float:
        """[s]"""
    @property
    def stopped(self) -> str:
        """Why it stopped."""

class CandidateReport:
    """A peak of the search, and what became of it."""
    @property
    def score(self) -> float:
        """Contrast against the typical value."""
    @property
    def correlation(self) -> float:
        """Pooled over the frames, of doubled angles, in [-1, 1]."""
    @property
    def overlap(self) -> float:
        """Overlap of both images' edges."""
    @property
    def refined_nec(self) -> float:
        """After the coarse levels."""
    @property
    def found(self) -> Rig:
        """Rig, by the search."""
    @property
    def refined(self) -> Rig:
        """Rig, after the coarse levels."""

class LensReport:
    """What k1 and k2 of the source's lens are worth."""
    @property
    def tried(self) -> bool:
        """Was a lens fitted?"""
    @property
    def coefficients(self) -> int:
        """Kept: 0, 1 (k1) or 2 (k1 and k2)."""
    @property
    def gain(self) -> float:
        """In NEC by the last one that was tried, of frames that the fit has not seen:
        the mean; of all frames where they gain too little to look further.
        """
    @property
    def gain_deviation(self) -> float:
        """The standard deviation of that mean; 0 of all frames."""

class AdamStep:
    """Before a step of Adam is taken: means over its batch."""
    @property
    def learning_rate(self) -> float:
        """Learning rate of the step."""
    @property
    def image(self) -> float:
        """Eq. (image_loss)."""
    @property
    def flow(self) -> float:
        """Eq. (flow_loss), in half widths of the reference."""
    @property
    def prior(self) -> float:
        """Eq. (camera_regularization)."""
    @property
    def total(self) -> float:
        """Eq. (total_loss)."""

class LagFit:
    """The fit with the sources some frames later, refitted."""
    @property
    def lag(self) -> int:
        """That a source is later than its own frame [source frames]."""
    @property
    def frames(self) -> int:
        """References that have such a source."""
    @property
    def factor(self) -> int:
        """Reduction of the level of the last fit: better lags are fitted further."""
    @property
    def nec(self) -> float:
        """Mean over the frames, there."""
    @property
    def gain(self) -> float:
        """NEC of a frame above the same with its own source, there: mean."""
    @property
    def error(self) -> float:
        """Standard error of the gain."""
    @property
    def rig(self) -> Rig:
        """Rig, refitted."""

class LagReport:
    """By how much the source is late beside its pairing."""
    @property
    def frames(self) -> int:
        """[source frames]; 0 too where the fits do not show it."""
    @property
    def change(self) -> int:
        """By how many frames the lag of the later half of the footage is the larger, where the
        halves differ.
        """
    @property
    def fits(self) -> list[LagFit]:
        """LagFit, by rising lag; none where the footage is no sequence."""
    def line(self) -> str:
        """How the fits compare."""

class CalibrationReport:
    """How a calibration went."""
    @property
    def verdict(self) -> Verdict:
        """Verdict."""
    @property
    def converged(self) -> bool:
        """Is the rig to be trusted?"""
    @property
    def message(self) -> str:
        """Why, and what to do next, in one line."""
    @property
    def seconds(self) -> float:
        """[s]"""
    @property
    def time(self) -> dict[str, float]:
        """Where they go [s]: `prepare` (working images and their pyramid), `search`, `warp`
        (reprojection and sampling of the passes over image pairs), `value` (the rest of the
        passes without derivatives), `jacobian` (the rest of those with them), `solver` (Ceres
        itself): the sum over threads divided by their number.
        """
    @property
    def working_width(self) -> int:
        """[px]"""
    @property
    def working_height(self) -> int:
        """[px]"""
    @property
    def nec(self) -> float:
        """At the finest level."""
    @property
    def baseline_nec(self) -> float:
        """Typical of rigs displaced by many pixels."""
    @property
    def contrast(self) -> float:
        """NEC above the baseline, in deviations over displacements."""
    @property
    def repeatability_px(self) -> float:
        """Median distance between the calibrations of two halves of the frames [working px]."""
    @property
    def visible_shift_px(self) -> float:
        """Shift, linear over the image, that flow between the registered images still sees:
        the length that 90 % of the pixels do not exceed [working px]; NaN where it is not
        known.
        """
    @property
    def valid_share(self) -> float:
        """Share of the reference's edge energy."""
    @property
    def weak_directions(self) -> list[str]:
        """What can slide, and with what, while the footage's pixels move by a tenth of a pixel."""
    @property
    def near_m(self) -> float:
        """Depth that 5 % are nearer than [m]."""
    @property
    def middle_m(self) -> float:
        """Median depth [m]."""
    @property
    def far_m(self) -> float:
        """Depth that 95 % are nearer than [m]."""
    @property
    def frames(self) -> list[int]:
        """Indices of the pairs used."""
    @property
    def candidates(self) -> list[CandidateReport]:
        """Candidates of the search, best score first."""
    @property
    def levels(self) -> list[LevelReport]:
        """In the order solved."""
    @property
    def lens(self) -> LensReport:
        """LensReport, of solver 'ceres'."""
    @property
    def steps(self) -> list[AdamStep]:
        """AdamStep, of solver 'adam'."""
    @property
    def lag(self) -> LagReport:
        """LagReport, where the footage is a sequence."""
    def expected_error_map(
        self, depth: float, width: int = 64, height: int = 48, share: float = 0.5
    ) -> NDArray[float32]:
        """(height, width) float32 over the reference image: the length that `share` of the
        errors at a depth [m] do not exceed [px of the reference when its width is 640 px];
        NaN where the source sees nothing.
        """
    def brief(self) -> str:
        """One line."""
    def full(self) -> str:
        """A table."""
    def to_dict(self) -> dict[str, Any]:
        """Plain lists and numbers, as for JSON."""

class CalibrationResult:
    """What calibrate() returns."""
    @property
    def rig(self) -> Rig:
        """The best rig found."""
    @property
    def converged(self) -> bool:
        """Is it to be trusted?"""
    @property
    def report(self) -> CalibrationReport:
        """CalibrationReport."""

def draw_frames(count: int, max_frames: int, seed: int) -> list[int]:
    """Indices of max_frames of count frames, spread over all, drawn with seed; sorted."""

def calibrate(
    references: Iterable[NDArray[Any]],
    sources: Iterable[NDArray[Any]],
    depths: Iterable[NDArray[Any]],
    initial: Rig | None = None,
    options: CalibrationOptions = ...,
    progress: Callable[[str, float], object] | None = None,
    flow: Callable[
        [NDArray[float32], NDArray[float32], NDArray[uint8]], tuple[NDArray[Any], NDArray[Any]]
    ]
    | None = None,
) -> CalibrationResult:
    """Estimates the rig from footage and depth, without a target.

    references, sources: lists (or other iterables) of (H, W) or (H, W, 3) uint8 | uint16 |
    float32 images, colour as blue-green-red, pairs by index; depths: (h, w) float32 [m], any
    size of the reference's aspect, 0 / NaN / inf unknown. initial: Rig to start from.
    progress: called with (stage, share of the work done). flow: a provider as in xcalib.flow,
    for the flow term; None is the built-in patch flow. Images are copied only where they are
    not contiguous and aligned.

    Raises ValueError, naming the frame, on unusable input. Not to converge is a result: see
    CalibrationResult.converged.
    """

class Registrar:
    """One rig, a stream of frames, Eq. (warping).

    num_threads: 0 uses every core. nearest: register() takes the source pixel next to the
    point as it is, instead of interpolating between four, so that radiometric counts are
    never mixed. occlusion, what the source camera sees something nearer in front of: "mark"
    gives it mask code 2, and the image shows what is in front; "hide" makes it 0 in the image
    and NaN in the map too, so that nothing is seen twice; "ignore" does not look for it.
    depth_scale: metres per unit of uint16 depth (1 / 256 is KITTI's), 0 unknown; None refuses
    integers. Raises ValueError where the rig or an option is not valid.
    """
    def __init__(
        self,
        rig: Rig,
        num_threads: int = 0,
        nearest: bool = False,
        occlusion: str = "mark",
        depth_scale: float | None = None,
    ) -> None: ...
    @property
    def rig(self) -> Rig:
        """A copy of the rig."""
    def map(self, depth: NDArray[Any]) -> NDArray[float32]:
        """(H, W, 2) float32: x and y in the source image [px] of each reference pixel, NaN where
        it is not valid. depth: as in register().
        """
    def register(
        self,
        source: NDArray[Any],
        depth: NDArray[Any],
        out: NDArray[Any] | None = None,
        mask: NDArray[uint8] | None = None,
    ) -> tuple[NDArray[Any], NDArray[uint8]]:
        """The source on the reference grid, and what each pixel is worth.

        source: (h, w) or (h, w, 3) uint8 | uint16 | float32 (float64 is converted to it) of
        the rig's source size; depth: (h, w) float32 [m], or uint16 if depth_scale was given,
        of the reference's aspect. out, mask: contiguous arrays to write the results to, which
        overlap no other; else new ones are made, which for large images takes as long as
        filling them. Returns (image, mask): image (H, W[, 3]) in the source's dtype, 0 where
        not valid, unless marked as occluded only; mask (H, W) uint8: 0 valid, 1 outside the
        source, 2 occluded, 3 no depth. Raises ValueError with shapes and dtypes.
        """

def nec(
    reference: NDArray[Any],
    registered: NDArray[Any],
    mask: NDArray[Any] | None = None,
    floor: str = "none",
) -> float:
    """Normalized Edge Correlation, Eq. (nec), in [0, 1]; NaN where no edge is left.

    Images (H, W) or (H, W, 3) of one size, colour as blue-green-red; mask (H, W) as
    Registrar.register() gives it: 0 where valid. floor: "none" (upper clamp
    only, as the authors' code) or "printed" (Eq. (gradient_clamping) as printed).
    """

def gc(
    reference: NDArray[Any], registered: NDArray[Any], mask: NDArray[Any] | None = None
) -> float:
    """Gradient correlation: mean over x and y of the zero-mean normalized correlation of the
    absolute forward differences, in [-1, 1]. Images and mask as in nec().
    """

def ncc(
    reference: NDArray[Any], registered: NDArray[Any], mask: NDArray[Any] | None = None
) -> float:
    """Zero-mean normalized cross correlation, in [-1, 1]. Images and mask as in nec()."""

def rmse(
    reference: NDArray[Any],
    registered: NDArray[Any],
    mask: NDArray[Any] | None = None,
    data_range: float | None = None,
) -> float:
    """Root mean square error of gray values, as a share of data_range. Images, mask and
    data_range as in ssim().
    """

def ssim(
    reference: NDArray[Any],
    registered: NDArray[Any],
    mask: NDArray[Any] | None = None,
    data_range: float | None = None,
) -> float:
    """Structural similarity (Wang et al. 2004), Gaussian window of sigma 1.5 px, over pixels
    whose 11 x 11 window is valid. data_range: span of the gray values, by default that of the
    type of integers, and 1 for floats, which must then lie in [0, 1]. Images and mask as in
    nec().
    """

def psnr(
    reference: NDArray[Any],
    registered: NDArray[Any],
    mask: NDArray[Any] | None = None,
    data_range: float | None = None,
) -> float:
    """Peak signal-to-noise ratio [dB], 20 log10(data_range / RMSE). Images, mask and data_range
    as in ssim().
    """

def patch_shifts(
    reference: NDArray[Any], registered: NDArray[Any], mask: NDArray[Any] | None = None
) -> NDArray[float32]:
    """(N, 4) float32: centre x, y and residual shift dx, dy [px] of the patches with a clear
    peak; see metrics.patch_residual().
    """

class FlowOptions:
    """Options of patch_flow()."""

    step: int
    """Distance of patches on their grid [px], odd, >= 3."""
    patch: int
    """Side of a patch [px], an odd multiple of the step."""
    levels: int
    """Levels of the pyramid, >= 1."""
    max_shift: int
    """Farthest shift that the coarsest level looks for [px], >= 1."""
    def __init__(self, **kwargs: Any) -> None: ...
    def validate(self) -> None:
        """Raises ValueError naming the field, its value and the allowed range."""

def patch_flow(
    reference: NDArray[Any],
    warped: NDArray[Any],
    valid: NDArray[Any] | None = None,
    options: FlowOptions = ...,
    num_threads: int = 0,
) -> tuple[NDArray[float32], NDArray[float32]]:
    """Residual flow between a reference and a warped source of another modality.

    Images (H, W) or (H, W, 3) of one size; valid (H, W), nonzero where the warped source is.
    Returns (flow, confidence): flow (H, W, 2) float32 [px], what reference pixel p shows is
    found at p + flow[p] in the warped source; confidence (H, W) float32 in [0, 1]. Both are
    linear between the grid's points. num_threads: 0 uses every core; the result does not
    depend on it. Raises ValueError with shapes and dtypes.
    """

def natural_order(names: Sequence[str]) -> list[int]:
    """Indices of names in the order in which people count: runs of digits compare as numbers,
    letters of ASCII without their case.
    """

def pair_files(
    first: Sequence[str | PathLike[str]], second: Sequence[str | PathLike[str]]
) -> list[int]:
    """The partner in second of each file of first, as indices; neither may be empty.

    Files of the same stem belong together; if none is common, those with the same numbers in
    their names; if none is common either, their order decides. Raises InputError, naming what
    has no partner, where names agree only in part or the counts differ.
    """

def times_of_names(names: Sequence[str]) -> list[float] | None:
    """Seconds where every name holds one time since 1970 (19, 16 or 13 digits, seconds with a
    fraction, SEC_NSEC, or a date and a time of day with a fraction) and they rise; None
    otherwise.
    """

class OffsetEstimate:
    """A clock offset, and what speaks for it."""
    def __init__(
        self,
        offset: float,
        trusted: bool,
        correlation: float,
        contrast: float,
        peak: float,
    ) -> None: ...
    @property
    def offset(self) -> float:
        """By how much the source's clock is late [s]; 0 where the footage does not show it."""
    @property
    def trusted(self) -> bool:
        """Whether it does."""
    @property
    def correlation(self) -> float:
        """Height of the peak, in [-1, 1]."""
    @property
    def contrast(self) -> float:
        """What it stands above the best peak elsewhere."""
    @property
    def peak(self) -> float:
        """Where the peak is [s], trusted or not."""
    def line(self) -> str:
        """In one line."""

class RefinedOffset:
    """A clock offset chosen by how well frames register, and what speaks for it."""
    @property
    def offset(self) -> float:
        """By how much the source's clock is late [s]; the middle candidate where it is not
        known.
        """
    @property
    def decided(self) -> bool:
        """Whether the frames register worse at both ends of the candidates."""
    @property
    def scores(self) -> list[float]:
        """Mean NEC of the frames judged, at each candidate; empty if fewer than two can be."""
    def line(self) -> str:
        """In one line."""

def fingerprint(data: str | bytes) -> str:
    """16 hexadecimal digits of a text, or of bytes: it detects accidental changes, not intended
    ones.
    """

def absolute_path(path: str | PathLike[str]) -> Path:
    """A path from the root, without `.` and empty parts; `..` and links stay."""

class Pairing:
    """Indices into two streams, and how they were found."""
    @property
    def method(self) -> str:
        """name, order or time."""
    @property
    def references(self) -> NDArray[intp]:
        """(N,) indices."""
    @property
    def sources(self) -> NDArray[intp]:
        """(N,) indices."""
    @property
    def dropped(self) -> tuple[int, int]:
        """Frames of either stream without a partner."""
    @property
    def gap(self) -> float:
        """Median distance in time, the offset allowed for [s]."""
    @property
    def offset(self) -> float:
        """By how much the source's clock is late [s]."""
    @property
    def lag(self) -> int:
        """By how many of its frames the source is late beyond that."""
    @property
    def alone(self) -> str:
        """Files without a partner, by name, a few of them; '' where there are none."""
    def line(self) -> str:
        """What happened, in one line."""

def pair_times(
    references: Sequence[float] | NDArray[float64],
    sources: Sequence[float] | NDArray[float64],
    offset: float = 0.0,
    max_gap: float | None = None,
) -> Pairing:
    """Pairs nearest times, one to one and in order, at most max_gap apart [s].

    The frames of the stream with fewer of them choose, one after the other, among the frames
    behind the last one chosen. By default max_gap is half the larger median period. Raises
    InputError where no two are near.
    """

def frames_to_look_at(count: int, max_frames: int, seed: int) -> list[int]:
    """Indices of the frames, of count, that a choice of max_frames looks at: four of each
    wanted, drawn with seed; rising.
    """

class Candidate:
    """What is kept of one frame, and what became of it."""
    def __init__(self, index: int, reason: str) -> None:
        """A frame that cannot be decoded."""
    @property
    def index(self) -> int:
        """Index of the frame in the footage."""
    @property
    def decoded(self) -> bool:
        """Whether there were images to look at."""
    @property
    def taken(self) -> bool:
        """Whether it is in the choice."""
    @property
    def reason(self) -> str:
        """Why it was taken or left."""
    @property
    def agreement(self) -> float:
        """Normalized correlation of the two images' edges where the footage as a whole aligns;
        NaN where not measured.
        """
    @property
    def gain(self) -> float:
        """What it added, or at the end would have added, to the log-determinant of the
        information; NaN where not measured.
        """

def look_at(
    index: int,
    reference: NDArray[Any],
    source: NDArray[Any],
    depth: NDArray[Any] | None = None,
) -> Candidate:
    """The Candidate of a frame; depth (h, w) float32 [m], None leaves it out of the choice."""

class Choice:
    """The frames to calibrate on, and what was found out on the way."""
    @property
    def indices(self) -> list[int]:
        """Indices of the frames taken, rising."""
    @property
    def candidates(self) -> list[Candidate]:
        """Every frame looked at, in order."""
    @property
    def unusable(self) -> list[Candidate]:
        """Candidates that something was found against: they never were in the choice."""
    def table(self, names: Callable[[int], str]) -> str:
        """One line per candidate: its name, what was measured, why it was taken or left."""

def choose(candidates: Sequence[Candidate], max_frames: int) -> Choice:
    """The Choice of at most max_frames of the candidates that determine the rig best; without a
    usable one it is empty.
    """

class ColorMap:
    """A curve in the colour cube, from cold to hot."""
    @property
    def name(self) -> str:
        """Name of a known map, or `estimated`."""
    @property
    def curve(self) -> NDArray[uint8]:
        """(256, 3) uint8, blue, green, red."""
    def invert(self, image: NDArray[Any]) -> NDArray[Any]:
        """The place of each pixel on the curve, 0 to 255: (h, w, 3) to (h, w) uint8. An image of
        one channel is returned as it is.
        """

def known_color_maps() -> list[ColorMap]:
    """OpenCV's, and `iron`."""

def recognise(images: Sequence[NDArray[Any]]) -> ColorMap | None:
    """The ColorMap of false-colour images of one camera, or None if they are none.

    The known map that is nearest, or one named `estimated`, whose bright end counts as hot.
    Gray images, tinted ones, and photographs give None. A few images are enough, and more
    than one is better where the map is not a known one.
    """

class FlirParts:
    """What a radiometric JPEG of a FLIR camera has in it."""
    @property
    def thermal(self) -> bytes:
        """The counts, uint16: an image file, or plain, row by row."""
    @property
    def width(self) -> int:
        """Of the counts [px]."""
    @property
    def height(self) -> int:
        """Of the counts [px]."""
    @property
    def is_file(self) -> bool:
        """Whether the counts are an image file."""
    @property
    def big_endian(self) -> bool:
        """The counts' order of bytes; in a PNG, that they are the wrong way."""
    @property
    def visible(self) -> bytes:
        """An image file; empty where there is none."""
    @property
    def real_to_ir(self) -> float:
        """Ratio of the fields of view, as the camera lays its images over each other."""
    @property
    def offset_x(self) -> float:
        """Of the thermal image from the visible one's middle [px of it]."""
    @property
    def offset_y(self) -> float:
        """The same, down."""
    def alignment(self, name: str) -> Rig:
        """The rig that the camera's own alignment is: a start, with a reference of 45 deg of field
        of view. InputError, naming `name`, where the file does not say.
        """
    def celsius(self, counts: NDArray[Any]) -> NDArray[float32] | None:
        """(H, W) float32, degrees Celsius of a black body; None where the file does not say."""

def flir_parts(data: bytes, name: str) -> FlirParts | None:
    """FlirParts of a JPEG, or None where it is not radiometric. DecodeError where damaged."""

def plain_counts(parts: FlirParts) -> NDArray[Any]:
    """(H, W) uint16 of counts that are no image file."""

class PlaneDepth:
    """Road-plane prior: a flat road under the camera, all else far away.

    D(x, y) = camera_height * fy / r(x, y), where r is the distance of a pixel below the
    horizon [px], never beyond far, which is also the depth at and above the horizon.
    """
    def __init__(
        self,
        camera_height: float = 1.6,
        horizon: float = 0.5,
        far: float = 60.0,
        hfov_deg: float = 45.0,
        roll_deg: float = 0.0,
    ) -> None:
        """Raises InputError: field, value, range."""
    @property
    def camera_height(self) -> float:
        """Height of the reference camera above the road [m], > 0."""
    @property
    def horizon(self) -> float:
        """Its row in the middle column, as a fraction of the image height from the top, (-1, 1)."""
    @property
    def far(self) -> float:
        """Largest depth [m], > 0."""
    @property
    def hfov_deg(self) -> float:
        """Horizontal field of view of the reference camera [deg], (0, 180); pixels are square."""
    @property
    def roll_deg(self) -> float:
        """How far the horizon falls towards the right [deg], (-45, 45)."""
    @property
    def parallel(self) -> bool:
        """Several threads may ask for depth at a time."""
    def __call__(self, index: int, reference: NDArray[Any]) -> NDArray[float32]:
        """Depth of any frame: (H, W) float32 [m], of the reference image's size."""

def frames_to_judge_plane(count: int) -> list[int]:
    """Of count frames, those that judge a plane: at most a dozen, evenly spread."""

def fit_plane(
    references: Sequence[NDArray[Any]],
    sources: Sequence[NDArray[Any]],
    plane: PlaneDepth,
    rig: Rig,
    options: CalibrationOptions,
    progress: Callable[[], object] | None = None,
) -> PlaneDepth:
    """The PlaneDepth near plane whose best rig aligns most edges.

    references, sources: images as calibrate() takes them; a dozen is enough. plane: where to
    start; its height, far distance and field of view are kept, since height scales depth and
    translation alike. rig: fitted with plane, where fits start. options: known cameras and
    threads are kept. progress: is called after each fit.
    """

class DepthUnits:
    """What the numbers of depth maps mean."""

    scale: float | None
    """Metres per unit of the numbers, of disparities px. None: 1/256 of the counts of a PNG, 1
    of floats.
    """
    invalid: list[float]
    """Numbers that mean unknown, besides those that are not above 0 or not finite, and the
    largest count of 16 bits.
    """
    baseline: float
    """Not 0: the numbers are disparities d [px] of cameras so far apart [m], and depth is focal
    * baseline / (d + doffs).
    """
    focal: float
    """[px]"""
    doffs: float
    """[px]"""

    def __init__(self, **kwargs: Any) -> None: ...
    def validate(self) -> None:
        """Raises InputError naming the field, its value and the allowed range."""

def depth_unit_of(word: str) -> float:
    """Metres per unit of what --depth-unit says: m, cm, mm or 1/N. Raises InputError."""

def metres_of(
    numbers: NDArray[Any], units: DepthUnits, where: str, is_png: bool
) -> NDArray[float32]:
    """(h, w) float32 [m] of a map's numbers, uint16 or float32; 0 where unknown.

    where names the map in messages; is_png: counts without a scale are of 1/256. Raises
    InputError where the unit is not known.
    """

def units_line(numbers: NDArray[Any], units: DepthUnits, where: str, is_png: bool) -> str:
    """A line on what a map is taken for: the range of its depth, its unit, the share that is
    unknown.
    """

def depth_choices() -> str:
    """What --depth may be, a line each; for the error where it is left out."""

def completion_confidence() -> float:
    """Filled pixels below it stay unknown, unless asked for."""

def complete_depth(
    depth: NDArray[Any], guide: NDArray[Any]
) -> tuple[NDArray[float32], NDArray[float32]]:
    """Fills the unknown pixels of a depth map along image edges; known ones are kept.

    depth (h, w) float32 [m], 0 unknown; guide: the reference image, of the same aspect.
    Returns (depth, confidence), (h, w) float32 each: depth > 0 everywhere; confidence in [0,
    1], 1 where depth was known, and lower the farther a pixel is from known depth and the
    more depth varies around it. An order, not a probability. Raises InputError where nothing
    is known or the aspects differ.
    """

def completed(
    depth: NDArray[Any], guide: NDArray[Any], min_confidence: float = 0.3
) -> NDArray[float32]:
    """The depth of complete_depth() where its confidence is at least min_confidence, [0, 1]; 0
    elsewhere.
    """

def compressed_guide(guide: NDArray[Any], width: int, height: int) -> NDArray[float32]:
    """The guide as gray of another size, with the contrast of dark parts raised: (height, width)
    float32 in [0, 1].
    """

class DepthSteadier:
    """Depth of a video, averaged over time along the image flow; causal.

    What the last frame knew is carried to this one by patch_flow() between their reference
    images, and by one forward speed for the whole frame. A pixel goes on with the running
    mean of its inverse depth, of 4 frames at most, or starts anew where depth or image around
    it has changed.
    """
    def __init__(self) -> None: ...
    def __call__(
        self,
        index: int,
        depth: NDArray[Any],
        reference: NDArray[Any],
        num_threads: int = 0,
    ) -> NDArray[float32]:
        """Frames are to follow on each other; any other one starts anew, and passes as it is.
        depth (h, w) float32 [m], 0 unknown, which stays unknown; reference: its image, of the
        same aspect. The result does not depend on num_threads.
        """

class Evaluation:
    """Scores of the registered and the unregistered source."""
    @property
    def size(self) -> tuple[int, int]:
        """Width and height the images are judged at [px]."""
    @property
    def valid_share(self) -> float:
        """Mean share of the pixels judged, [0, 1]."""
    @property
    def registered(self) -> dict[str, float]:
        """Scores by name, means over the frames; NaN where undefined."""
    @property
    def unregistered(self) -> dict[str, float]:
        """The same of the source that is only resized."""
    @property
    def given(self) -> dict[str, float] | None:
        """The same of images that another method registered, or None."""
    @property
    def gain_percent(self) -> dict[str, float]:
        """Change of each score by registration [%], NaN where undefined."""
    @property
    def frames(self) -> list[tuple[dict[str, float], dict[str, float]]]:
        """Registered and unregistered scores of each frame."""
    @property
    def verdict(self) -> Verdict | None:
        """Verdict of the rig on these frames, or None where it was not asked for, or where no two
        frames can be judged.
        """
    def table(self) -> str:
        """The scores as text, one line each."""
    def verdict_line(self) -> str:
        """The verdict on these frames."""
    def difference(self, rig: Rig, rig_file: str) -> str:
        """A line where that of the rig's file differs, else ''."""

class Evaluator:
    """Judges a rig on frames, one by one."""
    def __init__(self, rig: Rig, width: int = 640, num_threads: int = 0) -> None:
        """width: the reference is reduced by the smallest integer that makes it at most this
        wide [px]. num_threads: 0 means all cores.
        """
    def add(
        self,
        reference: NDArray[Any],
        source: NDArray[Any],
        depth: NDArray[Any],
        given: NDArray[Any] | None = None,
    ) -> None:
        """Images of one size a camera, as Registrar takes them; depth (h, w) float32 [m]. given:
        the source as another method registers it, of the reference's aspect.
        """
    def result(self, judge: bool = False) -> Evaluation:
        """The Evaluation; ValueError without a frame. judge: with the verdict of the rig on a
        dozen of these frames, which takes seconds.
        """

def _option_words() -> dict[str, list[str]]:
    """The words that each option of the command takes."""

def _flow_arguments() -> dict[str, str]:
    """CalibrationOptions.flow by what --flow of the command takes."""

def report_document(
    report: CalibrationReport,
    rig_file: str,
    files: Sequence[str],
    arguments: Sequence[str],
    directory: str,
    lag: int,
    choice: Sequence[tuple[str, bool, str]],
) -> str:
    """JSON text of a report, as `xcalib calibrate --report` writes it.

    files: those of its frames. arguments: of `xcalib`, which was run in directory. lag: of
    the sources, that was taken up [frames]. choice: (file, taken, reason) of the frames
    looked at.
    """

def evaluation_document(evaluation: Evaluation, rig_file: str, files: Sequence[str]) -> str:
    """JSON text of an Evaluation, as `xcalib evaluate --json` writes it; files: those of its
    frames.
    """

def rig_document(rig: Rig) -> str:
    """JSON text of describe(), as `xcalib inspect --json` prints it."""

def describe(rig: Rig) -> dict[str, Any]:
    """The rig's parameters and what follows from them, in px, deg and m.

    rotation_deg turns the source camera out of the reference camera's axes: pan to the right,
    then tilt up, then roll clockwise. Parallax is the distance from the point at infinity.
    """

def facts_text(rig: Rig) -> str:
    """describe(), as lines."""

def display_gray(image: NDArray[Any]) -> NDArray[uint8]:
    """Gray for the eye, (H, W) uint8: 1 to 99 % of the non-zero pixels stretched to 0 to 255."""

def overlay(
    reference: NDArray[Any], registered: NDArray[Any], mask: NDArray[Any] | None = None
) -> NDArray[uint8]:
    """Red-cyan composite (H, W, 3) uint8 of two images of one size: reference red, other cyan.

    Where the other is not valid by its mask, (H, W) as Registrar.register() gives it, the
    reference alone is shown, in gray.
    """

class Stream:
    """A sized sequence of frames, each read at the moment of access, all of one size.

    Only names and times are held, so that memory does not grow with the pixels of the
    footage. A slice is a stream again. A class of streams calls super().__init__() and has
    __len__, name(index), where(index) and read(index): frame 0 <= index < len, (H, W) or (H,
    W, 3), uint8, uint16 or float32; file(index) where that is not where(index);
    header_file(index) too where a frame is an image file as it is stored, so that its size is
    known without decoding it; and parallel = True if several threads may read.
    """
    def __init__(self) -> None: ...
    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: int) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, indices: slice) -> Stream: ...
    def __iter__(self) -> Iterator[NDArray[Any]]: ...
    def name(self, index: int) -> str:
        """What a file made from the frame is called, without suffix."""
    def where(self, index: int) -> str:
        """Where the frame is, for messages: a file, or a file and the frame's number."""
    def file(self, index: int) -> Path:
        """The file that the frame is in, or the folder of a bag."""
    @property
    def parallel(self) -> bool:
        """Whether several threads may read at a time."""
    times: NDArray[float64] | None
    """(N,) seconds of the frames, never falling; None where unknown. Each stream has its clock."""
    said: str
    """For the user: what of it was not used, or is missing, in a line, or ''."""

class Picked(Stream):
    """Some frames of a stream, in order."""
    def __init__(self, stream: Stream, indices: Sequence[int]) -> None: ...

class Half(Stream):
    """A half of every frame: two cameras side by side, or one above the other, in one stream."""
    def __init__(self, stream: Stream, half: str) -> None:
        """half: left, right, top or bottom."""

def oriented(stream: Stream) -> Stream:
    """A stream of image files, each turned as its EXIF orientation asks for; another stream as
    it is.
    """

def orientation_line(stream: Stream, applied: bool) -> str:
    """A line where the first file of the stream asks for a turn, or ''. applied: whether it is
    turned.
    """

def as_stored(file: bytes) -> bytes:
    """The bytes of an image file, of a TIFF as if it did not say how its picture is to be
    turned: OpenCV would do so, which it does with no other.
    """

def header_size(file: str | PathLike[str]) -> tuple[int, int] | None:
    """(width, height) of a PNG or JPEG file by its header; None of others, and where it is not
    whole.
    """

def times_beside(files: Sequence[str | PathLike[str]], stream: Stream) -> list[float] | None:
    """Times of timestamps.csv or timestamps.txt beside the files of a stream, None where there
    is none; a table without names that has more or fewer lines is not used, and stream.said
    says so.
    """

def read_times(table: str | PathLike[str], stream: Stream) -> list[float]:
    """Seconds of the frames of a stream from a file of `name timestamp` lines, or of as many
    times as frames, in their order.
    """

def scalar_sources(images: Stream, colormap: str = "auto") -> tuple[Stream, str]:
    """Source images with false colour turned back to numbers, and a line that says so, or ''.

    colormap: auto (a few frames, spread over the footage, are read to decide), none (images
    as they are), or the name of a known map.
    """

def pair_streams(
    references: Stream,
    sources: Stream,
    method: str = "auto",
    offset: float = 0.0,
    max_gap: float | None = None,
) -> Pairing:
    """Pairs two streams.

    method: name (pair_files), order (first with first, of equally many), time (pair_times),
    or auto: by time where both have times, else files by name, and others in order. offset
    [s]: reference time t is source time t + offset; not 0: by time. Raises InputError.
    """

def match_depths(references: Stream, used: Sequence[int], depths: Stream) -> list[int]:
    """The depth file, as an index into depths, of each of the references used.

    Files under the names of the frames are theirs, and others are left over. Else the nearest
    in time within half a period of the references, where both tell it; else by pair_files, of
    all references or of those in use. Raises InputError.
    """

def nearest_depths(references: Stream, used: Sequence[int], depths: Stream) -> list[int]:
    """The nearest depth map in time, as match_depths() does it, of streams with times."""

def estimate_offset(
    references: Stream, sources: Stream, max_offset: float = 2.0, max_frames: int = 1500
) -> OffsetEstimate:
    """A constant offset between the clocks of two streams with times, neither registered.

    max_offset: the largest looked for, either way [s]; also at most a third of the footage.
    max_frames: references read at most, from the middle of the footage. Raises InputError
    where the times do not overlap.
    """

def offsets_around(guess: float, references: Stream, sources: Stream) -> list[float]:
    """Candidates for refine_offset(): 6 frames of the faster stream either way, in quarters [s]."""

def refine_offset(
    rig: Rig,
    references: Stream,
    sources: Stream,
    depth: Any,
    candidates: Sequence[float],
    max_frames: int = 12,
) -> RefinedOffset:
    """Chooses among candidate offsets by how well the frames register with a rig.

    candidates [s], rising, around a guess in their middle. Of those that differ from the best
    by less than the frames do among each other (two standard errors of the mean), the one
    nearest to the middle is taken: the guess, unless the frames speak against it. Candidates
    that pair the same frames score the same. max_frames: frames of the slower stream judged,
    spread over the footage, the same ones for every candidate; those that cannot be decoded
    are left out. Raises InputError without candidates or times.
    """

class TimeOffset:
    """What --time-offset says."""
    @property
    def automatic(self) -> bool:
        """To be found from the footage."""
    @property
    def seconds(self) -> float:
        """By which the source's clock is late."""
    @property
    def frames(self) -> int:
        """By how many of its frames the source is late beyond that."""

def parse_time_offset(text: str) -> TimeOffset:
    """`auto`, seconds (0.1), or source frames (2f). Raises InputError."""

def is_sequence(stream: Stream) -> bool:
    """Whether frames follow each other: their times are at most a second apart, or one number in
    their names rises, by one as a rule.
    """

class Pairs:
    """Two streams, and which of their frames belong together."""
    def __init__(
        self,
        references: Stream,
        sources: Stream,
        method: str = "auto",
        time_offset: float | None = 0.0,
        max_gap: float | None = None,
        reference_times: str | PathLike[str] | None = None,
        source_times: str | PathLike[str] | None = None,
        estimate: OffsetEstimate | None = None,
        frame_offset: int = 0,
    ) -> None:
        """As pair_streams(); time_offset None: estimated; frame_offset: by how many of its
        frames the source is late beyond that. The tables are read by read_times(). Nothing
        else is read, save that an offset to be estimated, unless there is an estimate, needs
        the frames.
        """
    def refine(self, rig: Rig, open_depth: Callable[[list[int]], Any]) -> None:
        """Pairs anew with the offset at which frames register best with the rig.
        open_depth(used): the provider of the depth of these of all references. Without an
        estimated offset the pairs stay as they are, and so they do where the registered
        frames tell neither around the estimate nor around 0. Sequences without times are
        looked at up to 6 frames either way.
        """
    @property
    def references(self) -> Stream:
        """Those that have a partner."""
    @property
    def sources(self) -> Stream:
        """Their partners, in the same order."""
    @property
    def all_references(self) -> Stream:
        """With those that do not."""
    @property
    def all_sources(self) -> Stream:
        """With those that do not."""
    @property
    def offset(self) -> TimeOffset:
        """TimeOffset that they are paired with."""
    @property
    def pairing(self) -> Pairing:
        """Indices into the streams."""
    @property
    def notes(self) -> list[str]:
        """What the user should know, a line each."""

def is_video(output: str | PathLike[str]) -> bool:
    """Whether an output of this name is a video."""

def frame_names(references: Stream, sources: Stream, depth: Any) -> list[tuple[str, str]]:
    """(key, name) of each frame; the key changes with the files that the frame is made of: their
    names, sizes and times.
    """

def frame_rate(references: Stream) -> float:
    """Of a video of these frames [frames/s]: by the median of their times; 25 where they have
    none.
    """

def journal_of(output: str | PathLike[str]) -> Path:
    """Where the journal of an output is: in the folder, or beside the video, named after it."""

def load_frames(
    references: Stream,
    sources: Stream,
    depth: Any,
    chosen: Sequence[int],
    progress: Callable[[int], object],
) -> tuple[list[int], list[NDArray[Any]], list[NDArray[Any]], list[NDArray[float32]], str]:
    """(indices, references, sources, depths, line) of the chosen frames, in memory.

    Those that cannot be decoded are left out, and line says how many, or is ''; if none is
    left, raises DecodeError of the first. progress(done) is called after each.
    """

def plan_text(references: Stream, sources: Stream, depth: Any, chosen: Sequence[int]) -> str:
    """What a run would read and pair, and the frames chosen to calibrate on where there are any,
    a line each; of long footage the first and the last.
    """

def left_out(count: int, first: str) -> str:
    """The warning that frames were left out of a calibration, and why the first was."""

def with_file_name(message: str, images: Stream, chosen: Sequence[int]) -> str:
    """The message with the file that the core, which sees arrays only, calls `frame N`."""

def fit_lags(
    references: Sequence[NDArray[Any]],
    depths: Sequence[NDArray[Any]],
    sources: Mapping[int, Sequence[NDArray[Any] | None]],
    rig: Rig,
    options: CalibrationOptions = ...,
) -> LagReport:
    """Whether the source is late by whole frames: a LagReport.

    references, depths: a dozen of the frames that rig was fitted to, with options, as
    calibrate() takes them, spread over the footage. sources: by lag, 0 among them, a list
    with the source so many frames later than each reference's own, None where the footage has
    none. At each lag the rig is refitted, and the NEC of the same references compared.
    """

def look_at_lags(
    references: Sequence[NDArray[Any]],
    sources: Sequence[NDArray[Any]],
    depths: Sequence[NDArray[Any]],
    partners: Sequence[int],
    all_sources: Stream,
    rig: Rig,
    options: CalibrationOptions,
    progress: Callable[[float], object],
) -> LagReport:
    """fit_lags() of a dozen of the frames that rig was fitted to, with options.

    partners: the indices of their sources in all_sources, from which those before and after
    them are read. Where all_sources is no sequence, or the footage is short, nothing is.
    progress: is called with the share of the frames read.
    """

def add_lags(
    result: CalibrationResult, lag: LagReport, offset: TimeOffset, all_sources: Stream
) -> None:
    """Puts the report into the result, which is no longer trusted if the source is late beyond
    offset.
    """

def distrust(result: CalibrationResult, reason: str, advice: str) -> None:
    """The result is not to be trusted, and why; an empty reason changes nothing."""

def joined_images(images: Iterable[NDArray[Any]], name: str) -> tuple[str, str]:
    """(what is wrong, what to give instead) where most of the images look like two joined at
    their middle, one above the other or side by side; else two empty ones. name: REFERENCE or
    SOURCE.
    """

class ReadoutFit:
    """What fit_readout() found."""

    @property
    def share(self) -> float:
        """Of the time from frame to frame."""
    @property
    def taken(self) -> float:
        """To give to the option: at most 1."""
    @property
    def error(self) -> float:
        """Standard error of the share."""
    @property
    def seen(self) -> bool:
        """Whether there is one, and not by chance."""
    @property
    def shares(self) -> list[float]:
        """That were tried."""
    @property
    def nec(self) -> list[list[float]]:
        """Of each frame at each of the shares."""
    def line(self, camera: str) -> str:
        """In words."""

def parse_readout(option: str, text: str) -> float | None:
    """The share, 0 to 1, that an option says; None for 'auto'. Raises InputError."""

def straightened(
    sources: Stream,
    source: float,
    reference: float,
    rig: Rig | None,
    motion: Callable[[NDArray[Any], NDArray[Any]], NDArray[Any]],
    nearest: bool = False,
) -> Stream:
    """Source frames whose rows are brought to the time of the reference's, as they are read.

    source, reference: from the first row's reading to the last one's, in shares of the time
    from frame to frame; both 0 give the stream itself. rig: which rows look the same way;
    None: the rows of both, upright. motion: a function of two (H, W) uint8 frames that gives
    (H, W, 2) float32 [px], where what the first shows stands in the second. nearest: pixels
    are taken as they are, else cubic. Raises InputError where the frames do not follow each
    other.
    """

def fit_readout(
    references: Sequence[NDArray[Any]],
    depths: Sequence[NDArray[Any]],
    partners: Sequence[int],
    all_sources: Stream,
    rig: Rig,
    options: CalibrationOptions,
    source: float,
    reference: float,
    of_reference: bool,
    motion: Callable[[NDArray[Any], NDArray[Any]], NDArray[Any]],
    progress: Callable[[float], None],
) -> ReadoutFit:
    """The readout of a camera, as the fit of rig to a dozen of the frames shows it.

    partners: the indices of their sources in all_sources, as they were read. source,
    reference: what is known of the readouts; what is found comes to that of the source, or of
    the reference if of_reference.
    """

def frames_later(
    all_sources: Stream, partners: Sequence[int], lag: int
) -> tuple[list[int], list[int]]:
    """Of pairs with these partners in all_sources: those that have one lag frames later, and
    these partners.
    """

def max_threads() -> int:
    """How many threads may be asked for."""

def implausible(rig: Rig) -> list[str]:
    """What of a rig is so unlikely that another unit or a slip may be behind it, a line each."""

def read_text(file: str | PathLike[str]) -> str:
    """A text that people write: InputError where it is no file, larger than 1 MiB, or not UTF-8."""

def read_file(file: str | PathLike[str]) -> bytes:
    """The bytes of a file: InputError where it is none, as a pipe, or larger than 1 GiB."""

def read_array(file: str | PathLike[str], is_image: bool) -> NDArray[Any] | None:
    """What a .npy, .npz or .pfm file has, uint16 or float32; None where the suffix is another.

    (h, w) or, of an image, which may be uint8, (h, w, 3). Raises DecodeError where it is
    damaged, InputError where it is another array.
    """

def with_full_page_first(data: bytes, name: str) -> bytes:
    """The bytes of a TIFF file with the page of full size first, as of one that begins with a
    thumbnail; InputError, naming the file, where several pages are of that size.
    """

def as_signed(data: bytes) -> tuple[bool, bytes]:
    """Whether a TIFF file has unsigned 32-bit pixels, and its bytes with these said to be signed,
    as OpenCV decodes them.
    """

def video_line(name: str, times: Sequence[float], announced: float, rate: float) -> str:
    """A line where fewer frames were decoded than the header announces, though they reach to the
    end; else ''. InputError where the file ends early.
    """

def tiff_pixel_type(data: bytes) -> str:
    """The type of a TIFF's pixels, as numpy calls it; '' where the data does not say."""

def write_file(file: str | PathLike[str], data: bytes) -> None:
    """Writes bytes: under the file's name only when they are complete and on the disk.

    Its folder is made. What stands there is replaced; a link is followed; a pipe or a device
    is written to as it is. Raises InputError where that cannot be.
    """

def keep_file(partial: str | PathLike[str], file: str | PathLike[str]) -> None:
    """Gives a complete file, first made sure to be on the disk, its name."""

def list_files(folder: str | PathLike[str], suffixes: Sequence[str]) -> list[Path]:
    """Files of a folder with one of the suffixes (any case), in natural order, at least one."""

def check_folder_writable(folder: str | PathLike[str]) -> None:
    """Raises InputError now, before long work, if nothing can be written below a folder, which
    need not exist, and is not made.
    """

def check_file_writable(file: str | PathLike[str]) -> None:
    """Raises InputError now, before long work, if a file cannot be written."""

def check_output_writable(output: str | PathLike[str]) -> None:
    """Raises InputError now if a folder or a video, as register writes, cannot be."""

def check_writes(
    files: Sequence[str | PathLike[str]],
    references: Stream,
    sources: Stream,
    depth: Any,
    other_reads: Sequence[str | PathLike[str]],
) -> None:
    """Raises InputError if a run on these frames cannot write to all of the files, reads one of
    them, or would write one twice.
    """

class Registration:
    """How far a stream is registered, and its totals."""
    @property
    def frames(self) -> int:
        """Of the stream."""
    @property
    def earlier(self) -> int:
        """That were there from an earlier run."""
    @property
    def made(self) -> int:
        """That this run has made."""
    @property
    def valid(self) -> int:
        """Valid pixels of the frames of either."""
    @property
    def pixels(self) -> int:
        """Of all frames."""
    @property
    def not_finite(self) -> int:
        """Source pixels of the frames of this run that are no number: masked."""
    @property
    def seconds(self) -> float:
        """That this run took so far."""
    @property
    def busy(self) -> dict[str, float]:
        """Share of that time, [0, 1], that each stage was at work, by name."""
    def line(self) -> str:
        """While it is under way, in one line."""
    def summary(self) -> str:
        """At its end, in one line."""

class Ledger:
    """A registration that has begun, whose frames are registered elsewhere."""
    def __init__(
        self,
        references: Stream,
        sources: Stream,
        depth: Any,
        registrar: Registrar,
        output: str | PathLike[str],
        overlays: bool,
        overwrite: bool,
        inputs: Sequence[tuple[str, str]],
        other_reads: Sequence[str | PathLike[str]],
        codecs: object,
    ) -> None:
        """As register_frames() begins, with the same refusals: the journal of the output is held
        until close().
        """
    @property
    def names(self) -> list[tuple[str, str]]:
        """(key, name) of all frames, in order."""
    @property
    def there(self) -> dict[str, int]:
        """Valid pixels of the frames that an earlier run has written, by their keys."""
    @property
    def made_with(self) -> list[tuple[str, str]]:
        """(name, text) of all that the output depends on, but for the frames."""
    @property
    def rig(self) -> Rig:
        """The rig at the size of the images."""
    def claim(self) -> None:
        """Before the first file has its name: what is called as this output's files is of this
        run.
        """
    def append(
        self, units: Sequence[tuple[Sequence[tuple[str, int]], Sequence[tuple[str, int]]]]
    ) -> None:
        """Notes that files are whole, a unit (frames, files) for those that are whole only
        together: frames (key, valid pixels), in order, and files (name from the journal's folder,
        bytes).
        """
    def close(self) -> None:
        """Lets go of the journal."""

def register_frames(
    references: Stream,
    sources: Stream,
    depth: Any,
    registrar: Registrar,
    output: str | PathLike[str],
    overlays: bool,
    overwrite: bool,
    part_frames: int,
    inputs: Sequence[tuple[str, str]],
    other_reads: Sequence[str | PathLike[str]],
    codecs: object,
    progress: Callable[[Registration], object],
    hold_interrupts: bool,
    rate: float = 0.0,
) -> Registration:
    """Registers all frames that an earlier run has not written, and returns the Registration.

    registrar: with a rig and options to register by; its threads are those of the whole run.
    part_frames: of a video, that a run that is killed can lose at most. inputs: (name, text)
    of all that the frames were opened with; an output of others is refused. other_reads:
    files that were read besides those of the frames; nothing that is read is written to.
    codecs: has encode_image(file, image), which returns bytes, encoder_name(), Encoder(file,
    target, first, rate) and join(parts, file, target, rate, check). progress(registration) is
    called in this thread after frames, and a few times a second. hold_interrupts: in the main
    thread, SIGINT and SIGTERM end the run between two frames, by KeyboardInterrupt. rate: of a
    video [frames/s]; 0: that of the references.
    """
