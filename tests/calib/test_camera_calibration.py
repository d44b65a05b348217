"""Cameras from rendered boards with known intrinsics; boards at true size; bad sets refused."""

import re
from fractions import Fraction
from itertools import pairwise

import av
import cv2
import numpy as np
import pytest

from calib.board import PAPER_MM, Board
from calib.camera import MIN_VIEWS, View, calibrate_camera, collect_views, keystone
from handtrack import rotation
from handtrack.camera import Camera
from handtrack.cli import main
from handtrack.errors import InputError, NothingUsableError

TRUTH = Camera(700.0, 706.0, 325.0, 236.0, 640, 480)
FINER = 2


def render(board: Board, camera: Camera, R: np.ndarray, t_mm: np.ndarray) -> np.ndarray:
    """The board on grey ``(h, w, 3)``, its top left corner at the palm-like origin of ``R, t``."""
    px_per_module = 8
    texture = np.where(board.modules(), 20, 235).astype(np.uint8)
    texture = np.kron(texture, np.ones((px_per_module, px_per_module), np.uint8))
    margin = 4 * px_per_module
    texture = np.pad(texture, margin, constant_values=235)
    mm = board.square_mm / 8 / px_per_module
    to_board = np.array([[mm, 0, mm * (0.5 - margin)], [0, mm, mm * (0.5 - margin)], [0, 0, 1.0]])
    fine = np.array([[FINER, 0, (FINER - 1) / 2], [0, FINER, (FINER - 1) / 2], [0, 0, 1.0]])
    H = fine @ camera.matrix @ np.column_stack([R[:, 0], R[:, 1], t_mm]) @ to_board
    size = (camera.width_px * FINER, camera.height_px * FINER)
    drawn = cv2.warpPerspective(texture, H, size, flags=cv2.INTER_AREA, borderValue=120)
    drawn = cv2.resize(drawn, (camera.width_px, camera.height_px), interpolation=cv2.INTER_AREA)
    return np.repeat(drawn[..., None], 3, axis=2)


def poses(board: Board, rng: np.random.Generator, n: int, tilt_deg: float = 35.0):
    centre = np.array([board.columns, board.rows, 0]) * board.square_mm / 2
    for _ in range(n):
        turn = np.radians(rng.uniform(-1, 1, 3) * (tilt_deg, tilt_deg, 30))
        R = rotation.exp(turn)
        where = np.array([rng.uniform(-75, 75), rng.uniform(-55, 55), rng.uniform(330, 560)])
        yield R, where - R @ centre


def rendered(board: Board, n: int = 16, seed: int = 0, **options: float):
    rng = np.random.default_rng(seed)
    for k, (R, t) in enumerate(poses(board, rng, n, **options)):
        yield k, render(board, TRUTH, R, t)


@pytest.mark.parametrize("markers", [True, False])
def test_known_camera(markers):
    board = Board(markers=markers)
    views, n_seen = collect_views(rendered(board, 24 if markers else 12), board)
    found = calibrate_camera(views, board, 640, 480)
    assert n_seen >= len(views) >= MIN_VIEWS
    assert found.camera.fx_px == pytest.approx(TRUTH.fx_px, rel=0.005)
    assert found.camera.fy_px == pytest.approx(TRUTH.fy_px, rel=0.005)
    assert found.camera.cx_px == pytest.approx(TRUTH.cx_px, abs=4.0)
    assert found.camera.cy_px == pytest.approx(TRUTH.cy_px, abs=4.0)
    assert found.reprojection_px < 0.3
    assert found.distortion_px < 3.0
    assert not found.camera.assumed


def exact_views(board: Board, n: int, rng: np.random.Generator, noise_px: float = 0.1, **options):
    for R, t in poses(board, rng, n, **options):
        corners = TRUTH.project(board.corners_mm @ R.T + t)
        noisy = corners + rng.normal(0, noise_px, corners.shape)
        yield View(noisy, np.arange(len(noisy)))


def test_stated_uncertainty_covers_the_error():
    """Over 12 sets, the focal length lies within three of its own standard deviations."""
    board = Board()
    off = []
    for seed in range(12):
        views = list(exact_views(board, 10, np.random.default_rng(seed), noise_px=0.2))
        found = calibrate_camera(views, board, 640, 480)
        off.append((found.camera.fx_px / TRUTH.fx_px - 1) / found.focal_std)
    assert np.sqrt(np.mean(np.square(off))) < 2.0
    assert np.abs(off).max() < 4.0


def test_too_few_views_are_refused():
    board = Board()
    views = list(exact_views(board, MIN_VIEWS - 1, np.random.default_rng(0)))
    with pytest.raises(NothingUsableError, match="different views"):
        calibrate_camera(views, board, 640, 480)


