r"""Closed kinematic chains: coordinates reduced on the null space of the constraints, at one pose.

Equality constraints c(q) = 0 with the Jacobian C leave as many coordinates z as C lacks rank. These
are joints that are kept; the others follow, q = q(z), with

    dq/dz = N,  C N = 0,      d2q/dz2 = Q,  C Q + N' (d2c/dq2) N = 0.

A generalised force r with K = -dr/dq becomes N' r, and its stiffness N' K N - r.Q. At rest the
reactions l balance all forces, r + C' l = 0. Summed over all forces the stiffness is then

    K_r = N' (K - sum_i l_i d2c_i/dq2) N

(Wehage and Haug 1982 for the partition; the projection in Garcia de Jalon and Bayo 1994, ch. 5).
The second term needs no reactions in this form, so each spring and each weight has its own share.

A compiled model has its chains closed rigidly if constraints are active and MuJoCo's own, which
give way, are switched off by the flag (``mbmodel.mjcf.read``).
"""

import copy
from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import mujoco
import numpy as np

from identification.words import InputError, Integers, Mask, Real, shorten_names
from mbmodel.linearisation.chain_closure import (
    MAX_REFUSED_GAP,
    MIN_INDEPENDENT_SHARE,
    Closure,
    close_chains,
    count_independent,
    dense_rows,
    has_rigid_chains,
    read_closure,
    scale_rows,
)
from mbmodel.linearisation.tendon_slopes import FOURTH_ORDER_WEIGHTS
from mbmodel.mjcf.names import coordinate_names, equality_name

_CURVATURE_STEP = 1e-3  # m or rad: truncation is 4e-12 over a length of 0.3 m, rounding 1e-13
_MAX_CONTRADICTION = 1e-6  # of the curvature of constraints: what no motion takes up
# Of a column: what the columns before it leave of it, so that it is chosen, in turn.
_INDEPENDENT_SHARES = 0.3, 1e-3, 0.0


