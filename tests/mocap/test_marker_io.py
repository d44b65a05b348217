"""Marker files: round trips, an independent C3D reader, and files that are broken."""

import warnings

import c3d
import ezc3d
import numpy as np
import pytest

from handtrack.errors import InputError, OutputError
from handtrack.mocap.marker_io import SUFFIXES, read_markers, write_markers
from handtrack.mocap.markers import Gap, Markers

SINGLE_PRECISION_MM = 1e-4


@pytest.fixture
def markers() -> Markers:
    rng = np.random.default_rng(0)
    positions = rng.normal(0, 300, (40, 3, 3))
    positions[5:9, 1] = np.nan
    positions[39, 2] = np.nan
    return Markers(("thumb_tip", "index tip", "root_a"), positions, 120.0)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip_keeps_numbers_rate_names_and_gaps(markers, suffix, tmp_path):
    write_markers(markers, tmp_path / f"m{suffix}")
    back = read_markers(tmp_path / f"m{suffix}")
    exact = SINGLE_PRECISION_MM if suffix == ".c3d" else 0.0
    np.testing.assert_allclose(back.positions_mm, markers.positions_mm, atol=exact, rtol=0)
    assert (back.labels, back.unit) == (markers.labels, "mm")
    assert back.rate_hz == pytest.approx(120.0, abs=1e-3)
    assert back.gaps() == [Gap("index tip", 5, 8), Gap("root_a", 39, 39)]
    assert [p.name for p in tmp_path.iterdir()] == [f"m{suffix}"]


