"""How far a tracker is from the truth, told from 21 keypoints alone.

Angle conventions differ between trackers; points do not. So angles are measured on the points of
both sides in the same way (:func:`bends_deg`, :func:`palm_frames`):

- *bend* at a joint: the angle between the bone that ends there and the bone that begins there;
- *palm*: the frame of wrist, index, middle and little MCP (y to the middle MCP, z out of the palm);
- *flexion* and *abduction* of an MCP: direction of the first bone in that frame;
- *jitter*: mean ``|a[k+1] - 2 a[k] + a[k-1]|`` of the bends, beside the truth's own;
- *free*: the same after taking off one constant per joint (for the palm one constant turn), the
  median of the difference: where two models put a joint differs by a constant, and only the rest
  is tracking;
- *lag*: by how many frames the track must be shifted to fit best; 0 if it is in time.

Errors are means over the frames in which the hand is in the image and the tracker has an answer;
``tracked_share`` and ``answered_share`` say how many those are. NaN is "cannot be said".

>>> import numpy as np
>>> straight = np.zeros((21, 3)); straight[9:13, 1] = [80, 130, 160, 185]
>>> bends_deg(straight[None]).round(6)[0, 2].tolist()
[0.0, 0.0, 0.0]
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.bench.tracks import Track
from handtrack.errors import InputError

Array = NDArray[np.float64]
Scores = dict[str, float]

#: The paper's six numbers (Section 6, simulation) as keys of the scores.
PAPER_ROWS: dict[str, float] = {
    "x_px": 3.98,
    "rotation_deg": 3.42,
    "index_pip_deg": 8.46,
    "middle_mcp_deg": 4.96,
    "ring_pip_deg": 5.79,
    "ring_abduction_deg": 1.52,
}
_JOINTS = ("mcp", "pip", "dip")
#: Half width of a 90 % interval, in standard deviations.
_NINETY = 1.6448536
#: A hand that was lost must be found again within this many frames.
FOUND_AGAIN = 15
#: A hand is found where keypoints are nearer than this, in lengths of the palm.
FOUND_PALMS = 0.3


def bends_deg(keypoints_mm: Array) -> Array:
    """Angles between bones ``(F, 5, 3)`` at the first, second and last joint of each digit."""
    wrist, chains = keypoints_mm[:, :1], keypoints_mm[:, 1:].reshape(-1, 5, 4, 3)
    start = np.broadcast_to(wrist[:, None], (*chains.shape[:2], 1, 3))
    bones = np.diff(np.concatenate([start, chains], axis=2), axis=2)
    before, after = bones[:, :, :-1], bones[:, :, 1:]
    across = np.linalg.norm(np.cross(before, after), axis=-1)
    return np.degrees(np.arctan2(across, np.sum(before * after, axis=-1)))


def palm_frames(keypoints_mm: Array) -> Array:
    """Palm to camera ``(F, 3, 3)`` from wrist, index, middle and little MCP.

    z points out of the palm of a right hand; of a left hand it points out of the back, which is
    the same on both sides of a comparison.
    """
    wrist, index, middle, little = (keypoints_mm[:, k] for k in (0, 5, 9, 17))
    y = _unit(middle - wrist)
    z = _unit(np.cross(index - little, y))
    return np.stack([np.cross(y, z), y, z], axis=-1)


def in_image_deg(found_mm: Array, true_mm: Array) -> Array:
    """What of the palm's turn ``(F,)`` is about the camera's axis, the one that a picture shows."""
    turn = palm_frames(found_mm) @ np.swapaxes(palm_frames(true_mm), 1, 2)
    return np.abs(np.degrees(rotation.log(turn)[:, 2]))


def mcp_angles_deg(keypoints_mm: Array) -> tuple[Array, Array]:
    """Flexion and abduction ``(F, 4)`` of the fingers' first bones in the palm's frame."""
    roots, knuckles = keypoints_mm[:, 5::4], keypoints_mm[:, 6::4]
    local = np.einsum("fji,fdj->fdi", palm_frames(keypoints_mm), _unit(knuckles - roots))
    x, y, z = np.moveaxis(local, -1, 0)
    return np.degrees(np.arctan2(z, y)), np.degrees(np.arcsin(np.clip(x, -1, 1)))


def score(track: Track, truth: Track) -> Scores:
    """Every metric of ``track`` against ``truth``, by name; degrees, pixels, shares.

    Raises
    ------
    InputError
        They are of different lengths.
    """
    if len(track) != len(truth):
        raise InputError(f"the track has {len(track)} frames, the truth {len(truth)}")
    answered = np.isfinite(track.keypoints_px).all(axis=(1, 2)) & truth.shown
    solid = answered & np.isfinite(track.keypoints_mm).all(axis=(1, 2))
    return {
        "frames": float(len(truth)),
        "tracked_share": _mean((track.shown & answered)[truth.shown]),
        "answered_share": _mean(answered[truth.shown]),
        "found_share": found_share(track, truth),
        "frames_to_find": frames_to_find(track.shown & answered, truth.shown),
        "keypoints_px": _keypoint_error(track, truth, answered),
        "lag_frames": lag_frames(track, truth),
        **_angle_scores(track.keypoints_mm, truth.keypoints_mm, solid),
        **_paper_scores(track, truth, solid),
        "coverage_90": coverage(track, truth),
    }


def _angle_scores(found: Array, true: Array, use: NDArray[np.bool_]) -> Scores:
    """Bends by joint type, palm, jitter."""
    delta = bends_deg(found[use]) - bends_deg(true[use])  # (n, 5, 3)
    free = delta - np.median(delta, axis=0) if use.any() else delta
    turn = np.swapaxes(palm_frames(true[use]), 1, 2) @ palm_frames(found[use])
    scores = {"bend_deg": _mean(np.abs(delta))}
    scores |= {f"bend_{j}_deg": _mean(np.abs(delta[:, 1:, k])) for k, j in enumerate(_JOINTS)}
    scores |= {
        "bend_thumb_deg": _mean(np.abs(delta[:, 0])),
        "bend_worst_deg": float(np.percentile(np.abs(delta), 95)) if use.any() else np.nan,
        "palm_deg": _mean(_turn_deg(turn)),
        "palm_in_image_deg": _mean(in_image_deg(found[use], true[use])),
        "bend_free_deg": _mean(np.abs(free)),
        "palm_free_deg": _mean(_turn_deg(turn @ _mean_turn(turn).T)) if use.any() else np.nan,
        "jitter_deg": jitter_deg(found, use),
        "jitter_truth_deg": jitter_deg(true, use),
    }
    return scores


def _paper_scores(track: Track, truth: Track, use: NDArray[np.bool_]) -> Scores:
    """Mean absolute errors of the six quantities that the paper's table lists."""
    found, true = track.keypoints_mm[use], truth.keypoints_mm[use]
    palm = [0, 5, 9, 13, 17]
    x = track.keypoints_px[use][:, palm, 0].mean(axis=1)
    x -= truth.keypoints_px[use][:, palm, 0].mean(axis=1)
    bend = bends_deg(found) - bends_deg(true)
    flexion, abduction = (
        a - b for a, b in zip(mcp_angles_deg(found), mcp_angles_deg(true), strict=True)
    )
    turn = np.swapaxes(palm_frames(true), 1, 2) @ palm_frames(found)
    errors = (
        x,
        _turn_deg(turn),
        bend[:, 1, 1],
        _wrap(flexion[:, 1]),
        bend[:, 3, 1],
        abduction[:, 2],
    )
    return {name: _mean(np.abs(e)) for name, e in zip(PAPER_ROWS, errors, strict=True)}


