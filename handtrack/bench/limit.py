"""``handtrack bench limit``: what 21 perfect points would tell.

The paper's table is of pictures; here is what its six numbers would be if every keypoint, hidden
ones too, were seen to within a noise of known size. For each frame, pose and angles are fitted to
the points by least squares, begun at the truth itself, with a Gaussian prior (the configuration
space's, widened as for tracking) and the last frame's angles to within 10 deg. The hand is

- ``true``: handed over;
- ``flat``: its bones as long as the joints in the first frame say, if that hand is taken for flat;
- ``calibrated``: what :func:`calib.hand.calibrate_hand` makes of the first frame's true silhouette.

Outlines and edges tell less than points.

>>> import numpy as np
>>> from handtrack.hand.kinematics import keypoints_mm
>>> hand, camera, theta = HandShape.default(), Camera.assumed_for(640, 480), np.full(20, 0.3)
>>> pose = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 60.0, 450.0]))
>>> points = camera.project(pose @ keypoints_mm(theta, hand))
>>> found, bent = fit_points(points, 0.1, hand, camera, (pose, theta + 0.1), Gaussian.of_hands())
>>> float(np.abs(camera.project(found @ keypoints_mm(bent, hand)) - points).max()) < 0.2
True
"""

from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calib.hand import calibrate_hand
from handtrack import rotation
from handtrack.bench.metrics import Scores, score
from handtrack.bench.table import PAPER, PUBLISHED, aligned
from handtrack.bench.tracks import Track, read_truth
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.hand import space as spaces
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.records import Pose
from synth.cache import ClipCache

Array = NDArray[np.float64]

Hand = Literal["true", "flat", "calibrated"]

#: How far angles go from one frame to the next (standard deviation).
STEP_DEG = 10.0


@dataclass(frozen=True, eq=False)
class Gaussian:
    """A prior on angles: ``root @ (theta - mean)`` is standard normal."""

    mean: Array  # (20,) radians
    root: Array  # (20, 20)

    @classmethod
    def of_hands(cls) -> "Gaussian":
        """Of the configuration space that is shipped, widened as for tracking."""
        space = spaces.default()
        scatter = np.linalg.cholesky(space.prior_covariance())
        return cls(space.mean, np.asarray(np.linalg.inv(scatter), np.float64))

    def and_near(self, theta: Array, std: float) -> "Gaussian":
        """The product with a Gaussian about ``theta``."""
        precision = self.root.T @ self.root
        both = precision + np.eye(len(theta)) / std**2
        mean = np.linalg.solve(both, precision @ self.mean + theta / std**2)
        root = np.linalg.cholesky(both).T
        return Gaussian(np.asarray(mean, np.float64), np.asarray(root, np.float64))


def fit_points(
    points_px: Array,
    noise_px: float,
    shape: HandShape,
    camera: Camera,
    start: tuple[Pose, Array],
    prior: Gaussian,
) -> tuple[Pose, Array]:
    """Pose and angles ``(20,)`` that explain ``points_px`` ``(21, 2)`` best, from ``start`` on."""
    begin, theta = start

    def placed(z: Array) -> tuple[Pose, Array]:
        return Pose(begin.R @ rotation.exp(z[:3]), begin.t_mm + 100 * z[3:6]), z[6:]

    def residuals(z: Array) -> Array:
        pose, angles = placed(z)
        seen = camera.project(pose @ keypoints_mm(angles, shape))
        unlikely = prior.root @ (angles - prior.mean)
        return np.concatenate([((seen - points_px) / noise_px).ravel(), unlikely])

    return placed(least_squares(residuals, np.concatenate([np.zeros(6), theta]), method="lm").x)


def flattened(true: HandShape, truth: Track, camera: Camera) -> HandShape:
    """Bones as the first frame shows them, if its hand is flat and as far off as the wrist."""
    seen = (truth.keypoints_px[0] - truth.keypoints_px[0, 0]) / (camera.fx_px, -camera.fy_px)
    digits = (seen * truth.keypoints_mm[0, 0, 2])[1:].reshape(5, 4, 2)
    lengths = np.linalg.norm(np.diff(digits, axis=1), axis=-1)
    base = np.column_stack([digits[:, 0], true.base_mm[:, 2]])
    return replace(true, base_mm=base, length_mm=lengths)


