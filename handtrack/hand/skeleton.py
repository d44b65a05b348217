"""Names and limits of the 20 angles and 21 keypoints: the convention everything shares.

Digits are ordered thumb, index, middle, ring, little. Each has four angles, so angle ``4 d + k``
belongs to digit ``d``: flexion and abduction of its first joint, then flexion of the two others.
Flexion is positive towards the palm, abduction positive towards the thumb side; zero is the
flat hand with fingers parallel to their metacarpals.

>>> len(ANGLE_NAMES), len(KEYPOINT_NAMES)
(20, 21)
>>> ANGLE_NAMES[4:8]
('index_mcp_flexion', 'index_mcp_abduction', 'index_pip_flexion', 'index_dip_flexion')
>>> KEYPOINT_NAMES[KEYPOINT_PARENTS[8]]
'index_dip'
"""

import numpy as np

DIGITS = ("thumb", "index", "middle", "ring", "little")
N_ANGLES = 20
N_KEYPOINTS = 21

_THUMB_ANGLES = ("cmc_flexion", "cmc_abduction", "mcp_flexion", "ip_flexion")
_FINGER_ANGLES = ("mcp_flexion", "mcp_abduction", "pip_flexion", "dip_flexion")
ANGLE_NAMES = tuple(
    f"{digit}_{angle}"
    for digit in DIGITS
    for angle in (_THUMB_ANGLES if digit == "thumb" else _FINGER_ANGLES)
)

_THUMB_POINTS = ("cmc", "mcp", "ip", "tip")
_FINGER_POINTS = ("mcp", "pip", "dip", "tip")
KEYPOINT_NAMES = (
    "wrist",
    *(
        f"{digit}_{point}"
        for digit in DIGITS
        for point in (_THUMB_POINTS if digit == "thumb" else _FINGER_POINTS)
    ),
)
#: Parent of each keypoint; the wrist is its own. First joints hang on the wrist.
KEYPOINT_PARENTS = tuple(0 if k == 0 or (k - 1) % 4 == 0 else k - 1 for k in range(N_KEYPOINTS))
#: Keypoints of the fingertips, thumb to little.
TIPS = (4, 8, 12, 16, 20)

_THUMB_LIMITS_DEG = ((-30, 55), (-30, 60), (-20, 75), (-25, 90))
_FINGER_LIMITS_DEG = ((-30, 95), (-22, 22), (-8, 115), (-10, 90))
#: Anatomical limits ``(20, 2)`` in radians (active range, healthy adults, generously rounded).
LIMITS = np.radians([*_THUMB_LIMITS_DEG, *(_FINGER_LIMITS_DEG * 4)]).astype(float)
LIMITS[17] = np.radians((-30, 25))  # the little finger spreads farther
LIMITS.setflags(write=False)
