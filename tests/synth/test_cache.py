"""Clips that are kept: made once, and by several processes at a time."""

from pathlib import Path
from unittest.mock import patch

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
