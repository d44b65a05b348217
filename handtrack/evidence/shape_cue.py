"""What of a picture is hand by its shape and shading, whatever its colour: the shape cue.

A network of a million parameters says for every pixel how likely it is hand or bare forearm. It
learned from hands of any colour, rendered before anything (``handtrack.bench.training``), so it
still tells where a hand has the colour of what is behind it. Its answer is coarse: colours find
the outline.

>>> log_odds(np.zeros((60, 80, 3), np.uint8)).shape
(60, 80)
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.trained import TrainedNetwork, shipped

Pixels = NDArray[np.uint8]
Float = NDArray[np.float32]

WEIGHTS = "shape_cue.onnx"
#: Sides of what the network sees are multiples of this.
MULTIPLE_PX = 32


def log_odds(rgb: Pixels, network: TrainedNetwork | None = None) -> Float:
    """Log odds ``(h, w)`` of hand or bare forearm in a picture ``(h, w, 3)``.

    The palm should be 14 to 80 px long in it. Another ``network`` than the shipped one takes RGB
    ``(1, 3, h, w)``, 0 to 255, and gives log odds ``(1, 1, h / 2, w / 2)``.
    """
    network = network or shipped("handtrack.evidence", WEIGHTS)
    h, w = rgb.shape[:2]
    below, right = -h % MULTIPLE_PX, -w % MULTIPLE_PX
    padded = cv2.copyMakeBorder(rgb, 0, below, 0, right, cv2.BORDER_REPLICATE)
    answer = network(padded.astype(np.float32).transpose(2, 0, 1)[None])[0, 0]
    return np.asarray(cv2.resize(answer, padded.shape[1::-1])[:h, :w], np.float32)


def log_odds_sized(rgb: Pixels, size: tuple[int, ...], mirrored: bool = False) -> Float:
    """The log odds of a picture, blown up or down to a width and height ``size``.

    ``mirrored``: by what is seen in the picture's mirror image. The network does not see the same
    there, and two such answers err less together than two of the picture as it is.
    """
    if mirrored:
        turned = np.ascontiguousarray(rgb[:, ::-1])
        return np.ascontiguousarray(log_odds_sized(turned, size)[:, ::-1])
    return np.asarray(cv2.resize(log_odds(rgb), size), np.float32)
