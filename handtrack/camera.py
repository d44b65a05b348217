"""The pinhole camera: OpenCV's axes (x right, y down, z forward), no lens distortion.

Pixel centres lie at integers, points are ``(x, y)``. A :class:`Window` is the crop in which a
frame is worked on; a camera seen through it is again a camera.

>>> camera = Camera.assumed_for(640, 480)
>>> camera.project([0.0, 0.0, 500.0]).tolist(), camera.assumed
([319.5, 239.5], True)
>>> through = camera.through(Window(x_px=100.0, y_px=50.0, scale=0.5, width_px=80, height_px=60))
>>> through.project([0.0, 0.0, 500.0]).tolist()
[109.75, 94.75]
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError
from handtrack.toml_file import check_keys, read_document, write_document

Array = NDArray[np.float64]

FORMAT = "handtrack-camera"
FORMAT_VERSION = 1
_KEYS = ("fx_px", "fy_px", "cx_px", "cy_px", "width_px", "height_px")

#: Two images are of one shape where their width over height agrees to this part.
ASPECT_TOLERANCE = 0.01

#: Focal length over the longer image side where no camera file is given: a 58 deg field of view.
ASSUMED_FOCAL_RATIO = 0.9


@dataclass(frozen=True)
class Window:
    """A crop: frame pixel ``(x_px, y_px)`` becomes ``(0, 0)``, then lengths times ``scale``."""

    x_px: float
    y_px: float
    scale: float
    width_px: int
    height_px: int

    def to_window(self, points_px: ArrayLike) -> Array:
        """Points ``(..., 2)`` of the whole frame, in the window's pixels."""
        return (np.asarray(points_px, float) - (self.x_px, self.y_px)) * self.scale

    def to_frame(self, points_px: ArrayLike) -> Array:
        """Points ``(..., 2)`` of the window, in the whole frame's pixels."""
        return np.asarray(points_px, float) / self.scale + (self.x_px, self.y_px)


@dataclass(frozen=True)
class Camera:
    """Focal lengths and principal point in pixels of an image of ``width_px`` by ``height_px``."""

    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    width_px: int
    height_px: int
    assumed: bool = False

    @classmethod
    def assumed_for(cls, width_px: int, height_px: int) -> "Camera":
        """The stated default for an image of this size (design, Section 2: scale)."""
        f = ASSUMED_FOCAL_RATIO * max(width_px, height_px)
        return cls(f, f, (width_px - 1) / 2, (height_px - 1) / 2, width_px, height_px, True)

    @property
    def matrix(self) -> Array:
        """The intrinsic matrix ``K`` ``(3, 3)``."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1.0]])

    def project(self, points_mm: ArrayLike) -> Array:
        """Pixels ``(..., 2)`` of camera-frame points ``(..., 3)`` in mm, all with ``z > 0``."""
        X = np.asarray(points_mm, float)
        return X[..., :2] / X[..., 2:] * (self.fx_px, self.fy_px) + (self.cx_px, self.cy_px)

    def through(self, window: Window) -> "Camera":
        """This camera as seen through ``window``."""
        cx, cy = window.to_window((self.cx_px, self.cy_px))
        return replace(
            self,
            fx_px=self.fx_px * window.scale,
            fy_px=self.fy_px * window.scale,
            cx_px=float(cx),
            cy_px=float(cy),
            width_px=window.width_px,
            height_px=window.height_px,
        )

    def mirrored(self) -> "Camera":
        """The camera of the image flipped left to right (how a left hand is tracked)."""
        return replace(self, cx_px=self.width_px - 1 - self.cx_px)

    def for_size(self, width_px: int, height_px: int) -> "Camera":
        """This camera for an image of another size but the same shape.

        Raises
        ------
        InputError
            Width over height differs: another crop or another way up, not another size.
        """
        sx, sy = width_px / self.width_px, height_px / self.height_px
        if abs(sx / sy - 1) > ASPECT_TOLERANCE:
            raise InputError(
                f"the camera is for {self.width_px} x {self.height_px} pixels and the frames are "
                f"{width_px} x {height_px}, which is another shape: calibrate with frames like them"
            )
        return replace(
            self,
            fx_px=self.fx_px * sx,
            fy_px=self.fy_px * sy,
            cx_px=(self.cx_px + 0.5) * sx - 0.5,
            cy_px=(self.cy_px + 0.5) * sy - 0.5,
            width_px=width_px,
            height_px=height_px,
        )

    def save(self, path: str | Path, source: str = "") -> None:
        """Write ``camera.toml``: pixels of frames as they are shown, and where it comes from."""
        document = {key: getattr(self, key) for key in _KEYS} | {"source": source}
        write_document(path, FORMAT, FORMAT_VERSION, document)

    @classmethod
    def load(cls, path: str | Path) -> "Camera":
        """Read what :meth:`save` wrote.

        Raises
        ------
        InputError
            The file cannot be read, has an unknown or missing key, or a value makes no camera.
        """
        document = read_document(path, FORMAT, FORMAT_VERSION)
        check_keys(path, set(document), set(_KEYS), {"source"})
        for key in _KEYS:
            value, whole = document[key], key in ("width_px", "height_px")
            number = isinstance(value, int if whole else (int, float)) and value is not True
            if not number or not np.isfinite(value) or (key[0] in "fwh" and value <= 0):
                kind = "a whole number" if whole else "a number"
                raise InputError(f"{path}: {key} = {value!r} is not {kind} that makes a camera")
        width, height = document["width_px"], document["height_px"]
        f, c = [[float(document[f"{kind}{axis}_px"]) for axis in "xy"] for kind in "fc"]
        return cls(f[0], f[1], c[0], c[1], width, height)
