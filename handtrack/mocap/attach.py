"""Virtual markers on a moving skeleton: so any BVH of a hand becomes a data base, or a test.

A marker is glued to a bone: ``along`` it between its two keypoints and ``dorsal_mm`` above it, in
the bone's own frame, where it stays. Dorsal is across the axis about which the digit bends, away
from where it bends to: a property of the skeleton, so that all clips of a skeleton have their
markers in the same places. Where a digit never bends, dorsal is away from the palm (for the thumb,
turned half towards its side) in the frame where the digit is straightest. Markers of the palm stay
where they are in the palm frame. Noise and dropouts come from a seed.

>>> from handtrack.hand.shape import HandShape
>>> from handtrack.mocap.hand_motion import hand_motion
>>> motion = hand_motion(np.zeros((1, 20)), np.eye(3)[None], np.zeros((1, 3)), HandShape.default())
>>> markers = attach(motion, find_mapping(motion), marker_set("full13"))
>>> markers.n_frames, len(markers.labels)
(1, 16)
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import KEYPOINT_NAMES
from handtrack.mocap.bvh import Motion
from handtrack.mocap.mapping import SHIPPED, Mapping, read_mapping
from handtrack.mocap.marker_sets import MarkerSet, marker_set
from handtrack.mocap.markers import Markers
from handtrack.records import freeze_arrays

__all__ = ["Palm", "attach", "disturbed", "find_mapping", "marker_set", "palm_of"]

Array = NDArray[np.float64]

_JOINTS = tuple(name for name in KEYPOINT_NAMES if not name.endswith("_tip"))
#: The thumb's nail faces its side as much as the back of the hand.
_THUMB_DORSAL = np.array([1.0, 0.0, -1.0]) / np.sqrt(2)
_DORSAL = np.array([0.0, 0.0, -1.0])
#: A digit that bends by less than this (root mean square) does not show the axis of its hinges.
BENDS_RAD = np.radians(5.0)


@dataclass(frozen=True, eq=False)
class Palm:
    """The palm in the world: ``X_world = R X_palm + t_mm``, its length, and which hand it is."""

    R: Array  # (F, 3, 3)
    t_mm: Array  # (F, 3)
    length_mm: float
    side: str

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def mirror(self) -> Array:
        """Signs ``(3,)`` that take the right hand's palm frame to this hand's."""
        return np.array([-1.0 if self.side == "left" else 1.0, 1.0, 1.0])


def find_mapping(motion: Motion, name: str = "auto") -> Mapping:
    """The mapping called ``name`` (or at that path); ``auto`` finds the shipped one that fits.

    Raises
    ------
    InputError
        It names joints that the skeleton does not have; or none of the shipped ones fits.
    """
    if name != "auto":
        mapping = read_mapping(name)
        mapping.check(motion)
        return mapping
    for shipped in SHIPPED:
        mapping = read_mapping(shipped)
        joints = {*mapping.keypoints.values(), *(e["joint"] for e in mapping.angles.values())}
        if joints <= set(motion.names):
            mapping.check(motion)
            return mapping
    raise InputError(
        f"no shipped mapping ({', '.join(SHIPPED)}) fits this skeleton of "
        f"{', '.join(motion.names)}; give a mapping file with --mapping"
    )


def positional(mapping: Mapping) -> Mapping:
    """The mapping with its keypoints: a skeleton of ours has joints of the keypoints' names."""
    if mapping.keypoints:
        return mapping
    return replace(mapping, keypoints={name: name for name in _JOINTS}, angles={})


def axes_of(mapping: Mapping) -> Array:
    """Signs ``(3,)`` that take the file's axes to right-handed ones (x is flipped, or nothing)."""
    return np.array([-1.0 if mapping.left_handed_axes else 1.0, 1.0, 1.0])


def palm_of(keypoints_mm: Array) -> Palm:
    """The palm of keypoints ``(F, 21, 3)`` in any axes.

    y points from the wrist to the middle knuckle, z to the side to which the fingers curl (decided
    once for all frames), x is y cross z; a hand whose index knuckle is on the -x side is a left
    one.
    """
    X = keypoints_mm - keypoints_mm[:, :1]
    y = _unit(X[:, 9])
    across = X[:, 5] - X[:, 17]
    z = _unit(np.cross(across, y))
    first, second = _unit(X[:, 6::4] - X[:, 5::4]), _unit(X[:, 7::4] - X[:, 6::4])
    flexes_about = np.cross(first, second)  # (F, 4, 3); +x if z is out of the palm
    z = z if (flexes_about * np.cross(y, z)[:, None]).sum() >= 0 else -z
    x = np.cross(y, z)
    side = "right" if float((across * x).sum()) > 0 else "left"
    length = float(np.median(np.linalg.norm(X[:, 9], axis=1)))
    return Palm(np.stack([x, y, z], axis=-1), keypoints_mm[:, 0].copy(), length, side)


