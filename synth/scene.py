"""A scene: everything that decides the bytes of a clip, in one frozen record and one TOML file.

>>> scene = Scene.from_dict({"seed": 3, "motion": {"tilt_deg": 40.0}})
>>> scene.motion.tilt_deg, scene.side
(40.0, 'right')
"""

import tomllib
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from handtrack.camera import Camera
from handtrack.errors import InputError
from synth.background import KINDS
from synth.handspec import HAND_NAMES
from synth.motion import Motion
from synth.tones import TONES

SCENES_DIR = Path(__file__).parent / "scenes"


@dataclass(frozen=True)
class Light:
    """One lamp, in the camera frame.

    Parameters
    ----------
    kind : "sun", "spot" or "point"
        Parallel light; a cone of it; a bulb. Sun and spot throw shadows.
    from_mm, at_mm : (float, float, float)
        Where it comes from, and where it points.
    intensity : float
        1 lights white skin fully at ``at_mm``.
    colour : (float, float, float)
        RGB, 0 to 1.
    """

    kind: Literal["sun", "spot", "point"] = "sun"
    from_mm: tuple[float, float, float] = (-300.0, -500.0, -400.0)
    at_mm: tuple[float, float, float] = (0.0, 0.0, 450.0)
    intensity: float = 0.6
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Look:
    """What the picture is like.

    Parameters
    ----------
    skin : str
        A tone of `synth.tones.TONES`, or ``"any"``.
    forearm : "stub", "bare", "sleeve" or "any"
        It ends below the wrist; it is bare and leaves the image; it is clothed.
    background : str
        A kind of `synth.background.KINDS`, ``"any"`` of them, or an image file.
    body : str
        MakeHuman's folder, if somebody's face and shirt shall be behind the hand that is a model's.
    lights : tuple of Light
        Lamps; ``ambient`` lights everything alike. Without any the seed decides on both.
    noise : float
        Standard deviation of the sensor's noise at full white, of 255.
    lens_blur_px : float
        Standard deviation of the lens's blur.
    subframes : int
        Instants averaged while the shutter (a share of the frame time) is open: motion blur.
    crf : int
        H.264 quality, 0 (lossless) to 51.
    """

    skin: str = "light"
    forearm: Literal["stub", "bare", "sleeve", "any"] = "stub"
    background: str = "plain"
    body: str = ""
    lights: tuple[Light, ...] = (
        Light(),
        Light("point", from_mm=(350.0, -100.0, -100.0), intensity=0.15),
    )
    ambient: float = 0.45
    noise: float = 2.5
    lens_blur_px: float = 0.6
    subframes: int = 1
    shutter: float = 0.5
    crf: int = 20


