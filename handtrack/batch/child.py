"""The process that one clip runs in: ``handtrack run``, which ends when its parent does.

Its standard input is a pipe whose other end the parent holds and never writes to. Should the
parent die, even by SIGKILL, the pipe closes, and the run is asked to stop as by SIGTERM: a killed
worker leaves no run behind that eats a core for a result nobody takes.
"""

import os
import signal
import sys
import threading
import time

from handtrack.cli import main

#: How long a run may take to stop by itself when its parent is gone.
GRACE_S = 10.0


def _end_with_parent() -> None:
    while os.read(0, 1):
        pass  # nothing is ever said on this pipe: it only closes
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(GRACE_S)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()
    sys.exit(main())
