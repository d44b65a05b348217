"""The fingers' sides as points of the hand, for the palm to be fitted on (Section 5).

Once the angles are known, a finger is a rigid part of the palm: what can be seen of its sides
tells where the palm is as its own outline does. Of a palm between fingers and forearm little more
than two nearly parallel sides is seen, which leave its length, its place along them and both
tilts open; the fingers do not.

The samples are those of the cardboard model's lateral sides, in the palm's frame, with the
direction of the side and the one across it; samples that a nearer patch hides are left out.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.fingers.likelihood import hidden
from handtrack.hand.surface import SAMPLES_PER_SIDE, Cardboard
from handtrack.records import Pose

Array = NDArray[np.float64]


def visible_sides(
    surface: Cardboard, theta: Array, pose: Pose, intrinsics: Array, bones: int = 3
) -> tuple[Array, Array, Array]:
    """Points, outward unit normals and unit tangents ``(n, 3)`` of sides that are seen.

    Parameters
    ----------
    surface : Cardboard
    theta : (20,)
    pose : Pose
        From where they are seen.
    intrinsics : (4,)
        ``fx, fy, cx, cy``.
    bones : int
        How many bones of each finger, from its root.
    """
    ends = surface.sides_mm(theta[None])[0]  # (5, 4, 2, 3)
    near, far = ends[:, :3].reshape(15, 2, 3), ends[:, 1:].reshape(15, 2, 3)
    u = (np.arange(SAMPLES_PER_SIDE) + 0.5)[:, None] / SAMPLES_PER_SIDE
    points = near[:, :, None] * (1 - u) + far[:, :, None] * u
    tangents = far - near
    tangents /= np.maximum(np.linalg.norm(tangents, axis=-1, keepdims=True), 1e-9)
    across = near[:, 0] - near[:, 1]
    across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
    normals = np.stack([across, -across], axis=1)
    tangents, normals = (
        np.broadcast_to(a[:, :, None], points.shape).reshape(-1, 3) for a in (tangents, normals)
    )
    patches = surface.patches(theta[None], pose, intrinsics)
    count = len(tangents)
    seen = np.empty(count, bool)
    _seen(
        patches.sample[0, :count], patches.sample_patch, patches.corners[0], patches.depth_mm[0],
        patches.digit, patches.bone, seen,
    )  # fmt: skip
    seen &= np.repeat(np.arange(15) % 3 < bones, 2 * SAMPLES_PER_SIDE)
    return points.reshape(-1, 3)[seen], normals[seen], tangents[seen]


@numba.njit(cache=True)
def _seen(sample, patch, corners, depth, digit, bone, out):  # type: ignore[no-untyped-def]
    for s in range(len(sample)):
        out[s] = not hidden(sample[s, 0], sample[s, 1], patch[s], corners, depth, digit, bone)
