"""Joint direction of a fitted machine, and the stiffness that laws add to it in each test."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.hypothesis import JointDirection, Scene
from diagnosis.levels.hammer_pulse import Pulses, estimate_pulses
from diagnosis.levels.joint_transient import JointTransient, SimulatedHits
from diagnosis.levels.law_family import LawFamily
from diagnosis.levels.law_simulation import LawUnderHits, compute_equivalent_stiffness
from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.words import Complex, Integers, Real
from mbmodel.assembly import FrequencyDependentTerm, Matrices
from mbmodel.ports.ports import apply_point_changes, find_ports


@dataclass(frozen=True, eq=False)
class TestedJoint:
    """Linear machine about which a law is simulated, and the hits of all tests.

    Args:
        matrices: M, C, K at the fit.
        direction: of the joint; (nv,).
        inputs: generalised force of each input; (nv, n_in).
        freq_hz: lines above 0 Hz; (n_freq,).
        pulses: hits of each test.
        column: index of the input that each test hits; (n_test,).
        stiffness: fitted stiffness of the spring.
        damping: of its damper.
        loops: control loops that were closed during the test.
        steps_per_period: of simulations, in a period of the highest line.
    """

    matrices: Matrices
    direction: Real
    inputs: Real
    freq_hz: Real
    pulses: Pulses
    column: Integers
    stiffness: float
    damping: float
    loops: tuple[FrequencyDependentTerm, ...] = ()
    steps_per_period: int = LEVEL_SETTINGS.steps_per_period

    @classmethod
    def of_scene(cls, scene: Scene, joint: JointDirection) -> "TestedJoint":
        """Return a joint direction of a scene.

        Of terms that are no polynomial in s, control loops alone are kept.
        """
        model, campaign = scene.session.model, scene.session.campaign
        machine = model.machine
        assembly = model.assemble(scene.theta, campaign.tests[0].condition)
        outputs = list(campaign.tests[0].estimate.frf.outputs)
        references = list(campaign.inputs)
        ports = find_ports(machine, outputs, references)
        ports = apply_point_changes(ports, assembly.point_changes, outputs, references)
        columns = [references.index(test.condition.reference.positive) for test in campaign.tests]
        return cls(
            assembly.matrices,
            {spring.name: spring.direction for spring in machine.springs}[joint.spring],
            assembly.jacobian.T @ ports.force + ports.motor,
            campaign.freq_hz[campaign.freq_hz > 0],
            estimate_pulses(campaign),
            np.array(columns),
            float(scene.find_stiffness((joint.spring,))[0]),
            float(scene.find_damping((joint.spring,))[0]),
            tuple(term for term in assembly.frequency_dependent if term.is_loop),
        )

    def transient(self, stiffness: float = 0.0, damping: float = 0.0) -> JointTransient:
        """Return the linear machine with more stiffness and damping of the joint.

        Args:
            stiffness: of an element that sticks, for one [N/m or N m/rad].
            damping: likewise [N s/m or N m s/rad].
        """
        along = np.outer(self.direction, self.direction)
        matrices = Matrices(
            self.matrices.mass,
            self.matrices.damping + damping * along,
            self.matrices.stiffness + stiffness * along,
        )
        return JointTransient.of_matrices(
            matrices,
            self.direction,
            self.inputs,
            self.freq_hz,
            self.loops,
            self.steps_per_period,
        )

    @property
    def hits(self) -> SimulatedHits:
        """Root-mean-square hit of each test."""
        return SimulatedHits(self.column, self.pulses.peak, self.pulses.duration_s)

    def compute_stiffness(
        self, family: LawFamily, cases: Sequence[tuple[Real, Real | float, Real]]
    ) -> Complex:
        """Return what laws add to the joint's stiffness in each test; (n_case, n_test, n_freq).

        Tests with the same hits, as those of several set-ups, are simulated once.

        Args:
            family: of the laws.
            cases: parameters of each law and, as the last one, the duration of the hits over the
                estimated one; size of the hits over the root-mean-square hit, one number or one
                for each group (n_group,); stiffness and damping of the joint's linear spring and
                damper (2,).
        """
        stuck = [family.stuck(theta[:-1]) for theta, _, _ in cases]
        springs = [
            (float(linear[0]) - self.stiffness + stiffness, float(linear[1]) - self.damping)
            for stiffness, (_, _, linear) in zip(stuck, cases, strict=True)
        ]
        machines = {added: self.transient(*added) for added in dict.fromkeys(springs)}
        different, place = self._list_different_hits()
        laws = [
            LawUnderHits(
                machines[added],
                family.law(theta[:-1]),
                SimulatedHits(
                    different.column,
                    size * different.peak,
                    float(theta[-1]) * different.duration_s,
                ),
            )
            for added, (theta, size, _) in zip(springs, cases, strict=True)
        ]
        kappa = compute_equivalent_stiffness(laws, self.freq_hz)
        return np.array(stuck)[:, None, None] + kappa[:, place]

    def add_laws(self, laws: Sequence[tuple[LawFamily, Real, Real]], freq_hz: Real) -> Complex:
        """Return what laws add to the joint's complex stiffness; (n_law, n_test, n_freq).

        Args:
            laws: families of one effect, the parameters of each law, and stiffness and damping of
                the joint in parallel with it.
            freq_hz: lines above 0 Hz.
        """
        different, place = self._list_different_hits()
        added, cases = [], []
        for family, theta, parallel in laws:
            stiffness, damping = parallel - (self.stiffness, self.damping)
            stiffness += family.stuck(theta)
            transient = self.transient(stiffness, damping)
            cases.append(LawUnderHits(transient, family.law(theta), different))
            added.append(stiffness + 2j * np.pi * freq_hz * damping)
        kappa = compute_equivalent_stiffness(cases, freq_hz)
        return np.array(added)[:, None] + kappa[:, place]

    def list_hit_sizes(self, count: int) -> Real:
        """Return equally probable sizes of each group of equal hits; (count, n_group)."""
        _, first_tests = np.unique(self.group_equal_hits(), return_index=True)
        sizes = [self.pulses.list_sizes(int(test), count) for test in first_tests]
        return np.stack(sizes, axis=1)

    def group_equal_hits(self) -> Integers:
        """Return the number of the group of each test; those of one group have equal hits."""
        return self._list_different_hits()[1]

    def _list_different_hits(self) -> tuple[SimulatedHits, Integers]:
        """Return the hits that differ, and the number of that of each test; (n_test,)."""
        pairs = np.stack([self.column, self.pulses.peak])
        different, place = np.unique(pairs, axis=1, return_inverse=True)
        hits = SimulatedHits(different[0].astype(int), different[1], self.pulses.duration_s)
        return hits, place.ravel()
