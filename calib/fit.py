"""The residuals of the calibration: a batch of hands against one picture's landmarks.

Batched over hands so that the Jacobian by finite differences is a single call.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from calib.landmarks import Landmarks
from calib.parameters import Hands, thumb_grid, unpack
from handtrack import rotation
from handtrack.camera import Camera
from handtrack.hand.capsules import capsule_distance
from handtrack.hand.shape import HandShape
from handtrack.records import Pose, freeze_arrays

Array = NDArray[np.float64]

#: How far along the proximal bone the web between two fingers reaches (index-middle, ...).
WEB_SHARE = np.array([0.52, 0.58, 0.57])
#: The neck of the outline in the palm frame, mm: a little up the forearm.
NECK_MM = np.array([0.0, -7.0, 0.0])
#: Spacing of outline samples, and sigmas, in palm radii.
SPACING_R = 0.09
SIGMA_OUTLINE_R = 0.02
SIGMA_TIP_R = 0.04
SIGMA_VALLEY_R = np.array([0.05, 0.05, 0.08])  # the little finger's web varies most
SIGMA_WRIST_R = (0.08, 0.12)  # across the forearm, along it
UNSEEN_WRIST = 2.5  # times less sure where no neck was found
#: Centre of the palm disc to the wrist, over wrist to middle MCP (for the first guess of scale).
PALM_RADIUS_SHARE = 0.46


@dataclass(frozen=True, eq=False)
class Target:
    """What the picture shows, in pixels, with the default hand as the prior's mean."""

    points_px: Array  # (m, 2) labelled outline
    digit: NDArray[np.int64]  # (m,)
    tips_px: Array  # (5, 2)
    valleys_px: Array  # (3, 2) between the fingers
    wrist_px: Array  # (2,)
    wrist_weight: Array  # (2, 2): residual = weight @ (model - wrist)
    radius_px: float
    intrinsics: Array  # (4,) fx, fy, cx, cy
    default: HandShape

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @classmethod
    def of(cls, landmarks: Landmarks, camera: Camera, default: HandShape) -> "Target":
        """The target of one picture."""
        keep = np.zeros(len(landmarks.label), bool)
        step = max(1, round(SPACING_R * 32))
        keep[landmarks.tip_index[2] % step :: step] = True
        keep &= landmarks.label >= 0
        along = landmarks.up
        across = np.array([-along[1], along[0]])
        sigma = np.array(SIGMA_WRIST_R) * landmarks.radius_px
        sigma = sigma * (1.0 if landmarks.wrist_seen else UNSEEN_WRIST)
        return cls(
            points_px=landmarks.contour_px[keep],
            digit=landmarks.label[keep],
            tips_px=landmarks.tips_px,
            valleys_px=landmarks.valleys_px[1:],
            wrist_px=landmarks.wrist_px,
            wrist_weight=np.stack([across, along]) / sigma[:, None],
            radius_px=landmarks.radius_px,
            intrinsics=np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px]),
            default=default,
        )

    def project(self, X_mm: Array) -> Array:
        """Pixels ``(..., 2)`` of camera-frame points ``(..., 3)``."""
        return np.asarray(X_mm[..., :2] / X_mm[..., 2:] * self.intrinsics[:2] + self.intrinsics[2:])

    def outline_distances(self, hands: Hands, start: Pose) -> Array:
        """Signed distance in px ``(n, m)`` of outline points to their digit."""
        return self._distances(hands, _in_camera(joints_mm(hands), hands, start))

    def _distances(self, hands: Hands, joints: Array) -> Array:
        """The same, with joints ``(n, 5, 4, 3)`` already in the camera frame."""
        centre = joints.copy()
        last = joints[:, :, 3] - joints[:, :, 2]
        pull = hands.radius_mm[..., 3] / np.linalg.norm(last, axis=-1)
        centre[:, :, 3] -= np.minimum(pull, 0.9)[..., None] * last
        circles = np.empty((*centre.shape[:3], 3))
        circles[..., :2] = self.project(centre)
        circles[..., 2] = self.intrinsics[0] * hands.radius_mm / centre[..., 2]
        out = np.empty((len(centre), len(self.points_px)))
        _labelled_distances(self.points_px, self.digit, circles, out)
        return out


