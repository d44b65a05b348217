"""``handtrack view``: open the report of a run in the browser."""

import webbrowser
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from handtrack.errors import InputError
from handtrack.output.provenance import RUN_JSON
from handtrack.output.report.writer import REPORT_HTML


@dataclass(frozen=True)
class View:
    """Open the report of a run in the browser: the clip, its layers and the curves."""

    folder: tyro.conf.Positional[Path]
    """The folder of a run (or the report.html in it)."""
    print_path: Annotated[bool, tyro.conf.arg(name="print")] = False
    """Print where the report is and open nothing."""

    def __call__(self) -> int:
        """Open it; the exit code is 0.

        Raises
        ------
        InputError
            There is no report, or no browser.
        """
        path = report_in(self.folder)
        print(path)
        if not self.print_path and not webbrowser.open(path.as_uri()):
            raise InputError(f"{path}: no browser could be started; open that file in one")
        return 0


def report_in(folder: Path) -> Path:
    """Where the report of a run is, as a full path.

    Raises
    ------
    InputError
        It is not there.
    """
    path = folder if folder.name == REPORT_HTML else folder / REPORT_HTML
    if path.is_file():
        return path.resolve()
    if not path.parent.exists():
        raise InputError(f"{folder}: no such folder; wanted what handtrack run wrote")
    if not path.parent.is_dir():
        raise InputError(f"{folder}: is no folder; wanted what handtrack run wrote")
    if (path.parent / RUN_JSON).is_file():
        raise InputError(f"{folder}: the run made no {REPORT_HTML}; run again without --no-report")
    raise InputError(f"{folder}: has no {REPORT_HTML}; wanted a folder that handtrack run wrote")
