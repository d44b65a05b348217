"""A data base for the hand-over method: marker positions of the whole hand, and its angles.

A source is a BVH file, with the recorded markers of the same name beside it (``a.bvh`` and
``a.c3d``, ``.trc``, ``.tsv`` or ``.csv``) or else with virtual ones attached to its skeleton; or
``alphabet``, the one that ships. Frames whose angles cannot be trusted (jumps, angles far outside
the anatomical limits) do not enter.

The root's frame is the palm frame of the first source; its markers' places in it are the
reference to which every recording, also the query, is aligned.

>>> base = build([shipped_clip("girl", seed=0)])
>>> base.labels[:2], base.X_mm.shape[1:], base.theta.shape[1], base.rate_hz
(('thumb_mcp', 'thumb_ip'), (13, 3), 20, 120.0)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from handtrack.errors import InputError
from handtrack.hand.shape import HandShape
from handtrack.mocap.alphabet import perform, sequences
from handtrack.mocap.attach import Palm, attach, axes_of, find_mapping, palm_of, positional
from handtrack.mocap.bvh import Motion, read_bvh
from handtrack.mocap.hand_motion import hand_motion
from handtrack.mocap.marker_io import SUFFIXES, read_markers
from handtrack.mocap.marker_sets import MarkerSet, marker_set
from handtrack.mocap.markers import Markers
from handtrack.mocap.recordings import trusted
from handtrack.mocap.root import root_relative
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]

#: Two rates count as one when they differ by less than this share.
SAME_RATE = 0.005
#: A data base of so many clips is cross-validated clip by clip, a smaller one by so many groups of
#: alike poses.
MIN_FOLDS, POSE_FOLDS = 3, 6
_ROUNDS = 20


@dataclass(frozen=True, eq=False)
class Clip:
    """One recording: markers in the world, the angles that go with them, and the palm."""

    name: str
    markers: Markers
    theta: Array  # (F, 20)
    ok: NDArray[np.bool_]  # (F,) frames to trust
    palm: Palm
    shape: HandShape

    def __post_init__(self) -> None:
        freeze_arrays(self)


@dataclass(frozen=True, eq=False)
class Database:
    """Clips put together: frames of ``M`` markers in the root's frame and of 20 angles.

    ``starts`` are the rows at which clips begin; ``reference_mm`` ``(n, 3)`` are the places of the
    root markers in the root's frame.
    """

    labels: tuple[str, ...]
    X_mm: Array  # (N, M, 3)
    theta: Array  # (N, 20)
    starts: NDArray[np.int64]
    rate_hz: float
    root: tuple[str, ...]
    reference_mm: Array
    side: str
    shape: HandShape
    sources: tuple[str, ...]

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def folds(self) -> NDArray[np.int64]:
        """What to hold out together in a cross-validation ``(N,)``: a clip.

        Fewer than three clips often show the same poses again (an alphabet signed twice), and a
        part of them would be too easily told from the rest: then groups of alike poses.
        """
        if len(self.starts) >= MIN_FOLDS:
            rows = np.arange(len(self.theta))
            return np.asarray(np.searchsorted(self.starts, rows, side="right") - 1)
        return alike(self.theta, POSE_FOLDS)


def alike(theta: Array, groups: int) -> NDArray[np.int64]:
    """The group ``(N,)`` of each pose ``(N, K)``: k-means, begun from poses that are far apart."""
    centres = theta[:1]
    while len(centres) < min(groups, len(theta)):
        far = cdist(theta, centres).min(axis=1).argmax()
        centres = np.vstack([centres, theta[far]])
    for _ in range(_ROUNDS):
        nearest = cdist(theta, centres).argmin(axis=1)
        kept = np.unique(nearest)
        centres = np.stack([theta[nearest == group].mean(axis=0) for group in kept])
    return np.asarray(cdist(theta, centres).argmin(axis=1))


def shipped_clip(
    what: str | Sequence[str], seed: int, runs: int = 1, rate_hz: float = 120.0
) -> Clip:
    """A performance of a sequence that ships, by the default hand lying still in the world."""
    rng = np.random.default_rng(seed)
    theta = perform(what, rng, rate_hz, runs)
    still = np.tile(np.eye(3), (len(theta), 1, 1)), np.zeros((len(theta), 3))
    motion = hand_motion(
        theta, *still, HandShape.default(), frame_time_s=1 / rate_hz, axes=np.eye(3)
    )
    name = what if isinstance(what, str) else "-".join(what)
    return clip_of(name, motion, marker_set("full13"))


def read_clip(
    path: str | Path, chosen: MarkerSet, mapping: str = "auto", markers: str | Path | None = None
) -> Clip:
    """The clip in a BVH file.

    Parameters
    ----------
    path : the BVH file.
    chosen : the markers to attach where none are recorded.
    mapping : which joint is which (:func:`handtrack.mocap.attach.find_mapping`).
    markers : a file of recorded markers; by default the one of the same name beside it, if any.

    Raises
    ------
    InputError
        A file cannot be read, the mapping does not fit, or markers and motion differ in length.
    """
    source = Path(path)
    motion = read_bvh(source)
    beside = [source.with_suffix(s) for s in SUFFIXES if source.with_suffix(s).exists()]
    recorded = Path(markers) if markers else (beside[0] if beside else None)
    try:
        return clip_of(
            source.stem, motion, chosen, mapping, read_markers(recorded) if recorded else None
        )
    except InputError as error:
        raise InputError(
            f"{path}: {error}" if str(source) not in str(error) else str(error)
        ) from error


def clip_of(
    name: str,
    motion: Motion,
    chosen: MarkerSet,
    mapping: str = "auto",
    recorded: Markers | None = None,
) -> Clip:
    """The clip of a motion; ``recorded`` markers, if any, in place of virtual ones.

    Raises
    ------
    InputError
        As :func:`read_clip`.
    """
    found = find_mapping(motion, mapping)
    markers = recorded or attach(motion, found, chosen)
    if markers.n_frames != motion.n_frames:
        raise InputError(
            f"{markers.n_frames} frames of markers beside {motion.n_frames} frames of motion"
        )
    theta, out_of_plane = found.theta(motion)
    time_s = np.arange(motion.n_frames, dtype=np.float64) * motion.frame_time_s
    ok = trusted(theta, time_s, out_of_plane, np.ones(len(theta), bool))
    points = positional(found).positions_mm(motion) * axes_of(found)
    palm = palm_of(points)
    return Clip(name, markers, theta, ok, palm, _shape_of(points, palm))


def build(clips: Sequence[Clip], root: Sequence[str] | None = None) -> Database:
    """Put clips together.

    Parameters
    ----------
    clips : at least one; of one rate and one side.
    root : names of the root markers, by default those whose name begins with ``root``.

    Raises
    ------
    InputError
        There is no clip, rates or sides differ, no frame can be trusted, or the root markers are
        fewer than three or not there.
    """
    if not clips:
        raise InputError("a data base needs one source or more")
    first = clips[0]
    for clip in clips[1:]:
        if abs(clip.markers.rate_hz / first.markers.rate_hz - 1) > SAME_RATE:
            raise InputError(
                f"{clip.name} has {clip.markers.rate_hz:.4g} Hz and {first.name} "
                f"{first.markers.rate_hz:.4g} Hz: a data base has one rate"
            )
        if clip.palm.side != first.palm.side:
            raise InputError(
                f"{clip.name} is a {clip.palm.side} hand and {first.name} a {first.palm.side} one: "
                "a data base has one side"
            )
    names = tuple(root or root_labels(first.markers.labels))
    seen = first.markers.select(names).positions_mm
    if len(names) < 3:
        raise InputError(
            f"{len(names)} root markers ({', '.join(names)}); three or more are needed"
        )
    in_palm = np.einsum("fba,fnb->fna", first.palm.R, seen - first.palm.t_mm[:, None])
    reference = np.nanmean(in_palm[np.isfinite(in_palm).all(axis=(1, 2))], axis=0)
    if not np.isfinite(reference).all():
        raise InputError(f"{first.name}: no frame shows all root markers at once")
    labels = tuple(m for m in first.markers.labels if m not in names)
    parts, thetas = [], []
    for clip in clips:
        local = root_relative(clip.markers.select((*names, *labels)), names, reference)
        parts.append(local.positions_mm[clip.ok])
        thetas.append(clip.theta[clip.ok])
    lengths = [len(part) for part in parts]
    if sum(lengths) < 2:
        raise InputError("the data base has no frame whose angles can be trusted")
    return Database(
        labels=labels,
        X_mm=np.concatenate(parts),
        theta=np.concatenate(thetas),
        starts=np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype(np.int64),
        rate_hz=first.markers.rate_hz,
        root=names,
        reference_mm=reference,
        side=first.palm.side,
        shape=first.shape,
        sources=tuple(clip.name for clip in clips),
    )


def root_labels(labels: Sequence[str]) -> tuple[str, ...]:
    """The markers whose name begins with ``root``."""
    return tuple(label for label in labels if label.lower().startswith("root"))


def read_database(
    sources: Sequence[str | Path],
    chosen: MarkerSet,
    mapping: str = "auto",
    root: Sequence[str] | None = None,
) -> Database:
    """The data base of several sources: BVH files, or names of sequences that ship.

    Raises
    ------
    InputError
        As :func:`read_clip` and :func:`build`.
    """
    clips = []
    for source in sources:
        if str(source) in sequences():
            clips.append(shipped_clip(str(source), seed=0, runs=2))
        else:
            clips.append(read_clip(source, chosen, mapping))
    return build(clips, root)


def _shape_of(points_mm: Array, palm: Palm) -> HandShape:
    """The default hand with the bone lengths and joint places of keypoints ``(F, 21, 3)``."""
    local = np.einsum("fba,fkb->fka", palm.R, points_mm - palm.t_mm[:, None]) * palm.mirror
    digits = np.median(local[:, 1::4], axis=0)
    bones = np.linalg.norm(np.diff(points_mm[:, 1:].reshape(-1, 5, 4, 3), axis=2), axis=-1)
    default = HandShape.default()
    scaled = default.scaled(palm.length_mm / default.palm_length_mm)
    return replace(
        scaled,
        base_mm=digits,
        length_mm=np.median(bones, axis=0),
        source="bone lengths of the data base's skeleton",
    )
