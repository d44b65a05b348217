"""Our hand as BVH: a skeleton with metric offsets whose channels are the 20 angles themselves.

Each digit hangs on the wrist by a joint that never moves (``index_metacarpal``, ``thumb_carpal``):
its channels hold the digit's rest frame, so that the joints behind it turn about their own axes
only (:mod:`handtrack.hand.kinematics`)::

    wrist                 Xposition Yposition Zposition Zrotation Yrotation Xrotation   palm pose
      index_metacarpal    Z Y X rotation = R_rest, constant
        index_mcp         Zrotation = -abduction, Xrotation = flexion
          index_pip       Xrotation = flexion
            index_dip     Xrotation = flexion, End Site at the tip

Every joint has three rotation channels in the order ``Z Y X`` (some readers want all three).
A left hand is the mirror image in x, so its ``Zrotation`` is ``+abduction``. Lengths are mm.
BVH has y up: a camera's axes (y down, z forward) are turned by ``diag(1, -1, -1)``, so a hand
that points up in the picture stands upright in Blender.

>>> from handtrack.hand.shape import HandShape
>>> theta = np.radians([np.arange(20.0)])
>>> motion = hand_motion(theta, np.eye(3)[None], np.zeros((1, 3)), HandShape.default())
>>> motion.names[:5]
('wrist', 'thumb_carpal', 'thumb_cmc', 'thumb_mcp', 'thumb_ip')
>>> from handtrack.mocap.mapping import read_mapping
>>> np.allclose(read_mapping("handtrack").theta(motion)[0], theta)
True
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import DIGITS, KEYPOINT_NAMES
from handtrack.mocap.bvh import Motion

Array = NDArray[np.float64]

#: Turns camera axes (y down, z forward) into BVH's (y up, z to the viewer).
UPRIGHT = np.diag([1.0, -1.0, -1.0])
_MIRROR = np.array([-1.0, 1.0, 1.0])
_EULER = ("Zrotation", "Yrotation", "Xrotation")
_POSITION = ("Xposition", "Yposition", "Zposition")
#: The joints that hold the rest frames, thumb to little.
REST_JOINTS = tuple(f"{d}_{'carpal' if d == 'thumb' else 'metacarpal'}" for d in DIGITS)


def hand_motion(
    theta: ArrayLike,
    R: ArrayLike,
    t_mm: ArrayLike,
    shape: HandShape,
    side: str = "right",
    frame_time_s: float = 1 / 30,
    axes: ArrayLike = UPRIGHT,
) -> Motion:
    """The skeleton and its motion.

    Parameters
    ----------
    theta : (F, 20) angles in radians.
    R, t_mm : (F, 3, 3) and (F, 3), palm to camera (or to whatever ``axes`` turns upright).
    shape : sizes of the right-hand model; a left hand is its mirror image.
    side : ``"right"`` or ``"left"``.
    frame_time_s : seconds from frame to frame.
    axes : (3, 3) rotation from the frame of ``R`` and ``t_mm`` to BVH's axes.

    Frames in which something is not known (NaN) repeat the last known value (before the first,
    the first): BVH cannot say "unknown".

    Raises
    ------
    InputError
        No frame is known, or the side is neither right nor left.
    """
    if side not in ("right", "left"):
        raise InputError(f"side '{side}' is neither 'right' nor 'left'")
    angles = np.degrees(_held(theta))
    W = np.asarray(axes, float)
    turn = W @ _held(R)
    position = _held(t_mm) @ W.T
    mirror = _MIRROR if side == "left" else np.ones(3)
    z_sign = -mirror[0]  # Zrotation = z_sign * abduction
    names, parents, offsets, blocks = ["wrist"], [-1], [np.zeros(3)], [_euler_deg(turn)]
    rest = rotation.exp(shape.rest_rotvec)
    ends = []
    for d in range(5):
        rest_d = rest[d] * np.outer(mirror, mirror)
        joints = (REST_JOINTS[d], *KEYPOINT_NAMES[1 + 4 * d : 4 + 4 * d])
        first = len(names)
        names += joints
        parents += [0, first, first + 1, first + 2]
        base = rest_d.T @ (shape.base_mm[d] * mirror)
        offsets += [np.zeros(3), base, *(np.array([0, L, 0]) for L in shape.length_mm[d, :2])]
        ends.append([0.0, shape.length_mm[d, 2], 0.0])
        flexion, abduction, second, third = angles[:, 4 * d : 4 * d + 4].T
        blocks.append(np.tile(_euler_deg(rest_d), (len(angles), 1)))
        blocks.append(_columns(z_sign * abduction, flexion))
        blocks += [_columns(0.0 * second, second), _columns(0.0 * third, third)]
    return Motion(
        names=tuple(names),
        parents=np.array(parents, dtype=np.int64),
        offsets=np.array(offsets, dtype=float),
        channels=((*_POSITION, *_EULER), *([_EULER] * (len(names) - 1))),
        end_parents=np.array([names.index(KEYPOINT_NAMES[3 + 4 * d]) for d in range(5)]),
        end_offsets=np.array(ends, dtype=float),
        frame_time_s=float(frame_time_s),
        values=np.hstack([position, *blocks]),
    )


def _held(values: ArrayLike) -> Array:
    """``values`` ``(F, ...)`` with each unknown frame replaced by the last known one."""
    array = np.asarray(values, float)
    known = np.isfinite(array).all(axis=tuple(range(1, array.ndim)))
    if not known.any():
        raise InputError("the hand is not known in any frame: there is no motion to write")
    source = np.maximum.accumulate(np.where(known, np.arange(len(array)), -1))
    return array[np.where(source < 0, np.argmax(known), source)]


def _euler_deg(R: Array) -> Array:
    """Angles ``(..., 3)`` in degrees with ``R = Rz Ry Rx``, without jumps along the first axis."""
    flat = Rotation.from_matrix(np.array(R).reshape(-1, 3, 3)).as_euler("ZYX")
    angles = np.unwrap(flat, axis=0) if R.ndim == 3 else flat
    return np.degrees(angles).reshape(*R.shape[:-2], 3)


def _columns(z_deg: Array, x_deg: Array) -> Array:
    return np.stack([z_deg, np.zeros_like(z_deg), x_deg], axis=1)
