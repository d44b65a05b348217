"""The pictures of every stage."""

import cv2
import numpy as np
import pytest

from handtrack.camera import Camera
from handtrack.errors import OutputError
from handtrack.evidence.evidence import see, window_around
from handtrack.evidence.silhouette import Segmenter
from handtrack.stages import HEIGHT_PX, stage_picture, write_picture


def evidence_of_a_disc():
    frame = np.full((240, 320, 3), 60, np.uint8)
    cv2.circle(frame, (160, 120), 50, (210, 150, 130), -1)
    best = Segmenter.bootstrap(frame)[0]
    segmenter = Segmenter.from_mask(frame, best.mask)
    window = window_around(best.mask, size_px=128)
    return frame, see(frame, window, Camera.assumed_for(320, 240), segmenter)


def test_stages_stand_side_by_side():
    frame, evidence = evidence_of_a_disc()
    picture = stage_picture(evidence, frame)
    assert picture.shape == (HEIGHT_PX, 4 * HEIGHT_PX + 640, 3)
    crop, probability, outline, edges = np.split(picture[:, : 4 * HEIGHT_PX], 4, axis=1)
    middle, corner = (HEIGHT_PX // 2, HEIGHT_PX // 2), (2, 2)
    assert crop[middle].tolist() == pytest.approx([210, 150, 130], abs=3)
    assert probability[middle].sum() > probability[corner].sum() + 100  # yellow, not purple
    assert (np.abs(outline.astype(int) - [255, 255, 0]).sum(axis=2) < 60).sum() > 300
    assert edges[middle].max() < 30
    assert edges.max() > 150


def test_without_evidence_there_is_the_frame():
    assert stage_picture(None, np.zeros((100, 50, 3), np.uint8)).shape == (HEIGHT_PX, 240, 3)


def test_colours_are_written_as_they_are(tmp_path):
    write_picture(tmp_path / "Bild.png", np.full((4, 4, 3), (250, 10, 20), np.uint8))
    data = np.fromfile(tmp_path / "Bild.png", np.uint8)
    assert cv2.imdecode(data, cv2.IMREAD_COLOR)[0, 0].tolist() == [20, 10, 250]
    with pytest.raises(OutputError, match="cannot be written"):
        write_picture(tmp_path / "Bild.png" / "a.png", np.zeros((4, 4, 3), np.uint8))
