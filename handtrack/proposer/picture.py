"""What the proposer sees of a hand: a small square with the silhouette and the shading inside it.

The square is centred on the palm, as large as an open hand about it, and shading is brightness less
its mean over the silhouette, over its spread there: neither the tone of the skin nor the exposure
nor what is behind the hand is in it.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]
Array = NDArray[np.float64]

#: Side of the square in pixels, and half of it over the radius of the palm's largest disc.
SIDE_PX, REACH = 80, 3.6
#: Length of the palm over that radius.
PALM_PER_DISC = 2.2
#: Brightness that is added to its spread (so that even skin stays even), and deviations kept.
FLAT, MOST = 4.0, 3.0


@dataclass(frozen=True, eq=False)
class Square:
    """Where in an image the square lies: its centre, the palm's disc, and a turn in the image.

    Parameters
    ----------
    centre_px : (2,)
    radius_px : float
        Of the disc; half the square's side is ``REACH`` times this.
    turn : float
        Angle in radians by which the square is turned from x towards y.
    """

    centre_px: Array
    radius_px: float
    turn: float = 0.0


def picture_of(grey: NDArray, mask: NDArray[np.bool_], square: Square) -> Float:
    """Silhouette and shading ``(2, SIDE_PX, SIDE_PX)`` in a square.

    Parameters
    ----------
    grey : (h, w)
        Brightness, 0 to 255.
    mask : (h, w)
        The silhouette.
    """
    silhouette, shading = mask.astype(np.float32), np.zeros(mask.shape, np.float32)
    if mask.any():
        inside = grey[mask].astype(np.float32)
        shading[mask] = np.clip((inside - inside.mean()) / (inside.std() + FLAT), -MOST, MOST)
    step = 2 * REACH * square.radius_px / SIDE_PX
    c, s = step * np.cos(square.turn), step * np.sin(square.turn)
    half = (SIDE_PX - 1) / 2
    x, y = square.centre_px
    A = np.array([[c, -s, x - c * half + s * half], [s, c, y - s * half - c * half]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    layers = []
    for layer in (silhouette, shading):
        smooth = cv2.GaussianBlur(layer, (0, 0), 0.45 * step) if step > 1 else layer
        layers.append(cv2.warpAffine(smooth, A, (SIDE_PX, SIDE_PX), flags=flags))
    return np.asarray(layers, np.float32)