def residuals(z: Array, target: Target, start: Pose) -> Array:
    """Residuals ``(n, M)`` of unknowns ``z`` ``(n, N)``, each about 1 where all is well."""
    hands = unpack(z, target.default)
    n, r = len(z), target.radius_px
    joints = _in_camera(joints_mm(hands), hands, start)
    outline = target._distances(hands, joints) / (SIGMA_OUTLINE_R * r)
    tips = (target.project(joints[:, :, 3]) - target.tips_px) / (SIGMA_TIP_R * r)
    web = joints[:, 1:, 0], joints[:, 1:, 1] - joints[:, 1:, 0]
    share = (WEB_SHARE + hands.web_share[:, None])[..., None]
    near = web[0][:, :-1] + share * web[1][:, :-1]
    far = web[0][:, 1:] + share * web[1][:, 1:]
    valleys = (target.project((near + far) / 2) - target.valleys_px) / (SIGMA_VALLEY_R[:, None] * r)
    neck = _in_camera(np.broadcast_to(NECK_MM, (n, 1, 1, 3)), hands, start)[:, 0, 0]
    wrist = (target.project(neck) - target.wrist_px) @ target.wrist_weight.T
    return np.concatenate(
        [
            *(_pseudo_huber(part.reshape(n, -1)) for part in (outline, tips, valleys)),
            wrist,
            z,
        ],
        axis=1,
    )


def best_start(target: Target, start: Pose) -> Array:
    """The unknowns ``(N,)`` to begin from: the default hand with the best of a grid of thumbs.

    A thumb that starts on the wrong side of the outline stays there.
    """
    z = thumb_grid()
    energy = np.sum(residuals(z, target, start) ** 2, axis=1)
    return np.asarray(z[np.argmin(energy)])


def joints_mm(hands: Hands) -> Array:
    """First joint, the two others and the tip of every digit, palm frame: ``(n, 5, 4, 3)``."""
    theta = hands.theta.reshape(-1, 5, 4)
    sa, ca = np.sin(theta[..., 1]), np.cos(theta[..., 1])
    joints = [hands.base_mm]
    bend = np.cumsum(theta[..., [0, 2, 3]], axis=-1)
    for j in range(3):
        cf, sf = np.cos(bend[..., j]), np.sin(bend[..., j])
        along = np.einsum("ndij,ndj->ndi", hands.rest, np.stack([sa * cf, ca * cf, sf], axis=-1))
        joints.append(joints[-1] + hands.length_mm[..., j, None] * along)
    return np.stack(joints, axis=2)


def start_pose(landmarks: Landmarks, camera: Camera, default: HandShape, facing: str) -> Pose:
    """The frontal palm that puts wrist and middle finger where the landmarks are."""
    v = landmarks.valleys_px
    root = (v[1] + v[2]) / 2
    up = landmarks.tips_px[2] - root
    up /= np.linalg.norm(up)
    y = np.array([*up, 0.0])
    z = np.array([0.0, 0.0, -1.0 if facing == "palm" else 1.0])
    R = np.stack([np.cross(y, z), y, z], axis=1)
    scale = PALM_RADIUS_SHARE * default.palm_length_mm / landmarks.radius_px  # mm a pixel
    depth = camera.fx_px * scale
    wrist_px = root - up * (default.palm_length_mm + 0.5 * default.length_mm[2, 0]) / scale
    x, y_px = (wrist_px - (camera.cx_px, camera.cy_px)) / (camera.fx_px, camera.fy_px) * depth
    return Pose(R, np.array([x, y_px, depth]))


def _in_camera(points_mm: Array, hands: Hands, start: Pose) -> Array:
    """Camera-frame points ``(n, a, b, 3)`` of palm-frame ones."""
    R = rotation.exp(hands.turn) @ start.R
    t = start.t_mm * hands.depth_factor[:, None]
    t[:, :2] += hands.shift_mm
    return np.asarray(np.einsum("nij,nabj->nabi", R, points_mm) + t[:, None, None])


def _pseudo_huber(r: Array) -> Array:
    """``s`` with ``s^2 = 2 (sqrt(1 + r^2) - 1)``: quadratic near zero, linear far out."""
    return np.asarray(np.sign(r) * np.sqrt(2 * (np.sqrt(1 + r * r) - 1)))


@numba.njit(cache=True)
def _labelled_distances(points, digit, circles, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` ``(n, m)``: nearest of the three capsules of each point's own digit."""
    for n in range(circles.shape[0]):
        for m in range(len(points)):
            best = np.inf
            for b in range(3):
                a, c = circles[n, digit[m], b], circles[n, digit[m], b + 1]
                d, _ = capsule_distance(
                    points[m, 0], points[m, 1], a[0], a[1], a[2], c[0], c[1], c[2]
                )
                best = min(best, d)
            out[n, m] = best
