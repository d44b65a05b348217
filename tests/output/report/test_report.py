"""The report's files: what is in them, and that they appear whole or not at all."""

import base64
import json
import re

import av
import numpy as np
import pytest

from handtrack import cli
from handtrack.errors import InputError, OutputError
from handtrack.output.report.columns import Column, pack_columns, unpack_columns
from handtrack.output.report.film import GOP, Film
from handtrack.output.report.writer import ReportWriter
from handtrack.output.view import report_in
from handtrack.records import Status


def chunk_of(folder, number=0):
    """Packets and columns of a chunk's file."""
    text = (folder / "report_files" / f"{number:06d}.js").read_text()
    found, packets, block = re.fullmatch(
        r'handtrack\.chunk\((\d+),\[(.*?)\],"(.*)"\);\n', text
    ).groups()
    assert int(found) == number
    pieces = [base64.b64decode(p) for p in re.findall(r'"([^"]*)"', packets)]
    return pieces, unpack_columns(base64.b64decode(block))


def curves_of(folder):
    text = (folder / "report.html").read_text(encoding="utf-8")
    block = re.search(r'id="curve-block">([^<]*)<', text)[1]
    return unpack_columns(base64.b64decode(block))


def facts_in(folder):
    text = (folder / "report.html").read_text(encoding="utf-8")
    return json.loads(re.search(r'id="facts">([^<]*)<', text)[1])


@pytest.mark.parametrize("delta", [False, True])
def test_quantised_columns_come_back_within_half_a_step(delta):
    rng = np.random.default_rng(0)
    values = rng.normal(0, 300, 1000)
    values[::17] = np.nan
    found = unpack_columns(pack_columns([Column.quantised("a", values, 8, delta)]))["a"]
    np.testing.assert_array_equal(np.isnan(found), np.isnan(values))
    assert np.nanmax(np.abs(found - values)) <= 1 / 16


@pytest.mark.parametrize("kind", ["u8", "u16", "i16", "i32", "f32", "f64"])
def test_plain_columns_come_back_as_they_were(kind):
    values = np.random.default_rng(1).integers(0, 200, 77)
    columns = [Column.plain("a", kind, values), Column.plain("none", kind, [])]
    found = unpack_columns(pack_columns(columns))
    np.testing.assert_array_equal(found["a"], values)
    assert len(found["none"]) == 0


def test_numbers_too_far_to_hold_are_cut_off_and_not_wrapped():
    found = unpack_columns(pack_columns([Column.quantised("a", [1e9, -1e9, np.inf], 8)]))["a"]
    assert found.tolist() == [4095.875, -4095.875, 4095.875]


@pytest.mark.parametrize("size", [(203, 151), (64, 48), (1, 1), (2600, 1300)])
def test_each_packet_is_its_frame(size, reports):
    film = Film(*size)
    numbers = range(GOP + 3) if size[0] >= reports.BITS * reports.BLOCK else range(2)
    packets = [film.packet(reports.numbered(k, *size)) for k in numbers]
    decoder = av.CodecContext.create("h264", "r")
    frames = [f for p in [*packets, None] for f in decoder.decode(p and av.Packet(p))]
    assert len(frames) == len(packets)
    assert (frames[0].width, frames[0].height) == (film.width, film.height)
    if size == (203, 151):
        assert [reports.number_of(f.to_ndarray(format="rgb24")) for f in frames] == list(numbers)


def test_a_group_of_pictures_stands_alone(tmp_path, reports):
    packets, _ = chunk_of(reports.write_report(tmp_path / "a", 130), 0)
    decoder = av.CodecContext.create("h264", "r")
    later = packets[3 * GOP : 4 * GOP]
    frames = [f for p in [*later, None] for f in decoder.decode(p and av.Packet(p))]
    shown = [reports.number_of(f.to_ndarray(format="rgb24")) for f in frames]
    assert shown == list(range(3 * GOP, 4 * GOP))


