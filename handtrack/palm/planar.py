"""Pose of planar points with the known camera: the paper's two tilts, each refined.

Scaled orthography about the line of sight gives two starts; each is refined under full
perspective, and the costs are compared. Where the two end in one minimum, or one end is behind
the camera, there is one pose.

>>> import numpy as np
>>> camera = Camera(600.0, 600.0, 320.0, 240.0, 641, 481)
>>> plane = np.array([[-40.0, 0.0], [40.0, 0.0], [40.0, 90.0], [-40.0, 90.0]])
>>> truth = Pose(np.array([[0.8, 0, 0.6], [0, -1, 0], [0.6, 0, -0.8]]), np.array([0, 50.0, 400.0]))
>>> result = planar_pose(plane, camera.project(truth @ np.pad(plane, ((0, 0), (0, 1)))), camera)
>>> len(result.poses), bool(np.allclose(result.poses[0].R, truth.R)), result.ambiguity < 0.01
(2, True, True)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.camera import Camera
from handtrack.palm.orthographic import orthographic_pose
from handtrack.palm.perspective import refine
from handtrack.palm.status import PalmStatus
from handtrack.records import Pose

Array = NDArray[np.float64]

#: Poses whose matrices differ by less are one minimum.
SAME = 1e-6


@dataclass(frozen=True, eq=False)
class PlanarPose:
    """One or two poses, lower cost (half the weighted sum of squares, px^2) first."""

    poses: tuple[Pose, ...]
    costs: tuple[float, ...]
    status: PalmStatus

    @property
    def ambiguity(self) -> float:
        """Lower cost over higher, 1 when the tilts cannot be told apart, 0 for a single one."""
        if len(self.costs) < 2:
            return 0.0
        return (self.costs[0] + 1e-12) / (self.costs[1] + 1e-12)


def planar_pose(
    plane_mm: ArrayLike, points_px: ArrayLike, camera: Camera, weights: ArrayLike | None = None
) -> PlanarPose:
    """Both poses of points ``(n, 2)`` of the palm's plane from their images ``(n, 2)``.

    Raises
    ------
    InputError
        The points do not come in pairs, or a weight is negative or missing.
    """
    start = orthographic_pose(plane_mm, points_px, camera, weights, line_of_sight=True)
    if not start.status.usable:
        return PlanarPose((), (), start.status)
    points = np.pad(np.asarray(plane_mm, float), ((0, 0), (0, 1)))
    fits = [refine(points, points_px, pose, camera, weights) for pose in start.poses]
    fits = sorted((fit for fit in fits if np.isfinite(fit.cost)), key=lambda fit: fit.cost)
    if not fits:
        return PlanarPose((), (), PalmStatus.BEHIND_CAMERA)
    if len(fits) == 2 and np.abs(fits[0].pose.R - fits[1].pose.R).max() < SAME:
        fits = fits[:1]
    return PlanarPose(
        tuple(fit.pose for fit in fits), tuple(fit.cost for fit in fits), fits[0].status
    )
