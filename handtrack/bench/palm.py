"""``handtrack bench palm``: the palm's pose alone, beside OpenCV's planar solver.

Random poses of the default palm's outline, projected exactly and given noise; each solver sees
the same points. A plane has two tilts, so two things are told apart: the error of the pose that
is nearer to the truth, and how often that pose comes first.

>>> noisy = compare_palm(noise_px=1.0, tilt_max_deg=60.0, poses=20)
>>> [score.solver for score in noisy]
['ours', 'IPPE', 'orthographic']
>>> noisy[0].median_deg < 3
True
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.bench.table import aligned
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.hand.shape import HandShape
from handtrack.palm.orthographic import orthographic_pose
from handtrack.palm.planar import planar_pose
from handtrack.records import Pose

Array = NDArray[np.float64]
Solver = Callable[[Array, Array, Camera], Sequence[Pose]]

#: The pose that comes first counts as right if no other is nearer by more than this.
RIGHT_DEG = 0.5


@dataclass(frozen=True)
class PalmScore:
    """One solver: rotation error of the nearer tilt, and the share where it comes first."""

    solver: str
    median_deg: float
    p90_deg: float
    right_first: float


def _ours(plane: Array, images: Array, camera: Camera) -> Sequence[Pose]:
    return planar_pose(plane, images, camera).poses


def _orthographic(plane: Array, images: Array, camera: Camera) -> Sequence[Pose]:
    return orthographic_pose(plane, images, camera, line_of_sight=True).poses


def _ippe(plane: Array, images: Array, camera: Camera) -> Sequence[Pose]:
    """OpenCV's two poses, lower reprojection error first."""
    points = np.pad(plane, ((0, 0), (0, 1)))
    _, turns, shifts, errors = cv2.solvePnPGeneric(
        points, images, camera.matrix, None, flags=cv2.SOLVEPNP_IPPE
    )
    order = np.argsort(np.ravel(np.asarray(errors)))
    return [Pose(rotation.exp(np.ravel(turns[i])), np.ravel(shifts[i])) for i in order]


SOLVERS: dict[str, Solver] = {"ours": _ours, "IPPE": _ippe, "orthographic": _orthographic}


def random_pose(rng: np.random.Generator, tilt_max_deg: float) -> Pose:
    """A palm that faces the camera to within a tilt, 350 to 550 mm away."""
    direction = rng.uniform(-np.pi, np.pi)
    tilt = np.radians(rng.uniform(0, tilt_max_deg))
    lean = rotation.exp(tilt * np.array([np.cos(direction), np.sin(direction), 0]))
    R = lean @ rotation.about_z(rng.uniform(-np.pi, np.pi)) @ np.diag([1.0, -1.0, -1.0])
    return Pose(R, np.array([*rng.uniform(-80, 80, 2), rng.uniform(350, 550)]))


def compare_palm(
    noise_px: float, tilt_max_deg: float, poses: int = 300, seed: int = 0
) -> list[PalmScore]:
    """Scores of all `SOLVERS` on the same noisy points of a 640 x 480 camera."""
    rng = np.random.default_rng(seed)
    camera, plane = Camera.assumed_for(640, 480), np.array(HandShape.default().palm_outline_mm)
    turned: dict[str, list[list[float]]] = {name: [] for name in SOLVERS}
    for _ in range(poses):
        truth = random_pose(rng, tilt_max_deg)
        exact = camera.project(truth @ np.pad(plane, ((0, 0), (0, 1))))
        images = exact + rng.normal(0, noise_px, exact.shape)
        for name, solve in SOLVERS.items():
            found = solve(plane, images, camera)
            turned[name].append(
                [float(np.degrees(rotation.angle_between(p.R, truth.R))) for p in found]
            )
    return [_score(name, errors) for name, errors in turned.items()]


def _score(name: str, errors: list[list[float]]) -> PalmScore:
    nearer = [min(e, default=180.0) for e in errors]
    first = [bool(e) and e[0] <= min(e) + RIGHT_DEG for e in errors]
    return PalmScore(
        name, float(np.median(nearer)), float(np.quantile(nearer, 0.9)), float(np.mean(first))
    )


@dataclass(frozen=True)
class BenchPalm:
    """Measure the palm's pose alone against OpenCV's planar solver (IPPE), on the same points."""

    noise_px: tuple[float, ...] = (0.3, 1.0, 2.0)
    """Standard deviations of the image points."""
    tilt_max_deg: tuple[float, ...] = (10.0, 60.0)
    """Largest angles between the palm's normal and the optical axis."""
    poses: int = 500
    """Random poses of each."""
    seed: int = 0
    """Of the poses and the noise."""

    def __call__(self) -> int:
        """Print a table."""
        if self.poses < 1:
            raise InputError(f"--poses {self.poses}: wanted 1 or more")
        rows = [["noise px", "tilt up to", "solver", "median deg", "90 % deg", "right tilt first"]]
        for noise in self.noise_px:
            for tilt in self.tilt_max_deg:
                for score in compare_palm(noise, tilt, self.poses, self.seed):
                    rows.append(
                        [
                            f"{noise:g}",
                            f"{tilt:g} deg",
                            score.solver,
                            f"{score.median_deg:.2f}",
                            f"{score.p90_deg:.2f}",
                            f"{score.right_first:.0%}",
                        ]
                    )
        print(aligned(rows))
        return 0
