"""Settings for the estimation of FRFs from hits."""

from dataclasses import dataclass

from identification.words import Estimator


@dataclass(frozen=True)
class HitSettings:
    """Settings of a ``[[test]]`` of time records; None chooses a value from the records.

    Args:
        block_s: length of the block of each hit [s].
        pretrigger_s: part of the block before the first rise of the force [s].
        force_window_s: duration from its first rise for which the force is kept [s]; 0 for all.
        exponential_tau: time constant of the exponential window [s]; 0 for no window.
        window_tau: time constant of an exponential window that the analyser has applied to force
            and motion already [s]; 0 for none.
        estimator: H1 (noise on the responses), H2 (noise on the force) or Hv (noise on both).
        reject: whether to leave out double, clipped, weak, copied and outlying hits. Hits whose
            block does not fit into the record are always left out.
        period_s: time after which a force that never rests repeats [s].
        left_out: numbers of further hits to leave out, from 1.
    """

    block_s: float | None = None
    pretrigger_s: float | None = None
    force_window_s: float | None = None
    exponential_tau: float | None = None
    window_tau: float = 0.0
    estimator: Estimator = "H1"
    reject: bool = True
    period_s: float | None = None
    left_out: frozenset[int] = frozenset()
