"""The matches that refinement works on, for people to look at.

Each contour point pulls on the capsule that :func:`~handtrack.refine.outline.nearest_outline`
gives it; here is where on that capsule's outline the pull ends. The search is the refinement's own,
so what is shown is what was minimised.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from handtrack.estimate import Estimate
from handtrack.refine.outline import FARTHEST_PX, frame_capsules, nearest_outline
from handtrack.refine.solve import Refiner
from handtrack.refine.view import View

Array = NDArray[np.float64]


def contour_pairs(refiner: Refiner, view: View, estimate: Estimate) -> Array:
    """Contour points and their places on the model ``(p, 4)``: x, y, x, y in window pixels.

    Points that carry no weight (forearm, the frame's border) or find no capsule have no row.
    """
    hand, pose = refiner.hand, estimate.pose
    circles = hand.circles_px(estimate.theta[None], pose.R, pose.t_mm, view.intrinsics)[0]
    contour = refiner.contour(view, pose)
    capsules, digit, _ = refiner.parts
    feet = outline_feet(contour, circles, capsules, digit)
    pairs = np.column_stack([contour[:, :2], feet])
    return np.asarray(pairs[np.isfinite(feet).all(axis=1)])


@numba.njit(cache=True, nogil=True)
def outline_feet(contour, circles, capsules, digit):  # type: ignore[no-untyped-def]
    """The nearest outline point ``(m, 2)`` of each contour point ``(m, 5)``; NaN for none."""
    frames = np.empty((len(capsules), 12))
    frame_capsules(circles, capsules, frames)
    every = np.arange(len(capsules))
    feet = np.full((len(contour), 2), np.nan)
    for k in range(len(contour)):
        if contour[k, 4] <= 0:
            continue
        d, c, t = nearest_outline(contour[k], True, every, -9, digit, frames, FARTHEST_PX)
        if c < 0:
            continue
        a, b = capsules[c, 0], capsules[c, 1]
        mx = contour[k, 0] - circles[a, 0] - t * (circles[b, 0] - circles[a, 0])
        my = contour[k, 1] - circles[a, 1] - t * (circles[b, 1] - circles[a, 1])
        share = d / max(np.sqrt(mx * mx + my * my), 1e-9)
        feet[k, 0] = contour[k, 0] - share * mx
        feet[k, 1] = contour[k, 1] - share * my
    return feet