@dataclass(frozen=True, eq=False)
class Chains:
    """The closed chains of a machine at a pose.

    Args:
        model: compiled model whose constraints close them.
        data: at the pose.
        kept: numbers of the joint coordinates that are the machine's; (n,).
        following: those that follow from them, as many as C has rank.
        closure: constraints at the pose.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    kept: Integers
    following: Integers
    closure: Closure

    @cached_property
    def basis(self) -> Real:
        """N: motion of every joint coordinate per kept one; (nv, n)."""
        basis: Real = np.eye(self.model.nv)[:, self.kept]
        basis[self.following] = -self._follow(self.closure.rows[:, self.kept])[0]
        return basis

    def _follow(self, gaps: Real) -> tuple[Real, Real]:
        """Return motions of the following coordinates that cause gaps, and what they cannot."""
        rows = self.closure.rows[:, self.following]
        moved: Real = np.asarray(np.linalg.lstsq(rows, gaps, rcond=None)[0], float)
        return moved, gaps - rows @ moved

    @cached_property
    def _curvature(self) -> tuple[Real, float]:
        """Q, and the share of the constraints' curvature that no motion takes up."""
        count, step = len(self.kept), _CURVATURE_STEP
        gaps = np.zeros((len(self.closure.rows), count, count))
        for k, direction in enumerate(self.basis.T):
            size = float(np.abs(direction).max())
            for multiple, weight in FOURTH_ORDER_WEIGHTS.items():
                there = self.data.qpos.copy()
                mujoco.mj_integratePos(self.model, there, direction, multiple * step / size)
                rows = read_closure(self.model, self.data, there).rows
                gaps[:, :, k] += weight * size / step * (rows @ self.basis)
        gaps = (gaps + gaps.swapaxes(1, 2)) / 2
        bent, rest = self._follow(gaps.reshape(len(gaps), -1))
        bending = np.zeros((self.model.nv, count, count))
        bending[self.following] = -bent.reshape(-1, count, count)
        scale = float(np.abs(gaps).max(initial=0.0))
        return bending, float(np.abs(rest).max(initial=0.0)) / max(scale, 1e-300)

    @property
    def bending(self) -> Real:
        """Q: second derivative of every joint coordinate by the kept ones; (nv, n, n)."""
        return self._curvature[0]

    def force(self, force: Real) -> Real:
        """Return N' r; (n, ...)."""
        return self.basis.T @ force

    def matrix(self, matrix: Real, force: Real | None = None) -> Real:
        """Return N' A N, less r.Q for the stiffness A = -dr/dq of a force r; (n, n).

        Args:
            matrix: A; (nv, nv).
            force: r; None for mass and damping; (nv,).
        """
        reduced: Real = self.basis.T @ matrix @ self.basis
        return reduced if force is None else reduced - np.tensordot(force, self.bending, 1)

    @cached_property
    def reaction_names(self) -> list[tuple[str, str]]:
        """Name and unit of each number of ``react``.

        A constraint's are ``reaction_NAME``, ``reaction_NAME.1`` and so on.
        """
        rows = Counter[int]()
        names = []
        for number in self.closure.numbers.tolist():
            base = f"reaction_{self.model.equality(number).name or number}"
            names.append((f"{base}.{rows[number]}" if rows[number] else base, "N"))
            kind = mujoco.mjtEq(self.model.eq_type[number])
            if (kind == mujoco.mjtEq.mjEQ_WELD and rows[number] > 2) or self._turns(number):
                names[-1] = names[-1][0], "N m"
            rows[number] += 1
        return names

    def _turns(self, number: int) -> bool:
        """Return whether a constraint ties a hinge."""
        if mujoco.mjtEq(self.model.eq_type[number]) != mujoco.mjtEq.mjEQ_JOINT:
            return False
        kind = self.model.jnt_type[self.model.eq_obj1id[number]]
        return bool(kind == mujoco.mjtJoint.mjJNT_HINGE)

    def react(self, data: mujoco.MjData, applied: Real | float) -> Real:
        """Return the reactions of accelerated chains, the smallest where they are not unique.

        Of ``connect`` they are the force on its first body along world axes, of ``weld`` also the
        moment; of ``joint`` and ``tendon`` the force along the first.

        Args:
            data: a state with accelerations and all that MuJoCo computes before it solves for
                them, constraints included; the forces of these are set.
            applied: further generalised forces; (nv,).
        """
        model = self.model
        inertia = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, inertia, data.qacc)
        missing = inertia + data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator - applied
        is_equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        rows = dense_rows(model, data)[is_equality]
        reactions = _least_squares(rows.tobytes(), rows.shape) @ missing
        data.efc_force[is_equality] = reactions
        return self._in_world_axes(data, reactions.copy())

    def _in_world_axes(self, data: mujoco.MjData, reactions: Real) -> Real:
        """Turn the moments of welds from half the axes of the second body into world axes."""
        model = self.model
        for number in dict.fromkeys(self.closure.numbers.tolist()):
            if mujoco.mjtEq(model.eq_type[number]) != mujoco.mjtEq.mjEQ_WELD:
                continue
            at_sites = model.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE
            axes = (data.site_xmat if at_sites else data.xmat)[model.eq_obj2id[number]]
            moments = np.flatnonzero(self.closure.numbers == number)[3:]
            scale = model.eq_data[number, 10] / 2
            reactions[moments] = scale * axes.reshape(3, 3) @ reactions[moments]
        return reactions

    def at(self, data: mujoco.MjData) -> "Chains | None":
        """Return the chains at another pose, with the same coordinates kept.

        Args:
            data: near the pose; its following coordinates move in place until the chains close.

        Returns:
            The chains; None if they do not close.
        """
        if close_chains(self.model, data, self.following) > MAX_REFUSED_GAP:
            return None
        closure = read_closure(self.model, data, data.qpos)
        return replace(self, data=copy.copy(data), closure=closure)

    @property
    def constraint_names(self) -> list[str]:
        """Names of the equality constraints that close the chains."""
        numbers = dict.fromkeys(self.closure.numbers.tolist())
        return [equality_name(self.model, number) for number in numbers]

    def refuse_dead_centre(self, path: Path) -> None:
        """Refuse a pose where C has a lower rank than around it: N then holds what cannot move.

        The constraints bend along N in a way that no following coordinate takes up.
        """
        if self._curvature[1] > _MAX_CONTRADICTION:
            raise InputError(
                f"{path}: the chain of {shorten_names(self.constraint_names)} rests at a dead "
                "centre, where it has no linear model: draw it in another pose"
            )

    def remarks(self) -> tuple[str, ...]:
        """Return sentences on the chains and on constraints that repeat others."""
        names = coordinate_names(self.model)
        lost = [names[k] for k in self.following]
        sentences = [
            f"closed chains leave {len(self.kept)} of {len(names)} joint coordinates; "
            f"{shorten_names(lost)} follow{'s' if len(lost) == 1 else ''} from the others"
        ]
        scaled, rank = scale_rows(self.model, self.closure), 0
        for number in dict.fromkeys(self.closure.numbers.tolist()):
            count = int((self.closure.numbers == number).sum())
            until = int(np.flatnonzero(self.closure.numbers == number)[-1]) + 1
            before, rank = rank, count_independent(scaled[:until])
            if repeated := count - (rank - before):
                sentences.append(
                    f"{equality_name(self.model, number)} repeats {repeated} of its {count} "
                    "conditions, which joints or other constraints hold already: the reactions "
                    "are not unique, and the smallest are given"
                )
        return tuple(sentences)


