"""Frame by frame, as a program of yours would: python examples/stream.py [CLIP].

Any source of RGB arrays will do: make a ``handtrack.Frame`` of each, with its time.
"""

import numpy as np
import sample

import handtrack
from calib.hand import calibrate_hand

clip = sample.argument() or sample.clip()
info = handtrack.probe(clip)
camera = handtrack.Camera.assumed_for(info.width_px, info.height_px)
tracker = handtrack.Tracker(handtrack.TrackerSettings(), camera, calibrate=calibrate_hand)

pinch = [handtrack.KEYPOINT_NAMES.index(name) for name in ("thumb_tip", "index_tip")]
for frame in handtrack.read_frames(clip):
    hand = tracker.step(frame)  # a FrameResult; a lost hand is a status, not an exception
    thumb, index = hand.keypoints_mm[pinch]
    gap_mm = np.linalg.norm(thumb - index)  # NaN where the hand is not known
    print(f"{hand.time_s:6.3f} s  {hand.status.value:9}  thumb to index {gap_mm:5.1f} mm")
