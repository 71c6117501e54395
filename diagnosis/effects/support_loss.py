r"""A stage on four supports of which some carry less: a granite on two of four levelers.

A joint with three slides and three hinges along the world axes stands for four supports at
(+-a, +-b) about its point, each with a quarter of the stiffness of the slides. z is the third world
axis. The levers a and b of the supports make up the stiffness of the hinges. Supports that do not
tilt freely add to it, so that it is a bound:

    a^2 k_tz <= k_ry,   b^2 k_tz <= k_rx,   g^2 (b^2 k_tx + a^2 k_ty) <= k_rz,   g <= 1.

The levers are the longest that these bounds allow, less a shortening whose prior has a standard
deviation of a fifth. The prior is needed because a shorter lever looks like a smaller loss that
stands farther out.

A support at p = (x, y) stretches slide i by q_i + a_i.(R x p), the row g_i of the joint
coordinates. For horizontal slides p is shortened by g. A support that has lost theta of its load
takes from the joint

    theta / 4 (k_i g_i' g_i + s c_i g_i' g_i), summed over the slides.

Levers of the dampers are at most those that the damping of the hinges allows. Stiffness and damping
of the joint are fitted together with the losses, because a fit that lacks a loss of nine tenths
gives wrong levers. A fit that starts without any loss does not find that two of four supports are
gone. Each pair of supports that carry little is therefore an alternative start.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import find_own_springs, find_sprung_stages
from diagnosis.settings import HALF_PRECISION, NEGLIGIBLE_SHARE
from diagnosis.stated_values import Value
from identification.words import TOLERANCE_BOUND_SIGMA, Complex, Mask, Real
from mbmodel import AddedPart, Change, Machine, Parameter, joint_coupling_writer

_START_LOSS = 0.8  # of the load of a support, in alternative starts where two carry little
_LEVER_SIGMA = 0.2  # of a lever: standard deviation of its shortening


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each joint that may stand on four supports."""
    for stage in find_sprung_stages(scene.model.machine):
        springs = _find_six_springs(scene, stage)
        if springs is not None and (scene.find_stiffness(springs) > 0).all():
            supports = _FourSupports.find(scene, stage, springs)
            longest = TOLERANCE_BOUND_SIGMA * _LEVER_SIGMA
            yield Hypothesis(
                "support_loss",
                f"joint:{stage}",
                parts=(supports.part,),
                scored=supports.loss_names,
                follow=supports.follow,
                signed=True,
                bounds=dict.fromkeys(supports.loss_names, (0.0, 1.0))
                | dict.fromkeys(supports.shortening_names, (0.0, longest)),
                otherwise=tuple(
                    dict.fromkeys(two, _START_LOSS) for two in combinations(supports.loss_names, 2)
                ),
                believed=dict.fromkeys(supports.shortening_names, _LEVER_SIGMA),
                state=supports.state,
            )


