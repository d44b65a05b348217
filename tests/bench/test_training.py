"""Training needs PyTorch, which handtrack itself does not: skipped where there is none."""

from dataclasses import replace
from itertools import islice

import cv2
import numpy as np
import pytest

from handtrack.evidence import shape_cue as shipped_cue
from handtrack.proposer.network import NUMBERS
from handtrack.proposer.picture import SIDE_PX
from handtrack.trained import TrainedNetwork
from synth.pictures import pictures

torch = pytest.importorskip("torch")


@pytest.fixture(scope="module")
def shown(gl):
    return list(islice(pictures(np.random.default_rng(3)), 30))


def test_a_few_steps_lower_the_proposers_loss_and_opencv_reads_what_is_written(tmp_path, shown):
    from handtrack.bench.training import proposer
    from handtrack.bench.training.proposer_model import HYPOTHESES, ProposerNetwork, loss_of

    test = proposer.some_lessons(shown, 30)(np.random.default_rng(4))
    learned = proposer.trained(shown, replace(proposer.SHIPPED, steps=40))
    torch.manual_seed(0)
    fresh = ProposerNetwork().eval()
    with torch.no_grad():
        before, after = (loss_of(net(test[0]), *test[1:]).item() for net in (fresh, learned))
        answer = learned(test[0][:1]).numpy()
    assert after < before
    proposer.write(learned, tmp_path / "net.onnx")
    network = cv2.dnn.readNetFromONNX(str(tmp_path / "net.onnx"))
    network.setInput(test[0][:1].numpy().reshape(1, 2, SIDE_PX, SIDE_PX))
    np.testing.assert_allclose(network.forward(), answer, atol=1e-4)
    assert answer.shape == (1, HYPOTHESES * NUMBERS)


def test_a_few_steps_lower_the_facing_cues_loss_and_opencv_reads_what_is_written(tmp_path, shown):
    from handtrack.bench.training import facing_cue
    from handtrack.bench.training.facing_model import FacingNetwork, facing_loss

    test = facing_cue.some_lessons(shown, 60)(np.random.default_rng(4))
    assert {tuple(truth) for truth in test[1].tolist()} == {(a, b) for a in (0, 1) for b in (0, 1)}
    learned = facing_cue.trained(shown, replace(facing_cue.SHIPPED, steps=40))
    torch.manual_seed(0)
    fresh = FacingNetwork().eval()
    with torch.no_grad():
        before, after = (facing_loss(net(test[0]), test[1]).item() for net in (fresh, learned))
        answer = learned(test[0][:1]).numpy()
    assert after < before
    facing_cue.write(learned, tmp_path / "net.onnx")
    network = TrainedNetwork((tmp_path / "net.onnx").read_bytes())
    np.testing.assert_allclose(network(test[0][:1].numpy()), answer, atol=1e-4)


def test_a_few_steps_lower_the_shape_cues_loss_and_opencv_reads_what_is_written(tmp_path, shown):
    from handtrack.bench.training import shape_cue
    from handtrack.bench.training.grounds import ground
    from handtrack.bench.training.shape_model import ShapeNetwork, shape_loss

    rng = np.random.default_rng(5)
    grounds = [ground([], [], rng) for _ in range(20)]
    test = shape_cue.some_scenes(shown, grounds, 30)(np.random.default_rng(4))
    learned = shape_cue.trained(shown, grounds, replace(shape_cue.SHIPPED, steps=30))
    torch.manual_seed(0)
    fresh = ShapeNetwork().eval()
    picture = np.random.default_rng(6).integers(0, 256, (64, 96, 3), dtype=np.uint8)
    seen = torch.from_numpy(picture.transpose(2, 0, 1)[None].astype(np.float32))
    with torch.no_grad():
        before, after = (shape_loss(net(test[0]), test[1]).item() for net in (fresh, learned))
        answer = learned(seen).numpy()[0, 0]
    assert after < before
    shape_cue.write(learned, tmp_path / "net.onnx")
    network = TrainedNetwork((tmp_path / "net.onnx").read_bytes())
    np.testing.assert_allclose(
        shipped_cue.log_odds(picture, network), cv2.resize(answer, (96, 64)), atol=1e-3
    )
