"""handtrack: joint angles of a human hand over time, from an ordinary video.

An hourglass that meets at :class:`Trajectory`::

    video -> evidence -> palm <-> fingers --\\                /-> tables
            (silhouette,  (ICP +   (particle >-> Trajectory -+-> BVH
               edges)  factorisation) filter)/       ^       \\-> overlay film
                                                     |
    markers -> ranking (PCA) -> regression (LWR) ----/

>>> import handtrack
>>> hand = handtrack.track("clip.mp4")                      # doctest: +SKIP
>>> hand.to_dataframe()["index_pip_flexion_deg"].plot()     # doctest: +SKIP
>>> handtrack.ANGLE_NAMES[6]
'index_pip_flexion'

=======================================  ========================================================
``track``, ``Trajectory``                a whole clip; ``Trajectory.load`` reads a run's folder
``Tracker``, ``TrackerSettings``         frame by frame: ``Tracker.step(frame)``
``probe``, ``read_frames``, ``Frame``    the frames of a clip, upright, with their own times
``FrameResult``, ``Status``, ``Pose``    what is known of one frame
``HandShape``, ``Camera``                what was measured beforehand, or is assumed
``ConfigurationSpace``                   the 7 dimensions in which fingers are looked for
``ANGLE_NAMES``, ``KEYPOINT_NAMES``      the order of the columns
``HandtrackError``, ``InputError``       what can go wrong, in one line
=======================================  ========================================================

The names below are imported when they are first used, so ``import handtrack`` costs nothing.
Angles are in radians, lengths in mm; order and signs are told in :mod:`handtrack.hand.skeleton`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from handtrack.camera import Camera
    from handtrack.errors import HandtrackError, InputError
    from handtrack.evidence.video import probe, read_frames
    from handtrack.hand.shape import HandShape
    from handtrack.hand.skeleton import ANGLE_NAMES, KEYPOINT_NAMES
    from handtrack.hand.space import ConfigurationSpace
    from handtrack.records import Frame, FrameResult, Pose, Status
    from handtrack.run import track
    from handtrack.tracker import Tracker, TrackerSettings
    from handtrack.trajectory import Trajectory

__all__ = [
    "ANGLE_NAMES",
    "KEYPOINT_NAMES",
    "Camera",
    "ConfigurationSpace",
    "Frame",
    "FrameResult",
    "HandShape",
    "HandtrackError",
    "InputError",
    "Pose",
    "Status",
    "Tracker",
    "TrackerSettings",
    "Trajectory",
    "probe",
    "read_frames",
    "track",
]

_HOMES = {
    "camera": ("Camera",),
    "errors": ("HandtrackError", "InputError"),
    "evidence.video": ("probe", "read_frames"),
    "hand.shape": ("HandShape",),
    "hand.skeleton": ("ANGLE_NAMES", "KEYPOINT_NAMES"),
    "hand.space": ("ConfigurationSpace",),
    "records": ("Frame", "FrameResult", "Pose", "Status"),
    "run": ("track",),
    "tracker": ("Tracker", "TrackerSettings"),
    "trajectory": ("Trajectory",),
}
_HOME_OF = {name: f"handtrack.{home}" for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'handtrack' has no attribute '{name}'")
    return getattr(import_module(_HOME_OF[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
