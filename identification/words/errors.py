"""The exceptions of the workbench: three under one base, each with its exit code."""


class WorkbenchError(Exception):
    """Base of every error that the workbench raises on purpose.

    The message is one sentence: what came, where, and what to do.
    """

    exit_code = 1


class UsageError(WorkbenchError):
    """A question that makes no sense, such as an unknown label or solver."""

    exit_code = 2


class InputError(WorkbenchError):
    """A file or its content cannot be used; names file, element and remedy."""

    exit_code = 3


class ConvergenceError(WorkbenchError):
    """A calculation did not reach an answer, such as a static equilibrium."""

    exit_code = 4
