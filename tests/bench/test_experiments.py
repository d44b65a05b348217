"""The paper's comparison, the ablations and the timings run, and say what is so."""

from dataclasses import replace

import numpy as np
import pytest

from calib.hand import calibrate_hand
from handtrack.bench.ablation import variants
from handtrack.bench.comparison import (
    SCHEMES,
    Moment,
    compare,
    moments,
    run_scheme,
)
from handtrack.bench.metrics import bends_deg
from handtrack.bench.plots import by_count, plot_comparison, plot_speed
from handtrack.bench.speed import time_likelihood
from handtrack.bench.table import ablation_table, samples_table, tracker_ablation_table
from handtrack.bench.tracker_ablation import ablate_tracker, tracker_variants
from handtrack.errors import InputError, OutputError
from handtrack.fingers.likelihood import LikelihoodSettings
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.space import default
from handtrack.hand.surface import Cardboard
from handtrack.paper import make_filter
from synth.cache import ClipCache


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return ClipCache(tmp_path_factory.mktemp("clips"), frames=14)("paper", 0)


@pytest.fixture(scope="module")
def outcomes(clip):
    return list(compare(clip, Cardboard, (20, 200), 2, 12, default()))


def test_every_scheme_runs_with_every_number_of_samples(outcomes):
    assert len(outcomes) == 2 * (3 * 2 + 1)
    assert {o.scheme for o in outcomes} == {*SCHEMES, "refined"}
    assert all(0 < o.bend_deg < 60 and o.ms > 0 for o in outcomes)
    search = [o for o in outcomes if o.scheme == "random"]
    few, many = (np.mean([o.bend_deg for o in rows]) for rows in by_count(search).values())
    assert many < few  # more of a random search is better


def test_the_same_seed_gives_the_same_answer(clip):
    ready, shape = moments(clip, 4)
    one, two = (
        run_scheme("paper", 50, 3, ready, shape, Cardboard(shape), default(), LikelihoodSettings())
        for _ in range(2)
    )
    assert replace(one, ms=0.0) == replace(two, ms=0.0)


def test_a_likelihood_that_knows_leads_every_scheme_there(clip, monkeypatch):
    ready, shape = moments(clip, 4)
    space = default()
    target = space.to_angles(space.basis_X[5][None])[0]
    still = [Moment(m.view, m.pose, target) for m in ready] * 3

    def knows(*_):
        return lambda theta: -40.0 * np.sum((theta - target) ** 2, axis=1)

    monkeypatch.setattr("handtrack.bench.comparison.FingerLikelihood", knows)
    surface, settings = Cardboard(shape), LikelihoodSettings()
    errors = {
        name: run_scheme(name, 1000, 0, still, shape, surface, space, settings).bend_deg
        for name in SCHEMES
    }
    far = np.abs(
        bends_deg(keypoints_mm(space.mean[None], shape))
        - bends_deg(keypoints_mm(target[None], shape))
    ).mean()
    assert max(errors.values()) < 0.7 * far
    assert errors["paper"] < errors["random"]  # at 1000 samples on a basis state


def test_unlike_schemes_are_made():
    assert len({type(make_filter(name, 10, default())) for name in SCHEMES}) == 3


def test_variants_change_one_thing():
    first, *others = variants(default())
    assert len({v.name for v in others}) == len(others) >= 8
    for v in others:
        changed = [
            v.surface is not first.surface,
            v.likelihood != first.likelihood,
            v.samples != first.samples,
            len(v.space.basis_X) != len(first.space.basis_X),
            v.space.n_dims != first.space.n_dims,
        ]
        assert sum(changed) == 1, v.name


def test_tables_and_figures(outcomes, clip, tmp_path):
    assert "condensation" in samples_table(outcomes)
    assert "x  " in ablation_table([("x", outcomes[0])])
    plot_comparison(outcomes, tmp_path / "samples.png")
    timings = time_likelihood(clip, default(), counts=(10, 100), sides_px=(64, 128))
    assert len(timings) == 2 * 2 + 2 * 2
    assert min(t.per_second for t in timings) > 0
    plot_speed(timings, tmp_path / "speed.png")
    for name in ("samples.png", "speed.png"):
        assert (tmp_path / name).read_bytes()[:4] == b"\x89PNG"
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        plot_speed(timings, tmp_path / "file" / "x.png")


def test_left_hands_are_refused(clip, tmp_path):
    for name in ("camera.toml", "shape.toml"):
        (tmp_path / name).write_bytes((clip / name).read_bytes())
    with np.load(clip / "truth.npz") as data:
        values = {name: data[name] for name in data.files}
    np.savez(tmp_path / "truth.npz", **(values | {"side": np.array("left")}))
    with pytest.raises(InputError, match="right hand"):
        moments(tmp_path, 2)
    assert isinstance(moments(clip, 1)[1], HandShape)


def test_a_whole_tracker_without_one_of_its_choices_is_another_tracker():
    whole = tracker_variants()
    assert len({repr(settings) for settings in whole.values()}) == len(whole)


def test_whole_trackers_are_scored_and_tabled(clip):
    few = {name: tracker_variants()[name] for name in ("refined", "palm and fingers once")}
    scores = list(ablate_tracker([clip], calibrate_hand, few))
    assert [name for name, _ in scores] == list(few)
    assert all(0 < found["bend_deg"] < 40 for _, found in scores)
    lines = tracker_ablation_table(scores).splitlines()
    assert len(lines) == 3
    assert f"{scores[0][1]['bend_deg']:.2f}" in lines[1]
