"""What refinement sees of one frame, as flat arrays for the kernels.

The image contour comes thinned to one point every few pixels. Points below the wrist (the forearm,
a sleeve) and on the border of the frame carry weight zero: the forearm must neither pull the palm
nor count against it (design: "stop the evidence there").
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.records import Pose

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class View:
    """The evidence of one crop in the pixels of its window.

    Parameters
    ----------
    contour, normal : (m, 2)
        Points on the silhouette's outline and their outward normals.
    sdf : (h, w)
        Signed distance in px to the outline, negative inside.
    edge_strength, edge_x, edge_y : (h, w)
        Edge strength 0 to 1 and the unit gradient direction.
    intrinsics : (4,)
        ``fx, fy, cx, cy`` of the window.
    valid : (4,)
        ``x0, y0, x1, y1`` of the window's pixels that lie inside the frame.
    """

    contour: NDArray[np.float64]
    normal: NDArray[np.float64]
    sdf: NDArray[np.float32]
    edge_strength: NDArray[np.float32]
    edge_x: NDArray[np.float32]
    edge_y: NDArray[np.float32]
    intrinsics: Array
    valid: Array

    def wrist_line(self, pose: Pose, wrist_y_mm: float) -> tuple[Array, Array]:
        """A point of the wrist line in px, and the unit direction from it into the hand.

        The line runs through the palm's point ``(0, wrist_y, 0)`` across its y axis.
        """
        fx, fy, cx, cy = self.intrinsics
        ends = pose @ np.array([[0.0, wrist_y_mm, 0.0], [0.0, wrist_y_mm + 20.0, 0.0]])
        a, b = ends[:, :2] / np.maximum(ends[:, 2:], 1.0) * (fx, fy) + (cx, cy)
        return a, (b - a) / max(float(np.linalg.norm(b - a)), 1e-6)

    def contour_weights(self, pose: Pose, wrist_y_mm: float, border_px: float = 2.0) -> Array:
        """Weights ``(m,)``: 0 below the wrist line and at the frame's border, else 1."""
        a, axis = self.wrist_line(pose, wrist_y_mm)
        above = (self.contour - a) @ axis > 0
        x0, y0, x1, y1 = self.valid
        x, y = self.contour.T
        inside = (x > x0 + border_px) & (x < x1 - border_px)
        inside &= (y > y0 + border_px) & (y < y1 - border_px)
        return (above & inside).astype(float)
