"""The command line: finding commands, settings files, one-line errors and exit codes."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Literal

import pytest
import tyro

from handtrack import cli
from handtrack.errors import InputError, OutputError


@dataclass(frozen=True)
class Probe:
    """Say what was understood.

    More on it.
    """

    clip: tyro.conf.Positional[str]
    """What to look at."""
    side: Literal["right", "left"] = "right"
    count: int = 3
    overlay: bool = True
    frames: tuple[int, ...] = ()
    config: Path | None = None

    def __call__(self) -> int:
        print(self.clip, self.side, self.count, self.overlay, self.frames)
        return 0


@dataclass(frozen=True)
class Failing:
    """Fail as told."""

    how: tyro.conf.Positional[str]

    def __call__(self) -> int:
        if self.how == "output":
            raise OutputError("out.csv: cannot write\nthe second line")
        if self.how == "bug":
            raise ZeroDivisionError("a bug")
        raise KeyboardInterrupt


@pytest.fixture(autouse=True)
def _commands(monkeypatch):
    module = ModuleType("probe_commands")
    module.Probe, module.Failing = Probe, Failing
    monkeypatch.setitem(sys.modules, "probe_commands", module)
    commands = {
        "probe": "probe_commands:Probe",
        "probe twice": "probe_commands:Probe",
        "fail": "probe_commands:Failing",
        "space fit": "probe_commands:Probe",
    }
    monkeypatch.setattr(cli, "COMMANDS", commands)


def test_two_words_come_before_one():
    assert cli.find_command(["probe", "twice", "x"]) == ("probe twice", ["x"])
    assert cli.find_command(["probe", "x"]) == ("probe", ["x"])


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["prob"], "did you mean 'probe'"),
        (["space"], "wants one of: fit"),
        (["probe"], "Missing"),
        (["probe", "x", "--count", "many"], "--count"),
        (["probe", "x", "--side", "up"], "'right', 'left'"),
        (["probe", "x", "--wat", "3"], "--wat"),
    ],
)
def test_wrong_usage_is_one_line_and_code_2(argv, says, capsys):
    assert cli.main(argv) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert says in err
    assert err.startswith("handtrack: ")


@pytest.mark.parametrize(("how", "code"), [("output", 3), ("bug", 1), ("stop", 130)])
def test_errors_become_a_line_and_a_code(how, code, capsys):
    assert cli.main(["fail", how]) == code
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("argv", [["--debug", "fail", "output"], ["fail", "output", "--debug"]])
def test_debug_shows_the_traceback(argv, capsys):
    assert cli.main(argv) == 3
    assert "Traceback" in capsys.readouterr().err


def test_settings_file_is_read_and_the_command_line_beats_it(tmp_path, capsys):
    path = tmp_path / "run.toml"
    path.write_text('side = "left"\ncount = 7\noverlay = false\nframes = [1, 2]\n')
    assert cli.main(["probe", "clip.mp4", "--count", "9", "--config", str(path)]) == 0
    assert capsys.readouterr().out == "clip.mp4 left 9 False (1, 2)\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("cout = 3", "unknown key 'cout' (did you mean 'count'?)"),
        ("config = 'x'", "unknown key 'config'"),
        ("clip = 'x'", "unknown key 'clip' here"),
        ("[count]\nx = 1", "'count' is a table"),
        ("count = ", "not a TOML file"),
    ],
)
def test_settings_file_is_refused_by_name(text, says, tmp_path):
    path = tmp_path / "run.toml"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        cli.parse(["probe", "x", "--config", str(path)])
    assert says in str(error.value)
    assert "run.toml" in str(error.value)


def test_missing_settings_file_is_named(tmp_path, capsys):
    assert cli.main(["probe", "x", f"--config={tmp_path / 'none.toml'}"]) == 2
    assert "none.toml: cannot be read" in capsys.readouterr().err


@pytest.mark.parametrize("argv", [[], ["--help"], ["-h"]])
def test_overview_lists_every_real_command_with_a_line_on_it(argv, monkeypatch, capsys):
    monkeypatch.undo()
    assert cli.main(argv) == 0
    out = capsys.readouterr().out
    for name, target in cli.COMMANDS.items():
        [line] = [line for line in out.splitlines() if line.strip().startswith(f"{name}  ")]
        assert len(line.split(name, 1)[1].strip()) > 10, target
        assert "not installed" not in line


def test_command_help_is_made_of_its_fields(capsys):
    assert cli.main(["probe", "--help"]) == 0
    out = capsys.readouterr().out
    assert "What to look at." in out
    assert "--count" in out


def test_version(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("handtrack 0.")


def test_reader_that_has_enough_is_no_fault():
    done = subprocess.run(
        f"{sys.executable} -c 'import sys; from handtrack.cli import main;"
        'from handtrack import cli; cli._report_errors(lambda: print("x" * 10**6) or 0, False)\''
        " | head -c 1",
        shell=True,
        capture_output=True,
        text=True,
    )
    assert (done.stdout, done.stderr) == ("x", "")
