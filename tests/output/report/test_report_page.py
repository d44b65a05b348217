"""The report in a real browser, opened from disk.

Every frame of the clip shows its number as a pattern, and its wrist is drawn at a place of its
own, so that the canvas itself says which frame and which layers are on it.
"""

from pathlib import Path

import numpy as np
import pytest

N = 301
BUILD = Path(__file__).resolve().parents[3] / "build"

#: What is on the canvas: the number in the picture, and where the wrist's white disc is.
READ = """() => {
  const canvas = document.getElementById('picture'), ctx = canvas.getContext('2d');
  const [w, h] = handtrack.app.facts.size, scale = Math.min(canvas.width / w, canvas.height / h);
  const left = (canvas.width - scale * w) / 2, top = (canvas.height - scale * h) / 2;
  const at = (x, y) => ctx.getImageData(
    Math.floor(left + scale * (x + 0.5)), Math.floor(top + scale * (y + 0.5)), 1, 1).data;
  let number = 0;
  for (let bit = 0; bit < 12; bit++) number |= (at(16 * bit + 8, 8)[0] > 128) << bit;
  const white = [];
  for (let x = 15; x < 180; x++) if (Math.min(...at(x, 120).slice(0, 3)) > 240) white.push(x);
  return {number, wrist: white.reduce((a, b) => a + b, 0) / white.length,
          k: handtrack.app.frame.k, stamp: document.getElementById('stamp').textContent};
}"""
#: A number that stands for all pixels of the canvas.
PIXELS = """() => { const c = document.getElementById('picture');
  const data = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
  return new Int32Array(data.buffer).reduce((hash, pixel) => Math.imul(hash, 31) + pixel | 0, 7);
}"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory, reports):
    return reports.write_report(tmp_path_factory.mktemp("report") / "Ä run", N)


@pytest.fixture
def open_page(browser):
    """Opens a report; whatever the console complains of fails the test in the end."""
    complaints, pages = [], []

    def opened(folder, frame=0, limit_s=20, **more):
        page = browser.new_page(viewport={"width": 1280, "height": 800}, **more)
        pages.append(page)
        page.on("console", lambda m: m.type == "error" and complaints.append(m.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(f"{(folder / 'report.html').as_uri()}#{frame}")
        page.wait_for_function("handtrack.ready", timeout=1000 * limit_s)
        return page

    yield opened
    for page in pages:
        page.close()
    assert complaints == []


@pytest.fixture
def page(open_page, folder):
    return open_page(folder)


def only(page, *names):
    """Switch these layers on and all others off."""
    page.evaluate(
        "(names) => Object.keys(handtrack.app.on).forEach("
        "(name) => handtrack.app.setLayer(name, names.includes(name)))",
        list(names),
    )


def frame_of(page):
    return page.evaluate("handtrack.app.player.k")


def wait_for(page, k):
    page.wait_for_function(f"handtrack.app.player.painted === {k}", timeout=20000)


def test_it_opens_and_shows_what_it_is_of(page):
    assert page.title() == "numbered.mp4 – handtrack"
    assert "301 frames · 100 % tracked · left hand" in page.inner_text("#about")
    assert page.locator("#notice").is_hidden()
    assert page.locator(".plot").count() == 6
    assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")
    BUILD.mkdir(exist_ok=True)
    page.screenshot(path=str(BUILD / "report.png"))


@pytest.mark.parametrize("k", [0, 1, 14, 15, 119, 120, 239, 240, N - 1])
def test_picture_and_layers_are_of_the_frame_asked_for(open_page, folder, reports, k):
    page = open_page(folder, k)
    only(page, "picture", "keypoints")
    seen = page.evaluate(READ)
    assert seen["number"] == seen["k"] == k
    assert seen["wrist"] == pytest.approx(reports.keypoints_at(k)[0, 0], abs=0.6)
    assert seen["stamp"].endswith(f"#{k}")


def test_picture_and_layers_stay_together_while_it_plays_and_jumps(page, reports):
    only(page, "picture", "keypoints")
    page.evaluate(
        "() => { window.seen = []; const app = handtrack.app, shown = app.player.shown;"
        f"const read = {READ};"
        "app.player.shown = (frame) => { shown(frame); seen.push(read()); }; }"
    )
    page.keyboard.press("Space")
    page.wait_for_function("seen.length >= 25", timeout=20000)
    page.keyboard.press("Space")
    for k in (200, 7, 290, 131, 130, 129):
        page.evaluate(f"handtrack.app.player.seek({k})")
    wait_for(page, 129)
    seen = page.evaluate("seen")
    assert [s["number"] for s in seen] == [s["k"] for s in seen]
    wanted = [reports.keypoints_at(s["k"])[0, 0] for s in seen]
    np.testing.assert_allclose([s["wrist"] for s in seen], wanted, atol=0.6)
    played = [s["k"] for s in seen][:25]
    assert played == sorted(played)


@pytest.mark.parametrize("key", "1234567")
def test_each_layer_has_a_switch_that_changes_the_picture(page, key):
    only(page, "picture") if key != "1" else only(page)
    button = page.locator("#layers button").nth(int(key) - 1)
    without = page.evaluate(PIXELS)
    page.keyboard.press(key)
    assert button.get_attribute("aria-pressed") == "true"
    with_layer = page.evaluate(PIXELS)
    assert with_layer != without
    button.click()
    assert page.evaluate(PIXELS) == without


def test_a_click_on_a_curve_goes_to_that_frame(page):
    for name in ("angles", "status", "energy"):
        over = page.locator(f".plot[data-plot={name}] .u-over")
        box = over.bounding_box()
        for share in (0.25, 0.8):
            page.mouse.click(box["x"] + share * box["width"], box["y"] + 5)
            assert frame_of(page) == pytest.approx(share * (N - 1), abs=1)
            wait_for(page, frame_of(page))
            marker = over.locator(".marker").bounding_box()
            assert marker["x"] == pytest.approx(box["x"] + share * box["width"], abs=3)


def test_a_drag_zooms_and_a_double_click_undoes_it(page):
    box = page.locator(".plot[data-plot=angles] .u-over").bounding_box()
    y, x, w = box["y"] + 40, box["x"], box["width"]
    page.mouse.move(x + 0.2 * w, y)
    page.mouse.down()
    page.mouse.move(x + 0.4 * w, y, steps=4)
    page.mouse.up()
    low, high = page.evaluate("handtrack.app.curves.range")
    assert (low, high) == pytest.approx((2.0, 4.0), abs=0.05)
    assert frame_of(page) == 0
    page.mouse.click(x + 0.5 * w, y)
    assert frame_of(page) == pytest.approx(90, abs=1)
    page.mouse.dblclick(x + 0.5 * w, y)
    assert page.evaluate("handtrack.app.curves.range") == pytest.approx([0, 10], abs=1e-6)


def test_keys_step(page):
    for key, wanted in (
        ("ArrowRight", 1), ("Shift+ArrowRight", 11), ("ArrowLeft", 10), ("End", N - 1),
        ("ArrowRight", N - 1), ("Shift+ArrowLeft", N - 11), ("Home", 0), ("ArrowLeft", 0),
    ):  # fmt: skip
        page.keyboard.press(key)
        assert frame_of(page) == wanted
        wait_for(page, wanted)
    page.keyboard.press("Space")
    page.wait_for_function("handtrack.app.player.painted > 3", timeout=20000)
    page.keyboard.press("Space")
    assert not page.evaluate("handtrack.app.player.playing")


def test_truth_adds_its_curves_and_errors(open_page, reports, tmp_path):
    page = open_page(reports.write_report(tmp_path / "a", 40, truth=reports.truth_of(40)), 10)
    names = page.locator(".plot").evaluate_all("(plots) => plots.map((p) => p.dataset.plot)")
    assert names[:3] == ["angles", "error", "keypoints"]
    error = page.evaluate("handtrack.app.curves.plots[1].data.slice(1).flat()")
    np.testing.assert_allclose(error, 3, atol=0.02)
    only(page, "picture")
    without = page.evaluate(PIXELS)
    page.keyboard.press("8")
    assert page.evaluate(PIXELS) != without


def test_without_its_files_there_are_still_curves(browser, reports, tmp_path):
    folder = reports.write_report(tmp_path / "a", 40)
    (folder / "report_files").rename(tmp_path / "elsewhere")
    page = browser.new_page()
    page.goto((folder / "report.html").as_uri())
    page.wait_for_selector("#notice:visible")
    assert page.locator(".plot").count() == 5
    page.close()


def test_colours_are_those_of_the_frame(open_page, reports, tmp_path):
    colour, tmp = (210, 150, 130), tmp_path / "a"
    tmp.mkdir()
    writer = reports.ReportWriter(tmp, reports.WIDTH, reports.HEIGHT)
    image = np.full((reports.HEIGHT, reports.WIDTH, 3), colour, np.uint8)
    writer.add(reports.result_at(0), image, lambda: reports.layers_at(0), 1.0)
    writer.finish(reports.facts_of(reports.record_of(1), reports.space.default()))
    page = open_page(tmp)
    only(page, "picture")
    found = page.evaluate(
        "() => { const c = document.getElementById('picture'); return Array.from("
        "c.getContext('2d').getImageData(c.width / 2, c.height / 2, 1, 1).data); }"
    )
    assert found[:3] == pytest.approx(colour, abs=2)


def test_the_page_reads_columns_as_python_does(page):
    from handtrack.output.report.columns import Column, as_text, pack_columns, unpack_columns

    rng = np.random.default_rng(0)
    values = rng.normal(0, 500, 300)
    values[5] = np.nan
    block = pack_columns(
        [
            Column.quantised("a", values, 8, delta=True),
            Column.plain("b", "f64", values[6:]),
            Column.plain("c", "i32", np.arange(-50, 50) ** 3, delta=True),
            Column.plain("d", "u8", []),
        ]
    )
    found = page.evaluate(
        "async (text) => Object.fromEntries(Object.entries(await unpackColumns(text)).map("
        "([name, values]) => [name, Array.from(values)]))",
        as_text(block),
    )
    for name, wanted in unpack_columns(block).items():
        np.testing.assert_allclose(np.array(found[name], float), wanted, rtol=1e-7)


def test_decimation_keeps_every_peak_and_gap(page):
    found = page.evaluate(
        """() => {
          const n = 50000, x = Float64Array.from({length: n}, (_, i) => i);
          const y = Float32Array.from(x, (i) => Math.sin(i / 900)); y[31234] = 9; y[777] = -7;
          for (let i = 40000; i < 42000; i++) y[i] = NaN;
          const [t, both, high, low] = decimated(x, [y, y, y], ['both', 'max', 'min'], 0, n, 600);
          return {t, both, high, low};
        }"""
    )
    t, both = np.array(found["t"]), np.array(found["both"], float)
    assert len(t) == len(both) == 1200
    assert (np.diff(t) >= 0).all()
    assert np.nanmax(both) == 9
    assert np.nanmin(both) == -7
    gap = (t > 40100) & (t < 41900)
    assert np.isnan(both[gap]).all()
    assert np.isfinite(both[~gap & ((t < 39900) | (t > 42100))]).all()
    ok = np.isfinite(both)
    assert (np.array(found["high"], float)[ok] >= both[ok]).all()
    assert (np.array(found["low"], float)[ok] <= both[ok]).all()


def test_a_clip_of_ten_minutes_opens_soon_and_moves(open_page, reports, tmp_path):
    n, few = 18000, reports.layers_at(0)
    folder = reports.write_report(tmp_path / "long", n, layers=lambda k: few)
    page = open_page(folder, n // 2, limit_s=12)
    opened_s = page.evaluate("handtrack.ready") / 1000
    zoom_ms = page.evaluate(
        "async () => { const from = performance.now();"
        "for (let i = 1; i < 6; i++) { handtrack.app.curves.zoom([i, 600 - 10 * i]);"
        "await new Promise(requestAnimationFrame); }"
        "return (performance.now() - from) / 5; }"
    )
    only(page, "picture", "keypoints")
    assert page.evaluate(READ)["number"] == (n // 2) % 4096
    print(f"18000 frames: open after {opened_s:.2f} s, a zoom takes {zoom_ms:.0f} ms")
    assert zoom_ms < 1000