def limit_of(clip: Path, hand: Hand, noise_px: float, expected_px: float, seed: int) -> Scores:
    """Scores of the points' fit on every other frame of the clip in the folder ``clip``.

    Raises
    ------
    InputError
        There is no clip with its truth, or its first frame shows no open right palm.
    """
    truth, camera = read_truth(clip / "truth.npz"), Camera.load(clip / "camera.toml")
    with np.load(clip / "truth.npz", allow_pickle=False) as data:
        poses = [Pose(R, t) for R, t in zip(data["R"], data["t_mm"], strict=True)]
        first = np.unpackbits(data["mask"][0], axis=-1, count=camera.width_px) > 0
    shape = HandShape.load(clip / "shape.toml")
    if hand == "flat":
        shape = flattened(shape, truth, camera)
    elif hand == "calibrated":
        calibrated = calibrate_hand(first, camera, side="right")
        if not calibrated.ok:
            raise InputError(f"{clip}: its first frame: {calibrated.status.sentence}")
        shape = calibrated.shape
    rng, prior = np.random.default_rng(seed), Gaussian.of_hands()
    chosen = np.arange(0, len(truth), 2)
    found: list[Array] = []
    near = prior  # and near the last frame, from the second on
    for k in chosen:
        points = truth.keypoints_px[k] + noise_px * rng.standard_normal((21, 2))
        pose, theta = fit_points(
            points, expected_px, shape, camera, (poses[k], truth.theta[k]), near
        )
        near = prior.and_near(theta, np.radians(STEP_DEG))
        found.append(pose @ keypoints_mm(theta, shape))
    true = Track(*(array[chosen] for array in vars(truth).values()))
    track = replace(
        true, keypoints_mm=np.array(found), keypoints_px=camera.project(np.array(found))
    )
    return score(track, true)


@dataclass(frozen=True)
class BenchLimit:
    """What the paper's six numbers would be if every keypoint were seen, to within a noise.

    Pose and angles are fitted to the true keypoints with noise, begun at the truth, with the true
    hand, with one measured on the joints of the first frame, and with one calibrated from it.
    """

    condition: str = "paper"
    """The ready scene; right hands only."""
    seeds: int = 3
    """Clips."""
    first_seed: int = 0
    """Seed of the first of them."""
    frames: int | None = None
    """Another length for every clip."""
    noise_px: tuple[float, ...] = (0.3, 1.0)
    """Standard deviations of the keypoints."""
    expected_px: float | None = None
    """What the fit takes them for; a hand that is not quite the true one wants more than they are.
    Default: what they are."""
    out: Path = Path("bench")
    """Folder for the results."""
    clips: Path | None = None
    """Folder where rendered clips are kept; default: clips in the folder for the results."""

    def __call__(self) -> int:
        """Print the paper's table; the exit code is 0."""
        if self.seeds < 1:
            raise InputError(f"--seeds {self.seeds}: wanted 1 or more")
        if min(*self.noise_px, self.expected_px or 1.0, 1.0) <= 0:
            raise InputError("--noise-px and --expected-px: wanted more than 0")
        render = ClipCache(self.clips or self.out / "clips", self.frames)
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        clips = [render(self.condition, seed) for seed in seeds]
        rows = [["hand", "noise px", *PAPER.values()], ["(published)", "", *PUBLISHED]]
        for hand in get_args(Hand):
            for noise in self.noise_px:
                every = [
                    limit_of(c, hand, noise, self.expected_px or noise, s)
                    for c, s in zip(clips, seeds, strict=True)
                ]
                medians = (median(scores[name] for scores in every) for name in PAPER)
                rows.append([hand, f"{noise:g}", *(f"{m:.2f}" for m in medians)])
        print(aligned(rows))
        return 0
