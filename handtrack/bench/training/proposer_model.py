"""The proposer's network and what it is trained to minimise (PyTorch).

A small residual network whose answer is a mixture: the loss is the negative log likelihood of the
true hand under it (Bishop, "Mixture Density Networks", 1994).
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from handtrack.bench.training.blocks import Block, convolved
from handtrack.proposer.network import LOG_SPREAD, LOG_STD, NUMBERS
from handtrack.proposer.picture import SIDE_PX

HYPOTHESES = 5
#: Channels at a half, a quarter, an eighth and a sixteenth of the picture's resolution.
WIDTHS = (20, 36, 72, 160)
HIDDEN = 384
#: How much every hypothesis learns from every hand, so that none is left without any.
ALL_LEARN, SOFTNESS = 0.02, 20.0


class ProposerNetwork(nn.Module):
    """Pictures ``(n, 2, SIDE_PX, SIDE_PX)`` to answers ``(n, HYPOTHESES * NUMBERS)``."""

    def __init__(self) -> None:
        super().__init__()
        a, b, c, d = WIDTHS
        self.body = nn.Sequential(
            *(convolved(2, a, 5, stride=2), convolved(a, b, stride=2), Block(b)),
            *(convolved(b, c, stride=2), Block(c), convolved(c, d, stride=2), Block(d)),
            *(convolved(d, 64, 1), nn.Flatten()),
        )
        self.hidden = nn.Linear(64 * (SIDE_PX // 16) ** 2, HIDDEN)
        self.out = nn.Linear(HIDDEN, HYPOTHESES * NUMBERS)
        start = torch.zeros(HYPOTHESES, NUMBERS)
        start[:, 1:21], start[:, 21:41] = 0.5, -1.0  # fingers half bent, spread 20 deg
        start[:, 41:47] = torch.randn(HYPOTHESES, 6)
        start[:, 50:] = torch.tensor([-0.7, -1.5, -1.5])
        with torch.no_grad():
            self.out.weight *= 0.3
            self.out.bias.copy_(start.flatten())

    def forward(self, pictures: Tensor) -> Tensor:
        """The numbers that :func:`handtrack.proposer.network.decode` reads."""
        answer: Tensor = self.out(functional.relu(self.hidden(self.body(pictures))))
        return answer


def log_likelihoods(answer: Tensor, theta: Tensor, R: Tensor, place: Tensor) -> Tensor:
    """Log weight plus log density ``(n, HYPOTHESES)`` of true hands, up to a constant."""
    parts = answer.view(-1, HYPOTHESES, NUMBERS).split([1, 20, 20, 6, 3, 3], dim=-1)
    logit, mean, log_std, axes, at, spread = parts
    log_std, spread = log_std.clamp(*LOG_STD), spread.clamp(*LOG_SPREAD)
    fingers = -0.5 * ((theta[:, None] - mean) / log_std.exp()) ** 2 - log_std
    turn2 = ((rotations(axes) - R[:, None]) ** 2).sum((-1, -2)) / 2  # angle^2, for small ones
    turn, across, size = spread.unbind(-1)
    off2 = (place[:, None] - at) ** 2
    density = fingers.sum(-1)
    density = density - 0.5 * turn2 * (-2 * turn).exp() - 3 * turn
    density = density - 0.5 * off2[..., :2].sum(-1) * (-2 * across).exp() - 2 * across
    density = density - 0.5 * off2[..., 2] * (-2 * size).exp() - size
    return functional.log_softmax(logit[..., 0], -1) + density


def rotations(axes: Tensor) -> Tensor:
    """As :func:`handtrack.proposer.network.rotations`, ``(..., 6)`` to ``(..., 3, 3)``."""
    a = functional.normalize(axes[..., :3], dim=-1)
    b = axes[..., 3:] - (a * axes[..., 3:]).sum(-1, keepdim=True) * a
    b = functional.normalize(b, dim=-1)
    return torch.stack([a, b, torch.cross(a, b, dim=-1)], -1)


def loss_of(answer: Tensor, theta: Tensor, R: Tensor, place: Tensor) -> Tensor:
    """Mean negative log likelihood, and a little of it for every hypothesis on its own."""
    each = log_likelihoods(answer, theta, R, place)
    alone = SOFTNESS * functional.softplus(-each / SOFTNESS)
    return -torch.logsumexp(each, -1).mean() + ALL_LEARN * alone.mean()
