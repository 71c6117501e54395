"""Terms in the slopes of all chosen parameters, stacked into one sparse matrix for each target."""

from collections.abc import Mapping, Sequence

import numpy as np

from identification.words import Integers, Mask, Real
from mbmodel.frf.slope_matrix import SlopeMatrix, stack_slopes
from mbmodel.frf.slope_terms import SlopeTerm, Target, act_on_joints, slope_terms
from mbmodel.frf.solution import FrfSolution
from mbmodel.parts import Change

TermsByTarget = Mapping[Target, Sequence[tuple[Integers, SlopeTerm]]]


def collect_terms(
    solution: FrfSolution, slopes: Sequence[tuple[Change, ...]], chosen: Sequence[Mask], rates: Real
) -> TermsByTarget:
    """Return the terms of all parameters by target, each with the numbers of its parameters.

    Args:
        solution: the model linearised at theta.
        slopes: slopes of each Part.
        chosen: whether each parameter of a Part is chosen.
        rates: factor of each chosen parameter.
    """
    terms: dict[Target, list[tuple[Integers, SlopeTerm]]] = {"force": [], "load": []}
    start = 0
    for number, (mask, changes) in enumerate(zip(chosen, slopes, strict=True)):
        first, start = start, start + int(np.count_nonzero(mask))
        if not changes or first == start:
            continue
        indices = np.arange(first, start)
        for change in changes:
            core = change.core[mask] * rates[indices][:, None, None, None]
            for term in slope_terms(solution, number, change, core):
                terms.setdefault(term.target, []).append((indices, term))
    return terms


def move_loads_to_joints(terms: TermsByTarget, to_joints: Real) -> TermsByTarget:
    """Return terms whose loads on bodies are pseudo-forces on the joints.

    Args:
        terms: terms by target.
        to_joints: T'; (nv, 6 n_body).
    """
    loads = [(indices, act_on_joints(term, to_joints)) for indices, term in terms["load"]]
    return {**terms, "force": [*terms["force"], *loads], "load": []}


def stack_terms(
    solution: FrfSolution, terms: TermsByTarget, count: int
) -> dict[Target, SlopeMatrix]:
    """Return the matrix of each target that has entries.

    Args:
        solution: the model linearised at theta.
        terms: terms by target.
        count: number of chosen parameters: forces and loads have all of them.
    """
    n_joint, n_in = len(solution.motion), solution.values.shape[2]
    n_out, n_body = solution.ports.readout.shape
    targets: dict[Target, int] = {"force": n_joint, "motion": n_body, "readout": n_out}
    targets["load"] = n_body
    widths = {"joints": n_joint, "inputs": n_in, "floor": n_in}
    widths |= dict.fromkeys(("relative", "absolute", "body_loads"), n_body)
    matrices = {
        target: stack_slopes(
            of_target, (targets[target], widths), count if target in ("force", "load") else None
        )
        for target, of_target in terms.items()
    }
    return {target: slopes for target, slopes in matrices.items() if slopes.matrix.nnz}
