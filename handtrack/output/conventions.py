"""The drawing of the conventions, made by the kinematics it explains.

``python -m handtrack.output.conventions docs/conventions.png`` writes it. Every arrow is the path
of a fingertip while one angle goes from zero to a positive value, so a drawing that shows a wrong
sign would mean that the kinematics has it.

>>> tip = path_of("middle_mcp_abduction", 20.0)  # to the thumb's side, in the palm's plane
>>> bool(tip[-1, 0] > tip[0, 0]), bool(abs(tip[:, 2]).max() < 1.0)
(True, True)
"""

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import ANGLE_NAMES, DIGITS, KEYPOINT_NAMES, TIPS
from handtrack.output.drawing import DIGIT_COLOURS
from handtrack.output.files import save_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

SKIN, INK, GREY, RED = "#f1e7dc", "#222222", "#b5aca2", "#c0392b"
#: Digit colours darkened, so that lines stand out on white paper.
COLOURS = [tuple(0.8 * c / 255 for c in colour) for colour in DIGIT_COLOURS]
#: Which palm coordinates are right and up on the paper.
FRONT, SIDE, TOP = (0, 1), (2, 1), (0, 2)


def hand_at(**angles_deg: float) -> Array:
    """Keypoints ``(21, 3)`` of the default right hand, palm frame; angles not named are zero."""
    theta = np.zeros(len(ANGLE_NAMES))
    for name, value in angles_deg.items():
        theta[ANGLE_NAMES.index(name)] = np.radians(value)
    return keypoints_mm(theta, HandShape.default())


def path_of(angle: str, to_deg: float) -> Array:
    """Where the digit's tip goes ``(n, 3)`` while ``angle`` alone goes from 0 to ``to_deg``."""
    k = TIPS[DIGITS.index(angle.partition("_")[0])]
    return np.array([hand_at(**{angle: a})[k] for a in np.linspace(0, to_deg, 30)])