def test_an_independent_reader_sees_the_same_c3d(markers, tmp_path):
    write_markers(markers, tmp_path / "m.c3d")
    with (tmp_path / "m.c3d").open("rb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns that there are no analogue channels
        reader = c3d.Reader(file)
        points = np.array([p for _, p, _ in reader.read_frames()])
        assert reader.get("POINT:UNITS").string_value.strip() == "mm"
        assert [label.strip() for label in reader.point_labels] == list(markers.labels)
        assert reader.point_rate == 120.0
    seen = points[..., 3] >= 0
    np.testing.assert_array_equal(seen, markers.seen)
    np.testing.assert_allclose(
        points[..., :3][seen], markers.positions_mm[seen], atol=SINGLE_PRECISION_MM
    )


def test_metres_in_a_c3d_become_mm(markers, tmp_path):
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["UNITS"]["value"] = ["m"]
    file["parameters"]["POINT"]["RATE"]["value"] = [120.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(markers.labels)
    points = np.ones((4, 3, 40))
    points[:3] = markers.positions_mm.transpose(2, 1, 0) / 1000
    file["data"]["points"] = points
    file.write(str(tmp_path / "metres.c3d"))
    back = read_markers(tmp_path / "metres.c3d")
    np.testing.assert_allclose(back.positions_mm, markers.positions_mm, atol=1e-3)
    assert back.unit == "m"


def test_trc_in_metres_and_csv_in_cm_become_mm(markers, tmp_path):
    write_markers(markers, tmp_path / "m.trc")
    text = (tmp_path / "m.trc").read_text().replace("\tmm\t", "\tm\t")
    (tmp_path / "m.trc").write_text(text)
    back = read_markers(tmp_path / "m.trc")
    np.testing.assert_allclose(back.positions_mm, 1000 * markers.positions_mm)
    write_markers(markers, tmp_path / "m.csv")
    text = (tmp_path / "m.csv").read_text().replace("_mm", "_cm")
    (tmp_path / "m.csv").write_text(text)
    np.testing.assert_allclose(
        read_markers(tmp_path / "m.csv").positions_mm, 10 * markers.positions_mm
    )


@pytest.mark.parametrize("keep", [0, 100, 700, 1100, -300])
def test_a_cut_c3d_is_refused(markers, tmp_path, keep):
    write_markers(markers, tmp_path / "m.c3d")
    data = (tmp_path / "m.c3d").read_bytes()
    (tmp_path / "cut.c3d").write_bytes(data[:keep])
    with pytest.raises(InputError, match=r"cut\.c3d: .*(empty|not a C3D|cut short)"):
        read_markers(tmp_path / "cut.c3d")


@pytest.mark.parametrize("suffix", [".trc", ".tsv"])
def test_a_cut_text_is_refused(markers, tmp_path, suffix):
    write_markers(markers, tmp_path / f"m{suffix}")
    lines = (tmp_path / f"m{suffix}").read_text().splitlines()
    (tmp_path / f"cut{suffix}").write_text("\n".join(lines[:-10]))
    with pytest.raises(InputError, match="ends after 30 of the 40 frames"):
        read_markers(tmp_path / f"cut{suffix}")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.c3d", b"junk" * 300, "not a C3D"),
        ("a.trc", b"hello", "not a TRC"),
        ("a.tsv", b"NO_OF_FRAMES\t3\nx", "not a Qualisys"),
        ("a.csv", b"frame,tip_x\n1,2\n", "time_s"),
        ("a.csv", b"time_s,tip_x_ft,tip_y_ft,tip_z_ft\n0,1,2,3\n1,1,2,3\n", "unit"),
        ("a.csv", b"time_s,tip_x_mm,tip_y_mm\n0,1,2\n1,1,2\n", "tip_z_mm"),
        ("a.csv", b"time_s,t_x_mm,t_y_mm,t_z_mm\n0,,,\n1,,,\n", "no marker is seen"),
        ("a.csv", b"time_s,t_x_mm,t_y_mm,t_z_mm\n0,1,2,x\n1,1,2,3\n", "frame 1"),
        ("a.csv", b"\xff\xfe\x00\x81", "not text"),
        ("a.xyz", b"", "no marker format"),
    ],
)
def test_broken_files_get_one_line(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        read_markers(tmp_path / name)
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


def test_missing_file_and_folder(markers, tmp_path):
    with pytest.raises(InputError, match="No such file"):
        read_markers(tmp_path / "no.c3d")
    with pytest.raises(OutputError, match="cannot write"):
        write_markers(markers, tmp_path / "no" / "m.c3d")
    with pytest.raises(InputError, match="no marker format"):
        write_markers(markers, tmp_path / "m.txt")


def test_unknown_and_repeated_names(markers):
    with pytest.raises(InputError, match=r"no marker pinky; there are thumb_tip"):
        markers.select(["pinky"])
    with pytest.raises(InputError, match="more than once"):
        Markers(("a", "a"), np.zeros((2, 2, 3)), 100.0)


def test_resampling_keeps_a_straight_line_straight_and_gaps_missing():
    x = np.arange(20.0)[:, None, None] * np.ones(3)
    x[10] = np.nan
    half = Markers(("a",), x, 100.0).resampled(50.0)
    np.testing.assert_allclose(half.positions_mm[:5, 0, 0], [0, 2, 4, 6, 8])
    assert np.isnan(half.positions_mm[5]).all()
    double = Markers(("a",), x, 100.0).resampled(200.0)
    np.testing.assert_allclose(double.positions_mm[:4, 0, 0], [0, 0.5, 1, 1.5])
    assert np.isnan(double.positions_mm[19:22]).all()


def test_c3d_says_unseen_by_its_residual(tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    positions = np.arange(12.0).reshape(2, 2, 3)
    positions[1, 0] = np.nan
    write_markers(Markers(("a", "b"), positions, 30.0), tmp_path / "a.c3d")
    residuals = ezc3d.c3d(str(tmp_path / "a.c3d"))["data"]["meta_points"]["residuals"][0].T
    assert residuals.tolist() == [[0, 0], [-1, 0]]
    np.testing.assert_allclose(read_markers(tmp_path / "a.c3d").positions_mm, positions)
