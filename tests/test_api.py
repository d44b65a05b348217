"""The public names, and what importing costs."""

import subprocess
import sys

import numpy as np
import pytest

import handtrack
from handtrack.errors import InputError


def test_every_public_name_resolves():
    for name in handtrack.__all__:
        assert getattr(handtrack, name) is not None, name
    assert dir(handtrack) == sorted(handtrack.__all__)
    with pytest.raises(AttributeError, match="no attribute 'tracks'"):
        _ = handtrack.tracks


def test_importing_and_asking_for_help_stay_light():
    script = (
        "import sys, handtrack.cli as c; c.main(['--help']);"
        "heavy = {'numba', 'cv2', 'av', 'scipy', 'matplotlib'} & set(sys.modules);"
        "sys.exit(f'imports {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_track_gives_a_trajectory_and_writes_nothing(tmp_path, write_clip):
    class Still:
        def __init__(self, camera):
            self.shape, self.timings_ms = handtrack.HandShape.default(), {}

        def step(self, frame):
            assert frame.image.shape == (64, 96, 3)
            unknown = handtrack.FrameResult.unknown(frame.index, frame.time_s)
            return handtrack.FrameResult(**vars(unknown) | {"theta": np.full(20, frame.time_s)})

    clip = write_clip(tmp_path / "a.mp4", n=5)
    hand = handtrack.track(clip, lambda s, camera, shape: Still(camera), start_frame=1)
    assert len(hand) == 5
    np.testing.assert_allclose(hand.theta[1:, 0], hand.time_s[1:])
    assert np.isnan(hand.theta[0]).all()
    assert hand.provenance["clip"] == "a.mp4"
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]
    with pytest.raises(InputError, match="no such file"):
        handtrack.track(tmp_path / "none.mp4")
