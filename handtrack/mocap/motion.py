"""A skeleton and its motion, and where its joints are.

A joint turns by its rotation channels, in degrees, multiplied in the order in which they are
listed: ``Yrotation Xrotation Zrotation`` is ``R = Ry Rx Rz``, applied to column vectors. With
``R_j`` a joint's local rotation and ``o_j`` its offset, in the frame of its parent ``p``::

    R_world_j = R_world_p R_j        x_world_j = x_world_p + R_world_p o_j

Position channels, where a joint has them, stand in place of the offset (as Blender reads them).

>>> import numpy as np
>>> arm = Motion(
...     names=("elbow",),
...     parents=np.array([-1]),
...     offsets=np.zeros((1, 3)),
...     channels=(("Zrotation",),),
...     end_parents=np.array([0]),
...     end_offsets=np.array([[10.0, 0.0, 0.0]]),
...     frame_time_s=0.01,
...     values=np.array([[0.0], [90.0]]),
... )
>>> arm.world().ends.round(6)[:, 0].tolist()
[[10.0, 0.0, 0.0], [0.0, 10.0, 0.0]]
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.errors import InputError
from handtrack.records import freeze_arrays

Array = NDArray[np.float64]

_ROTATIONS = {
    "Xrotation": rotation.about_x,
    "Yrotation": rotation.about_y,
    "Zrotation": rotation.about_z,
}
_POSITIONS = {"Xposition": 0, "Yposition": 1, "Zposition": 2}
#: The names that a channel can have.
CHANNELS = (*_ROTATIONS, *_POSITIONS)


@dataclass(frozen=True, eq=False)
class World:
    """Where everything is: rotations and positions of joints, positions of End Sites."""

    R: Array  # (F, J, 3, 3)
    joints: Array  # (F, J, 3)
    ends: Array  # (F, E, 3)


@dataclass(frozen=True, eq=False)
class Motion:
    """A skeleton of ``J`` joints and ``E`` End Sites, and ``F`` frames of ``C`` channels.

    Parameters
    ----------
    names : J joint names, parents before children (a file lists them depth first).
    parents : (J,) index of each joint's parent, -1 for a root.
    offsets : (J, 3) in the parent's frame, in the file's unit of length.
    channels : the channel names of each joint, in file order.
    end_parents : (E,) the joint each End Site hangs on.
    end_offsets : (E, 3) in the frame of that joint.
    frame_time_s : seconds from one frame to the next.
    values : (F, C) channel values as the file has them: degrees and the unit of length.

    Raises
    ------
    InputError
        The parts do not fit each other.
    """

    names: tuple[str, ...]
    parents: NDArray[np.int64]
    offsets: Array
    channels: tuple[tuple[str, ...], ...]
    end_parents: NDArray[np.int64]
    end_offsets: Array
    frame_time_s: float
    values: Array

    def __post_init__(self) -> None:
        freeze_arrays(self)
        J, C = len(self.names), sum(map(len, self.channels))
        if self.offsets.shape != (J, 3) or self.parents.shape != (J,) or len(self.channels) != J:
            raise InputError(f"motion: {J} joints need {J} parents, offsets and channel lists")
        if self.values.ndim != 2 or self.values.shape[1] != C:
            raise InputError(f"motion: values {self.values.shape} for a skeleton of {C} channels")
        if self.end_offsets.shape != (len(self.end_parents), 3):
            raise InputError("motion: End Sites need one offset and one parent each")
        if (self.parents >= np.arange(J)).any():
            raise InputError("motion: parents must come before their children")

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.values)

    def index(self, name: str) -> int:
        """Index of the joint called ``name``.

        Raises
        ------
        InputError
            There is none; the message lists those there are.
        """
        if name not in self.names:
            raise InputError(f"no joint '{name}' in this skeleton; it has {', '.join(self.names)}")
        return self.names.index(name)

    def columns(self, joint: int) -> slice:
        """Columns of ``values`` that belong to a joint, by index."""
        start = sum(map(len, self.channels[:joint]))
        return slice(start, start + len(self.channels[joint]))

    def local_rotations(self) -> Array:
        """Each joint's rotation against its parent, ``(F, J, 3, 3)``."""
        R = np.tile(np.eye(3), (self.n_frames, len(self.names), 1, 1))
        for j, channels in enumerate(self.channels):
            for name, degrees in zip(channels, self.values[:, self.columns(j)].T, strict=True):
                if name in _ROTATIONS:
                    R[:, j] = R[:, j] @ _ROTATIONS[name](np.radians(degrees))
        return R

    def local_positions(self) -> Array:
        """Each joint's position in its parent's frame, ``(F, J, 3)``."""
        position = np.tile(self.offsets, (self.n_frames, 1, 1))
        for j, channels in enumerate(self.channels):
            for name, value in zip(channels, self.values[:, self.columns(j)].T, strict=True):
                if name in _POSITIONS:
                    position[:, j, _POSITIONS[name]] = value
        return position

    def world(self) -> World:
        """Forward kinematics of all frames."""
        R, x = self.local_rotations(), self.local_positions()
        for j, p in enumerate(self.parents):
            if p >= 0:
                x[:, j] = x[:, p] + np.einsum("fab,fb->fa", R[:, p], x[:, j])
                R[:, j] = R[:, p] @ R[:, j]
        reach = np.einsum("feab,eb->fea", R[:, self.end_parents], self.end_offsets)
        return World(R, x, x[:, self.end_parents] + reach)
