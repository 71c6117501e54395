r"""A stage on four supports of which some do not carry: a granite on two of four levelers.

A joint with three slides and three hinges along the world axes stands for four supports at
(+-a, +-b) about its point, each with a quarter of the slides' stiffness. Their levers are what
makes the hinges' stiffness, or less where supports do not tilt freely,

    a^2 k_tz <= k_ry,   b^2 k_tz <= k_rx,   g^2 (b^2 k_tx + a^2 k_ty) <= k_rz,   g <= 1,

z the world's third axis. All of a and b is believed, give or take a fifth, since what
tilts less looks like a smaller loss that stands farther out. A support at
p = (x, y) stretches slide i by q_i + a_i.(R x p), p shrunk by g for the horizontal ones, and one
that has lost theta takes

    theta / 4 (k_i g_i g_i' + s c_i g_i g_i')   summed over the slides

from the joint; dampers stand no farther out than their hinges allow. Stiffness and damping are the
joint's own, fitted with what is lost: of a loss of nine tenths no fit without it tells the levers.
Nor does one from no loss at all find that two of four are gone: a fit may begin with those as well.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from diagnosis.effects.points import find_own_springs, find_sprung_stages
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Value
from identification.words import Complex, Mask, Real
from mbmodel import AddedPart, Change, Machine, Parameter, joint_coupling_writer

_CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))
_ALONG_AXIS_COSINE = 1 - 1e-6  # cosine with a world axis
_START_LOSS = 0.8  # of what a support carries, where a fit begins with two that carry little
_LEVER_SIGMA = 0.2  # standard deviation of what is shorter
_MAX_SHORTENING = 0.5  # of a lever, how much shorter than it could be it is believed to be
_MIN_CARRIED = 1e-6  # that the best carries
_COMPLEX_STEP = 1e-30  # complex step, of each parameter's size


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each joint that may stand on four supports."""
    for stage in find_sprung_stages(scene.model.machine):
        springs = _find_six_springs(scene, stage)
        if springs is not None and (scene.find_stiffness(springs) > 0).all():
            stand = _Stand.of(scene, stage, springs)
            yield Hypothesis(
                "support_loss",
                f"joint:{stage}",
                parts=(stand.part,),
                scored=stand.lost,
                follow=stand.follow,
                signed=True,
                bounds=dict.fromkeys(stand.lost, (0.0, 1.0))
                | dict.fromkeys(stand.nearer, (0.0, _MAX_SHORTENING)),
                otherwise=tuple(
                    dict.fromkeys(two, _START_LOSS) for two in combinations(stand.lost, 2)
                ),
                believed=dict.fromkeys(stand.nearer, _LEVER_SIGMA),
                state=stand.state,
            )


