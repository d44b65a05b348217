"""The paper's comparison of three schemes: error and time against the number of samples.

Random search in ``R^7``, CONDENSATION, and importance sampling along the lines see the same frames
through the same likelihood (Section 5; the paper gives them 5000, 3000 and 100 samples). As there,
only the fingers are in question: the palm's pose and the hand's measures are the true ones.
``refined``, the default method, is put beside them on the same evidence; it takes its own number
of samples, and is free to move the palm.

A *moment* is a frame made ready: evidence, true pose, true angles. A scheme runs through the
moments of a clip in order, so what it has lost it must find again by itself.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.bench.metrics import bends_deg
from handtrack.camera import Camera
from handtrack.errors import InputError
from handtrack.estimate import Estimate
from handtrack.evidence.evidence import see
from handtrack.evidence.silhouette import Segmenter
from handtrack.evidence.video import read_frames
from handtrack.fingers.likelihood import FingerLikelihood, LikelihoodSettings
from handtrack.hand.kinematics import keypoints_mm
from handtrack.hand.shape import HandShape
from handtrack.hand.space import ConfigurationSpace
from handtrack.hand.surface import Surface
from handtrack.paper import make_filter
from handtrack.records import Pose
from handtrack.refine.view import View
from handtrack.refined import RefinedMethod, RefinedSettings
from handtrack.window import window_for

Array = NDArray[np.float64]

SCHEMES = ("random", "condensation", "paper")


@dataclass(frozen=True, eq=False)
class Moment:
    """A frame made ready, with what is true in it."""

    view: View
    pose: Pose
    theta: Array  # (20,)


@dataclass(frozen=True)
class Outcome:
    """One scheme with one number of samples and one seed, over a clip."""

    scheme: str
    samples: int
    seed: int
    bend_deg: float  # mean error of the angles between bones
    pip_deg: float  # of the four PIP joints only
    ms: float  # processor time of a frame


def moments(folder: Path, frames: int) -> tuple[list[Moment], HandShape]:
    """The first ``frames`` frames of a synthetic clip of a right hand, and its shape.

    Raises
    ------
    InputError
        It is a clip of a left hand.
    """
    with np.load(folder / "truth.npz", allow_pickle=False) as truth:
        if str(truth["side"]) != "right":
            raise InputError(f"{folder}: the comparison wants a right hand")
        theta, R, t_mm = truth["theta"], truth["R"], truth["t_mm"]
        first = truth["mask"][0]
    camera, shape = Camera.load(folder / "camera.toml"), HandShape.load(folder / "shape.toml")
    ready: list[Moment] = []
    segmenter: Segmenter | None = None
    with closing(read_frames(folder / "clip.mp4")) as clip:
        for frame in islice(clip, frames):
            if frame.image is None:
                continue
            if segmenter is None:
                mask = np.unpackbits(first, axis=-1)[:, : camera.width_px].astype(bool)
                segmenter = Segmenter.from_mask(frame.image, mask)
            pose = Pose(R[frame.index], t_mm[frame.index])
            evidence = see(frame.image, window_for(pose, shape, camera), camera, segmenter)
            ready.append(Moment(View.of(evidence), pose, theta[frame.index]))
    return ready, shape


def run_scheme(
    name: str,
    samples: int,
    seed: int,
    clip: Sequence[Moment],
    shape: HandShape,
    surface: Surface,
    space: ConfigurationSpace,
    likelihood: LikelihoodSettings,
) -> Outcome:
    """Run a scheme over a clip; random search answers its best sample, the others their mean."""
    rng = np.random.default_rng(seed)
    scheme = make_filter(name, samples, space)
    found = []
    begin = time.process_time()
    for moment in clip:
        term = FingerLikelihood(surface, moment.view, moment.pose, likelihood)
        posterior = scheme.step(rng, _in_space(term, space))
        best = posterior.map_X if name == "random" else posterior.mean
        found.append(space.to_angles(best[None])[0])
    return _outcome(name, samples, seed, np.array(found), clip, shape, time.process_time() - begin)


def run_refined(
    seed: int, clip: Sequence[Moment], shape: HandShape, space: ConfigurationSpace
) -> Outcome:
    """The default method over the same evidence, the true pose as its prediction of the palm."""
    rng = np.random.default_rng(seed)
    method = RefinedMethod(shape, space, RefinedSettings())
    theta, found = np.asarray(space.mean), []
    begin = time.process_time()
    for moment in clip:
        start = Estimate(moment.pose, theta, np.full(20, 0.2))
        theta = np.asarray(method.follow(moment.view, start, rng).theta)
        found.append(theta)
    spent = time.process_time() - begin
    return _outcome("refined", 0, seed, np.array(found), clip, shape, spent)


def compare(
    folder: Path,
    surface_of: Callable[[HandShape], Surface],
    counts: Sequence[int],
    seeds: int,
    frames: int,
    space: ConfigurationSpace,
    likelihood: LikelihoodSettings | None = None,
) -> Iterator[Outcome]:
    """Every scheme with every number of samples and every seed, and ``refined``."""
    clip, shape = moments(folder, frames)
    surface = surface_of(shape)
    settings = likelihood or LikelihoodSettings()
    for name in SCHEMES:  # compiles what has to be compiled, so that it is not timed
        run_scheme(name, 10, 0, clip[:2], shape, surface, space, settings)
    run_refined(0, clip[:2], shape, space)
    for seed in range(seeds):
        for name in SCHEMES:
            for samples in counts:
                yield run_scheme(name, samples, seed, clip, shape, surface, space, settings)
        yield run_refined(seed, clip, shape, space)


def _in_space(
    likelihood: Callable[[Array], Array], space: ConfigurationSpace
) -> Callable[[Array], Array]:
    return lambda X: likelihood(space.to_angles(X))


def _outcome(
    name: str,
    samples: int,
    seed: int,
    theta: Array,
    clip: Sequence[Moment],
    shape: HandShape,
    seconds: float,
) -> Outcome:
    true = np.array([moment.theta for moment in clip])
    error = np.abs(bends_deg(keypoints_mm(theta, shape)) - bends_deg(keypoints_mm(true, shape)))
    ms = 1e3 * seconds / len(clip)
    return Outcome(name, samples, seed, float(error.mean()), float(error[:, 1:, 1].mean()), ms)