def jitter_deg(keypoints_mm: Array, use: NDArray[np.bool_]) -> float:
    """Mean ``|second difference|`` of the bends over runs of three frames in ``use`` ``(F,)``."""
    bends = np.where(use[:, None, None], bends_deg(np.nan_to_num(keypoints_mm)), np.nan)
    second = np.abs(np.diff(bends, n=2, axis=0))
    return _mean(second[np.isfinite(second)])


def coverage(track: Track, truth: Track) -> float:
    """Share of the true angles inside the tracker's stated 90 % interval."""
    with np.errstate(invalid="ignore"):
        inside = np.abs(track.theta - truth.theta) <= _NINETY * track.theta_std
    said = np.isfinite(track.theta) & np.isfinite(track.theta_std) & truth.shown[:, None]
    return _mean(inside[said])


def frames_to_find(tracked: NDArray[np.bool_], shown: NDArray[np.bool_]) -> float:
    """Longest wait, in frames, from the hand's (re)appearance to the tracker's first answer."""
    begins = np.flatnonzero(shown & ~np.concatenate([[False], shown[:-1]]))
    waits = [0]
    for begin in begins:
        after = np.flatnonzero(tracked[begin:])
        waits.append(int(after[0]) if len(after) else len(shown) - int(begin))
    return float(max(waits))


