import av
import cv2
import numpy as np
import pytest

from handtrack.camera import Camera, Window
from handtrack.evidence.evidence import Evidence, crop, see, see_candidate, window_around
from handtrack.evidence.picture import draw_evidence
from handtrack.evidence.silhouette import Segmenter, SegmenterSettings

CAMERA = Camera.assumed_for(640, 480)


def overlap(a, b):
    return (a & b).sum() / max((a | b).sum(), 1)


def warp(values, window):
    """Values ``(H, W)`` of the frame in the window."""
    s = window.scale
    A = np.array([[1 / s, 0, window.x_px], [0, 1 / s, window.y_px]])
    size = (window.width_px, window.height_px)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(
        values.astype(np.float32), A, size, flags=flags, borderMode=cv2.BORDER_REPLICATE
    )


def errors(evidence, drawn):
    """Signed distance ``(m,)`` in window px of the outline's points from the true outline."""
    truth = warp(drawn.sdf, evidence.window) * evidence.window.scale
    x, y = evidence.contour.astype(np.float32).T
    return cv2.remap(truth, x[None], y[None], cv2.INTER_LINEAR)[0]


@pytest.mark.parametrize("tone", ["pale", "light", "brown", "dark", "blue"])
def test_silhouette_and_outline_of_drawn_hands(drawing, tone):
    drawn = drawing.draw(
        drawing.gradient(), drawing.SKIN[tone], drawing.curled([3]), turn=(0, 0.4, 0.3)
    )
    best = Segmenter.bootstrap(drawn.image)[0]
    window = window_around(drawn.mask)
    evidence = see(drawn.image, window, CAMERA, Segmenter.from_mask(drawn.image, best.mask))
    truth = warp(drawn.sdf, window) < 0
    assert overlap(evidence.mask, truth & evidence.visible) > 0.95
    e = errors(evidence, drawn)
    assert np.median(np.abs(e)) < 0.35
    assert abs(np.median(e)) < 0.25
    assert evidence.confidence > 0.6


def test_close_fingers_do_not_melt_together(drawing):
    drawn = drawing.draw(drawing.plain(), drawing.SKIN["light"], np.zeros(20), scale=2.0)
    window = window_around(drawn.mask)
    evidence = see(drawn.image, window, CAMERA, Segmenter.from_mask(drawn.image, drawn.mask))
    gap = warp(drawn.sdf, window) * window.scale > 1.2
    near = warp(drawn.sdf, window) * window.scale < 4
    assert evidence.mask[gap & near].mean() < 0.05


def test_background_that_was_seen_before_takes_wood_for_wood(drawing):
    """Learned from a hand on one side, the wood is told from a hand of its colour on the other."""
    place = drawing.wood(colour=(200, 146, 112))
    first, second = (
        drawing.draw(place, drawing.SKIN["light"], drawing.spread(), centre=c, seed=k, scale=1.5)
        for k, c in enumerate([(170, 240), (470, 240)])
    )
    window = window_around(second.mask)
    seed = warp(second.mask, window) > 0.5

    def seen(watched):
        segmenter = Segmenter.from_mask(first.image, first.mask)
        segmenter.settings = SegmenterSettings(watch_every=1)
        here = window_around(first.mask)
        for _ in range(watched):
            segmenter.watch(first.image, warp(first.mask, here) > 0.5, here)
        evidence = see(second.image, window, CAMERA, segmenter, seed)
        return overlap(evidence.mask, seed & evidence.visible)

    before, after = seen(0), seen(8)
    assert after > 0.9
    assert after > before + 0.02


def test_crop_is_where_the_window_says():
    y, x = np.mgrid[:300, :400]
    frame = np.dstack([x / 2, y / 2, 0 * x]).astype(np.uint8)
    for scale in (2.0, 1.0, 0.7, 0.5, 0.31, 0.2):
        window = Window(31.3, 22.8, scale, 50, 40)
        image = crop(frame, window)
        p = window.to_frame(np.array([25.0, 20.0]))
        assert image.shape == (40, 50, 3)
        assert np.abs(image[20, 25, :2] - p / 2).max() < 1.1


@pytest.mark.parametrize("corner", [(-900, 0), (0, -900), (2000, 2000), (-40, 430)])
def test_windows_that_leave_the_frame(drawing, corner):
    drawn = drawing.draw(drawing.plain(), drawing.SKIN["light"])
    segmenter = Segmenter.from_mask(drawn.image, drawn.mask)
    window = Window(*map(float, corner), 0.5, 120, 100)
    evidence = see(drawn.image, window, CAMERA, segmenter, np.ones((100, 120), bool))
    assert not (evidence.mask & ~evidence.visible).any()
    assert np.isfinite(evidence.sdf).all()
    assert draw_evidence(drawn.image, evidence).dtype == np.uint8


def test_the_frames_border_is_no_outline(drawing):
    drawn = drawing.draw(drawing.plain(), drawing.SKIN["light"], centre=(330, 350))
    evidence = see(
        drawn.image, window_around(drawn.mask), CAMERA, Segmenter.from_mask(drawn.image, drawn.mask)
    )
    bottom = evidence.window.to_window((0, 479.5))[1]
    assert evidence.mask[int(bottom) - 2].any()  # the forearm leaves the frame here
    assert evidence.contour[:, 1].max() < bottom - 1
    assert np.abs(errors(evidence, drawn)).max() < 3


