"""The tables: columns as the contract has them, bytes that repeat, and a full disk."""

import csv
import resource
import signal

import numpy as np
import pytest

from handtrack import rotation
from handtrack.errors import InputError, OutputError
from handtrack.hand.skeleton import ANGLE_NAMES, KEYPOINT_NAMES
from handtrack.output.table import ANGLES_CSV, KEYPOINTS_CSV, TableWriter, cell, read_tables
from handtrack.records import FrameResult, Status
from handtrack.trajectory import FRAME_SHAPES, Trajectory, angle_columns, keypoint_columns


def some_hand(n=6, seed=1):
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(n):
        if k == 2:
            rows.append(FrameResult.unknown(k, k / 30, Status.LOST, "left"))
            continue
        rows.append(
            FrameResult(
                index=k,
                time_s=k / 30,
                status=Status.PREDICTED if k == 3 else Status.TRACKED,
                side="left",
                confidence=rng.random(),
                ess=np.nan if k == 4 else 17.25,
                R=rotation.exp(rng.normal(size=3)),
                t_mm=rng.normal(0, 200, 3),
                theta=rng.normal(0, 0.7, 20),
                theta_std=rng.random(20),
                keypoints_px=rng.normal(300, 100, (21, 2)),
                keypoints_mm=rng.normal(0, 100, (21, 3)),
            )
        )
    return Trajectory.from_results(rows)


def write_tables(folder, *pieces):
    for name, columns in ((ANGLES_CSV, angle_columns), (KEYPOINTS_CSV, keypoint_columns)):
        table = TableWriter(folder / name, columns)
        for piece in pieces:
            table.write(piece)
        table.finish()


def test_columns_of_the_contract(tmp_path):
    write_tables(tmp_path, some_hand())
    header = (tmp_path / ANGLES_CSV).read_text().splitlines()[0].split(",")
    assert header == [
        *("frame", "time_s", "status", "side", "confidence", "ess"),
        *("palm_x_mm", "palm_y_mm", "palm_z_mm", "palm_qw", "palm_qx", "palm_qy", "palm_qz"),
        *(f"{name}_deg" for name in ANGLE_NAMES),
        *(f"{name}_std_deg" for name in ANGLE_NAMES),
    ]
    header = (tmp_path / KEYPOINTS_CSV).read_text().splitlines()[0].split(",")
    units = ("x_px", "y_px", "x_mm", "y_mm", "z_mm")
    assert header == [
        *("frame", "time_s", "status"),
        *(f"{name}_{unit}" for name in KEYPOINT_NAMES for unit in units),
    ]


def test_round_trip_to_the_stated_decimals(tmp_path):
    hand = some_hand()
    write_tables(tmp_path, hand)
    back = read_tables(tmp_path)
    for name in FRAME_SHAPES:
        found, wanted = getattr(back, name), getattr(hand, name)
        if wanted.dtype.kind == "f":
            atol = {"ess": 0.006, "keypoints_px": 6e-4, "palm_wxyz": 1e-8}.get(name, 6e-5)
            np.testing.assert_allclose(found, wanted, rtol=0, atol=atol, err_msg=name)
        else:
            np.testing.assert_array_equal(found, wanted)


def test_unknown_is_empty_never_a_number(tmp_path):
    write_tables(tmp_path, some_hand())
    for name, known in ((ANGLES_CSV, 5), (KEYPOINTS_CSV, 3)):
        with open(tmp_path / name, newline="") as file:
            row = list(csv.reader(file))[3]
        assert row[2] == "lost"
        assert row[known:] == [""] * (len(row) - known)


def test_same_bytes_in_one_piece_or_many(tmp_path):
    (tmp_path / "one").mkdir()
    (tmp_path / "many").mkdir()
    write_tables(tmp_path / "one", some_hand())
    write_tables(tmp_path / "many", *some_hand())
    for name in (ANGLES_CSV, KEYPOINTS_CSV):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "many" / name).read_bytes()


@pytest.mark.parametrize(
    ("column", "value", "text"),
    [
        ("frame", 12, "12"),
        ("palm_qw", 0.123456789, "0.12345679"),
        ("wrist_x_px", -0.0001, "0.000"),
        ("wrist_x_mm", np.inf, ""),
        ("confidence", 1.0, "1.0000"),
    ],
)
def test_cells(column, value, text):
    assert cell(column, value) == text


def test_file_appears_only_when_finished(tmp_path):
    table = TableWriter(tmp_path / ANGLES_CSV, angle_columns)
    table.write(some_hand())
    assert not (tmp_path / ANGLES_CSV).exists()
    table.finish()
    assert [p.name for p in tmp_path.iterdir()] == [ANGLES_CSV]


def test_full_disk_keeps_whole_rows(tmp_path):
    hand = some_hand()
    table = TableWriter(tmp_path / ANGLES_CSV, angle_columns)
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (2500, limit[1]))
        table.write(hand[:2])
        with pytest.raises(OutputError, match=r"angles\.csv: cannot be written"):
            list(map(table.write, hand))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    table.finish()
    lines = (tmp_path / ANGLES_CSV).read_text().splitlines()
    assert len(lines) >= 3
    assert {line.count(",") for line in lines} == {52}


def test_tables_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"angles\.csv: cannot be read"):
        read_tables(tmp_path)
    write_tables(tmp_path, some_hand())
    whole = (tmp_path / ANGLES_CSV).read_text()
    for old, new, says in (
        ("palm_qw", "palm_w", "missing: palm_qw"),
        ("tracked", "tracked,", "fields"),
        ("17.25", "many", "no number"),
        ("tracked", "seen", "unknown status"),
    ):
        (tmp_path / ANGLES_CSV).write_text(whole.replace(old, new))
        with pytest.raises(InputError, match=says):
            read_tables(tmp_path)


def test_table_in_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(OutputError, match="cannot be written"):
        TableWriter(tmp_path / "none" / ANGLES_CSV, angle_columns)
