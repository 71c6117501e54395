"""Exceptions of the workbench: three under one base, each with its exit code."""

import re

_MAX_QUOTED_CHARACTERS = 80  # of a quoted text: enough to find it in the file
_MAX_MESSAGE_CHARACTERS = 1000  # a dozen lines of a terminal, enough for the names of 100 sites
# From an opening quote to the closing one; to the end where none closes, so that time is linear.
_QUOTED_TEXT = re.compile(
    r"""(?<!\w)b?(?P<quote>['"])(?:(?!(?P=quote))[^\\]|\\.)*(?P=quote)?""", re.DOTALL
)


class WorkbenchError(Exception):
    """Base of every error that the workbench raises on purpose.

    The message is one sentence: what was wrong, where, and what to do. Texts of the user in it
    are made printable and short, as a file may hold anything.

    Args:
        message: the sentence.
    """

    exit_code = 1

    def __init__(self, message: str) -> None:
        super().__init__(_shorten_message(message))


class UsageError(WorkbenchError):
    """Invalid request, such as an unknown label or solver."""

    exit_code = 2


class InputError(WorkbenchError):
    """Unusable file or content; the message names the file, the element and the remedy."""

    exit_code = 3


class ConvergenceError(WorkbenchError):
    """Failure of a calculation to converge, such as the search for a static equilibrium."""

    exit_code = 4


def _shorten_message(message: str) -> str:
    """Return a message with printable characters, short quoted texts and a bounded length.

    What stands before and after a cut stays, because a message ends with its remedy.
    """
    printable = "".join(
        character if character.isprintable() or character == "\n" else ascii(character)[1:-1]
        for character in message
    )
    text = _QUOTED_TEXT.sub(_shorten_quoted, printable)
    if len(text) <= _MAX_MESSAGE_CHARACTERS:
        return text
    half = _MAX_MESSAGE_CHARACTERS // 2
    return f"{text[:half]} ... {text[-half:]}"


def _shorten_quoted(match: re.Match[str]) -> str:
    """Return a quoted text with at most some characters between its quotes.

    Both ends stay, for a path ends with the name of its file.
    """
    text, quote = match[0], match["quote"]
    if len(text) <= _MAX_QUOTED_CHARACTERS + 2 or not text.endswith(quote):
        return text
    half = _MAX_QUOTED_CHARACTERS // 2
    return f"{text[: half + 1]}...{text[-half - 1 :]}"
