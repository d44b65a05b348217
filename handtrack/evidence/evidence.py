"""What one frame says about the hand: :func:`see` makes an :class:`Evidence` of a crop.

Crop first, everything else after: the :class:`~handtrack.camera.Window` is resampled by area to a
size at which the hand is about 200 px tall, and the segmenter, the outline and the edges work on
that alone.

>>> from handtrack.evidence.silhouette import Segmenter
>>> frame = np.full((240, 320, 3), 60, np.uint8)
>>> _ = cv2.circle(frame, (160, 120), 50, (210, 150, 130), -1)
>>> best = Segmenter.bootstrap(frame)[0]
>>> segmenter = Segmenter.from_mask(frame, best.mask)
>>> window = window_around(best.mask, size_px=128)
>>> evidence = see(frame, window, Camera.assumed_for(320, 240), segmenter)
>>> r = np.hypot(*(window.to_frame(evidence.contour) - (160, 120)).T)
>>> bool(np.abs(r - 50.3).max() < 0.8), evidence.mask.shape
(True, (128, 128))
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.camera import Camera, Window
from handtrack.evidence.contour import Outline, clean, signed_distance, trace
from handtrack.evidence.edges import edges_of, gradients
from handtrack.evidence.silhouette import Segmenter
from handtrack.parallel import both
from handtrack.records import freeze_arrays

Pixels = NDArray[np.uint8]
Float = NDArray[np.float32]
Mask = NDArray[np.bool_]

#: Log odds that a seed adds deep inside, and takes away far outside.
SEED_INSIDE, SEED_OUTSIDE = 1.0, 2.0
#: Distance from the seed's outline at which it says all it can.
SEED_REACH_PX = 24.0
#: A silhouette that meets the window's border in so many pixels is cut; then so much more is seen.
CUT_PX, WIDER = 6, 1.4
#: The outline this near the frame's border is where the frame ends, not the hand.
BORDER_PX = 2.0


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a crop ``(h, w)`` says; points are ``(x, y)`` pixels of the window.

    Attributes
    ----------
    window : Window
        Where in the frame the crop lies.
    camera : Camera
        The camera through the window.
    image : (h, w, 3) uint8
        The crop, RGB; beyond the frame its border is repeated.
    visible : (h, w) bool
        Inside the frame.
    probability : (h, w) float32
        P(hand or bare forearm).
    mask : (h, w) bool
        The hand's component of it, cleaned, within ``visible``.
    sdf : (h, w) float32
        Signed distance in px to its outline, negative inside. Beyond the frame it goes on as
        if the hand did, so that the frame's border is no outline.
    contour, contour_normal : (m, 2) float32
        Its outline about every pixel, and unit normals pointing out; not along the frame's border.
    contour_snapped : (m,) bool
        The picture has an edge where the outline is.
    edge_strength : (h, w) float32
        0 to 1, a ridge along each edge. See :mod:`handtrack.evidence.edges`.
    edge_x, edge_y : (h, w) float32
        Unit direction of the gradient, either sign.
    edge_points, edge_normals : (k, 2) float32
        Thinned edges, the outline and those inside the hand, sub-pixel; unit normals, either sign.
    edge_point_strength : (k,) float32
        Strength of each.
    decided : float
        0 to 1: how surely pixels are hand or not, in the hand and around it, mean ``|2 P - 1|``.
    confidence : float
        That times the share of the outline that lies on an edge of the picture: how well the
        segmenter still describes this picture.
    """

    window: Window
    camera: Camera
    image: Pixels
    visible: Mask
    probability: Float
    mask: Mask
    sdf: Float
    contour: Float
    contour_normal: Float
    contour_snapped: Mask
    edge_strength: Float
    edge_x: Float
    edge_y: Float
    edge_points: Float
    edge_normals: Float
    edge_point_strength: Float
    decided: float
    confidence: float

    def __post_init__(self) -> None:
        freeze_arrays(self, copy=False)  # a crop's pictures are made for it alone

    @property
    def edge_direction(self) -> Float:
        """Angle ``(h, w)`` of the gradient from x towards y, modulo pi."""
        return np.asarray(np.mod(np.arctan2(self.edge_y, self.edge_x), np.pi), np.float32)


