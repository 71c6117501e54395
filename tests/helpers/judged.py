"""Plain evidence, to be judged."""

from diagnosis.inference.evidence import Evidence, FittedSet, ForceGain, Scored

PLACES = ("body:a", "joint:b", "sensor:acc1")
VALUES = 10_000


def fitted(*keys, cost, gap, floor=0.02, shifts=()):
    """Return a set of causes: ``keys`` are pairs of effect and place, cost is in nats a value."""
    return FittedSet(
        keys=tuple((effect, place, None) for effect, place in keys),
        floor=floor,
        cost=cost,
        values=VALUES,
        fitted_values=VALUES,
        noise_share=0.1,
        effective_values=0.5 * VALUES,
        chi_square=1 + gap,
        serial=gap,
        doubt=0.1,
        shifts=shifts,
    )


def evidence(gap, sets=(), proven=(), gains=(5.0, 3.0, 1.0), **further):
    """Return evidence of a null model with a gap, and of sets of causes."""
    return Evidence(
        proven=proven,
        null=fitted(cost=0.0, gap=gap, floor=0.05),
        sets=tuple(sets),
        hypotheses=60,
        scored=tuple(
            Scored(effect="mass_error", location=place, dof=None, gain=gain)
            for place, gain in zip(PLACES, gains, strict=True)
        ),
        pushed=tuple(
            ForceGain(location=place, dof=None, gain=gain)
            for place, gain in zip(PLACES, gains, strict=True)
        ),
        variance="coherence",
        **further,
    )
