"""What the networks are made of (PyTorch)."""

from torch import Tensor, nn
from torch.nn import functional


class Block(nn.Module):
    """Two convolutions beside a shortcut (He et al. 2016)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(width, width, 3, padding=1, bias=False)
        self.first_norm = nn.BatchNorm2d(width)
        self.second = nn.Conv2d(width, width, 3, padding=1, bias=False)
        self.second_norm = nn.BatchNorm2d(width)

    def forward(self, x: Tensor) -> Tensor:
        """``(n, width, h, w)`` in and out."""
        y = functional.relu(self.first_norm(self.first(x)))
        return functional.relu(x + self.second_norm(self.second(y)))


def convolved(wide_in: int, wide_out: int, size: int = 3, stride: int = 1) -> nn.Sequential:
    """A convolution, normalised and rectified; stride 2 halves the picture."""
    return nn.Sequential(
        nn.Conv2d(wide_in, wide_out, size, stride=stride, padding=size // 2, bias=False),
        nn.BatchNorm2d(wide_out),
        nn.ReLU(),
    )
