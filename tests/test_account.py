"""What a run says of itself."""

import subprocess
import sys

import pytest


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells it of one program alone")
def test_the_peak_of_memory_is_not_that_of_who_started_the_program():
    child = "from handtrack.account import peak_memory_mb; print(peak_memory_mb())"
    parent = (
        "import subprocess, sys; held = b'x' * (600 << 20);"
        "subprocess.run([sys.executable, '-c', sys.argv[1]], check=True)"
    )
    done = subprocess.run(
        [sys.executable, "-c", parent, child], capture_output=True, text=True, check=True
    )
    assert 10 < float(done.stdout) < 500