def draw() -> "Figure":
    """The whole drawing: names and palm frame, flexion, abduction, thumb, camera frame."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 8), layout="constrained")
    grid = figure.add_gridspec(2, 4, width_ratios=(2.2, 1, 1, 1), height_ratios=(1.2, 1))
    _names(figure.add_subplot(grid[:, 0]))
    _flexion(figure.add_subplot(grid[0, 1]))
    _abduction(figure.add_subplot(grid[0, 2:]))
    _thumb_flexion(figure.add_subplot(grid[1, 1]))
    _thumb_abduction(figure.add_subplot(grid[1, 2]))
    _camera(figure.add_subplot(grid[1, 3]))
    return figure


def _names(axes: "Axes") -> None:
    points = hand_at()
    _titled(axes, "21 keypoints and the palm frame:\nright hand, palm to the viewer, all angles 0")
    _body(axes, FRONT)
    _bones(axes, points, FRONT)
    for k, name in enumerate(KEYPOINT_NAMES):
        digit, _, joint = name.partition("_")
        x, y = points[k, :2]
        label = f"{k} {joint}" if joint else ""
        axes.text(x + 4, y, label, fontsize=8.5, va="center", color=INK, zorder=8)
        if k in TIPS:
            colour = COLOURS[DIGITS.index(digit)]
            axes.text(x, y + 10, digit, fontsize=11, ha="center", color=colour, weight="bold")
    axes.text(0, -9, "0 wrist", fontsize=8.5, ha="center", color=INK)
    for name, end in (("x", (58, 0)), ("y", (0, 62))):
        _arrow(axes, (0, 0), end, RED)
        at = np.array(end) * 1.09 - ((8, 8) if name == "y" else (0, 0))
        axes.text(at[0], at[1], name, color=RED, fontsize=13, ha="center", va="center")
    axes.plot(-9, 4, "o", ms=11, mfc="white", mec=RED, mew=1.6, zorder=6)
    axes.plot(-9, 4, "o", ms=3.5, color=RED, zorder=7)
    axes.text(-17, 6, "z", color=RED, fontsize=13, ha="center")
    axes.set(xlim=(-85, 115), ylim=(-20, 205))


def _flexion(axes: "Axes") -> None:
    _titled(axes, "Flexion > 0: to the palm\n(the index, from the little side)")
    bent = hand_at(index_mcp_flexion=30, index_pip_flexion=45, index_dip_flexion=30)
    for points, colour in ((hand_at(), GREY), (bent, COLOURS[1])):
        chain = points[[0, 5, 6, 7, 8]][:, SIDE]
        axes.plot(*chain.T, "-o", color=colour, lw=3, ms=5)
    for name, at in (("mcp", 5), ("pip", 6), ("dip", 7)):
        z, y = bent[at, SIDE]
        axes.text(z + 3, y - 9, name, fontsize=9, color=INK)
    _path(axes, path_of("index_mcp_flexion", 25), SIDE, "+")
    _frame(axes, SIDE, (35, 8), 24)
    axes.set(xlim=(-45, 90), ylim=(-10, 205))


def _abduction(axes: "Axes") -> None:
    _titled(axes, "Abduction > 0: every finger to the thumb's side\n(grey: 0, colour: 15 deg)")
    spread = hand_at(**{f"{digit}_mcp_abduction": 15 for digit in DIGITS[1:]})
    _body(axes, FRONT)
    _bones(axes, hand_at(), FRONT, GREY)
    _bones(axes, spread, FRONT, digits=DIGITS[1:])
    for digit in DIGITS[1:]:
        _path(axes, path_of(f"{digit}_mcp_abduction", 15), FRONT, "+")
    _frame(axes, FRONT, (75, 8), 24)
    axes.set(xlim=(-75, 120), ylim=(-10, 205))


def _thumb_flexion(axes: "Axes") -> None:
    _titled(axes, "Thumb flexion > 0: across the palm\n(grey: 0, colour: cmc 40 deg)")
    _body(axes, FRONT)
    _bones(axes, hand_at(), FRONT, GREY)
    _bones(axes, hand_at(thumb_cmc_flexion=40), FRONT, digits=DIGITS[:1])
    _path(axes, path_of("thumb_cmc_flexion", 40), FRONT, "+")
    _frame(axes, FRONT, (75, 8), 24)
    axes.set(xlim=(-60, 115), ylim=(-10, 142))


def _thumb_abduction(axes: "Axes") -> None:
    _titled(axes, "Thumb abduction > 0: out of the palm\n(from the fingertips; colour: cmc 40 deg)")
    zero = hand_at()
    for digit in (1, 2, 3, 4):
        axes.plot(*zero[1 + 4 * digit, TOP], "o", color=GREY, ms=13)
    axes.text(-6, -20, "knuckles", fontsize=8, ha="center", color=INK)
    for points, colour in ((zero, GREY), (hand_at(thumb_cmc_abduction=40), COLOURS[0])):
        axes.plot(*points[[0, 1, 2, 3, 4]][:, TOP].T, "-o", color=colour, lw=3, ms=5)
    _path(axes, path_of("thumb_cmc_abduction", 40), TOP, "+")
    _frame(axes, TOP, (-45, 30), 24)
    axes.set(xlim=(-60, 115), ylim=(-35, 105))


def _camera(axes: "Axes") -> None:
    _titled(axes, "Camera frame: directions\nof pixels and of mm")
    axes.plot([0, 100, 100, 0, 0], [0, 0, 75, 75, 0], color=GREY, lw=1.5)
    hand = hand_at()[:, FRONT] * 0.3 * (1, -1) + (50, 66)
    for k in range(5):
        axes.plot(*hand[[0, *range(1 + 4 * k, 5 + 4 * k)]].T, color=COLOURS[k], lw=2)
    for name, end in (("x", (34, 0)), ("y", (0, 34))):
        _arrow(axes, (0, 0), end, RED)
        axes.text(end[0] * 1.12 - 1, end[1] * 1.2 + 2, name, color=RED, fontsize=12)
    axes.plot(0, 0, "o", ms=11, mfc="white", mec=RED, mew=1.6, zorder=6)
    axes.plot(0, 0, "x", ms=7, color=RED, mew=1.6, zorder=7)
    axes.text(2, 83, "z into the picture", color=RED, fontsize=9)
    axes.set(xlim=(-12, 112), ylim=(88, -12))


def _titled(axes: "Axes", text: str) -> None:
    axes.set_title(text, fontsize=9.5)
    axes.set_aspect("equal")
    axes.axis("off")


def _body(axes: "Axes", view: tuple[int, int]) -> None:
    """The flat palm and the flesh of the digits, at zero."""
    shape, points = HandShape.default(), hand_at()
    axes.fill(*shape.palm_outline_mm.T, color=SKIN, zorder=0)
    for digit in range(5):
        chain = points[1 + 4 * digit : 5 + 4 * digit][:, view]
        axes.plot(*chain.T, color=SKIN, lw=19, solid_capstyle="round", zorder=0)


def _bones(
    axes: "Axes",
    points: Array,
    view: tuple[int, int],
    colour: str | None = None,
    digits: tuple[str, ...] = DIGITS,
) -> None:
    for digit in digits:
        d = DIGITS.index(digit)
        chain = points[[0, *range(1 + 4 * d, 5 + 4 * d)]][:, view]
        axes.plot(*chain[:2].T, color=colour or COLOURS[d], lw=1.2, zorder=2)
        axes.plot(*chain[1:].T, "-o", color=colour or COLOURS[d], lw=3, ms=5.5, zorder=3)
    axes.plot(*points[0, view], "o", color=INK, ms=6, zorder=4)


def _path(axes: "Axes", points: Array, view: tuple[int, int], label: str) -> None:
    """The way of a point as an arrow."""
    x, y = points[:, view].T
    axes.plot(x, y, color=RED, lw=1.6, zorder=5)
    _arrow(axes, (x[-4], y[-4]), (x[-1], y[-1]), RED)
    along = np.array([x[-1] - x[-6], y[-1] - y[-6]])
    end = np.array([x[-1], y[-1]]) + 7 * along / np.linalg.norm(along)
    axes.text(end[0], end[1], label, color=RED, fontsize=13, ha="center", va="center", zorder=6)


def _frame(axes: "Axes", view: tuple[int, int], at: tuple[float, float], length: float) -> None:
    """The two palm axes that lie in the paper."""
    for k, step in zip(view, np.eye(2) * length, strict=True):
        _arrow(axes, at, tuple(np.add(at, step)), RED)
        x, y = np.add(at, step * 1.25)
        axes.text(x, y, "xyz"[k], color=RED, ha="center", va="center")


def _arrow(axes: "Axes", start: tuple[float, float], end: tuple[float, float], colour: str) -> None:
    style = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, start, arrowprops=style, zorder=5)


def write(path: Path) -> None:
    """Write the drawing as PNG; the same bytes each time.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    figure = draw()
    save_whole(path, partial(figure.savefig, format="png", dpi=80, metadata={"Software": None}))


if __name__ == "__main__":
    write(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/conventions.png"))
