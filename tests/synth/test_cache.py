"""Clips that are kept: made once, and by several processes at a time."""

from pathlib import Path
from unittest.mock import patch

import pytest

from handtrack.errors import InputError
from synth import cache
from synth.cache import ClipCache


def written(out: Path, text: str) -> None:
    out.mkdir(parents=True)
    (out / "truth.npz").write_text(text)


def test_a_clip_is_made_once(tmp_path):
    with patch.object(cache, "write_clip", lambda scene, out: written(out, "mine")):
        first = ClipCache(tmp_path)("clean", 0)
    with patch.object(cache, "write_clip", lambda scene, out: written(out, "again")):
        assert ClipCache(tmp_path)("clean", 0) == first
    assert (first / "truth.npz").read_text() == "mine"
    assert [p.name for p in tmp_path.iterdir()] == [first.name]


def test_a_clip_that_another_process_made_meanwhile_stays(tmp_path):
    def slow(scene, out):
        written(out, "mine")
        with (
            patch.object(cache, "write_clip", lambda scene, out: written(out, "theirs")),
            patch.object(cache.os, "getpid", lambda: -1),
        ):
            ClipCache(tmp_path)("clean", 0)

    with patch.object(cache, "write_clip", slow):
        made = ClipCache(tmp_path)("clean", 0)
    assert (made / "truth.npz").read_text() == "theirs"
    assert [p.name for p in tmp_path.iterdir()] == [made.name]


def test_what_was_left_half_made_is_made_anew(tmp_path):
    with patch.object(cache, "write_clip", lambda scene, out: written(out, "whole")):
        made = ClipCache(tmp_path)("clean", 0)
        (made / "truth.npz").unlink()
        (made / "clip.mp4").write_text("half")
        assert ClipCache(tmp_path)("clean", 0) == made
    assert (made / "truth.npz").read_text() == "whole"
    assert not (made / "clip.mp4").exists()


def test_scenes_of_other_hands_are_filmed_with_those_that_are_named(tmp_path):
    hand, people, scenes = tmp_path / "hand.glb", tmp_path / "people", []

    def noted(scene, out):
        scenes.append(scene)
        written(out, "")

    with patch.object(cache, "write_clip", noted):
        ClipCache(tmp_path / "a", model=hand, makehuman=people)("people", 0)
        ClipCache(tmp_path / "b", makehuman=people)("model", 0)
    assert [Path(scene.model) for scene in scenes] == [hand, people]
    assert [scene.look.body for scene in scenes] == [str(people), ""]


def test_nor_are_they_without(tmp_path):
    with pytest.raises(InputError, match="name one with --model"):
        ClipCache(tmp_path)("model", 0)
    with pytest.raises(InputError, match="MakeHuman's folder"):
        ClipCache(tmp_path, model=tmp_path)("people", 0)
