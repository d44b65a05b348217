"""Calm a run and bring it to 60 frames a second: python examples/smooth_and_resample.py [RUN]."""

import numpy as np
import sample

import handtrack

hand = handtrack.Trajectory.load(sample.argument() or sample.run())
calm = hand.bridge_gaps(longest_s=0.1).smooth(width_s=0.15).resample(rate_hz=60)
calm.save("calm.npz")  # Trajectory.load reads it back

for name, one in (("as tracked", hand), ("smoothed", calm)):
    speed = np.degrees(one.joint_velocity())  # NaN in and beside a gap
    print(f"{name:10}  {len(one):4} frames, joints move at {np.nanstd(speed):5.1f} deg/s rms")
print(calm.provenance["steps"])
