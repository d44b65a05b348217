"""A page on this machine that shows pictures as they come: MJPEG, which every browser plays.

Bound to the loopback address, so that nobody else on the network sees it, and only for requests
that name it so, lest a page from elsewhere reads it under a name of its own that points here.
"""

import threading
from collections.abc import Iterator
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2
import numpy as np

from handtrack.errors import InputError
from handtrack.evidence.orientation import Image

HOST = "127.0.0.1"
BOUNDARY = "picture"
JPEG_QUALITY = 85
STREAM = "/stream.mjpg"
HTML = f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>handtrack, live</title>
<link rel="icon" href="data:,">
<style>
  body {{ margin: 0; background: #222; color: #ddd; font: 14px sans-serif; text-align: center }}
  img {{ max-width: 100vw; max-height: calc(100vh - 3em) }}
</style></head>
<body><img src="{STREAM}" alt="the camera's picture with the hand drawn over it">
<p>Ctrl-C in the terminal ends it and leaves the tables.</p></body></html>
""".encode()


class Newest:
    """The newest picture as JPEG, encoded only if somebody looks, and once for all who do."""

    def __init__(self) -> None:
        self._news = threading.Condition()
        self._n, self._image, self._jpeg = 0, np.zeros((1, 1, 3), np.uint8), b""
        self._ended = False

    def put(self, image: Image) -> None:
        """A newer picture, RGB ``(H, W, 3)``, that nobody changes any more."""
        with self._news:
            self._n, self._image, self._jpeg = self._n + 1, image, b""
            self._news.notify_all()

    def end(self) -> None:
        """No more pictures."""
        with self._news:
            self._ended = True
            self._news.notify_all()

    def jpegs(self) -> Iterator[bytes]:
        """Every picture that is the newest when asked for, until the end."""
        seen = 0
        while True:
            with self._news:
                self._news.wait_for(lambda: self._ended or self._n > seen)  # noqa: B023
                if self._ended:
                    return
                seen = self._n
                if not self._jpeg:
                    bgr = np.ascontiguousarray(self._image[:, :, ::-1])
                    quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
                    self._jpeg = cv2.imencode(".jpg", bgr, quality)[1].tobytes()
                jpeg = self._jpeg
            yield jpeg


class Page:
    """The server.

    Parameters
    ----------
    port : int
        0 takes one that is free.

    Raises
    ------
    InputError
        The port cannot be had.
    """

    def __init__(self, port: int) -> None:
        self._newest = Newest()
        try:
            self._server = _Server((HOST, port), _Handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(
                f"--port {port}: cannot be had ({reason}); 0 takes a free one"
            ) from error
        self._server.newest = self._newest
        self.address = f"http://{HOST}:{self._server.server_port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, name="page", daemon=True)
        self._thread.start()

    def show(self, image: Image) -> None:
        """Show a picture, RGB ``(H, W, 3)``."""
        self._newest.put(image)

    def close(self) -> None:
        """End all streams and the server."""
        self._newest.end()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    newest: Newest


class _Handler(BaseHTTPRequestHandler):
    server: _Server

    def do_GET(self) -> None:
        port = self.server.server_port
        if self.headers.get("Host") not in (f"{HOST}:{port}", f"localhost:{port}"):
            self.send_error(HTTPStatus.FORBIDDEN)
        elif self.path == "/":
            self._send_page()
        elif self.path == STREAM:
            self._send_stream()
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: the terminal belongs to the progress bar."""

    def _send_page(self) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(HTML)))
        self.end_headers()
        self.wfile.write(HTML)

    def _send_stream(self) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={BOUNDARY}")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        try:
            for jpeg in self.server.newest.jpegs():
                head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}"
                self.wfile.write(f"{head}\r\n\r\n".encode() + jpeg + b"\r\n")
            self.wfile.write(f"--{BOUNDARY}--\r\n".encode())
        except ConnectionError:
            self.close_connection = True  # whoever looked has closed the page