@dataclass(frozen=True, eq=False)
class _FourSupports:
    """Four supports of a stage, located by stiffness and damping of its joint.

    Args:
        machine: machine of the scene.
        stage: stage on the supports.
        frame: directions of the joint coordinates tx .. rz; (nv, 6).
        names: names of their stiffnesses, then of their dampings.
        is_tuned: whether each of these parameters varies; (12,).
        start: fitted values of these parameters; (12,).
    """

    machine: Machine
    stage: str
    frame: Real
    names: tuple[str, ...]
    is_tuned: Mask
    start: Real

    @classmethod
    def find(cls, scene: Scene, stage: str, springs: tuple[str, ...]) -> "_FourSupports":
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
    def loss_names(self) -> tuple[str, ...]:
        """Names of the losses of the supports."""
        return tuple(f"{self.stage}.lost{number}" for number in range(4))

    @property
    def shortening_names(self) -> tuple[str, ...]:
        """Names of the shortenings of the two levers."""
        return tuple(f"{self.stage}.lost_nearer_{axis}" for axis in "xy")

    @property
    def follow(self) -> dict[str, str]:
        """Parameter of the model that each parameter of the Part follows, by name."""
        tuned = (name for name, varies in zip(self.names, self.is_tuned, strict=True) if varies)
        return {f"{self.stage}.lost({name})": name for name in tuned}

    @property
    def part(self) -> AddedPart:
        """Part that takes the losses from the joint."""
        follows = zip(self.follow, self.start[self.is_tuned].tolist(), strict=True)
        parameters = (
            *(
                Parameter(name, 0.0, "1", positive=False)
                for name in (*self.loss_names, *self.shortening_names)
            ),
            *(Parameter(name, value, "of the joint") for name, value in follows),
        )
        place = f"joint:{self.stage}"
        written = joint_coupling_writer(f"{self.stage}.lost", self.machine, self.compute_change)
        return AddedPart(
            place, parameters, self.compute_change, self.compute_slopes, written=written
        )

    def compute_change(self, theta: Real) -> tuple[Change, ...]:
        """Return the change of the joint by the losses."""
        return (self._build_change(self._sum_losses(theta).real),)

    def compute_slopes(self, theta: Real) -> tuple[Change, ...]:
        """Return the slopes by complex steps: f(x + ih) = f(x) + ih f'(x), exact for tiny h."""
        core = np.zeros((len(theta), 3, 6, 6))
        for place, value in enumerate(theta):
            step = np.finfo(float).eps ** 2 * max(abs(float(value)), 1.0)
            moved = theta.astype(complex)
            moved[place] += 1j * step
            core[place] = self._sum_losses(moved).imag / step
        return (self._build_change(core),)

    def _build_change(self, core: Real) -> Change:
        return Change("joint", self.frame, self.frame, core)

    def _sum_losses(self, theta: Real | Complex) -> Complex:
        """Return the cores of s^0 and s^1; (3, 6, 6)."""
        sizes = self.start.astype(complex)
        sizes[self.is_tuned] = theta[6:]
        stiffness, damping = sizes[:6], sizes[6:]
        far = _find_levers(stiffness, 1 - theta[4:6])
        near = _find_smaller_levers(_find_levers(damping, 1 - theta[4:6]), far)
        core = np.zeros((3, 6, 6), complex)
        for lost, corner in zip(theta[:4], _list_corners(), strict=True):
            for power, values, levers in ((0, stiffness, far), (1, damping, near)):
                rows = _find_stretch(corner, levers)
                core[power] -= lost / 4 * (rows.T * values[:3]) @ rows
        return core

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return the load of each support, relative to the largest: 0 to 1.

        An equal loss of all supports is a softer joint, whose stiffness is fitted too.
        """
        carried = [max(1 - fitted[name], 0.0) for name in self.loss_names]
        most = max(*carried, NEGLIGIBLE_SHARE)
        return {"fraction": tuple(share / most for share in carried)}


def _find_six_springs(scene: Scene, stage: str) -> tuple[str, ...] | None:
    """Return the springs in the order tx .. rz; None unless they are all, through one point."""
    machine = scene.model.machine
    springs = find_own_springs(machine, stage)
    axles = {axle.joint: axle for axle in machine.axles if axle.stage == stage}
    if len(springs) != 6 or len(axles) != 6:
        return None
    places: dict[int, str] = {}
    for name in springs:
        axle = axles[name]
        axis = int(np.abs(axle.axis).argmax())
        if abs(axle.axis[axis]) > 1 - NEGLIGIBLE_SHARE:
            places[axis + 3 * axle.turns] = name
    anchors = np.array([axle.anchor for axle in axles.values() if axle.turns])
    if len(places) != 6 or np.ptp(anchors, axis=0).max() > HALF_PRECISION:
        return None
    return tuple(places[k] for k in range(6))


def _find_levers(stiffness: Complex, share: Real | Complex) -> Complex:
    """Return ``a`` and ``b`` [m] as a share of what the hinges allow, and ``g``; (3,)."""
    tx, ty, tz, rx, ry, rz = stiffness
    zero = np.zeros((), complex)
    a, b = (np.sqrt(ry / tz), np.sqrt(rx / tz)) if tz.real > 0 else (zero, zero)
    a, b = a * share[0], b * share[1]
    twist = b**2 * tx + a**2 * ty
    unit = np.ones((), complex)
    flat = np.sqrt(rz / twist) if twist.real > rz.real else unit
    return np.array([a, b, flat])


def _find_smaller_levers(first: Complex, second: Complex) -> Complex:
    return np.where(first.real <= second.real, first, second)


def _list_corners() -> list[tuple[int, int]]:
    """Return the signs of x and y at the four supports, counter-clockwise from (1, 1)."""
    corners = product((1, -1), (1, -1))
    return sorted(corners, key=lambda signs: np.arctan2(signs[1], signs[0]) % (2 * np.pi))


def _find_stretch(corner: tuple[int, int], levers: Complex) -> Complex:
    """Return the stretch of the three slides at a support per joint coordinate; (3, 6)."""
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
