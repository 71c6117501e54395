"""Summary of a simulation for ``--json`` and the terminal."""

from identification.readers.result_files import ResultFile


class SimulationSummary(ResultFile):
    """Summary of ``mbw simulate``.

    Args:
        model: path of the MJCF.
        kind: ``hammer test`` or ``signal``.
        integrator: ``RK4``, ``implicitfast`` or ``discrete``.
        step: of the integration [s].
        error: estimated error of the channels, relative to their rms; null if an estimate failed.
        span: time over which it was estimated [s].
        files: files that were written.
        hits: number of hits of a hammer test; null for a signal.
        rate: samples per second of records and responses [Hz].
        duration: of one record [s].
        seconds: of simulated time.
    """

    model: str
    kind: str
    integrator: str
    step: float
    error: float | None
    span: float
    files: list[str]
    hits: int | None
    rate: float
    duration: float
    seconds: float


def count_noun(count: int, noun: str) -> str:
    """Return a number with its noun, such as ``1 hit`` and ``10 hits``.

    Args:
        count: number of things.
        noun: their name, in the singular.
    """
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
