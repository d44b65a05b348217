"""The camera from pictures of a board: focal lengths and principal point, or a reason why not.

Zhang's calibration (``cv2.calibrateCameraExtended``) over views chosen to differ from each other.
The lens is fitted with two radial coefficients, so that they do not bend the focal length, but
handtrack's camera is a pinhole: how far the lens moves the corners of the picture is reported.

A set is refused rather than believed when there are too few views, when they are all alike (by
how much larger the board's near end looks, and by the focal length's standard deviation), when
they leave most of the picture empty, or when the model does not explain them.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board import Board
from handtrack.camera import Camera
from handtrack.errors import NothingUsableError

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

MIN_VIEWS = 6
MAX_VIEWS = 40
MIN_CORNERS = 12
#: A view is new if its corners have moved by this share of the picture's diagonal on average.
NEW_VIEW = 0.03
MAX_REPROJECTION_PX = 1.0
MAX_FOCAL_STD = 0.01  # of the focal length
MIN_COVERAGE = 0.35
_GRID = 5

#: Share by which a tilted board must look larger at one end than in its middle, and how often.
#: Without it the fit has no answer, and its standard deviation does not say so.
MIN_KEYSTONE = 0.04
MIN_TILTED = 4


@dataclass(frozen=True, eq=False)
class View:
    """The board in one picture: corners ``(k, 2)`` in px, and which of the board's they are."""

    corners_px: Array
    which: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """A camera and how well it explains the board."""

    camera: Camera
    reprojection_px: float
    focal_std: float  # relative
    n_views: int
    coverage: float  # share of a 5 x 5 grid over the picture in which corners were seen
    distortion: Array  # (2,) radial
    distortion_px: float  # how far the lens moves the corners of the picture


def collect_views(pictures: Iterable[tuple[int, Image]], board: Board) -> tuple[list[View], int]:
    """Views that differ from each other, and how many of the RGB pictures showed the board."""
    views: list[View] = []
    n_seen = 0
    for _, image in pictures:
        gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
        corners, which = board.find(gray)
        if len(which) < min(MIN_CORNERS, len(board.corners_mm)):
            continue
        n_seen += 1
        view = View(corners, which)
        far = NEW_VIEW * float(np.hypot(*gray.shape))
        if len(views) < MAX_VIEWS and all(_moved(view, old) > far for old in views):
            views.append(view)
    return views, n_seen


def calibrate_camera(views: list[View], board: Board, width: int, height: int) -> CameraCalibration:
    """The camera of pictures of ``width`` by ``height`` px.

    Raises
    ------
    NothingUsableError
        The views are too few, too alike, or do not agree with any camera; the text says which.
    """
    if len(views) < MIN_VIEWS:
        raise NothingUsableError(
            f"only {len(views)} different views of the board, {MIN_VIEWS} are needed: show it "
            "nearer and farther, tilted each way, and in the corners of the picture"
        )
    coverage = _coverage(views, width, height)
    if coverage < MIN_COVERAGE:
        raise NothingUsableError(
            f"the board was seen in {coverage:.0%} of the picture only, {MIN_COVERAGE:.0%} are "
            "needed: move it into the corners, or nearer"
        )
    n_tilted = sum(keystone(view, board) > MIN_KEYSTONE for view in views)
    if n_tilted < MIN_TILTED:
        raise NothingUsableError(
            f"the board is tilted in {n_tilted} of {len(views)} views only, {MIN_TILTED} are "
            "needed to tell the focal length: tilt the board by 20 degrees and more, both ways"
        )
    found = _fit(views, board, width, height, coverage)
    if found.reprojection_px > MAX_REPROJECTION_PX:
        raise NothingUsableError(
            f"the corners lie {found.reprojection_px:.2f} px off on average, at most "
            f"{MAX_REPROJECTION_PX:g} is believed: is the board flat, and are its columns and rows "
            "those given?"
        )
    if not found.focal_std < MAX_FOCAL_STD:
        raise NothingUsableError(
            f"the focal length is known to {found.focal_std:.1%} only, {MAX_FOCAL_STD:.0%} is "
            "needed: tilt the board more, about both of its axes"
        )
    return found


def keystone(view: View, board: Board) -> float:
    """How much larger the board looks at one end than in its middle, as a share.

    It is the last row of the homography about the board's centre times half the board's
    diagonal: about ``sin(tilt)`` times half the diagonal over the distance, for any camera.
    """
    centre = np.array([board.columns, board.rows]) * board.square_mm / 2
    plane = board.corners_mm[view.which, :2] - centre
    H, _ = cv2.findHomography(plane, view.corners_px)
    if H is None or abs(H[2, 2]) < 1e-12:
        return 0.0
    return float(np.hypot(H[2, 0], H[2, 1]) / abs(H[2, 2]) * np.hypot(*centre))


def _fit(
    views: list[View], board: Board, width: int, height: int, coverage: float
) -> CameraCalibration:
    """Zhang's method with two radial coefficients."""
    objects = [board.corners_mm[v.which].astype(np.float32)[:, None] for v in views]
    corners = [v.corners_px.astype(np.float32)[:, None] for v in views]
    flags = cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3
    rms, K, lens, _, _, std, _, _ = cv2.calibrateCameraExtended(
        objects, corners, (width, height), np.eye(3), np.zeros(5), flags=flags
    )
    fx, fy, cx, cy = (float(v) for v in (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))
    camera = Camera(fx, fy, cx, cy, width, height)
    k = np.asarray(lens, float).ravel()[:2]
    return CameraCalibration(
        camera=camera,
        reprojection_px=float(rms),
        focal_std=float(np.max(np.ravel(std)[:2] / (fx, fy))),
        n_views=len(views),
        coverage=coverage,
        distortion=k,
        distortion_px=_distortion_px(camera, k),
    )


def _distortion_px(camera: Camera, k: Array) -> float:
    """How far two radial coefficients move the corners of the picture, at most."""
    x = np.array([0.0, camera.width_px - 1]) - camera.cx_px
    y = np.array([0.0, camera.height_px - 1]) - camera.cy_px
    X, Y = np.meshgrid(x / camera.fx_px, y / camera.fy_px)
    r2 = X**2 + Y**2
    shift = np.sqrt(r2) * np.abs(k[0] * r2 + k[1] * r2**2) * camera.fx_px
    return float(shift.max())


def _moved(a: View, b: View) -> float:
    """Mean distance in px of the corners that two views share; infinite if they share few."""
    _, i, j = np.intersect1d(a.which, b.which, return_indices=True)
    if len(i) < 4:
        return np.inf
    return float(np.mean(np.linalg.norm(a.corners_px[i] - b.corners_px[j], axis=1)))


def _coverage(views: list[View], width: int, height: int) -> float:
    """Share of the cells of a 5 x 5 grid over the picture in which a corner was seen."""
    points = np.concatenate([v.corners_px for v in views])
    cell = np.clip(np.floor(points / (width, height) * _GRID).astype(int), 0, _GRID - 1)
    return len(np.unique(cell, axis=0)) / _GRID**2
