"""Methods beside another tracker's keypoints: reading, spans, and a row worked out by hand."""

from pathlib import Path

import numpy as np
import pytest

from handtrack.bench.peer import BenchClip, frames_in, read_peer
from handtrack.errors import InputError
from handtrack.records import FrameResult, Status
from handtrack.trajectory import Trajectory


def test_spans() -> None:
    assert frames_in((), 3).all()
    assert frames_in(("0:1", "3:9"), 5).tolist() == [True, True, False, True, True]
    with pytest.raises(InputError, match="first:last"):
        frames_in(("7",), 10)


def test_a_file_without_keypoints_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "peer.npz"
    np.savez(path, kp2=np.zeros((4, 20, 2)))
    with pytest.raises(InputError, match="20"):
        read_peer(path)
    with pytest.raises(InputError, match="kp2"):
        read_peer(tmp_path / "none.npz")


def test_a_row_counts_tracked_frames_in_palm_lengths() -> None:
    other = np.zeros((4, 21, 2))
    other[:, 9] = [0.0, 100.0]  # a palm of 100 px
    results = []
    for k in range(4):
        seen = FrameResult.unknown(k, k / 30, Status.TRACKED if k < 3 else Status.LOST)
        pixels = other[k] + [10.0, 0.0]
        pixels[[4, 8, 12, 16, 20]] = other[k, [4, 8, 12, 16, 20]] + [20.0, 0.0]
        values = {f: getattr(seen, f) for f in seen.__dataclass_fields__}
        results.append(FrameResult(**(values | {"keypoints_px": pixels})))
    bench = BenchClip(Path("x.mp4"), Path("peer.npz"), Path("out"), worst=1)
    found = Trajectory.from_results(results)
    row = bench._row("refined", found, other, np.ones(4, bool), 2.0).split()
    assert row[:4] == ["refined", "75.0%", f"{(16 * 0.1 + 5 * 0.2) / 21:.3f}", "0.200"]
    with pytest.raises(InputError, match="another clip"):
        bench._row("refined", found, other[:2], np.ones(2, bool), 2.0)
