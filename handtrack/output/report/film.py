"""The pictures of the report: H.264 packets, each of which is one frame.

No file around them: the page hands the packets to the browser's decoder itself, with the frame's
number as time stamp. Every :data:`GOP` frames there is a picture that stands alone, so any frame is
a few packets away; no packet waits for a later frame.
"""

from fractions import Fraction

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import HandtrackError

Image = NDArray[np.uint8]

#: Frames from one picture that stands alone to the next.
GOP = 15
#: Longer side of the pictures; the layers are drawn at the screen's own resolution.
LONGEST_PX = 960
#: High profile, level 5.2: what a decoder is asked for; the stream says what it is.
CODEC = "avc1.640034"
_OPTIONS = {
    "preset": "superfast",
    "tune": "zerolatency",
    "crf": "26",
    "bf": "0",
    "x264-params": f"keyint={GOP}:min-keyint={GOP}:scenecut=0:repeat-headers=1:annexb=1"
    ":colormatrix=smpte170m:colorprim=smpte170m:transfer=smpte170m",
}


class Film:
    """Encodes frames of one size.

    Attributes
    ----------
    width, height : int
        Of the encoded pictures; even, as H.264 wants it.
    used_width, used_height : int
        The part of them that is the frame; the rest repeats its border.
    """

    def __init__(self, width_px: int, height_px: int) -> None:
        scale = min(1.0, LONGEST_PX / max(width_px, height_px))
        if scale < 1:
            self.width, self.height = (
                max(2, 2 * round(side * scale / 2)) for side in (width_px, height_px)
            )
            self.used_width, self.used_height = self.width, self.height
        else:
            self.used_width, self.used_height = width_px, height_px
            self.width, self.height = width_px + width_px % 2, height_px + height_px % 2
        self._n = 0
        codec = av.CodecContext.create("libx264", "w")
        codec.width, codec.height, codec.pix_fmt = self.width, self.height, "yuv420p"
        codec.time_base, codec.framerate = Fraction(1, 30), Fraction(30)
        codec.thread_count = 1
        codec.options = _OPTIONS
        self._codec = codec

    def packet(self, image: Image | None) -> bytes:
        """The packet of the next frame ``(H, W, 3)``; None is a black one."""
        # OpenCV's conversion takes a quarter of the time of the library's own
        planes = cv2.cvtColor(self._sized(image), cv2.COLOR_RGB2YUV_I420)
        frame = av.VideoFrame.from_ndarray(np.asarray(planes, np.uint8), format="yuv420p")
        frame.pts, frame.time_base = self._n, Fraction(1, 30)
        packets = self._codec.encode(frame)
        wanted = [(self._n, self._n % GOP == 0)]
        found = [(packet.pts, packet.is_keyframe) for packet in packets]
        if found != wanted:
            raise HandtrackError(f"report: the encoder gave packets {found}, wanted {wanted}")
        self._n += 1
        return bytes(packets[0])

    def _sized(self, image: Image | None) -> Image:
        if image is None:
            return np.zeros((self.height, self.width, 3), np.uint8)
        if (self.used_width, self.used_height) != (image.shape[1], image.shape[0]):
            size = (self.used_width, self.used_height)
            image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        right, bottom = self.width - image.shape[1], self.height - image.shape[0]
        if right or bottom:
            padded = cv2.copyMakeBorder(image, 0, bottom, 0, right, cv2.BORDER_REPLICATE)
            image = np.asarray(padded, np.uint8)
        return image