def attach(motion: Motion, mapping: Mapping, chosen: MarkerSet) -> Markers:
    """The markers of a set on a moving skeleton, mm, in the motion's axes (made right-handed).

    Raises
    ------
    InputError
        The mapping names a joint that the skeleton does not have.
    """
    where = positional(mapping)
    where.check(motion)
    points = where.positions_mm(motion)
    world_R = motion.world().R
    palm = palm_of(points)
    positions = np.empty((motion.n_frames, len(chosen.labels), 3))
    for m, label in enumerate(chosen.labels):
        site = chosen.sites[label]
        if not site.bone:
            local = np.array(site.palm) * palm.mirror * palm.length_mm
            positions[:, m] = np.einsum("fab,b->fa", palm.R, local) + palm.t_mm
            continue
        k = KEYPOINT_NAMES.index(site.bone)
        start, stop = points[:, k], points[:, k + 1]
        R = world_R[:, motion.index(where.keypoints[site.bone])]
        in_bone = dorsal_in_bone(points, palm, R, k)  # glued there: the same in every frame
        positions[:, m] = start + site.along * (stop - start) + site.dorsal_mm * (R @ in_bone)
    return Markers(chosen.labels, positions * axes_of(mapping), 1 / motion.frame_time_s)


def disturbed(
    markers: Markers,
    rng: np.random.Generator,
    noise_mm: float = 0.0,
    dropout: float = 0.0,
    mean_gap_s: float = 0.1,
) -> Markers:
    """The markers with measurement noise and dropouts.

    Parameters
    ----------
    rng : where the noise comes from.
    noise_mm : standard deviation of each coordinate.
    dropout : share of the frames in which a marker is not seen, in gaps.
    mean_gap_s : mean length of a gap (geometrically distributed).

    Raises
    ------
    InputError
        A share outside [0, 1), or a negative noise or length.
    """
    if not 0 <= dropout < 1 or noise_mm < 0 or mean_gap_s <= 0:
        raise InputError("dropout is a share from 0 to below 1; noise and gaps are not negative")
    positions = markers.positions_mm + rng.normal(0, noise_mm, markers.positions_mm.shape)
    if dropout > 0:
        end = min(1.0, 1 / (mean_gap_s * markers.rate_hz))
        begin = min(1.0, end * dropout / (1 - dropout))
        toss = rng.random((markers.n_frames, len(markers.labels)))
        hidden = toss[0] < dropout
        for f in range(markers.n_frames):
            if f > 0:
                hidden = np.where(hidden, toss[f] >= end, toss[f] < begin)
            positions[f, hidden] = np.nan
    return replace(markers, positions_mm=positions)


def dorsal_in_bone(points: Array, palm: Palm, R: Array, keypoint: int) -> Array:
    """The dorsal side ``(3,)`` of the bone that begins at a keypoint, in the bone's frame.

    Parameters
    ----------
    points : (F, 21, 3) keypoints.
    palm : in the same axes.
    R : (F, 3, 3) the bone's frame in every frame of the motion.
    keypoint : where the bone begins.
    """
    digit = (keypoint - 1) // 4
    chain = points[:, 1 + 4 * digit : 5 + 4 * digit]
    frame = int(np.linalg.norm(chain[:, 3] - chain[:, 0], axis=1).argmax())  # the straightest
    up = palm.R[frame] @ ((_THUMB_DORSAL if digit == 0 else _DORSAL) * palm.mirror)
    b = _unit(np.diff(chain, axis=1))  # (F, 3, 3)
    bone = R[frame].T @ b[frame, (keypoint - 1) % 4]
    bends = np.cross(b[:, :2], b[:, 1:])  # (F, 2, 3)
    in_bone = np.einsum("fba,fkb->fka", R, bends).reshape(-1, 3)
    spread, axes = np.linalg.eigh(in_bone.T @ in_bone / len(in_bone))
    dorsal = np.cross(bone, axes[:, -1])
    dorsal = dorsal if dorsal @ (R[frame].T @ up) >= 0 else -dorsal
    if spread[-1] < np.sin(BENDS_RAD) ** 2:
        dorsal = R[frame].T @ up
    return np.asarray(_unit(dorsal - bone * (bone @ dorsal)))


def _unit(vectors: Array) -> Array:
    norm = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(norm, 1e-12))