@dataclass(frozen=True, eq=False)
class _Stand:
    """Loss of four supports; the joint's own stiffness and damping say where they stand.

    Args:
        machine: of the scene.
        stage: stage on the supports.
        frame: directions of the joint's coordinates tx .. rz; (nv, 6).
        names: their stiffnesses, then their dampings.
        is_tuned: whether each of those varies; the others stay; (12,).
        start: their fitted values; (12,).
    """

    machine: Machine
    stage: str
    frame: Real
    names: tuple[str, ...]
    is_tuned: Mask
    start: Real

    @classmethod
    def of(cls, scene: Scene, stage: str, springs: tuple[str, ...]) -> "_Stand":
        """Return the supports of a stage on six springs, tx .. rz."""
        machine = scene.model.machine
        directions = {spring.name: spring.direction for spring in machine.springs}
        along = {axle.joint: np.sign(axle.axis.sum()) for axle in machine.axles}
        tuned = {parameter.name for parameter in scene.model.parameters}
        names = tuple(f"{name}.{kind}" for kind in ("stiffness", "damping") for name in springs)
        return cls(
            machine,
            stage,
            np.array([along[name] * directions[name] for name in springs]).T,
            names,
            np.array([name in tuned for name in names]),
            np.concatenate([scene.find_stiffness(springs), scene.find_damping(springs)]),
        )

    @property
    def lost(self) -> tuple[str, ...]:
        """Names of what each support has lost."""
        return tuple(f"{self.stage}.lost{number}" for number in range(4))

    @property
    def nearer(self) -> tuple[str, ...]:
        """Names of how much shorter the levers are."""
        return tuple(f"{self.stage}.lost_nearer_{axis}" for axis in "xy")

    @property
    def follow(self) -> dict[str, str]:
        """The model's parameter that each parameter of the joint follows."""
        tuned = (name for name, varies in zip(self.names, self.is_tuned, strict=True) if varies)
        return {f"{self.stage}.lost({name})": name for name in tuned}

    @property
    def part(self) -> AddedPart:
        """Part that takes what is lost from the joint."""
        follows = zip(self.follow, self.start[self.is_tuned].tolist(), strict=True)
        parameters = (
            *(Parameter(name, 0.0, "1", positive=False) for name in (*self.lost, *self.nearer)),
            *(Parameter(name, value, "of the joint") for name, value in follows),
        )
        place = f"joint:{self.stage}"
        written = joint_coupling_writer(f"{self.stage}.lost", self.machine, self.finite)
        return AddedPart(place, parameters, self.finite, self.derivatives, written=written)

    def finite(self, theta: Real) -> tuple[Change, ...]:
        """Stiffness and damping that are taken from the joint."""
        return (self._change(self._sum_losses(theta).real),)

    def derivatives(self, theta: Real) -> tuple[Change, ...]:
        """By complex steps, exact to rounding: f(x + ih) = f(x) + ih f'(x) for tiny h."""
        core = np.zeros((len(theta), 3, 6, 6))
        for place, value in enumerate(theta):
            step = _COMPLEX_STEP * max(abs(float(value)), 1.0)
            moved = theta.astype(complex)
            moved[place] += 1j * step
            core[place] = self._sum_losses(moved).imag / step
        return (self._change(core),)

    def _change(self, core: Real) -> Change:
        return Change("joint", self.frame, self.frame, core)

    def _sum_losses(self, theta: Real | Complex) -> Complex:
        """Cores of s^0 and s^1; (3, 6, 6)."""
        sizes = self.start.astype(complex)
        sizes[self.is_tuned] = theta[6:]
        stiffness, damping = sizes[:6], sizes[6:]
        far = _levers(stiffness, 1 - theta[4:6])
        near = _smaller_levers(_levers(damping, 1 - theta[4:6]), far)
        core = np.zeros((3, 6, 6), complex)
        for lost, corner in zip(theta[:4], _CORNERS, strict=True):
            for power, values, levers in ((0, stiffness, far), (1, damping, near)):
                rows = _stretch(corner, levers)
                core[power] -= lost / 4 * (rows.T * values[:3]) @ rows
        return core

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return the load of each support, relative to the one that carries most: 0 to 1.

        What all have lost alike is a softer joint, whose stiffness is fitted beside.
        """
        carried = [max(1 - fitted[name], 0.0) for name in self.lost]
        most = max(*carried, _MIN_CARRIED)
        return {"fraction": tuple(share / most for share in carried)}


def _find_six_springs(scene: Scene, stage: str) -> tuple[str, ...] | None:
    """Springs in the order tx .. rz, if the stage has just these, through one point."""
    machine = scene.model.machine
    springs = find_own_springs(machine, stage)
    axles = {axle.joint: axle for axle in machine.axles if axle.stage == stage}
    if len(springs) != 6 or len(axles) != 6:
        return None
    places: dict[int, str] = {}
    for name in springs:
        axle = axles[name]
        axis = int(np.abs(axle.axis).argmax())
        if abs(axle.axis[axis]) > _ALONG_AXIS_COSINE:
            places[axis + 3 * axle.turns] = name
    anchors = np.array([axle.anchor for axle in axles.values() if axle.turns])
    if len(places) != 6 or np.ptp(anchors, axis=0).max() > 1e-9:
        return None
    return tuple(places[k] for k in range(6))


def _levers(along: Complex, share: Real | Complex) -> Complex:
    """A, b [m] as a share of what the hinges allow, and g; (3,)."""
    tx, ty, tz, rx, ry, rz = along
    zero = np.zeros((), complex)
    a, b = (np.sqrt(ry / tz), np.sqrt(rx / tz)) if tz.real > 0 else (zero, zero)
    a, b = a * share[0], b * share[1]
    twist = b**2 * tx + a**2 * ty
    unit = np.ones((), complex)
    flat = np.sqrt(rz / twist) if twist.real > rz.real else unit
    return np.array([a, b, flat])


def _smaller_levers(first: Complex, second: Complex) -> Complex:
    return np.where(first.real <= second.real, first, second)


def _stretch(corner: tuple[int, int], levers: Complex) -> Complex:
    """Stretch of the three slides at a support per joint coordinate tx .. rz; (3, 6)."""
    a, b, flat = levers
    x, y = corner[0] * a, corner[1] * b
    rows = np.eye(3, 6, dtype=complex)
    rows[0, 5], rows[1, 5] = -flat * y, flat * x
    rows[2, 3], rows[2, 4] = y, -x
    return rows


EFFECT = Effect(
    propose,
    noun="supports that carry less than their share",
    means="a support of the joint of {place} carries less than its share",
    confirm="shim or adjust the support of {place} that has lost most and repeat",
    undoes=True,
)
