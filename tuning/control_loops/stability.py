"""Stability of a machine with its control loops, and what to check where it is unstable.

The poles are those of the state space with the controllers and Pade's fractions of their delays.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from identification.words import Complex, InputError, Loop, Real
from mbmodel import Machine, Model, as_drawn, closed_loop_dynamics, system_poles, with_loops

# A pole grows if its real part exceeds this part of its size: rounding leaves less.
_MIN_RELATIVE_GROWTH = 1e-6


def growing_pole(poles: Complex) -> complex | None:
    """Return the pole that grows fastest; None if none grows.

    Args:
        poles: of a machine with or without loops, those at rest 0 exactly [rad/s]; (n,).
    """
    is_growing = poles.real > _MIN_RELATIVE_GROWTH * np.abs(poles)
    if not is_growing.any():
        return None
    return complex(max(poles[is_growing], key=lambda pole: pole.real))


def growing_pole_of_model(model: Model, theta: Real) -> complex | None:
    """Return the pole of a model with its loops that grows fastest; None if none grows.

    Args:
        model: machine and Parts; laws of Parts that are no polynomials in s are left out.
        theta: parameters in SI; (n_parameter,).
    """
    return growing_pole(system_poles(closed_loop_dynamics(model.assemble(theta))))


def unstable_variants(model: Model, theta: Real) -> dict[str, complex]:
    """Return the fastest growing pole of each variant that is unstable with the model's loops.

    Args:
        model: machine with its variants, and Parts.
        theta: parameters in SI; (n_parameter,).
    """
    poles = {
        name: growing_pole_of_model(model.in_variant(name), theta)
        for name in model.machine.variants
    }
    return {name: pole for name, pole in poles.items() if pole is not None}


def instability_sentence(subject: str, loops: str, variant: str, pole: complex) -> str:
    """Return that a machine is unstable with its loops, and which pole grows.

    Args:
        subject: such as "the tuned machine".
        loops: names of the loops.
        variant: in which the machine is unstable; empty for the machine itself.
        pole: that grows [rad/s].
    """
    place = f" ({variant})" if variant else ""
    return (
        f"{subject}{place} with {loops} closed is unstable: the pole {pole.real:.4g} "
        f"{pole.imag:+.4g}i rad/s at {abs(pole.imag) / (2 * np.pi):.4g} Hz grows"
    )


def check_nominal_loops(machine: Machine, trusted: Collection[str]) -> list[str]:
    """Return remarks on loops with which the nominal machine, or a variant of it, is unstable.

    Args:
        machine: nominal machine with its loops and variants.
        trusted: names of the loops that are right however unstable the nominal machine is.

    Raises:
        InputError: the nominal machine is unstable with a loop that is not trusted.
    """
    names = ", ".join(f"loop.{loop.name}" for loop in machine.loops)
    is_trusted = all(loop.name in trusted for loop in machine.loops)
    remarks = []
    for variant, each in {"": machine, **machine.variants}.items():
        pole = _pole_with(each, each.loops)
        if pole is None:
            continue
        sentence = instability_sentence("the nominal machine", names, variant, pole)
        if _pole_with(each, ()) is not None:
            sentence += ", and so does one without any loop"
        if not is_trusted:
            raise InputError(
                f"{sentence}; {_hint(each)}check the sign of each gain (u = -K y), its unit (that "
                "of the input per SI unit of the output) and quantity; if all are right, set "
                "as_stated = true in each loop"
            )
        remarks.append(f"{sentence}; campaign.toml states that the loops are right")
    return remarks


def tuned_loop_remarks(model: Model, theta: Real) -> list[str]:
    """Return remarks if a tuned machine, or a variant of it, is unstable with its loops.

    Args:
        theta: tuned parameters in SI; (n_parameter,).
    """
    if not model.loops:
        return []
    pole = growing_pole_of_model(model, theta)
    poles = {**({} if pole is None else {"": pole}), **unstable_variants(model, theta)}
    names = ", ".join(part.loop.name for part in model.loops)
    return [
        f"{instability_sentence('the tuned machine', names, variant, growing)}, but it was "
        "measured: check the loop's sign, gain, unit and delay"
        for variant, growing in poles.items()
    ]


def _hint(machine: Machine) -> str:
    """Return which single loop is stable with the opposite sign, or an empty text."""
    for number, loop in enumerate(machine.loops):
        turned = list(machine.loops)
        turned[number] = _turn_sign(loop)
        if _pole_with(machine, tuple(turned)) is None:
            return f"with the opposite sign of loop.{loop.name} it would be stable; "
    return ""


def _turn_sign(loop: Loop) -> Loop:
    """Return a loop with the opposite sign of its gain."""
    known = loop.controller
    turned = replace(known, output_matrix=-known.output_matrix, feedthrough=-known.feedthrough)
    return replace(loop, controller=turned)


def _pole_with(machine: Machine, loops: tuple[Loop, ...]) -> complex | None:
    """Return the pole of the nominal machine with these loops that grows; None if none does."""
    model = as_drawn(with_loops(machine, loops))
    return growing_pole_of_model(model, model.drawn)
