"""How fast the exact regression is, how much memory it takes, and that it is scikit-learn's.

The data base is 20,000 frames of the alphabet, performed anew until they suffice; the queries are
of a performance that is not in it; six markers.
"""

import time
import tracemalloc
from dataclasses import dataclass, replace

import numpy as np

from handtrack.mocap.database import build, shipped_clip
from handtrack.mocap.handover import columns
from handtrack.mocap.ranking import rank
from handtrack.mocap.regression import Regression, predict

FRAMES, QUERIES, REFERENCE_QUERIES, ROUNDS = 20_000, 600, 12, 3


@dataclass(frozen=True)
class Speed:
    """Query frames a second of ours and of scikit-learn's, the largest difference, the memory.

    ``per_core_s`` counts processor time, which a busy machine leaves alone.
    """

    frames: int
    per_s: float
    per_core_s: float
    memory_mb: float
    reference_per_s: float | None = None
    difference_rad: float | None = None

    @property
    def sentence(self) -> str:
        """For people."""
        text = (
            f"exact regression against {self.frames} frames, six markers: {self.per_s:.0f} query "
            f"frames a second, {self.per_core_s:.0f} a second of one core's time, "
            f"{self.memory_mb:.0f} MB"
        )
        if self.reference_per_s is None or self.difference_rad is None:
            return text + " (scikit-learn is not installed: no reference)"
        return text + (
            f"; scikit-learn's weighted LinearRegression {self.reference_per_s:.1f} a second, "
            f"{self.per_s / self.reference_per_s:.0f} times slower, "
            f"largest difference {self.difference_rad:.1e} rad"
        )


def measure_speed() -> Speed:
    """Measure; the best of a few rounds."""
    clips = [shipped_clip("alphabet", seed, runs=2) for seed in range(7)]
    base = build(clips)
    chosen = rank(base.labels, base.X_mm).top(6)
    X, Y = columns(base, base.labels, chosen)[:FRAMES], base.theta[:FRAMES]
    other = build([shipped_clip("gestures", 99)])
    Q = columns(other, other.labels, chosen)[:QUERIES]
    tracemalloc.start()
    got = predict(Regression(), X, Y, Q).mean
    memory = tracemalloc.get_traced_memory()[1] / 2**20
    tracemalloc.stop()
    best, best_core = np.inf, np.inf
    for _ in range(ROUNDS):
        begin, begin_core = time.perf_counter(), time.process_time()
        predict(Regression(), X, Y, Q)
        best = min(best, time.perf_counter() - begin)
        best_core = min(best_core, time.process_time() - begin_core)
    speed = Speed(len(X), len(Q) / best, len(Q) / best_core, memory)
    try:
        from sklearn.linear_model import LinearRegression
    except ImportError:
        return speed
    rows = np.linspace(0, len(Q) - 1, REFERENCE_QUERIES).round().astype(int)
    flat = X.reshape(len(X), -1)
    expected = []
    begin = time.perf_counter()
    for q in Q[rows].reshape(len(rows), -1):
        weight = 1 / np.linalg.norm(flat - q, axis=1)
        model = LinearRegression().fit(flat, Y, sample_weight=weight)
        expected.append(model.predict(q[None])[0])
    took = time.perf_counter() - begin
    difference = float(np.abs(np.array(expected) - got[rows]).max())
    return replace(speed, reference_per_s=len(rows) / took, difference_rad=difference)
