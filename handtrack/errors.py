"""What can go wrong, said in one line that names the thing and the way out.

Every error that a user can cause inherits :class:`HandtrackError`; the command line prints
its text, exits with its ``exit_code`` and shows a traceback only with ``--debug``.

>>> issubclass(InputError, HandtrackError), InputError.exit_code
(True, 2)
"""


class HandtrackError(Exception):
    """Base of all errors with a message for people."""

    exit_code = 1


class InputError(HandtrackError):
    """A file, an option or a value that the user gave cannot be used."""

    exit_code = 2


class OutputError(HandtrackError):
    """Results cannot be written where they should go."""

    exit_code = 3


class NothingUsableError(HandtrackError):
    """The work was done and nothing usable came out (no hand in any frame)."""

    exit_code = 4


#: Exit code of a run that is complete but for frames that could not be decoded.
EXIT_SOME_UNDECODABLE = 5
#: Exit code of a batch in which some clip has no result.
EXIT_SOME_CLIPS_FAILED = 6
#: Exit code of a run that Ctrl-C or SIGTERM ended; what was done so far is kept.
EXIT_INTERRUPTED = 130