def see(
    frame_rgb: Pixels,
    window: Window,
    camera: Camera,
    segmenter: Segmenter,
    seed: Mask | None = None,
) -> Evidence:
    """The evidence of a frame in a window.

    Parameters
    ----------
    frame_rgb : (H, W, 3)
        The whole frame.
    window : Window
        The crop to look at; it may stick out of the frame.
    camera : Camera
        Of the whole frame.
    segmenter : Segmenter
        What is known of this clip; not changed.
    seed : (h, w) bool, optional
        Where the hand is expected in the window: chooses among components and, weakly, among
        doubtful pixels.
    """
    image = crop(frame_rgb, window)
    visible = _visible(frame_rgb, window)

    def hand_or_not() -> Float:
        log_odds = segmenter.log_odds(image, window)
        if seed is not None and seed.any():
            log_odds = log_odds + _seed_log_odds(seed)
        return np.asarray(cv2.GaussianBlur(log_odds, (3, 3), 0.7), np.float32)

    log_odds, gradient = both(hand_or_not, lambda: gradients(image))
    extended = clean(log_odds > 0, seed)

    def around() -> tuple[Outline, Float]:
        outline = trace(extended, log_odds, gradient[2])
        return outline, signed_distance(extended, outline)

    (outline, sdf), edges = both(around, lambda: edges_of(gradient, extended))
    decided = decidedness(log_odds, visible, extended) if len(outline.points) else 0.0
    kept = _inside(outline.points, frame_rgb, window)
    on_edge = _inside(edges.points, frame_rgb, window)
    return Evidence(
        window=window,
        camera=camera.through(window),
        image=image,
        visible=visible,
        probability=np.asarray(visible / (1 + cv2.exp(-log_odds)), np.float32),
        mask=extended & visible,
        sdf=sdf,
        contour=outline.points[kept],
        contour_normal=outline.normals[kept],
        contour_snapped=outline.snapped[kept],
        edge_strength=edges.strength,
        edge_x=edges.x,
        edge_y=edges.y,
        edge_points=edges.points[on_edge],
        edge_normals=edges.normals[on_edge],
        edge_point_strength=edges.point_strength[on_edge],
        decided=decided,
        confidence=decided * float(outline.snapped.mean()) if decided else 0.0,
    )


def see_candidate(
    frame_rgb: Pixels, mask: Mask, camera: Camera, segmenter: Segmenter
) -> Iterator[Evidence]:
    """The evidence about a rough silhouette ``(H, W)``, such as a candidate's.

    Where what is found goes on beyond the window, a second one follows, of a wider window.
    """
    window = window_around(mask)
    evidence = see(frame_rgb, window, camera, segmenter)
    yield evidence
    rim = evidence.mask.copy()
    rim[1:-1, 1:-1] = False
    if np.count_nonzero(rim) >= CUT_PX:
        yield see(frame_rgb, _widened(window), camera, segmenter)


def decidedness(log_odds: Float, visible: Mask, mask: Mask) -> float:
    """Mean ``|2 P - 1|`` of the hand's own pixels and of those around it; 0 for no hand."""
    if mask.sum() < 50:
        return 0.0
    few = (slice(None, None, 3), slice(None, None, 3))
    near = cv2.dilate(mask[few].view(np.uint8), np.ones((5, 5), np.uint8)) > 0
    told = log_odds[few][near & visible[few]]
    return float(np.mean(np.abs(np.tanh(0.5 * told)))) if len(told) else 0.0


