"""Trained networks that ship, as OpenCV runs them."""

import threading
from functools import cache
from importlib import resources

import cv2
import numpy as np
from numpy.typing import NDArray


class TrainedNetwork:
    """A network with one input and one answer; threads that ask at a time take turns.

    Parameters
    ----------
    onnx : bytes
        What an ONNX file holds.
    """

    def __init__(self, onnx: bytes) -> None:
        self._network = cv2.dnn.readNetFromONNX(np.frombuffer(onnx, np.uint8))
        self._lock = threading.Lock()

    def __call__(self, seen: NDArray[np.float32]) -> NDArray[np.float32]:
        """The answer to a batch of one, ``(1, channels, h, w)``."""
        with self._lock:
            self._network.setInput(seen)
            return np.array(self._network.forward(), np.float32)


@cache
def shipped(package: str, file: str) -> TrainedNetwork:
    """The network in a file of a package, read once."""
    return TrainedNetwork((resources.files(package) / file).read_bytes())
