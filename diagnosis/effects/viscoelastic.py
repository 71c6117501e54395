"""A Maxwell branch in parallel with springs of a joint: stiffness rises with frequency.

With the static stiffness k, springs of the joint get

    K += r k s tau / (1 + s tau),   r > 0.

They are one spring, all of them alike, or those that elements along one axis at several points
make up: such elements, as the air springs below a table, resist the translation along their axis
and the rotations about the two others, with one ratio. The verdict gives the direction of the
translation.

The ratio r is fitted as ln(1 + r), the logarithm of the stiffness at high frequency over the static
one, so that neither r nor its interval can be negative. The time constant is scanned and fitted.
The scan goes from 1 / w of the highest line, above which the branch is a damper, to twice that of
the lowest line, below which it is a spring. Its steps are at most a factor of e, less than a
relaxation is wide. The scores choose direction and time constant; few of them are refitted. A fit
whose time constant ends a step above the scan describes a stiffer spring, which is another effect.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from diagnosis.effects.scales import LOG_UNIT
from diagnosis.effects.spring_laws import Law, Shape, TimedLaw
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import find_own_springs, find_sprung_stages
from diagnosis.stated_values import Value
from identification.words import Complex
from mbmodel.parts.spring_laws import Relaxation


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each time constant of the scan, joint, and direction or all directions."""
    machine = scene.model.machine
    omega = 2 * np.pi * scene.session.campaign.freq_hz
    shortest, longest = 1 / float(omega[-1]), 2 / float(omega[omega > 0].min())
    times = np.geomspace(shortest, longest, 1 + int(np.ceil(np.log(longest / shortest))))
    laws = [TimedLaw(tau, Relaxation, _maxwell_slope) for tau in times.tolist()]
    dofs = {axle.joint: axle.dof for axle in machine.axles}
    tuned = {parameter.name for parameter in scene.model.parameters}
    for stage in find_sprung_stages(machine):
        springs = tuple(
            spring for spring in find_own_springs(machine, stage) if f"{spring}.stiffness" in tuned
        )
        for prefix, dof, group in _list_groups(stage, springs, dofs):
            for number, law in enumerate(laws):
                name = f"{prefix}{number}"
                branch = Law.for_springs(
                    scene, f"joint:{stage}", group, name, law, is_logarithmic=True
                )

                def state(fitted: Mapping[str, float], branch: Law = branch) -> dict[str, Value]:
                    return {"ratio": branch.read_size(fitted), "tau": branch.read_time(fitted)}

                longest_step = (1.0 + float(np.log(longest / law.tau))) / LOG_UNIT
                for hypothesis in branch.propose("viscoelastic", dof, state, otherwise=(1.0,)):
                    low, high = hypothesis.bounds[branch.time_name]
                    ends = {branch.time_name: (low, min(high, longest_step))}
                    yield replace(
                        hypothesis,
                        bounds={**hypothesis.bounds, **ends},
                        valid_below_bound=(branch.time_name,),
                    )


def _list_groups(
    stage: str, springs: tuple[str, ...], dofs: Mapping[str, str]
) -> list[tuple[str, str | None, tuple[str, ...]]]:
    """Return prefix, direction and springs of each group that may have a branch."""
    groups: dict[tuple[str, ...], tuple[str, str | None]] = {}
    if len(springs) > 1:
        groups[springs] = f"{stage}.maxwell", None
    for spring in springs:
        groups.setdefault((spring,), (f"{spring}.branch", dofs[spring]))
    for slide in (spring for spring in springs if dofs[spring][0] == "t"):
        across = tuple(
            spring
            for spring in springs
            if dofs[spring][0] == "r" and dofs[spring][1] != dofs[slide][1]
        )
        groups.setdefault((slide, *across), (f"{slide}.elements", dofs[slide]))
    return [(prefix, dof, group) for group, (prefix, dof) in groups.items()]


@lru_cache(1024)  # all joints share it: their columns are formed together
def _maxwell_slope(tau: float) -> Shape:
    """Return the slope by ln tau, s tau / (1 + s tau)^2."""

    def shape(laplace: Complex) -> Complex:
        return np.asarray(laplace * tau / (1 + laplace * tau) ** 2, complex)

    return shape


EFFECT = Effect(
    propose,
    noun="a stiffness that rises with frequency",
    means="the joint of {place} stiffens with frequency: rubber, a hydraulic or air damper",
    confirm="repeat with {place} at another temperature: the time constant moves",
)
