"""The shape of a hand, and its pose, from the silhouette of one open palm.

Find the landmarks (:mod:`calib.landmarks`), then one least-squares fit of shape and pose
(:mod:`calib.parameters`, unknowns ``z`` with prior ``|z|^2``) to what they label::

    outline of digit d:  distance to the nearest of d's three capsules     2 % of the radius
    fingertips:          the end of the last bone                          4 %
    valleys:             between the proximal bones, WEB_SHARE along them  5 %
    wrist:               the neck of the outline                           8 % across, 12 % along

Outline residuals are robust (pseudo-Huber). Because a point of the outline only ever meets its own
digit, the fit cannot lock on one finger over. The palm is taken for frontal: a tilt shortens what
another hand's proportions shorten too, and one picture does not say which.

One camera cannot see size: the palm (wrist to middle MCP) keeps the default's length unless the
length of the hand, wrist to middle tip, is given. A left hand is flipped first and comes back as
the right hand in its mirror image, ``side`` says so, as the tracker wants it.

>>> import numpy as np
>>> from handtrack.camera import Camera
>>> result = calibrate_hand(np.zeros((48, 64), bool), Camera.assumed_for(64, 48))
>>> result.ok, result.status.sentence
(False, 'the silhouette is empty or too small to hold a hand')
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calib.fit import Target, best_start, residuals, start_pose
from calib.landmarks import Landmarks, Mask, search_landmarks, start_quality
from calib.outline import palm_from_outline
from calib.parameters import POSE, Hands, N, unpack
from calib.seen import Seen
from handtrack import rotation
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.hand.shape import HandShape
from handtrack.records import OTHER_SIDE, Pose, freeze_arrays

Array = NDArray[np.float64]
#: Mean distance of outline and model, in palm radii, above which the fit is not believed.
MAX_RESIDUAL_R = 0.06
FINITE_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """A calibrated hand, or the reason why there is none (``ok`` is False, the default hand).

    Everything is in the convention of the right hand: of a left hand this is the mirror image,
    found in the picture flipped left to right (``landmarks`` too).
    """

    shape: HandShape
    pose: Pose
    theta: Array  # (20,) radians
    side: str  # "right", "left", "" where no hand was found
    landmarks: Landmarks | None
    residual_px: float  # mean distance of the labelled outline to the model
    quality: float  # of the open hand, 0 to 1 (calib.landmarks.start_quality)
    status: Seen

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def ok(self) -> bool:
        """Whether a hand was found and fitted."""
        return self.status is Seen.OPEN_HAND


def calibrate_hand(
    mask: Mask,
    camera: Camera,
    default: HandShape | None = None,
    side: str | None = None,
    facing: str = "palm",
    hand_length_mm: float | None = None,
    visible: Mask | None = None,
    fit_shape: bool = True,
    min_quality: float = 0.0,
) -> CalibrationResult:
    """Fit ``default`` to the open hand in ``mask`` ``(h, w)`` seen by ``camera``.

    Parameters
    ----------
    side : "right", "left" or None
        What the hand is known to be; a picture that says otherwise is refused.
    facing : "palm" or "back"
        Which side of the hand the camera sees; it cannot be told from a silhouette.
    hand_length_mm : float, optional
        Wrist to middle fingertip: sets the scale.
    visible : (h, w) bool, optional
        Where the picture goes on, if that is not all of the mask (a crop beyond the frame).
    fit_shape : bool
        False: the hand is ``default`` as it is, and only its pose and angles are found.
    min_quality : float
        A hand that is not so open (:func:`calib.landmarks.start_quality`) is refused, unfitted.

    Raises
    ------
    InputError
        ``side`` or ``facing`` is none of the above, or the mask does not fit the camera.
    """
    _check(mask, camera, side, facing)
    default = default or HandShape.default()
    landmarks, seen = search_landmarks(mask, visible)
    if landmarks is None:
        return _refused(default, seen)
    found = _side_shown(landmarks, facing)
    if side not in (None, found):
        return _refused(default, Seen.OTHER_SIDE)
    if start_quality(landmarks) < min_quality:
        return _refused(default, Seen.HALF_OPEN)
    if found == "left":
        mask, camera = mask[:, ::-1], camera.mirrored()
        landmarks, seen = search_landmarks(mask, None if visible is None else visible[:, ::-1])
        if landmarks is None:
            return _refused(default, seen)
    result = _fit(landmarks, camera, default, found, facing, fit_shape)
    return result if hand_length_mm is None else _scaled(result, hand_length_mm)


def _check(mask: Mask, camera: Camera, side: str | None, facing: str) -> None:
    if side not in (None, "right", "left"):
        raise InputError(f"side is {side!r}, wanted 'right' or 'left'")
    if facing not in ("palm", "back"):
        raise InputError(f"facing is {facing!r}, wanted 'palm' or 'back'")
    if mask.shape != (camera.height_px, camera.width_px):
        raise InputError(
            f"mask of {mask.shape[1]}x{mask.shape[0]} px for a camera of "
            f"{camera.width_px}x{camera.height_px} px: give the camera of this crop"
        )


def _side_shown(landmarks: Landmarks, facing: str) -> str:
    return landmarks.side if facing == "palm" else OTHER_SIDE[landmarks.side]


def _refused(default: HandShape, seen: Seen) -> CalibrationResult:
    nowhere = Pose(np.full((3, 3), np.nan), np.full(3, np.nan))
    theta = np.full(20, np.nan)
    return CalibrationResult(default, nowhere, theta, "", None, np.nan, 0.0, seen)


def _fit(
    landmarks: Landmarks,
    camera: Camera,
    default: HandShape,
    side: str,
    facing: str,
    fit_shape: bool,
) -> CalibrationResult:
    """Least squares over the free ones of ``z``, then the record in mm."""
    target = Target.of(landmarks, camera, default)
    start = start_pose(landmarks, camera, default, facing)

    free = np.ones(N, bool) if fit_shape else POSE
    z = _solved(best_start(target, start), free, target, start)
    hand = unpack(z[None], default)
    distance = target.outline_distances(hand, start)[0]
    residual_px = float(np.mean(np.abs(distance)))
    believed = residual_px < max(MAX_RESIDUAL_R * landmarks.radius_px, 1.0)
    pose = _pose(hand, start)
    shape = default
    if fit_shape:
        shape = palm_from_outline(_shape(hand, default), pose, landmarks, camera)
    return CalibrationResult(
        shape=shape,
        pose=pose,
        theta=hand.theta[0],
        side=side,
        landmarks=landmarks,
        residual_px=residual_px,
        quality=start_quality(landmarks),
        status=Seen.OPEN_HAND if believed else Seen.POOR_FIT,
    )


def _solved(z: Array, free: NDArray[np.bool_], target: Target, start: Pose) -> Array:
    """The unknowns ``(N,)`` of least squares, begun at ``z``."""
    unit_steps = FINITE_STEP * np.eye(N)[free]

    def residuals_of(values: Array) -> Array:
        return residuals(_with(z, free, values)[None], target, start)[0]

    def jacobian(values: Array) -> Array:
        here = _with(z, free, values)
        both = residuals(np.vstack([here, here + unit_steps]), target, start)
        return np.asarray((both[1:] - both[0]).T / FINITE_STEP)

    solution = least_squares(
        residuals_of,
        z[free],
        jac=jacobian,
        method="trf",
        max_nfev=40,
        xtol=1e-4,
        ftol=1e-5,
    )
    return _with(z, free, solution.x)


def _with(z: Array, free: NDArray[np.bool_], values: Array) -> Array:
    """``z`` with its ``free`` ones replaced."""
    full = z.copy()
    full[free] = values
    return full


def _scaled(result: CalibrationResult, hand_length_mm: float) -> CalibrationResult:
    """The same picture of a hand of another size."""
    shape = result.shape
    factor = hand_length_mm / (shape.palm_length_mm + shape.length_mm[2].sum())
    pose = Pose(result.pose.R, result.pose.t_mm * factor)
    return replace(result, shape=shape.scaled(factor), pose=pose)


def _pose(hand: Hands, start: Pose) -> Pose:
    t = start.t_mm * hand.depth_factor[0]
    return Pose(rotation.exp(hand.turn[0]) @ start.R, t + np.array([*hand.shift_mm[0], 0.0]))


def _shape(hand: Hands, default: HandShape) -> HandShape:
    thickness = float(np.exp(np.mean(np.log(hand.radius_mm[0] / default.radius_mm))))
    return replace(
        default,
        base_mm=hand.base_mm[0],
        rest_rotvec=rotation.log(hand.rest[0]),
        length_mm=hand.length_mm[0],
        radius_mm=hand.radius_mm[0],
        palm_radius_mm=default.palm_radius_mm * thickness,
        calibrated=True,
        source="calibrated from the silhouette of an open palm",
    )
