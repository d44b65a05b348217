"""From a scene to a clip and its truth.

``clip.mp4`` beside ``truth.npz`` (angles, palm pose, keypoints in px and mm, mask), ``shape.toml``
(the hand's measures as the tracker would know them; none for another maker's hand),
``camera.toml`` and ``scene.toml``.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import tomli_w
from numpy.typing import NDArray
from tqdm import tqdm

from handtrack.camera import Camera
from handtrack.errors import OutputError
from synth.actor import Actor, make_actor
from synth.background import background
from synth.export import as_hand_shape
from synth.handspec import HandSpec
from synth.kinematics import mirror
from synth.motion import Film
from synth.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Truth:
    """What is true of each of ``F`` frames, of the hand as filmed (a left hand is a left hand).

    Camera-frame points are ``R S p + t_mm`` with ``S = diag(-1, 1, 1)`` for a left hand.
    """

    times_s: Array  # (F,)
    theta: Array  # (F, 20)
    R: Array  # (F, 3, 3)
    t_mm: Array  # (F, 3)
    keypoints_mm: Array  # (F, 21, 3)
    keypoints_px: Array  # (F, 21, 2)
    visible: NDArray[np.bool_]  # (F,) at least half of the keypoints are in the image
    mask: NDArray[np.uint8]  # (F, H, ceil(W / 8)) of the bare skin, np.packbits
    camera: Camera
    side: str
    fps: float

    def save(self, path: Path) -> None:
        """Write an ``.npz`` that needs no pickle."""
        values = {k: v for k, v in self.__dict__.items() if k != "camera"}
        camera = np.array(
            [
                self.camera.fx_px,
                self.camera.fy_px,
                self.camera.cx_px,
                self.camera.cy_px,
                self.camera.width_px,
                self.camera.height_px,
            ]
        )
        np.savez_compressed(path, camera=camera, **values)

    @classmethod
    def load(cls, path: Path) -> "Truth":
        """Read what :meth:`save` wrote."""
        with np.load(path, allow_pickle=False) as data:
            values = {name: data[name] for name in data.files}
        fx, fy, cx, cy, width, height = values.pop("camera").tolist()
        camera = Camera(fx, fy, cx, cy, int(width), int(height))
        side, fps = str(values.pop("side")), float(values.pop("fps"))
        return cls(camera=camera, side=side, fps=fps, **values)


def truth_of(scene: Scene, actor: Actor, film: Film, mask: NDArray[np.uint8]) -> Truth:
    """The truth of a scene that moves as ``film`` does, one row a frame."""
    points, theta = actor.bent(film.theta)
    points = points * mirror(scene.side)
    points = np.einsum("fij,fkj->fki", film.R, points) + film.t_mm[:, None]
    px = scene.camera.project(points)
    inside = ((px > 0) & (px < (scene.width_px - 1, scene.height_px - 1))).all(axis=-1)
    return Truth(
        times_s=film.times_s,
        theta=theta,
        R=film.R,
        t_mm=film.t_mm,
        keypoints_mm=points,
        keypoints_px=px,
        visible=inside.mean(axis=1) >= 0.5,
        mask=mask,
        camera=scene.camera,
        side=scene.side,
        fps=scene.fps,
    )


def frames(scene: Scene, actor: Actor) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.bool_]]]:
    """The clip's images ``(H, W, 3)`` and masks ``(H, W)``, one after another."""
    look, motion = scene.look, scene.motion
    motion_rng, scenery_rng, noise_rng = _streams(scene)
    film = motion.film(motion_rng, scene.fps, look.subframes, look.shutter)
    behind = background(look.background, scene.width_px, scene.height_px, scenery_rng)
    behind = behind.astype(np.float32)
    for first in range(0, motion.frames * look.subframes, look.subframes):
        layers = [
            actor.draw(film.theta[i], film.R[i], film.t_mm[i], film.wrist[i])
            for i in range(first, first + look.subframes)
        ]
        rgba = _average([layer.rgba for layer in layers])
        image = rgba[..., :3] + behind * (1.0 - rgba[..., 3:] / np.float32(255))
        mask = _average([layer.skin for layer in layers]) >= 0.5
        yield _sense(image, look.lens_blur_px, look.noise, noise_rng), mask


