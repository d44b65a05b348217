"""Clips are made once: a folder per scene, named after everything that decides its bytes."""

import hashlib
import os
import shutil
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path

import tomli_w

from handtrack.errors import InputError
from synth.clip import write_clip
from synth.scene import Scene

_SOURCES = Path(__file__).parent


@dataclass(frozen=True)
class ClipCache:
    """Ready scenes, rendered into ``folder`` when they are first asked for."""

    folder: Path
    frames: int | None = None  # cut or lengthen every clip to so many
    recordings: tuple[Path, ...] = ()  # that fingers replay, in turn; none: as the scene says
    model: Path | None = None  # another maker's hand, for scenes that film one; none: of people
    makehuman: Path | None = None  # MakeHuman's folder, for scenes with somebody's body

    def __call__(self, condition: str, seed: int) -> Path:
        """The folder of ready scene ``condition``, its seed counted on from the scene's own."""
        scene = Scene.named(condition)
        scene = replace(scene, seed=1000 * scene.seed + seed)
        if self.frames is not None:
            scene = replace(scene, motion=replace(scene.motion, frames=self.frames))
        if self.recordings:
            replayed = str(self.recordings[seed % len(self.recordings)].resolve())
            motion = replace(scene.motion, fingers="recording", recording=replayed)
            scene = replace(scene, motion=motion)
        if scene.surface == "model":
            scene = self._cast(scene)
        made = self.folder / f"{condition}-{seed}-{key_of(scene)}"
        if not _is_whole(made):
            part = made.with_name(f".{made.name}-{os.getpid()}.part")  # others may make it too
            shutil.rmtree(part, ignore_errors=True)
            write_clip(scene, part)
            _put_in_place(part, made)
        return made

    def _cast(self, scene: Scene) -> Scene:
        """The scene with the hand that is filmed, and somebody behind it if it wants that."""
        if (hand := self.model or self.makehuman) is None:
            raise InputError("another maker's hand is filmed: name one with --model or --makehuman")
        if scene.look.body and self.makehuman is None:
            raise InputError(
                "somebody stands behind the hand: --makehuman wants MakeHuman's folder"
            )
        body = str(self.makehuman.resolve()) if scene.look.body and self.makehuman else ""
        return replace(scene, model=str(hand.resolve()), look=replace(scene.look, body=body))


def _is_whole(made: Path) -> bool:
    return (made / "truth.npz").is_file()


def _put_in_place(part: Path, made: Path) -> None:
    """Rename a clip that is whole; one that another process has put there meanwhile stays."""
    if not _is_whole(made):
        shutil.rmtree(made, ignore_errors=True)
    try:
        part.rename(made)
    except OSError:
        if not _is_whole(made):
            raise
        shutil.rmtree(part)


def key_of(scene: Scene) -> str:
    """Ten hex digits that change with the scene, and with the program that draws it."""
    text = tomli_w.dumps(asdict(scene)) + _program()
    return hashlib.sha256(text.encode()).hexdigest()[:10]


@cache
def _program() -> str:
    files = sorted(p for p in _SOURCES.rglob("*") if p.suffix in (".py", ".toml"))
    drawing = [
        p
        for p in files
        if p.parent.name != "scenes" and p.stem not in ("commands", "cache", "draws", "pictures")
    ]
    return hashlib.sha256(b"".join(p.read_bytes() for p in drawing)).hexdigest()
