"""Exceptions of the workbench: three under one base, each with its exit code."""


class WorkbenchError(Exception):
    """Base of every error that the workbench raises on purpose.

    The message is one sentence: what was wrong, where, and what to do.
    """

    exit_code = 1


class UsageError(WorkbenchError):
    """Invalid request, such as an unknown label or solver."""

    exit_code = 2


class InputError(WorkbenchError):
    """Unusable file or content; the message names the file, the element and the remedy."""

    exit_code = 3


class ConvergenceError(WorkbenchError):
    """Failure of a calculation to converge, such as the search for a static equilibrium."""

    exit_code = 4