def _average(images: Sequence[NDArray[Any]]) -> NDArray[np.float32]:
    total = images[0].astype(np.float32)
    for image in images[1:]:
        total += image
    return total / np.float32(len(images)) if len(images) > 1 else total


def _streams(scene: Scene) -> list[np.random.Generator]:
    """Separate seeds for motion, scenery and noise, so that each can change alone."""
    return np.random.default_rng(scene.seed).spawn(3)


def _sense(
    image: NDArray[np.float32], blur_px: float, noise: float, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """What the sensor makes of the light: blur, noise that grows with brightness, 8 bits."""
    if blur_px > 0:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), blur_px), np.float32)
    if noise > 0:
        strength = np.sqrt(image * np.float32(0.75 / 255) + np.float32(0.25))
        strength *= rng.standard_normal(image.shape, dtype=np.float32)
        image = image + np.float32(noise) * strength
    return np.clip(image + np.float32(0.5), 0, 255).astype(np.uint8)


def write_clip(scene: Scene, folder: Path, progress: bool = False) -> Truth:
    """Render ``scene`` into ``folder``; returns the truth that was written there.

    Raises
    ------
    OutputError
        The folder cannot be written.
    NoGLError
        The smooth hand is asked for and there is no OpenGL.
    """
    scene = scene.settled()
    film = scene.motion.film(_streams(scene)[0], scene.fps)
    with make_actor(scene) as actor:
        _make(folder)
        masks = _film(scene, actor, folder / "clip.mp4", progress)
        truth = truth_of(scene, actor, film, np.array(masks))
    truth.save(folder / "truth.npz")
    if scene.surface != "model":
        shape = as_hand_shape(HandSpec.named(scene.hand), scene.surface)
        shape.save(folder / "shape.toml")
    scene.camera.save(folder / "camera.toml", source="synthetic truth")
    (folder / "scene.toml").write_text(tomli_w.dumps(asdict(scene)), encoding="utf-8")
    return truth


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot make the folder ({error.strerror})") from error


def _film(scene: Scene, actor: Actor, path: Path, progress: bool) -> list[NDArray[np.uint8]]:
    """Write the clip; returns its masks, packed."""
    masks = []
    hidden = not (progress and sys.stderr.isatty())
    with (
        _Encoder(path, scene) as encoder,
        tqdm(total=scene.motion.frames, unit="frame", disable=hidden) as bar,
    ):
        for image, mask in frames(scene, actor):
            encoder.add(image)
            masks.append(np.packbits(mask, axis=-1))
            bar.update()
    return masks


class _Encoder:
    """H.264 in MP4, one thread, nothing in the file that changes from run to run."""

    def __init__(self, path: Path, scene: Scene) -> None:
        self._container = av.open(str(path), "w", options={"fflags": "+bitexact"})
        rate = Fraction(scene.fps).limit_denominator(1001)
        self._stream = self._container.add_stream("libx264", rate=rate)
        self._stream.width, self._stream.height = scene.width_px, scene.height_px
        self._stream.pix_fmt = "yuv420p"
        self._stream.thread_count = 1
        options: dict[str, object] = {"crf": str(scene.look.crf), "preset": "veryfast"}
        # x264 weighs blocks of 16 pixels by what later frames take from them, eight at a time, and
        # at the end of a row that eight do not fill by whatever lies in memory behind it
        if -(-scene.width_px // 16) % 8:
            options["x264-params"] = "mbtree=0"
        self._stream.options = options

    def __enter__(self) -> "_Encoder":
        return self

    def add(self, image: NDArray[np.uint8]) -> None:
        frame = av.VideoFrame.from_ndarray(image, format="rgb24")
        self._container.mux(self._stream.encode(frame))

    def __exit__(self, *_: object) -> None:
        self._container.mux(self._stream.encode())
        self._container.close()
