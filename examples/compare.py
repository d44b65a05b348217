"""How far two runs of one clip differ, joint by joint: python examples/compare.py [RUN RUN]."""

import numpy as np
import sample

import handtrack

one = handtrack.Trajectory.load(sample.argument(1) or sample.run())
other_path = sample.argument(2)
other = handtrack.Trajectory.load(other_path) if other_path else one.smooth(width_s=0.2)

_, here, there = np.intersect1d(one.frame, other.frame, return_indices=True)
difference = np.degrees(one.theta[here] - other.theta[there])  # (F, 20), NaN where either is lost
both = np.isfinite(difference).all(axis=1)
for name, column in zip(handtrack.ANGLE_NAMES, difference[both].T, strict=True):
    print(f"{name:24} rms {np.sqrt(np.mean(column**2)):5.2f} deg, largest {abs(column).max():5.2f}")
print(f"{both.sum()} frames known in both")
