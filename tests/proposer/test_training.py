"""Training needs PyTorch, which handtrack itself does not: skipped where there is none."""

from itertools import islice

import cv2
import numpy as np
import pytest

from handtrack.proposer.network import NUMBERS
from handtrack.proposer.picture import SIDE_PX
from synth.pictures import pictures

torch = pytest.importorskip("torch")


def test_a_few_steps_lower_the_loss_and_opencv_reads_what_is_written(tmp_path, gl):
    from handtrack.bench.training.lessons import lesson_from
    from handtrack.bench.training.model import HYPOTHESES, Network, loss_of
    from handtrack.bench.training.train import TrainingSettings, export, stacked, train

    shown = list(islice(pictures(np.random.default_rng(3)), 30))
    rng = np.random.default_rng(4)
    test = stacked([lesson_from(picture, rng) for picture in shown])
    learned = train(shown, TrainingSettings(steps=40))
    torch.manual_seed(0)
    fresh = Network().eval()
    with torch.no_grad():
        before, after = (loss_of(net(test[0]), *test[1:]).item() for net in (fresh, learned))
        answer = learned(test[0][:1]).numpy()
    assert after < before
    export(learned, tmp_path / "net.onnx")
    network = cv2.dnn.readNetFromONNX(str(tmp_path / "net.onnx"))
    network.setInput(test[0][:1].numpy().reshape(1, 2, SIDE_PX, SIDE_PX))
    np.testing.assert_allclose(network.forward(), answer, atol=1e-4)
    assert answer.shape == (1, HYPOTHESES * NUMBERS)
