"""Hypotheses of the whole hand from one picture, by a small network.

A network of a million parameters sees silhouette and shading (:mod:`handtrack.proposer.picture`)
and answers with a mixture of Gaussians over angles, rotation, place and size, as a mixture density
network does (Bishop, "Mixture Density Networks", 1994): a silhouette rarely says which of two
poses it is. It was trained on renders alone (``handtrack.bench.training``) and runs through
OpenCV in two milliseconds.

It only proposes. What it says is searched and refined like any other seed.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from handtrack import rotation
from handtrack.proposer.picture import Square, picture_of
from handtrack.records import freeze_arrays
from handtrack.trained import shipped

Array = NDArray[np.float64]
WEIGHTS = "proposer.onnx"
#: Numbers a hypothesis has: its logit, angles and log spreads, two axes of the palm, place (2) and
#: log size, log spreads of rotation, place and size.
NUMBERS = 53
#: Bounds of the log spreads: of angles, and of rotation, place and size.
LOG_STD, LOG_SPREAD = (-3.5, 1.0), (-3.5, 1.5)
#: Point of the palm that is placed, as a share of its length from the wrist to the middle knuckle.
PLACED = 0.5
#: Less probability than this is none.
FEWEST = 1e-4


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """A mixture over right hands, ``k`` of them.

    Attributes
    ----------
    weight : (k,)
        Sums to 1.
    theta, theta_std : (k, 20)
        Angles and their spread, radians.
    R : (k, 3, 3)
        Palm to camera.
    turn_std : (k,)
        Spread of the rotation, radians about any axis.
    at_px : (k, 2)
        Where the middle of the palm's axis lies in the image.
    at_std_px : (k,)
    palm_px : (k,)
        The palm's length, times focal length over depth.
    size_std : (k,)
        Spread of its logarithm.
    """

    weight: Array
    theta: Array
    theta_std: Array
    R: Array
    turn_std: Array
    at_px: Array
    at_std_px: Array
    palm_px: Array
    size_std: Array

    def __post_init__(self) -> None:
        freeze_arrays(self, copy=False)

    @classmethod
    def _names(cls) -> list[str]:
        return [field.name for field in fields(cls)]

    @classmethod
    def joined(cls, several: "list[Hypotheses]") -> "Hypotheses":
        """One mixture of several, each as likely as the next."""
        values = {
            name: np.concatenate([getattr(one, name) for one in several]) for name in cls._names()
        }
        values["weight"] = values["weight"] / len(several)
        return cls(**values)

    def facing(self, sides: tuple[str, ...]) -> "Hypotheses | None":
        """Those that show one of the sides ("palm", "back") to the camera; None without any."""
        palm = self.R[:, 2, 2] < 0
        kept = (palm & ("palm" in sides)) | (~palm & ("back" in sides))
        if self.weight[kept].sum() < FEWEST:
            return None
        values = {name: getattr(self, name)[kept] for name in self._names()}
        values["weight"] = values["weight"] / values["weight"].sum()
        return Hypotheses(**values)

    def draw(
        self, n: int, intrinsics: Array, palm_length_mm: float, rng: np.random.Generator
    ) -> tuple[Array, Array, Array]:
        """Angles ``(n, 20)``, rotations ``(n, 3, 3)`` and translations ``(n, 3)`` in mm."""
        fx, fy, cx, cy = intrinsics
        k = rng.choice(len(self.weight), n, p=self.weight)
        theta = self.theta[k] + rng.normal(size=(n, 20)) * self.theta_std[k]
        R = rotation.exp(rng.normal(size=(n, 3)) * self.turn_std[k, None]) @ self.R[k]
        x, y = (self.at_px[k] + rng.normal(size=(n, 2)) * self.at_std_px[k, None]).T
        z = fx * palm_length_mm / (self.palm_px[k] * np.exp(rng.normal(size=n) * self.size_std[k]))
        at = np.column_stack([(x - cx) / fx * z, (y - cy) / fy * z, z])
        return theta, R, at - PLACED * palm_length_mm * R[:, :, 1]

    def near(self, R: Array, std: float = np.radians(20.0)) -> tuple[Array, Array, Array] | None:
        """What they say together of a hand whose palm is near ``R``; None if none is there.

        Mean and spread ``(20,)`` of the angles, and the mean direction ``(3,)`` the palm faces.
        """
        turn2 = rotation.angle_between(self.R, R) ** 2
        w = self.weight * np.exp(-0.5 * turn2 / (self.turn_std**2 + std**2))
        if w.sum() < FEWEST:
            return None
        w /= w.sum()
        mean, normal = w @ self.theta, w @ self.R[:, :, 2]
        spread = np.sqrt(w @ (self.theta_std**2 + (self.theta - mean) ** 2) + 1e-6)
        return mean, spread, normal / np.linalg.norm(normal)

    def log_density(self, theta: Array, R: Array) -> float:
        """Log density of angles ``(20,)`` and a rotation ``(3, 3)``, up to a constant."""
        off = (theta - self.theta) / self.theta_std
        turn = rotation.angle_between(self.R, R) / self.turn_std
        spread = np.log(self.theta_std).sum(axis=1) + 3 * np.log(self.turn_std)
        logs = np.log(self.weight) - 0.5 * (off**2).sum(axis=1) - 0.5 * turn**2 - spread
        return float(np.logaddexp.reduce(logs))


def propose(
    grey: NDArray, mask: NDArray[np.bool_], square: Square, intrinsics: Array
) -> Hypotheses:
    """What the hand may be that fills ``mask`` about ``square``.

    Parameters
    ----------
    grey : (h, w)
        Brightness, 0 to 255.
    mask : (h, w)
        The silhouette.
    square : Square
        Where to look.
    intrinsics : (4,)
        ``fx, fy, cx, cy`` of the image.
    """
    answer = shipped("handtrack.proposer", WEIGHTS)(picture_of(grey, mask, square)[None])
    return decode(np.asarray(answer, float).reshape(-1, NUMBERS), square, intrinsics)


def decode(answer: Array, square: Square, intrinsics: Array) -> Hypotheses:
    """Hypotheses from the network's numbers ``(k, NUMBERS)``."""
    logit, theta, log_std, axes, place, log_spread = np.split(answer, [1, 21, 41, 47, 50], axis=1)
    weight = np.exp(logit[:, 0] - logit.max())
    fx, fy, cx, cy = intrinsics
    back = rotation.about_z(np.full(len(answer), square.turn))  # the square's turn, undone
    at_px = square.centre_px + square.radius_px * np.einsum(
        "kij,kj->ki", back[:, :2, :2], place[:, :2]
    )
    ray = (at_px - (cx, cy)) / (fx, fy)
    towards = towards_ray(ray)
    turn_std, place_std, size_std = np.exp(np.clip(log_spread, *LOG_SPREAD)).T
    return Hypotheses(
        weight=weight / weight.sum(),
        theta=theta,
        theta_std=np.exp(np.clip(log_std, *LOG_STD)),
        R=towards @ back @ rotations(axes),
        turn_std=turn_std,
        at_px=at_px,
        at_std_px=place_std * square.radius_px,
        palm_px=np.exp(place[:, 2]) * square.radius_px,
        size_std=size_std,
    )


def rotations(axes: Array) -> Array:
    """Rotations ``(k, 3, 3)`` whose first columns lie along ``axes`` ``(k, 6)``, Gram-Schmidt.

    Zhou et al., "On the Continuity of Rotation Representations in Neural Networks" (2019).
    """
    a, b = axes[:, :3], axes[:, 3:]
    a = a / np.linalg.norm(a, axis=1, keepdims=True)
    b = b - np.sum(a * b, axis=1, keepdims=True) * a
    b = b / np.linalg.norm(b, axis=1, keepdims=True)
    return np.stack([a, b, np.cross(a, b)], axis=-1)


def towards_ray(ray: Array) -> Array:
    """The least rotations ``(..., 3, 3)`` that take the optical axis to rays ``(x, y, 1)``.

    ``ray`` ``(..., 2)`` holds ``x, y``.
    """
    off = np.linalg.norm(ray, axis=-1, keepdims=True)
    across = np.stack([-ray[..., 1], ray[..., 0], np.zeros(ray.shape[:-1])], axis=-1)
    return np.asarray(rotation.exp(across / np.maximum(off, 1e-12) * np.arctan(off)))
