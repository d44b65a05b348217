"""The command line: ``handtrack COMMAND ...``, each command imported only when it is asked for.

A command is a frozen dataclass that can be called: its fields are the options (one definition
each; tyro makes flags and help of them), its ``__call__`` does the work and returns the exit
code. A field named ``config`` makes the command read a TOML file whose keys are its options; the
command line beats the file, and a key that is no option is refused by name.

To add a command, add a line to :data:`COMMANDS`.

>>> find_command(["run", "clip.mp4"])
('run', ['clip.mp4'])
"""

import ast
import contextlib
import difflib
import importlib
import importlib.util
import io
import itertools
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import fields
from importlib import metadata
from pathlib import Path
from typing import Any

import tyro

from handtrack.errors import EXIT_INTERRUPTED, HandtrackError, InputError
from handtrack.toml_file import read_toml

#: What a shell says of a program that SIGPIPE ended.
EXIT_BROKEN_PIPE = 141

#: What is typed (one or two words) -> ``module:Class``.
COMMANDS: dict[str, str] = {
    "batch": "handtrack.batch.commands:Batch",
    "bench": "handtrack.bench.commands:Bench",
    "bench ablations": "handtrack.bench.commands:BenchAblations",
    "bench calibration": "handtrack.bench.calibration:BenchCalibration",
    "bench clip": "handtrack.bench.peer:BenchClip",
    "bench handover": "handtrack.bench.handover:BenchHandover",
    "bench limit": "handtrack.bench.limit:BenchLimit",
    "bench palm": "handtrack.bench.palm:BenchPalm",
    "bench samples": "handtrack.bench.commands:BenchSamples",
    "bench speed": "handtrack.bench.commands:BenchSpeed",
    "calibrate board": "calib.commands:CalibrateBoard",
    "calibrate camera": "calib.commands:CalibrateCamera",
    "calibrate hand": "calib.commands:CalibrateHand",
    "demo": "synth.commands:Demo",
    "export": "handtrack.output.export:Export",
    "handover": "handtrack.mocap.commands:HandoverCommand",
    "markers attach": "handtrack.mocap.commands:MarkersAttach",
    "markers rank": "handtrack.mocap.commands:MarkersRank",
    "run": "handtrack.settings:RunSettings",
    "view": "handtrack.output.view:View",
    "synth": "synth.commands:Synth",
    "space excerpt": "handtrack.hand.commands:SpaceExcerpt",
    "space fit": "handtrack.hand.commands:SpaceFit",
    "space report": "handtrack.hand.commands:SpaceReport",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command named by ``arguments`` (default: ``sys.argv``) and return its exit code."""
    argv = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in argv
    while argv[:1] == ["--debug"]:
        argv.pop(0)
    if not argv or argv[0] in ("-h", "--help", "help"):
        print(overview())
        return 0
    if argv[0] == "--version":
        print(f"handtrack {metadata.version('handtrack')}")
        return 0
    return _report_errors(lambda: parse(argv)(), debug)


def overview() -> str:
    """The list of commands with a line on each."""
    width = max(map(len, COMMANDS), default=0)
    lines = [f"  {name:{width}}  {_summary(COMMANDS[name])}" for name in sorted(COMMANDS)]
    return "\n".join(
        [
            "usage: handtrack COMMAND ...    (handtrack COMMAND --help says more)",
            "",
            "Joint angles of a human hand over time, from an ordinary video.",
            "",
            *lines,
            "",
            "  --version  print the version        --debug  show the traceback of an error",
        ]
    )


def find_command(argv: Sequence[str]) -> tuple[str, list[str]]:
    """The command at the start of ``argv``, two words before one, and what is left.

    Raises
    ------
    InputError
        There is no such command.
    """
    for words in (2, 1):
        name = " ".join(argv[:words])
        if len(argv) >= words and name in COMMANDS:
            return name, list(argv[words:])
    second = sorted(name.split()[1] for name in COMMANDS if name.split()[:-1] == [argv[0]])
    if second:
        raise InputError(f"handtrack {argv[0]} wants one of: {', '.join(second)}")
    close = difflib.get_close_matches(argv[0], COMMANDS, n=1)
    hint = f"did you mean '{close[0]}'?" if close else "handtrack --help lists the commands"
    raise InputError(f"no command '{argv[0]}'; {hint}")


def parse(argv: Sequence[str]) -> Callable[[], int]:
    """The command that ``argv`` asks for, with its options filled in, ready to be called."""
    name, rest = find_command(argv)
    module, _, attribute = COMMANDS[name].partition(":")
    command = getattr(importlib.import_module(module), attribute)
    options = {field.name: field.type for field in fields(command)}
    rest = _without_bare_debug(rest, takes_value="debug" in options)
    if "config" in options and (path := _config_path(rest)) is not None:
        given = {word.partition("=")[0].replace("_", "-") for word in rest}
        rest += [w for flags in config_flags(path, options, given) for w in flags]
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            parsed: Callable[[], int] = tyro.cli(command, prog=f"handtrack {name}", args=rest)
    except SystemExit as stop:
        if not stop.code:
            raise
        raise InputError(f"{_one_line(said.getvalue())}; see handtrack {name} --help") from None
    return parsed


def config_flags(path: Path, options: dict[str, Any], given: set[str]) -> list[list[str]]:
    """The flags that stand for the keys of the TOML file at ``path``, but for those ``given``.

    Raises
    ------
    InputError
        The file cannot be read, is not TOML, or has a key that is no option.
    """
    document = read_toml(path)
    flags = []
    for key, value in document.items():
        name = key.replace("-", "_")
        positional = "Positional" in str(options.get(name))
        if name not in options or name == "config" or positional:
            close = difflib.get_close_matches(name, options, n=1)
            hint = f" (did you mean '{close[0]}'?)" if close and not positional else ""
            where = " here; give it on the command line" if positional else hint
            raise InputError(f"{path}: unknown key '{key}'{where}")
        flag = name.replace("_", "-")
        if not {f"--{flag}", f"--no-{flag}"} & given:
            flags.append(_flags_of(path, flag, value))
    return flags


def _flags_of(path: Path, name: str, value: Any) -> list[str]:
    if isinstance(value, bool):
        return [f"--{name}" if value else f"--no-{name}"]
    if isinstance(value, list):
        return [f"--{name}", *map(str, value)]
    if isinstance(value, dict):
        raise InputError(f"{path}: '{name}' is a table; settings are plain 'key = value' lines")
    return [f"--{name}={value}"]


def _config_path(argv: Sequence[str]) -> Path | None:
    """The value of the last ``--config`` in ``argv``."""
    path = None
    for k, word in enumerate(argv):
        if word == "--config" and k + 1 < len(argv):
            path = Path(argv[k + 1])
        elif word.startswith("--config="):
            path = Path(word.removeprefix("--config="))
    return path


def _without_bare_debug(argv: Sequence[str], takes_value: bool) -> list[str]:
    """Drop ``--debug`` where it has no folder behind it: it then only asks for the traceback."""
    following = [*argv, "-"][1:]
    return [
        word
        for word, after in zip(argv, following, strict=True)
        if word != "--debug" or (takes_value and not after.startswith("-"))
    ]


def _one_line(box: str) -> str:
    """The first message in tyro's framed text, on one line."""
    lines = [line.strip("│|+ ") for line in box.splitlines()]
    below_title = itertools.dropwhile(_is_rule, lines[1:])
    message = itertools.takewhile(lambda line: not _is_rule(line), below_title)
    return " ".join(message).strip(" .") or "cannot read the options"


def _is_rule(line: str) -> bool:
    return line.startswith(("───", "---"))


def _summary(target: str) -> str:
    """First line of a command's docstring, read from the source: nothing is imported for it."""
    module, _, attribute = target.partition(":")
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        return "(not installed)"
    for node in ast.parse(Path(spec.origin).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef) and node.name == attribute:
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return "(not installed)"


def _report_errors(call: Callable[[], int], debug: bool) -> int:
    """Call, and turn every error into one line on stderr and an exit code."""
    try:
        return call()
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else int(bool(stop.code))
    except KeyboardInterrupt:
        print("handtrack: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # whoever reads our output has enough; what is left of it goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_BROKEN_PIPE
    except HandtrackError as error:
        if debug:
            traceback.print_exc()
        print(f"handtrack: {' '.join(str(error).split())}", file=sys.stderr)
        return error.exit_code
    except Exception as error:
        if debug:
            traceback.print_exc()
        text = " ".join(str(error).split())
        print(
            f"handtrack: internal error ({type(error).__name__}: {text}); "
            "this is a fault of ours: --debug shows where",
            file=sys.stderr,
        )
        return HandtrackError.exit_code