def test_confidence_falls_when_the_colours_hold_no_more(drawing):
    drawn = drawing.draw(drawing.plain(), drawing.SKIN["light"])
    segmenter = Segmenter.from_mask(drawn.image, drawn.mask)
    window = window_around(drawn.mask)
    good = see(drawn.image, window, CAMERA, segmenter).confidence
    elsewhere = drawing.clutter(seed=5).astype(np.uint8)
    bad = see(elsewhere, window, CAMERA, segmenter).confidence
    none = see(drawing.plain().astype(np.uint8), window, CAMERA, segmenter).confidence
    assert good > 0.7
    assert bad < good - 0.2
    assert none == 0


def test_records_are_read_only_and_complete(drawing):
    drawn = drawing.draw(drawing.plain(), drawing.SKIN["light"])
    evidence = see(
        drawn.image, window_around(drawn.mask), CAMERA, Segmenter.from_mask(drawn.image, drawn.mask)
    )
    assert isinstance(evidence, Evidence)
    arrays = [v for v in vars(evidence).values() if isinstance(v, np.ndarray)]
    assert len(arrays) == 14
    assert not any(a.flags.writeable for a in arrays)
    assert evidence.probability.dtype == evidence.sdf.dtype == np.float32
    assert len(evidence.contour) == len(evidence.contour_normal) == len(evidence.contour_snapped)
    assert 0 <= evidence.edge_direction.min() <= evidence.edge_direction.max() <= np.pi


def test_same_input_same_evidence(drawing):
    drawn = drawing.draw(drawing.clutter(seed=3), drawing.SKIN["brown"])
    window = window_around(drawn.mask)

    def once():
        segmenter = Segmenter.from_mask(drawn.image, Segmenter.bootstrap(drawn.image)[0].mask)
        return see(drawn.image, window, CAMERA, segmenter)

    a, b = once(), once()
    for name, value in vars(a).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, getattr(b, name), err_msg=name)


def test_mirrored_segmenter_sees_the_mirrored_frame(drawing):
    drawn = drawing.draw(
        drawing.gradient(), drawing.SKIN["light"], centre=(250, 240), noise=0, jpeg=0
    )
    segmenter = Segmenter.from_mask(drawn.image, drawn.mask)
    window = Window(100.0, 60.0, 0.5, 180, 200)
    flipped = Window(639 - 100 - 179 / 0.5, 60.0, 0.5, 180, 200)
    P = segmenter.probability(crop(drawn.image, window), window)
    image = np.ascontiguousarray(drawn.image[:, ::-1])
    Q = segmenter.mirrored().probability(crop(image, flipped), flipped)
    assert np.abs(P - Q[:, ::-1]).mean() < 0.005


def test_real_hand_every_fortieth_frame(shared):
    """The silhouette holds the independent tracker's joints, from the first frame's colours."""
    clip = shared / "clips" / "folding.mp4"
    points = np.load(shared / "clips" / "folding_peer.npz")["kp2"]
    camera = Camera.assumed_for(405, 720)
    segmenter, mask = None, None
    with av.open(str(clip)) as container:
        for k, frame in enumerate(container.decode(video=0)):
            if k > 180:
                break
            if k % 20:
                continue
            image = cv2.resize(
                frame.to_ndarray(format="rgb24"), (405, 720), interpolation=cv2.INTER_AREA
            )
            if segmenter is None:
                mask = Segmenter.bootstrap(image)[0].mask
                segmenter = Segmenter.from_mask(image, mask)
            window = window_around(mask)
            evidence = see(image, window, camera, segmenter)
            joints = window.to_window(points[k]).round().astype(int).clip(0, 255)
            assert (evidence.sdf[joints[:, 1], joints[:, 0]] < 3).mean() > 0.9, k
            assert evidence.confidence > 0.8, k
            assert evidence.contour_snapped.mean() > 0.9


def test_a_candidate_that_is_cut_is_looked_at_in_a_wider_window(drawing):
    drawn = drawing.draw(
        drawing.plain(), drawing.SKIN["light"], drawing.spread(), scale=1.2, forearm=False
    )
    segmenter = Segmenter.from_mask(drawn.image, drawn.mask)
    y = np.nonzero(drawn.mask)[0]
    palm = drawn.mask.copy()
    palm[: int(y.min() + 0.45 * np.ptp(y))] = False  # the fingers were not found
    narrow, wide = see_candidate(drawn.image, palm, CAMERA, segmenter)
    assert wide.window.scale < narrow.window.scale
    np.testing.assert_allclose(
        wide.window.to_frame((128, 128)), narrow.window.to_frame((128, 128)), atol=0.01
    )
    assert wide.mask.sum() / wide.window.scale**2 > 1.1 * narrow.mask.sum() / narrow.window.scale**2
    assert len(list(see_candidate(drawn.image, drawn.mask, CAMERA, segmenter))) == 1
