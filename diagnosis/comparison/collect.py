"""From fits to evidence: what a verdict is judged by, as plain numbers."""

from collections.abc import Sequence
from typing import Any

from diagnosis.data_checks.sensors import Gate
from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.evidence import Evidence, Paired, Refitted
from diagnosis.refits.refitting import Refit, off_by, source_of, unbounded
from diagnosis.search.ladder import Search


def gathered(
    scene: Scene,
    gate: Gate,
    proven: Sequence[Hypothesis],
    nothing: Refit,
    found: Search,
    changing: int,
) -> Evidence:
    """What the judgement reads.

    Args:
        scene: of the search.
        gate: what sensors tell among each other.
        proven: hypotheses of that.
        nothing: the refit without any effect.
        found: what was tried.
        changing: how many tests met different machines from hit to hit.
    """
    loose, pull = 1 + nothing.gap, 0.0
    if not nothing.is_noise:
        freed = nothing if nothing.loose is not None else unbounded(scene, nothing)
        loose = loose if freed.loose is None else freed.loose
        pull = pull if freed.pull is None else freed.pull
    return Evidence(
        proven=tuple(one.key for one in proven),
        unknown=gate.unknown,
        cost=nothing.cost,
        chi_square=nothing.chi_square,
        serial=nothing.serial,
        doubt=nothing.doubt,
        loose=loose,
        pull=pull,
        refits=tuple(
            Refitted(
                effect=one.hypothesis.effect,
                location=one.hypothesis.location,
                dof=one.hypothesis.dof,
                off=off_by(one, one.hypothesis),
                **_leaves(one),
            )
            for one in found.refits
            if one.hypothesis is not None
        ),
        scored=found.rows,
        pushed=found.pushed,
        pairs=tuple(
            Paired(
                keys=(first.key, second.key),
                off=(off_by(one, first), off_by(one, second)),
                **_leaves(one),
            )
            for one in found.pairs
            if one.hypothesis
            for first, second in [one.hypothesis.members]
        ),
        variance=source_of(nothing.session.campaign),
        unsteady=changing,
    )


def _leaves(one: Refit) -> dict[str, Any]:
    """What a fit costs and leaves."""
    return {
        "cost": one.cost,
        "chi_square": one.chi_square,
        "serial": one.serial,
        "doubt": one.doubt,
        "loose": one.loose,
        "pull": one.pull,
    }
