"""``handtrack calibrate hand`` as a user meets it."""

import cv2
import numpy as np
import pytest

from calib.card import find_card
from handtrack.cli import main
from handtrack.hand.shape import HandShape


@pytest.fixture(scope="module")
def photograph(open_hand, tmp_path_factory):
    """A skin-coloured drawn right hand on a noisy grey wall, and what is true of it."""
    rng = np.random.default_rng(9)
    hand = open_hand(rng, tilt_deg=0.0, turn_deg=20.0, height_px=220)
    wall = np.full((*hand.mask.shape, 3), 120.0)
    soft = cv2.GaussianBlur(hand.mask.astype(np.float32), (3, 3), 0.6)[..., None]
    image = soft * (205, 150, 125) + (1 - soft) * wall + rng.normal(0, 3, wall.shape)
    path = tmp_path_factory.mktemp("hand") / "Hand, geöffnet.png"
    data = cv2.imencode(".png", np.clip(image, 0, 255).astype(np.uint8)[..., ::-1])[1]
    path.write_bytes(data.tobytes())
    return path, hand


def test_photograph(photograph, tmp_path, capsys):
    path, hand = photograph
    out = tmp_path / "mine.toml"
    assert main(["calibrate", "hand", str(path), "-o", str(out)]) == 0
    shape = HandShape.load(out)
    assert shape.calibrated
    assert path.name in shape.source
    error = np.log(shape.length_mm.sum(axis=1) / hand.shape.length_mm.sum(axis=1))
    assert np.abs(error).max() < 0.08
    said = capsys.readouterr().out
    assert "right hand" in said
    assert "one camera cannot see size" in said
    picture = cv2.imread(str(out.with_suffix(".png")))
    assert picture is not None
    assert picture.std() > 20


def test_known_length(photograph, tmp_path):
    path, _ = photograph
    out = tmp_path / "mine.toml"
    arguments = ["calibrate", "hand", str(path), "-o", str(out), "--hand-length-mm", "170"]
    assert main(arguments) == 0
    shape = HandShape.load(out)
    assert shape.palm_length_mm + shape.length_mm[2].sum() == pytest.approx(170, abs=1e-3)


@pytest.fixture(scope="module")
def with_card(photograph):
    """The photograph with a card beside the hand, in the plane of its palm."""
    path, hand = photograph
    image = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_COLOR)
    middle = hand.pose @ np.array([0.0, 0.5 * hand.shape.palm_length_mm, 0.0])
    px_per_mm = hand.camera.fx_px / middle[2]
    turn = np.radians(12)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (85.60 / 2, 53.98 / 2) * px_per_mm
    fine = np.zeros((image.shape[0] * 4, image.shape[1] * 4), np.uint8)
    corners = box @ R.T + (85, 390)
    cv2.fillPoly(fine, [np.round(((corners + 0.5) * 4 - 0.5) * 16).astype(np.int32)], 255, shift=4)
    share = cv2.resize(fine, image.shape[1::-1], interpolation=cv2.INTER_AREA)[..., None] / 255
    drawn = (share * (170, 60, 40) + (1 - share) * image).astype(np.uint8)
    target = path.with_name("with card.png")
    target.write_bytes(cv2.imencode(".png", drawn)[1].tobytes())
    return target, corners, px_per_mm


def test_card_is_measured(with_card):
    path, corners, px_per_mm = with_card
    card = find_card(cv2.imread(str(path))[..., ::-1].copy())
    assert card.mm_per_px == pytest.approx(1 / px_per_mm, rel=0.004)
    distance = np.linalg.norm(card.corners_px[:, None] - corners, axis=-1).min(axis=1)
    assert distance.max() < 1.0


def test_card_sets_the_scale(photograph, with_card, tmp_path):
    out = tmp_path / "mine.toml"
    assert main(["calibrate", "hand", str(with_card[0]), "-o", str(out), "--card"]) == 0
    shape, truth = HandShape.load(out), photograph[1].shape
    length = [s.palm_length_mm + s.length_mm[2].sum() for s in (shape, truth)]
    assert length[0] == pytest.approx(length[1], rel=0.03)
    assert "bank card" in shape.source


def test_no_card_is_said(photograph, tmp_path, capsys):
    assert main(["calibrate", "hand", str(photograph[0]), "--card"]) == 4
    assert "no bank card beside the hand" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "code", "text"),
    [
        (["--side", "left"], 4, "the thumb is on the other side"),
        (["--hand-length-mm", "20"], 2, "wanted 50 to 350"),
        (["--hand-length-mm", "180", "--card"], 2, "give one of them"),
        (["--camera", "none.toml"], 2, "none.toml"),
        (["-o", "no/such/folder/hand.toml"], 3, "no/such/folder"),
    ],
)
def test_refusals(photograph, tmp_path, monkeypatch, capsys, options, code, text):
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", "hand", str(photograph[0]), *options]) == code
    assert text in capsys.readouterr().err
    assert not list(tmp_path.rglob("*.toml"))


@pytest.mark.parametrize("content", [None, b"", b"not a picture"])
def test_unreadable_pictures(tmp_path, capsys, content):
    path = tmp_path / "odd.jpg"
    if content is not None:
        path.write_bytes(content)
    assert main(["calibrate", "hand", str(path), "-o", str(tmp_path / "h.toml")]) == 2
    assert "odd.jpg" in capsys.readouterr().err


def test_no_hand_in_a_clip(write_clip, tmp_path, capsys):
    clip = write_clip(tmp_path / "none.mp4", n=2)
    out = tmp_path / "h.toml"
    assert main(["calibrate", "hand", str(clip), "-o", str(out), "--quiet"]) == 4
    assert "no open palm in the 2 picture(s)" in capsys.readouterr().err
    assert not out.exists()


def test_a_frame_that_is_not_there(write_clip, tmp_path, capsys):
    clip = write_clip(tmp_path / "none.mp4", n=2)
    assert main(["calibrate", "hand", str(clip), "--frame", "7", "--quiet"]) == 2
    assert "frames 0 to 1" in capsys.readouterr().err