@pytest.mark.parametrize("tilt_deg", [0.0, 0.3, 1.0, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_frontal_views_do_not_tell_the_focal_length(tilt_deg, seed):
    board = Board()
    rng = np.random.default_rng(seed)
    views = list(exact_views(board, 10, rng, tilt_deg=tilt_deg, noise_px=0.3))
    with pytest.raises(NothingUsableError, match="tilt the board"):
        calibrate_camera(views, board, 640, 480)


def test_keystone_is_the_tilt():
    """A board turned about its y axis by 30 deg: sin(30) times half its width over the distance."""
    board = Board()
    half = np.array([board.columns, board.rows, 0]) * board.square_mm / 2
    R = rotation.about_y(np.radians(30))
    corners = TRUTH.project(board.corners_mm @ R.T + np.array([0, 0, 500.0]) - R @ half)
    share = keystone(View(corners, np.arange(len(corners))), board)
    assert share == pytest.approx(0.5 * np.hypot(*half[:2]) / 500, rel=1e-3)


def test_a_board_in_one_corner_is_refused():
    board = Board()
    views = [
        View(v.corners_px * 0.3, v.which) for v in exact_views(board, 10, np.random.default_rng(0))
    ]
    with pytest.raises(NothingUsableError, match="of the picture only"):
        calibrate_camera(views, board, 640, 480)


def test_another_board_is_refused():
    board = Board()
    views = list(exact_views(board, 10, np.random.default_rng(0)))
    wrong = Board(columns=6, rows=9)
    with pytest.raises(NothingUsableError, match="columns and rows"):
        calibrate_camera(views, wrong, 640, 480)


def test_views_that_hardly_differ_count_once():
    board = Board()
    image = next(rendered(board, 1))[1]
    views, n_seen = collect_views([(k, image) for k in range(5)], board)
    assert (len(views), n_seen) == (1, 5)


@pytest.mark.parametrize("paper", sorted(PAPER_MM))
def test_the_sheet_has_its_true_size(tmp_path, paper):
    Board(columns=7, rows=5).save_pdf(tmp_path / "board.pdf", paper)
    box = re.search(
        rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", (tmp_path / "board.pdf").read_bytes()
    )
    size_mm = [float(v) / 72 * 25.4 for v in box.groups()]
    np.testing.assert_allclose(size_mm, PAPER_MM[paper], atol=0.01)


def test_the_drawn_squares_have_their_true_size():
    board = Board(columns=7, rows=5, square_mm=25.0)
    figure = board._figure("a4")
    [axes] = figure.axes
    np.testing.assert_allclose(axes.get_position().bounds, (0, 0, 1, 1))
    np.testing.assert_allclose(axes.transData.transform((25.4, 0))[0], figure.dpi)  # an inch
    x = np.concatenate([path.vertices[:, 0] for path in axes.collections[0].get_paths()])
    assert np.ptp(x) == pytest.approx(7 * 25.0)


def test_the_drawing_is_found_where_it_is():
    for board in (Board(), Board(columns=7, rows=5), Board(columns=8, rows=5)):
        picture = np.kron(np.where(board.modules(), 0, 255).astype(np.uint8), np.ones((5, 5)))
        picture = np.pad(picture.astype(np.uint8), 30, constant_values=255)
        corners, which = board.find(picture)
        expected = board.corners_mm[which, :2] / board.square_mm * 40 + 29.5
        assert len(which) == len(board.corners_mm)
        np.testing.assert_allclose(corners, expected, atol=0.1)


@pytest.mark.parametrize("options", [{"columns": 2}, {"rows": 41}, {"square_mm": float("nan")}])
def test_impossible_boards_are_refused(options):
    with pytest.raises(InputError, match="wanted"):
        Board(**options)


def test_a_board_larger_than_the_sheet_is_refused(tmp_path):
    with pytest.raises(InputError, match="does not fit"):
        Board(square_mm=60.0).save_pdf(tmp_path / "board.pdf")


@pytest.fixture(scope="module")
def board_clip(tmp_path_factory):
    """A clip that moves from pose to pose, two frames each way."""
    board, path = Board(), tmp_path_factory.mktemp("board") / "board.mp4"
    stops = list(poses(board, np.random.default_rng(4), 10))
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25, options={"crf": "16"})
        stream.width, stream.height, stream.pix_fmt = 640, 480, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 25)
        for (Ra, ta), (Rb, tb) in pairwise(stops):
            for share in np.linspace(0, 1, 2, endpoint=False):
                R = Ra @ rotation.exp(share * rotation.log(Ra.T @ Rb))
                image = render(board, TRUTH, R, (1 - share) * ta + share * tb)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode(None))
    return path


def test_the_command(board_clip, tmp_path, capsys):
    out = tmp_path / "camera.toml"
    assert main(["calibrate", "camera", str(board_clip), "-o", str(out), "--quiet"]) == 0
    camera = Camera.load(out)
    assert camera.fx_px == pytest.approx(TRUTH.fx_px, rel=0.005)
    assert camera.fy_px == pytest.approx(TRUTH.fy_px, rel=0.005)
    said = re.search(r"reprojection error ([\d.]+) px", capsys.readouterr().out)
    assert said is not None
    assert float(said[1]) < 0.3
    assert "views of the board" in out.read_text()


def test_the_command_says_that_there_is_no_board(write_clip, tmp_path, capsys):
    clip = write_clip(tmp_path / "none.mp4", n=3)
    assert main(["calibrate", "camera", str(clip), "--quiet"]) == NothingUsableError.exit_code
    assert "the board is in none of the frames" in capsys.readouterr().err


def test_the_board_command(tmp_path, capsys):
    out = tmp_path / "b.pdf"
    assert main(["calibrate", "board", "-o", str(out), "--columns", "7", "--rows", "5"]) == 0
    assert out.read_bytes().startswith(b"%PDF")
    assert "7 x 5 squares of 28 mm" in capsys.readouterr().out
    assert main(["calibrate", "board", "-o", str(tmp_path / "no" / "b.pdf")]) == 3
