"""The network of the shape cue (PyTorch): what of a picture is hand, pixel by pixel.

A small U-net (Ronneberger et al., "U-Net", 2015) with residual blocks, whose answer has half the
picture's resolution.
"""

import itertools

import torch
from torch import Tensor, nn
from torch.nn import functional

from handtrack.bench.training.blocks import Block, convolved

#: Channels at a half to a thirty-second of the picture's resolution.
WIDTHS = (16, 32, 64, 96, 128)
#: Weight of the overlap in what is minimised, where a scene shows more hand than this.
OVERLAP, FEWEST = 0.1, 5.0


class Joined(nn.Module):
    """What was seen coarsely, doubled, beside what was seen finely."""

    def __init__(self, coarse: int, fine: int) -> None:
        super().__init__()
        self.mix = nn.Sequential(*convolved(coarse + fine, fine, 1), *convolved(fine, fine))

    def forward(self, coarse: Tensor, fine: Tensor) -> Tensor:
        """``(n, coarse, h, w)`` and ``(n, fine, 2 h, 2 w)`` to ``(n, fine, 2 h, 2 w)``."""
        doubled = functional.interpolate(coarse, scale_factor=2.0, mode="nearest")
        joined: Tensor = self.mix(torch.cat([doubled, fine], dim=1))
        return joined


class ShapeNetwork(nn.Module):
    """RGB ``(n, 3, h, w)`` in 0 to 255 to log odds of hand ``(n, 1, h / 2, w / 2)``.

    Both sides are multiples of 32.
    """

    def __init__(self) -> None:
        super().__init__()
        self.first = convolved(3, WIDTHS[0], 5, stride=2)
        pairs = list(itertools.pairwise(WIDTHS))
        self.down = nn.ModuleList(
            nn.Sequential(convolved(a, b, stride=2), Block(b)) for a, b in pairs
        )
        self.up = nn.ModuleList(Joined(b, a) for a, b in reversed(pairs))
        self.out = nn.Conv2d(WIDTHS[0], 1, 1)

    def forward(self, rgb: Tensor) -> Tensor:
        """Log odds."""
        seen = [self.first((rgb - 128.0) / 64.0)]
        for down in self.down:
            seen.append(down(seen[-1]))
        x = seen.pop()
        for up in self.up:
            x = up(x, seen.pop())
        answer: Tensor = self.out(x)
        return answer


def shape_loss(log_odds: Tensor, skin: Tensor) -> Tensor:
    """Cross entropy of what is hand, and a little of the overlap that small hands miss.

    ``log_odds`` and the shares ``skin`` are ``(n, 1, h, w)``.
    """
    p = torch.sigmoid(log_odds)
    both, either = (p * skin).sum((1, 2, 3)), p.sum((1, 2, 3)) + skin.sum((1, 2, 3))
    shown = (skin.sum((1, 2, 3)) > FEWEST).float()
    missed = (shown * (1 - (2 * both + 1) / (either + 1))).mean()
    return functional.binary_cross_entropy_with_logits(log_odds, skin) + OVERLAP * missed
