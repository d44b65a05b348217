"""Tones of skin, from very light to very dark."""

#: sRGB in even light.
TONES: dict[str, tuple[int, int, int]] = {
    "porcelain": (240, 204, 186),
    "light": (226, 180, 154),
    "olive": (203, 158, 118),
    "tan": (176, 126, 90),
    "brown": (132, 88, 62),
    "dark": (86, 57, 42),
}
