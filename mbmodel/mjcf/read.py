"""Reading of MJCF files: MuJoCo compiles them, and what has no linear model is refused."""

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

import mujoco

from identification.words import InputError, UsageError
from mbmodel.mjcf.compile import SpecChange, compile_with_meshes
from mbmodel.mjcf.refusals import is_enabled, refuse_unlinearisable
from mbmodel.mjcf.source_files import named_files, read_source_files

# Words of MuJoCo's own message, recognised to give a remedy.
_MUJOCO_MASSLESS_MESSAGE = "mass and inertia of moving bodies must be larger"
_MUJOCO_ELEMENT_NAME = re.compile(r"Element name '(?P<name>[^']*)'")
# MuJoCo's warning on a model that is attached without a prefix: no names clash, and MuJoCo itself
# does not save the model here.
_MUJOCO_PREFIX_WARNING = "empty prefix"
# Options that concern MuJoCo's own steps in time: trees that sleep would have no forces, and the
# experimental contacts need an integrator.
_STEPPING_OPTIONS = mujoco.mjtEnableBit.mjENBL_SLEEP | mujoco.mjtEnableBit.mjENBL_IPC

LEFT_OUT = {
    "contact": mujoco.mjtDisableBit.mjDSBL_CONTACT,
    "friction": mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS,
    "limits": mujoco.mjtDisableBit.mjDSBL_LIMIT,
    "gravity": mujoco.mjtDisableBit.mjDSBL_GRAVITY,
}


@dataclass(frozen=True)
class Reading:
    """Wishes of a user beyond what a file states.

    Args:
        without: what is left out: ``contact``, ``friction``, ``limits``, ``gravity``.
        soft_equalities: whether equality constraints give way as MuJoCo's do; else they are rigid.

    Raises:
        UsageError: there is nothing of a name that is left out.
    """

    without: tuple[str, ...] = ()
    soft_equalities: bool = False

    def __post_init__(self) -> None:
        """Check the names of what is left out."""
        if unknown := [name for name in self.without if name not in LEFT_OUT]:
            raise UsageError(
                f"without {unknown[0]!r}: name one or several of {', '.join(LEFT_OUT)}"
            )

    @property
    def disabled(self) -> int:
        """MuJoCo's flags of what is left out."""
        return sum(int(LEFT_OUT[name]) for name in set(self.without))


_READING: ContextVar[Reading | None] = ContextVar("reading", default=None)


def current_reading() -> Reading:
    """Return how MJCF files are read here: as they state it, but within ``read_as``."""
    return _READING.get() or Reading()


@contextmanager
def read_as(reading: Reading) -> Iterator[None]:
    """Read all MJCF files within the context in one way."""
    token = _READING.set(reading)
    try:
        yield
    finally:
        _READING.reset(token)


# Without a handler MuJoCo writes its warnings into a file MUJOCO_LOG.TXT in the working folder.
# They say that numbers became huge; the search for equilibrium refuses such a machine itself.
mujoco.set_mju_user_warning(lambda _: None)


def compile_mjcf(path: Path, reading: Reading | None = None) -> mujoco.MjModel:
    """Compile an MJCF file and refuse what has no linear model (``compile_with_remarks``)."""
    return compile_with_remarks(path, reading=reading)[0]


def compile_with_remarks(
    path: Path,
    *,
    without_friction: bool = False,
    reading: Reading | None = None,
    change: SpecChange | None = None,
) -> tuple[mujoco.MjModel, tuple[str, ...]]:
    """Compile an MJCF file and refuse what has no linear model.

    Args:
        without_friction: whether dry friction (``frictionloss``) is switched off instead of
            refused.
        reading: what the user wants of the file; None for that of ``read_as``.
        change: adds elements before the file is compiled; None for none.

    Returns:
        The compiled model, remarks on its meshes, and MuJoCo's own warnings as remarks.

    Raises:
        InputError: missing file, XML or MJCF that MuJoCo refuses, a body without mass, negative
            or non-finite stiffness or damping, dry friction, ball joints
            with stiffness, or a mesh that gives mass but does not bound a solid.
    """
    read_source_files(path)  # refuses what MuJoCo would misread
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            model, mesh_remarks = compile_with_meshes(path, change)
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(_explain(path, str(error))) from error
    _part_frames(model)
    model.opt.enableflags &= ~int(_STEPPING_OPTIONS)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.actuator_actearly[:] = 0  # else a control acts at once, by the length of a step
    if without_friction:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    reading = reading or current_reading()
    left_out = _leave_out(model, reading)
    _set_closure(model, soft=reading.soft_equalities)
    refuse_unlinearisable(path, model)
    sentences = dict.fromkeys(" ".join(str(warning.message).split()) for warning in caught)
    sentences = {text: None for text in sentences if _MUJOCO_PREFIX_WARNING not in text}
    warned = tuple(f"MuJoCo warns: {sentence}" for sentence in sentences)
    return model, (*mesh_remarks, *warned, *left_out)


def _leave_out(model: mujoco.MjModel, reading: Reading) -> tuple[str, ...]:
    """Switch off what is left out, and return a remark if a model has any of it."""
    touching = int(((model.geom_contype | model.geom_conaffinity) > 0).sum()) + model.npair
    rubbing = int((model.dof_frictionloss > 0).sum() + (model.tendon_frictionloss > 0).sum())
    limited = int(model.jnt_limited.sum() + model.tendon_limited.sum())
    words = {
        "contact": f"geoms that touch ({touching})" if touching else "",
        "friction": f"frictionloss ({rubbing})" if rubbing else "",
        "limits": f"limits ({limited})" if limited else "",
        "gravity": "gravity" if is_enabled(model, LEFT_OUT["gravity"]) else "",
    }
    model.opt.disableflags |= reading.disabled
    named = [words[name] for name in reading.without if words[name]]
    return (f"left out as requested: {', '.join(named)}",) if named else ()


def _set_closure(model: mujoco.MjModel, *, soft: bool) -> None:
    """Leave active only the equality constraints that act, and MuJoCo's forces of them if soft.

    Closed rigidly they are eliminated (``mbmodel.linearisation.closed_chains``).
    """
    if not is_enabled(model, mujoco.mjtDisableBit.mjDSBL_EQUALITY):
        model.eq_active0[:] = 0
    elif not soft:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY


def _part_frames(model: mujoco.MjModel) -> None:
    """Let every frame be computed from its own pose.

    MuJoCo marks frames that coincide and then computes one of them. Its test lets rotations of
    1e-7 rad pass, and frames that are moved later would stay marked.
    """
    for marks in (model.body_sameframe, model.geom_sameframe, model.site_sameframe):
        marks[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE


def mjcf_files(path: Path) -> tuple[Path, ...]:
    """Return every file that an MJCF reads.

    Returns:
        The file, those that it includes, attached models, meshes, textures and other assets that
        exist; sorted.
    """
    return named_files(read_source_files(path))


def _explain(path: Path, message: str) -> str:
    """Return MuJoCo's message in one sentence, with a remedy where the cause is known."""
    text = " ".join(message.split())
    if _MUJOCO_MASSLESS_MESSAGE in text:
        match = _MUJOCO_ELEMENT_NAME.search(text)
        body = match["name"] if match else "?"
        return (
            f"{path}: body {body!r} moves but has no mass: give it an <inertial> or a geom with "
            "mass or density"
        )
    return f"{path}: MuJoCo refuses it: {text.removeprefix('XML Error: ').removeprefix('Error: ')}"
