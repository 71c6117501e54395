"""Joint direction of a fitted machine, and the stiffness that laws add to it in each test."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.hypothesis import JointDirection, Scene
from diagnosis.levels.hammer_pulse import estimate_pulse_duration
from diagnosis.levels.joint_transient import JointTransient, SimulatedHits
from diagnosis.levels.law_family import LawFamily
from diagnosis.levels.law_simulation import LawUnderHits, compute_equivalent_stiffness
from diagnosis.levels.settings import LEVEL_SETTINGS
from identification.words import Complex, Integers, Real
from mbmodel.assembly import FrequencyDependentTerm, Matrices
from mbmodel.frf.ports import apply_point_changes, find_ports


@dataclass(frozen=True, eq=False)
class TestedJoint:
    """Linear machine about which a law is simulated, and the hits of all tests.

    Args:
        matrices: M, C, K at the fit.
        direction: of the joint; (nv,).
        inputs: generalised force of each input; (nv, n_in).
        freq_hz: lines above 0 Hz; (n_freq,).
        hits: one for each test.
        stiffness: fitted stiffness of the spring.
        loops: control loops that were closed during the test.
    """

    matrices: Matrices
    direction: Real
    inputs: Real
    freq_hz: Real
    hits: SimulatedHits
    stiffness: float
    loops: tuple[FrequencyDependentTerm, ...] = ()

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
        conditions = [test.condition for test in campaign.tests]
        hits = SimulatedHits(
            np.array([references.index(c.reference.positive) for c in conditions]),
            np.array([float(c.level_n or 0.0) * c.reference.sign for c in conditions]),
            estimate_pulse_duration(campaign),
        )
        return cls(
            assembly.matrices,
            {spring.name: spring.direction for spring in machine.springs}[joint.spring],
            assembly.jacobian.T @ ports.force + ports.motor,
            campaign.freq_hz[campaign.freq_hz > 0],
            hits,
            float(scene.find_stiffness((joint.spring,))[0]),
            tuple(term for term in assembly.frequency_dependent if term.is_loop),
        )

    def transient(self, stuck: float = 0.0) -> JointTransient:
        """Return the linear machine with an element that sticks.

        Args:
            stuck: its stiffness [N/m or N m/rad].
        """
        added = stuck * np.outer(self.direction, self.direction)
        matrices = Matrices(
            self.matrices.mass, self.matrices.damping, self.matrices.stiffness + added
        )
        return JointTransient.of_matrices(
            matrices, self.direction, self.inputs, self.freq_hz, self.loops
        )

    def compute_stiffness(self, family: LawFamily, cases: Sequence[tuple[Real, float]]) -> Complex:
        """Return what laws add to the joint's stiffness in each test; (n_case, n_test, n_freq).

        Tests with the same hits, as those of several set-ups, are simulated once.

        Args:
            family: of the laws.
            cases: parameters of each law and the duration of the hits over the estimated one;
                peak of the hits over the stated one.
        """
        stuck = [family.stuck(theta[:-1]) for theta, _ in cases]
        machines = {stiffness: self.transient(stiffness) for stiffness in dict.fromkeys(stuck)}
        different, place = self._list_different_hits()
        laws = [
            LawUnderHits(
                machines[stiffness],
                family.law(theta[:-1]),
                SimulatedHits(
                    different.column,
                    peak * different.peak,
                    float(theta[-1]) * self.hits.duration_s,
                ),
            )
            for stiffness, (theta, peak) in zip(stuck, cases, strict=True)
        ]
        kappa = compute_equivalent_stiffness(laws, self.freq_hz)
        return np.array(stuck)[:, None, None] + kappa[:, place]

    def _list_different_hits(self) -> tuple[SimulatedHits, Integers]:
        """Return the hits that differ, and the number of that of each test; (n_test,)."""
        pairs = np.stack([self.hits.column, self.hits.peak])
        different, place = np.unique(pairs, axis=1, return_inverse=True)
        hits = SimulatedHits(different[0].astype(int), different[1], self.hits.duration_s)
        return hits, place.ravel()


@dataclass(frozen=True, eq=False)
class LawTable:
    """Stiffness that a law adds on every line of every test, and its derivatives.

    The stiffness of a test is linear in the logarithm of its peak, which varies little.

    Args:
        joint: linear machine and hits.
        family: of the law.
        known: results at the last parameters.
    """

    joint: TestedJoint
    family: LawFamily
    known: dict[bytes, tuple[Complex, Complex]] = field(default_factory=dict)

    def at(self, theta: Real) -> tuple[Complex, Complex]:
        """Return kappa at the stated peaks (n_test, n_freq), and its derivatives.

        Args:
            theta: parameters of the law, and the relative duration.

        Returns:
            kappa, and its derivatives by theta, then by the logarithm of each test's peak;
            (n_parameter + 1, n_test, n_freq).
        """
        key = theta.tobytes()
        if key not in self.known:
            steps = LEVEL_SETTINGS.difference_step * np.where(theta == 0, 1.0, np.abs(theta))
            cases = [(theta, 1.0), *((moved, 1.0) for moved in theta + np.diag(steps))]
            cases.append((theta, 1 + LEVEL_SETTINGS.difference_step))
            middle, *moved = self.joint.compute_stiffness(self.family, cases)
            divisors = np.append(steps, np.log1p(LEVEL_SETTINGS.difference_step))
            slopes = (np.array(moved) - middle) / divisors[:, None, None]
            self.known.clear()
            self.known[key] = middle, slopes
        return self.known[key]