def test_layers_and_curves_are_those_of_the_frames(tmp_path, reports):
    n = 125
    folder = reports.write_report(tmp_path / "a", n, truth=reports.truth_of(100))
    _, columns = chunk_of(folder, 1)
    start = np.concatenate([[0], np.cumsum(columns["contour_n"], dtype=int)])
    for i, k in enumerate(range(120, n)):
        wanted, found = reports.layers_at(k), slice(start[i], start[i + 1])
        np.testing.assert_allclose(columns["contour_x"][found], wanted.contour[::2, 0], atol=0.07)
        np.testing.assert_allclose(
            columns["key_y"].reshape(-1, 21)[i], reports.keypoints_at(k)[:, 1], atol=0.07
        )
    curves = curves_of(folder)
    theta = np.degrees([reports.result_at(k).theta for k in range(n)])
    np.testing.assert_allclose([curves[f"theta{a}"] for a in range(20)], theta.T, atol=0.006)
    np.testing.assert_allclose(curves["t"], np.arange(n) / 30)
    np.testing.assert_allclose(curves["truth3"][:100] - curves["theta3"][:100], 3, atol=0.011)
    np.testing.assert_allclose(curves["keypoint_error"][:100], 5, atol=1e-5)
    assert np.isnan(curves["truth3"][100:]).all()
    assert np.isnan(curves["keypoint_error"][100:]).all()
    assert facts_in(folder)["n_chunks"] == 2


def test_what_is_not_known_is_not_a_number(tmp_path, reports):
    status = lambda k: Status.LOST if k == 1 else Status.TRACKED  # noqa: E731
    curves = curves_of(reports.write_report(tmp_path / "a", 3, status))
    assert np.isnan(curves["theta0"]).tolist() == [False, True, False]
    assert curves["status"].tolist() == [0, 2, 0]


def test_the_same_run_gives_the_same_bytes_but_for_the_times(tmp_path, reports):
    first = reports.write_report(tmp_path / "a", 130, ms=20.0)
    second = reports.write_report(tmp_path / "b", 130, ms=31.0)
    names = sorted(p.name for p in (first / "report_files").iterdir())
    assert names == ["000000.js", "000001.js", "times.js"]
    for name in ("report.html", *(f"report_files/{name}" for name in names)):
        same = (first / name).read_bytes() == (second / name).read_bytes()
        assert same == (name != "report_files/times.js")


def test_nothing_is_there_before_the_end_or_after_discarding(tmp_path, reports):
    writer = ReportWriter(tmp_path, reports.WIDTH, reports.HEIGHT)
    for k in range(122):
        writer.add(reports.result_at(k), None, lambda k=k: reports.layers_at(k), 1.0)
    assert all(p.name.startswith(".") for p in tmp_path.iterdir())
    writer.discard()
    assert list(tmp_path.iterdir()) == []


def test_an_earlier_report_is_replaced_whole(tmp_path, reports):
    reports.write_report(tmp_path, 250)
    reports.write_report(tmp_path, 20)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["report.html", "report_files"]
    names = sorted(p.name for p in (tmp_path / "report_files").iterdir())
    assert names == ["000000.js", "times.js"]
    assert facts_in(tmp_path)["n"] == 20


def test_files_of_others_are_not_removed(tmp_path, reports):
    reports.write_report(tmp_path, 3)
    (tmp_path / "report_files" / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match="report_files: cannot be replaced"):
        reports.write_report(tmp_path, 3)
    assert (tmp_path / "report_files" / "notes.txt").read_text() == "mine"


def test_a_fault_in_the_thread_comes_out(tmp_path, reports):
    writer = ReportWriter(tmp_path, reports.WIDTH, reports.HEIGHT)
    writer.add(reports.result_at(0), None, lambda: 1 // 0, 1.0)
    with pytest.raises(ZeroDivisionError):
        writer.finish({})
    assert list(tmp_path.iterdir()) == []


def test_a_name_cannot_end_the_script_it_stands_in(tmp_path, reports):
    from handtrack.output.report.page import page

    assert "</script><b>" not in page({"clip": "</script><b>.mp4"}, "")
    assert facts_in(reports.write_report(tmp_path, 1))["clip"] == "numbered.mp4"


def test_view_finds_the_report_and_says_what_is_missing(tmp_path, reports, capsys, monkeypatch):
    folder = reports.write_report(tmp_path / "Händ run", 2)
    assert cli.main(["view", str(folder), "--print"]) == 0
    assert capsys.readouterr().out == f"{folder / 'report.html'}\n"
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda uri: opened.append(uri) or True)
    assert cli.main(["view", str(folder / "report.html")]) == 0
    assert opened == [(folder / "report.html").as_uri()]
    monkeypatch.setattr("webbrowser.open", lambda uri: False)
    assert cli.main(["view", str(folder)]) == InputError.exit_code
    assert "no browser could be started; open that file" in capsys.readouterr().err
    with pytest.raises(InputError, match="no such folder"):
        report_in(tmp_path / "none")
    with pytest.raises(InputError, match=r"has no report\.html"):
        report_in(tmp_path)
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(InputError, match="without --no-report"):
        report_in(tmp_path)
