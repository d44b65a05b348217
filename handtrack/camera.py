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

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

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
