"""The network of the facing cue (PyTorch): palm or back, and which way round."""

from torch import Tensor, nn
from torch.nn import functional

from handtrack.bench.training.blocks import Block, convolved
from handtrack.proposer.picture import SIDE_PX

#: Channels at a half, a quarter, an eighth and a sixteenth of the picture's resolution.
WIDTHS = (16, 32, 64, 96)
HIDDEN = 96
#: Share of the labels that is in doubt: it keeps log odds from growing without end.
SMOOTHED = 0.02


class FacingNetwork(nn.Module):
    """Pictures ``(n, 2, SIDE_PX, SIDE_PX)`` to log odds ``(n, 2)``.

    Of a palm, and of the thumb to the right of fingers that point up.
    """

    def __init__(self) -> None:
        super().__init__()
        a, b, c, d = WIDTHS
        self.body = nn.Sequential(
            *(convolved(2, a, 5, stride=2), convolved(a, b, stride=2), Block(b)),
            *(convolved(b, c, stride=2), Block(c), convolved(c, d, stride=2), Block(d)),
            *(convolved(d, 32, 1), nn.Flatten(), nn.Dropout(0.3)),
        )
        self.hidden = nn.Linear(32 * (SIDE_PX // 16) ** 2, HIDDEN)
        self.out = nn.Linear(HIDDEN, 2)

    def forward(self, pictures: Tensor) -> Tensor:
        """Log odds."""
        answer: Tensor = self.out(functional.relu(self.hidden(self.body(pictures))))
        return answer


def facing_loss(log_odds: Tensor, truth: Tensor) -> Tensor:
    """Cross entropy; both are ``(n, 2)``, the truth 0 or 1."""
    wanted = (1 - SMOOTHED) * truth + 0.5 * SMOOTHED
    return functional.binary_cross_entropy_with_logits(log_odds, wanted)