def found_share(track: Track, truth: Track) -> float:
    """Share of the frames with the hand whose keypoints are near it, tracked or not.

    Near are 0.3 of the palm's length in the mean, as long as it is in the image by the median.
    """
    palm_px = np.linalg.norm(truth.keypoints_px[:, 9] - truth.keypoints_px[:, 0], axis=-1)
    off = np.linalg.norm(track.keypoints_px - truth.keypoints_px, axis=-1).mean(axis=-1)
    near = off < FOUND_PALMS * np.median(palm_px[truth.shown])  # False for NaN
    return _mean(near[truth.shown])


def lag_frames(track: Track, truth: Track, widest: int = 5) -> float:
    """Shift of the track, in frames, at which its keypoints fit the truth best; late is positive.

    Each keypoint's constant offset is taken off first, so that only motion tells. Between whole
    frames a parabola through the three best gives the fraction.
    """
    errors = []
    for shift in range(-widest, widest + 1):
        late = slice(max(shift, 0), len(track) + min(shift, 0))
        then = slice(max(-shift, 0), len(track) + min(-shift, 0))
        delta = track.keypoints_px[late] - truth.keypoints_px[then]
        known = np.isfinite(delta).all(axis=(1, 2)) & truth.shown[then]
        if known.sum() < 3:
            return float("nan")
        delta = delta[known] - np.median(delta[known], axis=0)
        errors.append(_mean(np.linalg.norm(delta, axis=-1) ** 2))
    best = int(np.argmin(errors))
    if not 0 < best < len(errors) - 1:
        return float(best - widest)
    before, here, after = errors[best - 1 : best + 2]
    curve = before - 2 * here + after
    return best - widest + (0.5 * (before - after) / curve if curve > 0 else 0.0)


def _keypoint_error(track: Track, truth: Track, use: NDArray[np.bool_]) -> float:
    delta = track.keypoints_px[use] - truth.keypoints_px[use]
    return _mean(np.linalg.norm(delta, axis=-1))


def _turn_deg(turn: Array) -> Array:
    return np.degrees(np.linalg.norm(rotation.log(turn), axis=-1))


def _mean_turn(turn: Array) -> Array:
    """The rotation nearest to the mean of ``turn`` ``(n, 3, 3)`` (chordal L2 mean)."""
    U, _, Vt = np.linalg.svd(turn.mean(axis=0))
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)


def _unit(v: Array) -> Array:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(v / np.where(length > 0, length, 1.0))


def _wrap(degrees: Array) -> Array:
    return (degrees + 180.0) % 360.0 - 180.0


def _mean(values: NDArray[Any]) -> float:
    return float(np.mean(values)) if np.size(values) else float("nan")
