"""Tones of skin, from very light to very dark, and of sleeves."""

import numpy as np
from numpy.typing import NDArray

#: sRGB in even light.
TONES: dict[str, tuple[int, int, int]] = {
    "porcelain": (240, 204, 186),
    "light": (226, 180, 154),
    "olive": (203, 158, 118),
    "tan": (176, 126, 90),
    "brown": (132, 88, 62),
    "dark": (86, 57, 42),
}


def some_cloth(rng: np.random.Generator) -> NDArray[np.float64]:
    """A sleeve's sRGB colour ``(3,)``."""
    return rng.integers((20, 40, 60), (90, 120, 200)).astype(float)


def linear(srgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear light, 0 to 1, of displayed colours, 0 to 255."""
    return (srgb / 255.0) ** 2.2