def crop(frame_rgb: Pixels, window: Window) -> Pixels:
    """The window's picture ``(h, w, 3)``: halved by averaging to about its scale, then warped."""
    H, W = frame_rgb.shape[:2]
    halvings = max(0, int(np.log2(1 / window.scale) + 0.1))
    k = 2**halvings
    margin = 2 * k
    left = int(np.clip(np.floor(window.x_px) - margin, 0, W - 1))
    top = int(np.clip(np.floor(window.y_px) - margin, 0, H - 1))
    right = int(np.ceil(window.x_px + window.width_px / window.scale)) + margin
    bottom = int(np.ceil(window.y_px + window.height_px / window.scale)) + margin
    piece = frame_rgb[top : max(bottom, top + k), left : max(right, left + k)]
    for _ in range(halvings):
        size = (max(1, piece.shape[1] // 2), max(1, piece.shape[0] // 2))
        even = piece[: 2 * size[1], : 2 * size[0]]
        piece = np.asarray(cv2.resize(even, size, interpolation=cv2.INTER_AREA), np.uint8)
    step = 1 / (window.scale * k)
    x0 = (window.x_px - left - (k - 1) / 2) / k
    y0 = (window.y_px - top - (k - 1) / 2) / k
    A = np.array([[step, 0, x0], [0, step, y0]])
    size = (window.width_px, window.height_px)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(piece, A, size, flags=flags, borderMode=cv2.BORDER_REPLICATE), np.uint8
    )


def window_around(mask: Mask, size_px: int = 256, margin: float = 0.12) -> Window:
    """A square window of ``size_px`` about a mask ``(H, W)`` of the frame, never enlarging it."""
    y, x = np.nonzero(mask)
    extent = max(np.ptp(x), np.ptp(y)) + 1 if len(x) else max(mask.shape)
    centre = ((x.min() + x.max()) / 2, (y.min() + y.max()) / 2) if len(x) else (0.0, 0.0)
    scale = min(1.0, size_px / (extent * (1 + 2 * margin)))
    half = (size_px - 1) / 2 / scale
    return Window(float(centre[0] - half), float(centre[1] - half), scale, size_px, size_px)


def _widened(window: Window) -> Window:
    """A window about the same middle that shows ``WIDER`` times as much each way."""
    scale = window.scale / WIDER
    x, y = window.to_frame((window.width_px / 2, window.height_px / 2))
    left, top = x - window.width_px / 2 / scale, y - window.height_px / 2 / scale
    return replace(window, x_px=float(left), y_px=float(top), scale=scale)


def _visible(frame_rgb: Pixels, window: Window) -> Mask:
    """Which pixels ``(h, w)`` of the window lie in the frame."""
    H, W = frame_rgb.shape[:2]
    x = np.arange(window.width_px) / window.scale + window.x_px
    y = np.arange(window.height_px) / window.scale + window.y_px
    columns = (x >= -0.5) & (x <= W - 0.5)
    rows = (y >= -0.5) & (y <= H - 0.5)
    return np.asarray(rows[:, None] & columns[None, :], bool)


def _inside(points: Float, frame_rgb: Pixels, window: Window) -> Mask:
    """Which points ``(n, 2)`` of the window are clear of the frame's border and the window's."""
    H, W = frame_rgb.shape[:2]
    low = window.to_window((-0.5, -0.5)) + BORDER_PX
    high = window.to_window((W - 0.5, H - 0.5)) - BORDER_PX
    low = np.maximum(low, 0.5)
    high = np.minimum(high, (window.width_px - 1.5, window.height_px - 1.5))
    return np.asarray(np.all((points >= low) & (points <= high), axis=1), bool)


def _seed_log_odds(seed: Mask) -> Float:
    """A weak prior ``(h, w)`` from where the hand is expected."""
    s = seed[::2, ::2].astype(np.uint8)
    reach = SEED_REACH_PX / 2
    inside = np.minimum(cv2.distanceTransform(s, cv2.DIST_L2, 3), reach)
    outside = np.minimum(cv2.distanceTransform(1 - s, cv2.DIST_L2, 3), reach)
    prior = np.asarray(SEED_INSIDE * inside - SEED_OUTSIDE * outside, np.float32) / reach
    return np.asarray(cv2.resize(prior, seed.shape[::-1]), np.float32)
