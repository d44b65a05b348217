"""``handtrack synth`` and ``handtrack demo``."""

from dataclasses import dataclass, replace
from pathlib import Path

import tyro

from handtrack.bench.metrics import score
from handtrack.bench.tracks import read_track, read_truth
from handtrack.run import RunSettings, run_clip
from synth.clip import write_clip
from synth.render import NoGLError
from synth.scene import Scene


@dataclass(frozen=True)
class Synth:
    """Make a film of a hand whose every angle is known.

    Writes clip.mp4, truth.npz (angles, palm pose, keypoints, mask), shape.toml, camera.toml and
    scene.toml.
    """

    scene: tyro.conf.Positional[str]
    """A scene file, or the name of a ready scene (clean, turning, clutter, ...)."""
    out: Path | None = None
    """Folder for the results; default: the scene's name with .synth, here."""
    seed: int | None = None
    """Another seed than the scene's."""
    frames: int | None = None
    """Another length than the scene's."""
    quiet: bool = False
    """No progress bar."""

    def __call__(self) -> int:
        """Render; the exit code is 0."""
        is_file = self.scene.endswith(".toml") or Path(self.scene).is_file()
        scene = Scene.load(self.scene) if is_file else Scene.named(self.scene)
        if self.seed is not None:
            scene = replace(scene, seed=self.seed)
        if self.frames is not None:
            scene = replace(scene, motion=replace(scene.motion, frames=self.frames))
        out = self.out or Path(f"{Path(self.scene).stem}.synth")
        truth = write_clip(scene, out, progress=not self.quiet)
        print(f"{out / 'clip.mp4'}: {len(truth.theta)} frames, truth in {out / 'truth.npz'}")
        return 0


@dataclass(frozen=True)
class Demo:
    """Make a clip, follow the hand in it, and say how far off the result is.

    Needs no input. Without OpenGL the clip shows the cardboard hand, which is drawn in software.
    """

    out: Path = Path("demo")
    """Folder for the clip and the results."""
    frames: int = 120
    """Length of the clip."""
    seed: int = 1
    """Seed of the clip."""
    quiet: bool = False
    """No progress bar."""

    def __call__(self) -> int:
        """Render, track, compare; the exit code is that of the tracking."""
        scene, clip = Scene.named("turning", self.seed), self.out / "clip"
        scene = replace(scene, motion=replace(scene.motion, frames=self.frames, tilt_deg=20.0))
        try:
            write_clip(scene, clip, progress=not self.quiet)
        except NoGLError as error:
            print(f"{error}; drawing the cardboard hand")
            scene = replace(scene, surface="cardboard", hand="average")
            write_clip(scene, clip, progress=not self.quiet)
        found = self.out / "found"
        report = run_clip(
            RunSettings(
                clip / "clip.mp4",
                out=found,
                camera=clip / "camera.toml",
                truth=clip / "truth.npz",
                quiet=self.quiet,
            )
        )
        print(report.last_line)
        truth = read_truth(clip / "truth.npz")
        print(_verdict(score(read_track(found / "keypoints.csv", len(truth)), truth)))
        for file, what in _WHERE_TO_LOOK.items():
            if (found / file).exists():
                print(f"  {found / file}: {what}")
        if (found / "report.html").exists():
            print(f"handtrack view {found} opens the report")
        return report.exit_code


_WHERE_TO_LOOK = {
    "overlay.mp4": "what was found, drawn over the clip",
    "report.html": "picture, layers, angles and their error",
    "angles.csv": "the table of angles",
    "motion.bvh": "the motion, for Blender",
}


def _verdict(scores: dict[str, float]) -> str:
    return (
        f"against the truth: angles between bones {scores['bend_deg']:.1f} deg, "
        f"palm {scores['palm_deg']:.1f} deg, keypoints {scores['keypoints_px']:.1f} px, "
        f"jitter {scores['jitter_deg']:.2f} deg (the hand's own {scores['jitter_truth_deg']:.2f}), "
        f"{100 * scores['tracked_share']:.0f} % of the frames tracked"
    )
