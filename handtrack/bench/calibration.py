"""``handtrack bench calibration``: the shape of a hand from one picture, against the true shape.

Every synthetic hand holds an open palm to the camera in a few *takes*: fingers closer and wider,
the thumb in and out, the palm tilted by 5 deg, with a stub, a bare arm and a sleeve. Each picture
goes the way of ``handtrack calibrate hand``. One camera cannot see size, so the true length of the
hand (wrist to middle tip) is handed over, and all else is compared after that: the palm's length is
then an error like any other. The default hand, brought to the same length, stands beside it.

Errors ``e`` of lengths are ``100 (found / true - 1)``; of axes the angle between the found and the
true one in the palm frame. The direction of a finger at zero abduction cannot be told from its
abduction in one picture, nor its roll from a silhouette: there calibration can only do no harm.

>>> hand = HandShape.default()
>>> float(abs(errors_of(hand.scaled(1.02), hand).bones_percent - 2).max()) < 1e-9
True
>>> float(errors_of(hand, hand).flexion_deg.max())
0.0
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.search import best_hand
from handtrack import rotation
from handtrack.bench.table import aligned
from handtrack.errors import InputError
from handtrack.hand.shape import HandShape
from handtrack.hand.skeleton import DIGITS
from synth.actor import Actor, make_actor
from synth.export import as_hand_shape
from synth.fingers import OPEN_DEG
from synth.handspec import HAND_NAMES, HandSpec
from synth.motion import FRONTAL
from synth.scene import Look, Scene

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
WALL_RGB = (150.0, 152.0, 158.0)
NOISE = 2.5
BLUR_PX = 0.6
#: Degrees that each finger moves to the thumb's side when the hand spreads by one.
FAN = np.array([1.0, 0.1, -0.6, -1.0])


@dataclass(frozen=True)
class Take:
    """How an open palm is held: what differs from the plain one."""

    spread_deg: float = 0.0
    thumb_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tilt_deg: tuple[float, float] = (0.0, 0.0)
    distance_mm: float = 440.0
    forearm: str = "stub"


TAKES: dict[str, Take] = {
    "plain": Take(),
    "wide": Take(spread_deg=5.0),
    "narrow": Take(spread_deg=-3.0),
    "thumb_in": Take(thumb_deg=(5.0, 10.0, 8.0)),
    "thumb_out": Take(thumb_deg=(-5.0, -6.0, 0.0)),
    "tilt_x": Take(tilt_deg=(5.0, 0.0)),
    "tilt_-x": Take(tilt_deg=(-5.0, 0.0)),
    "tilt_y": Take(tilt_deg=(0.0, 5.0)),
    "far": Take(distance_mm=600.0),
    "bare": Take(forearm="bare"),
    "sleeve": Take(forearm="sleeve"),
}


@dataclass(frozen=True, eq=False)
class ShapeErrors:
    """How far a hand is from the true one of the same length."""

    palm_percent: float
    digits_percent: Array  # (5,) whole digits
    bones_percent: Array  # (5, 3)
    base_mm: Array  # (5,) first joints, in the palm's plane
    flexion_deg: Array  # (5,) flexion axis of the first joint
    along_deg: Array  # (5,) direction at zero abduction


def errors_of(found: HandShape, truth: HandShape) -> ShapeErrors:
    """Errors of ``found``, whatever scale it has."""
    a, b = rotation.exp(found.rest_rotvec), rotation.exp(truth.rest_rotvec)
    cosine = np.clip(np.einsum("dij,dij->dj", a, b), -1.0, 1.0)
    angle = np.where(cosine > 1 - 1e-12, 0.0, np.degrees(np.arccos(cosine)))
    total = found.length_mm.sum(axis=1) / truth.length_mm.sum(axis=1)
    return ShapeErrors(
        palm_percent=100 * (found.palm_length_mm / truth.palm_length_mm - 1),
        digits_percent=100 * (total - 1),
        bones_percent=100 * (found.length_mm / truth.length_mm - 1),
        base_mm=np.linalg.norm((found.base_mm - truth.base_mm)[:, :2], axis=1),
        flexion_deg=angle[:, 0],
        along_deg=angle[:, 1],
    )


def hand_length_mm(shape: HandShape) -> float:
    """Wrist to middle fingertip."""
    return shape.palm_length_mm + float(shape.length_mm[2].sum())


def pictures(hand: str, takes: Sequence[str], seed: int = 0) -> Iterator[tuple[str, Scene, Image]]:
    """Name, scene and RGB picture ``(H, W, 3)`` of each of ``takes``."""
    for forearm in ("stub", "bare", "sleeve"):
        names = [name for name in takes if TAKES[name].forearm == forearm]
        if not names:
            continue
        scene = Scene(hand=hand, seed=seed, look=Look(forearm=forearm))
        with make_actor(scene) as actor:
            for name in names:
                yield name, scene, _picture(actor, TAKES[name], np.random.default_rng(seed))


def _picture(actor: Actor, take: Take, rng: np.random.Generator) -> Image:
    theta_deg = np.array(OPEN_DEG)
    theta_deg[5::4] += take.spread_deg * FAN
    theta_deg[:3] += take.thumb_deg
    R = rotation.exp(np.radians([*take.tilt_deg, 0.0])) @ FRONTAL
    t_mm = np.array([0.0, 15.0, take.distance_mm]) - R @ (0.0, 75.0, 0.0)
    rgba = actor.draw(np.radians(theta_deg), R, t_mm, np.zeros(2)).rgba.astype(float)
    image = rgba[..., :3] + np.array(WALL_RGB) * (1 - rgba[..., 3:] / 255)
    image = cv2.GaussianBlur(image, (0, 0), BLUR_PX) + rng.normal(0, NOISE, image.shape)
    return np.clip(image, 0, 255).astype(np.uint8)


def measured(hand: str, takes: Sequence[str], seed: int = 0) -> dict[str, HandShape | None]:
    """The shape that each picture of ``hand`` gives, at its true length; None where refused."""
    length_mm = hand_length_mm(as_hand_shape(HandSpec.named(hand)))
    shapes: dict[str, HandShape | None] = {}
    for name, scene, image in pictures(hand, takes, seed):
        camera = scene.camera
        found = best_hand([(0, image)], camera.for_size, hand_length_mm=length_mm).found
        shapes[name] = None if found is None else found.result.shape
    return shapes


@dataclass(frozen=True)
class BenchCalibration:
    """Measure the calibration of the hand on pictures of open palms with known shapes."""

    hands: tuple[str, ...] = HAND_NAMES
    """Synthetic hands."""
    takes: tuple[str, ...] = tuple(TAKES)
    """How they are held."""
    seed: int = 0
    """Of the noise and the sleeve."""

    def __call__(self) -> int:
        """Print two tables: mean size of the errors, and the worst of any take."""
        if unknown := sorted(set(self.takes) - set(TAKES)):
            raise InputError(f"no take '{unknown[0]}'; there are {', '.join(TAKES)}")
        head = ["hand", "shape", "takes", "palm %", *(f"{d} %" for d in DIGITS)]
        head += ["bone %", "worst", "thumb base mm", "bases mm", "flexion deg", "thumb", "fan deg"]
        rows = [head]
        for hand in self.hands:
            truth = as_hand_shape(HandSpec.named(hand))
            shapes = measured(hand, self.takes, self.seed)
            known = [errors_of(s, truth) for s in shapes.values() if s is not None]
            if known:
                rows.append([hand, "calibrated", f"{len(known)}/{len(shapes)}", *_columns(known)])
            usual = HandShape.default()
            usual = usual.scaled(hand_length_mm(truth) / hand_length_mm(usual))
            rows.append([hand, "default", "", *_columns([errors_of(usual, truth)])])
        print(aligned(rows))
        return 0


def _columns(errors: Sequence[ShapeErrors]) -> list[str]:
    """Mean signed errors of palm and digits, then mean sizes."""
    bones = np.abs([e.bones_percent for e in errors])
    digits = np.mean([e.digits_percent for e in errors], axis=0)
    base, flexion, along = (
        np.mean([getattr(e, name) for e in errors], axis=0)
        for name in ("base_mm", "flexion_deg", "along_deg")
    )
    signed = [np.mean([e.palm_percent for e in errors]), *digits]
    sizes = [bones.mean(), bones.max(), base[0], base[1:].mean(), flexion[1:].mean(), flexion[0]]
    return [f"{v:+.1f}" for v in signed] + [f"{v:.1f}" for v in (*sizes, along[1:].mean())]
