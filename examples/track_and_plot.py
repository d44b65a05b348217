"""Track a clip and plot a joint with its 90 % band: python examples/track_and_plot.py [CLIP]."""

import numpy as np
import sample
from matplotlib.figure import Figure

import handtrack

hand = handtrack.track(sample.argument() or sample.clip())

joint = handtrack.ANGLE_NAMES.index("index_pip_flexion")
angle_deg = np.degrees(hand.theta[:, joint])
band_deg = 1.645 * np.degrees(hand.theta_std[:, joint])  # a normal distribution's 90 %

figure = Figure(figsize=(8, 3), layout="constrained")
axes = figure.subplots()
axes.fill_between(hand.time_s, angle_deg - band_deg, angle_deg + band_deg, alpha=0.3)
axes.plot(hand.time_s, angle_deg)
axes.set(xlabel="time (s)", ylabel="index PIP flexion (deg)")
figure.savefig("index_pip.png")

tracked = hand.is_status(handtrack.Status.TRACKED)
print(f"{tracked.sum()} of {len(hand)} frames tracked; index_pip.png")
