"""Plain evidence, to be judged."""

from diagnosis.inference.evidence import Evidence, Paired, Pushed, Refitted, Scored

PLACES = ("body:a", "joint:b", "sensor:acc1")


def refit(effect, place, cost, left):
    return Refitted(effect=effect, location=place, dof=None, cost=cost, chi_square=1 + left)


def pair(first, second, cost, left):
    return Paired(keys=(first.key, second.key), cost=cost, chi_square=1 + left)


def evidence(gap, refits=(), proven=(), gains=(5.0, 3.0, 1.0), loose=None, pull=0.0, pairs=()):
    rows = [
        Scored(effect="mass_error", location=place, dof=None, gains=(gain, gain, gain))
        for place, gain in zip(PLACES, gains, strict=True)
    ]
    return Evidence(
        proven=proven,
        cost=1e4 * (1 + gap),
        chi_square=1 + gap,
        loose=1 + gap if loose is None else loose,
        pull=pull,
        refits=refits,
        pairs=pairs,
        scored=tuple(rows),
        pushed=tuple(
            Pushed(location=place, dof=None, gain=gain)
            for place, gain in zip(PLACES, gains, strict=True)
        ),
        variance="coherence",
    )