@dataclass(frozen=True)
class Scene:
    """A clip to be made.

    Parameters
    ----------
    seed : int
        Decides everything that is random: motion, scenery, noise, and what is ``"any"``.
    hand : str
        One of `synth.handspec.HAND_NAMES`, or ``"any"``.
    side : "right", "left" or "any"
    surface : "smooth", "cardboard", "spheres" or "model"
        The skinned hand, the paper's flat patches, or swept balls (these need no OpenGL), or a hand
        that somebody else modelled.
    model : str
        That hand's file (:mod:`synth.webxr`) or folder (:mod:`synth.makehuman`).
    """

    seed: int = 0
    hand: str = "average"
    side: Literal["right", "left", "any"] = "right"
    surface: Literal["smooth", "cardboard", "spheres", "model"] = "smooth"
    model: str = ""
    width_px: int = 640
    height_px: int = 480
    focal_px: float = 600.0
    fps: float = 30.0
    motion: Motion = field(default_factory=Motion)
    look: Look = field(default_factory=Look)

    def __post_init__(self) -> None:
        for name in ("width_px", "height_px"):
            if (n := getattr(self, name)) < 16 or n % 2:
                raise InputError(f"scene: {name} = {n}, wanted an even number from 16 (H.264)")
        checks = {
            "fps": self.fps > 0,
            "focal_px": self.focal_px > 0,
            "motion.frames": self.motion.frames >= 1,
            "motion.distance_mm": self.motion.distance_mm >= 250,
            "motion.pace_s": 0 < self.motion.pace_s[0] <= self.motion.pace_s[1],
            "look.subframes": self.look.subframes >= 1,
            "look.crf": 0 <= self.look.crf <= 51,
            "look.noise": self.look.noise >= 0,
            "look.body": self.surface == "model" or not self.look.body,
        }
        if wrong := [name for name, fine in checks.items() if not fine]:
            raise InputError(f"scene: {', '.join(wrong)} out of range")

    @property
    def camera(self) -> Camera:
        """The camera, principal point in the middle."""
        f, w, h = self.focal_px, self.width_px, self.height_px
        return Camera(f, f, (w - 1) / 2, (h - 1) / 2, w, h)

    def settled(self) -> "Scene":
        """The same scene with every ``"any"`` decided by its seed."""
        rng = np.random.default_rng([self.seed, 2])
        hand = _decided(self.hand, HAND_NAMES, rng)
        skin = _decided(self.look.skin, tuple(TONES), rng)
        forearm = _decided(self.look.forearm, ("bare", "sleeve"), rng)
        background = _decided(self.look.background, KINDS, rng)
        side = _decided(self.side, ("right", "left"), rng)
        facing = _decided(self.motion.facing, ("palm", "palm", "palm", "back"), rng)
        look = replace(self.look, skin=skin, forearm=forearm, background=background)
        motion = replace(self.motion, facing=facing)
        return replace(self, hand=hand, side=side, motion=motion, look=look)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], name: str = "scene") -> "Scene":
        """A scene from nested tables; unknown keys and wrong types are refused."""
        return typing.cast(Scene, _build(cls, values, name))

    @classmethod
    def load(cls, path: str | Path) -> "Scene":
        """Read a scene file.

        Raises
        ------
        InputError
            It cannot be read, is not TOML, or has a key that means nothing.
        """
        try:
            values = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"{path}: cannot read the scene ({error.strerror})") from error
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise InputError(f"{path}: not a TOML file ({error})") from error
        return cls.from_dict(values, str(path))

    @classmethod
    def named(cls, name: str, seed: int | None = None) -> "Scene":
        """A ready scene of ``synth/scenes``, with another seed if one is given."""
        path = SCENES_DIR / f"{name}.toml"
        if not path.is_file():
            raise InputError(f"no scene named '{name}'; there are {', '.join(scene_names())}")
        scene = cls.load(path)
        return scene if seed is None else replace(scene, seed=seed)


def scene_names() -> list[str]:
    """The ready scenes."""
    return sorted(path.stem for path in SCENES_DIR.glob("*.toml"))


def _decided(value: str, choices: Sequence[str], rng: np.random.Generator) -> Any:
    """``value``, or if it is ``"any"`` one of the choices, which are drawn from in either case."""
    choice = str(rng.choice(choices))
    return choice if value == "any" else value


def _build(kind: Any, value: Any, name: str) -> Any:
    """``value`` of a TOML file as ``kind``, a dataclass or the type of one of its fields."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if isinstance(kind, type) and is_dataclass(kind):
        if not isinstance(value, Mapping):
            raise InputError(f"{name}: wanted a table, found {value!r}")
        known = {f.name for f in fields(kind)}
        if stray := sorted(set(value) - known):
            raise InputError(
                f"{name}: unknown key {', '.join(stray)} (known: {', '.join(sorted(known))})"
            )
        types_of = typing.get_type_hints(kind)
        return kind(**{k: _build(types_of[k], v, f"{name}: {k}") for k, v in value.items()})
    if origin is Literal:
        if value not in arguments:
            raise InputError(f"{name}: {value!r} is not one of {', '.join(map(repr, arguments))}")
        return value
    if origin is tuple:
        many = len(arguments) == 2 and arguments[1] is Ellipsis
        if not isinstance(value, list) or (not many and len(value) != len(arguments)):
            wanted = "a list" if many else f"a list of {len(arguments)}"
            raise InputError(f"{name}: wanted {wanted}, found {value!r}")
        kinds = [arguments[0]] * len(value) if many else arguments
        return tuple(_build(k, v, name) for k, v in zip(kinds, value, strict=True))
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise InputError(f"{name}: wanted {kind.__name__}, found {value!r}")
    return value