@lru_cache(maxsize=1)  # of the rest, whose rows most readings share
def _least_squares(rows: bytes, shape: tuple[int, ...]) -> Real:
    """Return the pseudo-inverse of C'; (n_row, nv).

    Args:
        rows: C as bytes of float64.
        shape: of C.
    """
    constraints = np.frombuffer(rows).reshape(shape)
    return np.asarray(np.linalg.pinv(constraints.T, rcond=MIN_INDEPENDENT_SHARE), float)


def find_chains(
    model: mujoco.MjModel, data: mujoco.MjData, following: Integers | None = None
) -> Chains | None:
    """Return the closed chains at a pose; None without any.

    Rows are scaled by their size and translations by that of the machine, so that units do not
    count. The rank is that of the singular values.

    Args:
        data: state at the pose, with its forces.
        following: coordinates that follow, where another pose has chosen them; None to choose.
    """
    if not has_rigid_chains(model):
        return None
    closure = read_closure(model, data, data.qpos)
    if following is None:
        following = _find_following(model, closure)
    kept = np.setdiff1d(np.arange(model.nv), following)
    return Chains(model, copy.copy(data), kept, following, closure)


def _find_following(model: mujoco.MjModel, closure: Closure) -> Integers:
    """Return the coordinates that follow at a pose."""
    ties = (model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_obj2id >= 0)
    driven = np.isin(model.dof_jntid, model.eq_obj1id[ties])
    return _choose_following(scale_rows(model, closure), closure.numbers, driven)


def _choose_following(rows: Real, numbers: Integers, driven: Mask) -> Integers:
    """Return as many independent columns as C has rank.

    Joints in few constraints come first, and of these the last of the file: the legs of a platform
    follow it, whatever they weigh. Of a gear its first joint follows, a function of the second. A
    column is passed over at first if most of it depends on those before it.

    Args:
        rows: scaled C; (n_row, nv).
        numbers: number of the constraint of each row; (n_row,).
        driven: coordinates that a gear states as functions of others; (nv,).
    """
    sizes = np.linalg.norm(rows, axis=0)
    is_tied = np.abs(rows) > MIN_INDEPENDENT_SHARE
    counts = [len(set(numbers[column].tolist())) for column in is_tied.T]
    order = sorted(range(len(counts)), key=lambda k: (counts[k], not driven[k], -k))
    rank, chosen = count_independent(rows), list[int]()
    span = np.zeros((len(rows), 0))
    for share in _INDEPENDENT_SHARES:
        for k in order:
            rest = rows[:, k] - span @ (span.T @ rows[:, k])
            rest -= span @ (span.T @ rest)
            is_new = np.linalg.norm(rest) > max(share * sizes[k], MIN_INDEPENDENT_SHARE)
            if k not in chosen and is_new and len(chosen) < rank:
                chosen.append(k)
                span = np.column_stack([span, rest / np.linalg.norm(rest)])
    return np.sort(np.array(chosen, np.intp))
