"""How hits become FRFs: what a user may state, and what is found from the records otherwise."""

from dataclasses import dataclass

from identification.words import Estimator


@dataclass(frozen=True)
class HitSettings:
    """The keys of a ``[[test]]`` of time records; None leaves the choice to the records.

    Args:
        block_s: length of the block of each hit [s].
        pretrigger_s: part of it before the hit's first rise [s].
        force_window_s: how long the force is kept from its first rise on [s]; 0 keeps all of it.
        exponential_tau: time constant of the exponential window [s]; 0 for none.
        estimator: H1 (noise on the responses), H2 (on the force), Hv (on both).
        reject: whether double, clipped, weak, copied and outlying hits are left out. Hits whose
            block leaves the record always are.
    """

    block_s: float | None = None
    pretrigger_s: float | None = None
    force_window_s: float | None = None
    exponential_tau: float | None = None
    estimator: Estimator = "H1"
    reject: bool = True
