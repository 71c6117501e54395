r"""Errors of a machine with control loops, and how they change with its FRFs.

With H the FRFs between all labels, G = C H B those between signals, d the disturbances, n the noise
and u = -K (y + n) the controls:

    T = K (1 + G_yu K)^-1,    R = B_d - B_u T (G_yd + N),    E = C_z H R
    L = C_z - G_zu T C_y,     dE = L dH R

E is the error per source: (G_zd - G_zu T G_yd) for a disturbance and -G_zu T for noise, whose N
selects the measurement. A change dH of the FRFs changes E by L dH R. Sampled loops add the images
of the sampler to G_yu K (``closed_loop_states``); L neglects how these change.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Input, Output, PortSum, Real
from tuning.plant.error_budget.definition import BudgetDefinition


@dataclass(frozen=True, eq=False)
class PortMap:
    """Labels of a budget, and signals as their weighted sums.

    Args:
        outputs: labels of all outputs.
        inputs: labels of all inputs.
        errors: C_z; (n_error, n_out).
        measured: C_y without time derivatives; (n_loop, n_out).
        disturbances: B_d; (n_in, n_source).
        controls: B_u; (n_in, n_loop).
        noise: N; (n_loop, n_source).
    """

    outputs: tuple[Output, ...]
    inputs: tuple[Input, ...]
    errors: Real
    measured: Real
    disturbances: Complex
    controls: Real
    noise: Real


def map_ports(definition: BudgetDefinition) -> PortMap:
    """Return the labels of a budget and the matrices of its signals."""
    signals = [*definition.errors, *(loop.measured for loop in definition.loops)]
    outputs = tuple(dict.fromkeys(port for signal in signals for port, _ in signal.terms))
    inputs = tuple(
        dict.fromkeys(
            [
                *(port for source in definition.sources for port, _ in source.inputs),
                *(loop.input for loop in definition.loops),
            ]
        )
    )
    disturbances = np.zeros((len(inputs), len(definition.sources)), complex)
    noise = np.zeros((len(definition.loops), len(definition.sources)))
    names = [loop.name for loop in definition.loops]
    for column, source in enumerate(definition.sources):
        for port, factor in source.inputs:
            disturbances[inputs.index(port), column] += factor
        if source.noise_of:
            noise[names.index(source.noise_of), column] = 1.0
    controls = np.zeros((len(inputs), len(definition.loops)))
    for column, loop in enumerate(definition.loops):
        controls[inputs.index(loop.input), column] = 1.0
    return PortMap(
        outputs,
        inputs,
        _selection(definition.errors, outputs),
        _selection([loop.measured for loop in definition.loops], outputs),
        disturbances,
        controls,
        noise,
    )


def _selection(signals: "list[PortSum] | tuple[PortSum, ...]", outputs: tuple[Output, ...]) -> Real:
    """Return signals as weighted sums of outputs; (n_signal, n_out)."""
    matrix = np.zeros((len(signals), len(outputs)))
    for row, signal in zip(matrix, signals, strict=True):
        for port, weight in signal.terms:
            row[outputs.index(port)] += weight
    return matrix


@dataclass(frozen=True, eq=False)
class LoopResponse:
    """Errors per source, and the factors of their change with the FRFs.

    Args:
        errors: E; (n_freq, n_error, n_source).
        left: L; (n_freq, n_error, n_out).
        right: R; (n_freq, n_in, n_source).
    """

    errors: Complex
    left: Complex
    right: Complex


def controller_response(definition: BudgetDefinition, laplace: Complex) -> Complex:
    """Return K(s) of each loop with its delay, and the hold of a sampled one; (n_freq, n_loop)."""
    columns = [
        loop.controller.response(laplace) * np.exp(-laplace * loop.delay)
        for loop in definition.loops
    ]
    return np.stack(columns, axis=-1) if columns else np.zeros((len(laplace), 0), complex)


def loop_gains(
    definition: BudgetDefinition,
    ports: PortMap,
    frfs: Complex,
    laplace: Complex,
    aliases: Complex | float = 0.0,
) -> Complex:
    """Return the loop gains GK, G from the controls to what the loops measure.

    Args:
        frfs: H, receptances or what sensors read; (n_freq, n_out, n_in).
        laplace: s of every line [rad/s]; (n_freq,).
        aliases: images of sampled loops; (n_freq, n_loop, n_loop).

    Returns:
        (n_freq, n_loop, n_loop).
    """
    plants = measured_rows(definition, ports, laplace) @ (frfs @ ports.controls)
    return np.asarray(plants * controller_response(definition, laplace)[:, None, :] + aliases)


def measured_rows(definition: BudgetDefinition, ports: PortMap, laplace: Complex) -> Complex:
    """Return C_y with time derivatives; (n_freq, n_loop, n_out)."""
    derivatives = np.array([loop.measured.derivative for loop in definition.loops], int)
    return np.asarray(ports.measured * laplace[:, None, None] ** derivatives[:, None])


def close_loops(
    definition: BudgetDefinition,
    ports: PortMap,
    frfs: Complex,
    laplace: Complex,
    aliases: Complex | float = 0.0,
) -> LoopResponse:
    """Return the errors per source with all loops closed.

    Args:
        definition: loops and sources.
        frfs (n_freq, n_out, n_in), laplace [rad/s] (n_freq,),
            aliases (n_freq, n_loop, n_loop): as for ``loop_gains``.
    """
    measured, count = measured_rows(definition, ports, laplace), len(definition.loops)
    to_controls = frfs @ ports.controls
    gains = controller_response(definition, laplace)
    return_difference = np.eye(count) + (measured @ to_controls) * gains[:, None, :] + aliases
    # T = K (1 + G K)^-1 solves T (1 + G K) = K, K diagonal.
    effort = np.linalg.solve(
        return_difference.transpose(0, 2, 1), gains[:, :, None] * np.eye(count)
    ).transpose(0, 2, 1)
    right = ports.disturbances - ports.controls @ (
        effort @ (measured @ (frfs @ ports.disturbances) + ports.noise)
    )
    left = ports.errors - (ports.errors @ to_controls) @ effort @ measured
    return LoopResponse(ports.errors @ frfs @ right, left, right)
