"""Ports of a model: forces of the inputs on the machine, and readout of the outputs, by label."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from identification.words import (
    DERIVATIVE_ORDER,
    Complex,
    Dof,
    Input,
    Integers,
    Output,
    Port,
    Real,
    Signal,
    UsageError,
    group_by_key,
)
from mbmodel.linearisation.motors import Activation, ActuatorGain
from mbmodel.machine import Machine
from mbmodel.parts import Change
from mbmodel.ports.request import FrfRequest
from mbmodel.ports.signal_rows import (
    find_axle,
    find_sensor,
    is_floor,
    point_rows,
    refuse_point_without_direction,
)


@dataclass(frozen=True, eq=False)
class PointChannels:
    """The labels at one point.

    Args:
        rows: their numbers among all labels; (n,).
        axes: axis 0..5 of each; (n,).
        signs: sign of each; 0 for a signal, which is no single direction of the point; (n,).
    """

    rows: Integers
    axes: Integers
    signs: Real

    @property
    def selection(self) -> Real:
        """1 where a label reads a direction, whatever its sign; (n, 6)."""
        return np.eye(6)[self.axes]

    @property
    def directions(self) -> Real:
        """Signed direction of each label; (n, 6)."""
        return self.signs[:, None] * self.selection


NO_CHANNELS = PointChannels(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))


def group_by_point(labels: Sequence[Port]) -> dict[str, PointChannels]:
    """Return the labels at each point.

    Args:
        labels: outputs or inputs.
    """
    members = group_by_key(
        (label.point, (row, label.axis, label.sign if isinstance(label, Dof) else 0))
        for row, label in enumerate(labels)
    )
    groups = {}
    for point, of_point in members.items():
        rows, axes, signs = np.array(of_point).T
        groups[point] = PointChannels(rows, axes, signs.astype(float))
    return groups


@dataclass(frozen=True, eq=False)
class FurtherTerms:
    """Terms of readings beside one derivative of the motion, as force sensors have.

    Args:
        motion: C, reading per s^0, s^1, s^2 of the joint coordinates; (3, n_out, nv).
        direct: reading per unit of each input at once; (n_out, n_in).
    """

    motion: Real
    direct: Real


@dataclass(frozen=True, eq=False)
class Ports:
    """Rows of the outputs and columns of the inputs.

    Args:
        readout: L, output per motion of the centres of mass; (n_out, 6 n_body).
        force: P, forces at the centres per unit of each input; (6 n_body, n_in).
        motor: generalised forces per unit of each input; (nv, n_in).
        floor: U, acceleration of the centres with the floor, per unit of each input;
            (6 n_body, n_in).
        joint_readout: J, output per joint coordinate; (n_out, nv).
        orders: derivative that each output reads: 0 position, 1 velocity, 2 acceleration; None
            for the quantity of the request; n_out.
        further: terms of readings that are no single derivative; None without any.
        activations: dynamics from each input to what acts; None for an input that acts at once;
            n_in.
    """

    readout: Real
    force: Real
    motor: Real
    floor: Real
    joint_readout: Real
    orders: tuple[int | None, ...]
    further: FurtherTerms | None = None
    activations: tuple[Activation | None, ...] = ()

    def lags(self, laplace: Complex) -> Complex | None:
        """Return what acts per unit of each input; None if all act at once; (n_in, n_freq)."""
        if not any(self.activations):
            return None
        unit = np.ones(len(laplace), np.complex128)
        return np.array([unit if each is None else each(laplace) for each in self.activations])

    @property
    def has_floor(self) -> bool:
        """Whether some input moves the floor."""
        return bool(self.floor.any())


# Ports of every machine in use: many fits have equal channels.
_PORTS: WeakKeyDictionary[Machine, dict[tuple[tuple[Port, ...], ...], Ports]] = WeakKeyDictionary()


def find_ports(machine: Machine, outputs: Sequence[Output], inputs: Sequence[Input]) -> Ports:
    """Return the ports of a machine for labels and signals; see ``signal_rows``.

    Args:
        machine: as drawn.
        outputs: labels of sensors, points or bodies; joints, MuJoCo sensors, differences.
        inputs: labels of points or bodies, of the floor; motors, joints, pairs of forces.

    Raises:
        UsageError: a label or motor that the machine does not have; a floor that tilts under
            gravity.
    """
    kept, labels = _PORTS.setdefault(machine, {}), (tuple(outputs), tuple(inputs))
    if labels not in kept:
        kept[labels] = _read_ports(machine, *labels)
    return kept[labels]


def _read_ports(machine: Machine, outputs: Sequence[Output], inputs: Sequence[Input]) -> Ports:
    """Return the ports of a machine; see ``find_ports`` for the arguments."""
    size, count, nv = len(machine.body_mass), len(inputs), len(machine.coordinates)
    force, floor = np.zeros((size, count)), np.zeros((size, count))
    motor = np.zeros((nv, count))
    activations: list[Activation | None] = [None] * count
    for column, port in enumerate(inputs):
        if is_floor(machine, port):
            _refuse_tilt(machine, port)
            floor[:, column] = port.sign * machine.floor_jacobian[:, port.axis]
        elif isinstance(port, Signal) and port.is_joint:
            motor[:, column] = find_axle(machine, port).motion(nv)
        elif isinstance(port, Signal) and not port.is_directed:
            gain = _motor(machine, port)
            motor[:, column], force[:, column] = gain.joint, gain.body
            activations[column] = gain.activation
        else:
            force[:, column] = point_rows(machine.layout, port)
    readout, joint_readout = np.zeros((len(outputs), size)), np.zeros((len(outputs), nv))
    motion, direct = np.zeros((3, len(outputs), nv)), np.zeros((len(outputs), count))
    orders: list[int | None] = []
    for row, port in enumerate(outputs):
        orders.append(None)
        if isinstance(port, Signal) and port.is_joint:
            joint_readout[row] = find_axle(machine, port).motion(nv)
        elif isinstance(port, Signal) and not port.is_directed:
            reading = find_sensor(machine, port)
            readout[row], joint_readout[row] = reading.body, reading.joint
            motion[:, row], orders[-1] = reading.motion, reading.order
            controls = [reading.controls.get(str(source)) for source in inputs]
            # MuJoCo counts the force of a motor at a joint even where it acts at a site.
            direct[row] = [
                wrench if control is None else control
                for wrench, control in zip(reading.wrench @ force, controls, strict=True)
            ]
            if reading.has_further_terms and floor.any():
                raise UsageError(
                    f"{port.name!r} reads forces or weight, which is not handled with a moving "
                    "floor: leave it out, or name forces or motors as inputs"
                )
        else:
            readout[row] = point_rows(machine.layout, port)
    has_further = motion.any() or direct.any()
    further = FurtherTerms(motion, direct) if has_further else None
    rows = readout, force, motor, floor, joint_readout
    return Ports(*rows, tuple(orders), further, tuple(activations))


def with_orders(request: FrfRequest, ports: Ports) -> FrfRequest:
    """Return a request with the derivative that each output reads, if these differ.

    Args:
        ports: of its outputs.
    """
    quantity = DERIVATIVE_ORDER[request.quantity]
    orders = [quantity if order is None else order for order in ports.orders]
    if ports.further is None and all(order == quantity for order in orders):
        return request
    base = min(orders) if ports.further is None else 0
    return replace(request, orders=tuple(orders), base_order=base)


def _motor(machine: Machine, motor: Signal) -> ActuatorGain:
    """Return the gain of a motor."""
    if motor.name not in machine.motors:
        refuse_point_without_direction(machine, motor.name)
        if not machine.motors:
            raise UsageError(
                f"{motor.name!r} is no motor of the model, which has none: name a point and its "
                "direction, such as POINT:+tz"
            )
        names = ", ".join(machine.motors)
        raise UsageError(f"{motor.name!r} is no motor of the model: choose one of {names}")
    return machine.motors[motor.name]


def _refuse_tilt(machine: Machine, dof: Port) -> None:
    """Raise UsageError for a tilting floor if gravity is on or a rotor spins."""
    if dof.is_rotation and (machine.gravity.any() or machine.spinning):
        raise UsageError(
            f"{dof}: a tilting floor also turns the machine's weight and rotors, which is not "
            "handled: turn gravity and spin off, or request translations of the floor"
        )


def parse_input(machine: Machine, text: str) -> Input:
    """Return the input that a text names: a motor, joint or pair, or a direction at a point.

    Args:
        machine: with its motors and points.
        text: ``ty_drive``, ``joint:ty_tx``, ``coil-magnet:+tx``, or a label such as ``acc11:+tx``.

    Raises:
        UsageError: the text names none of these.
    """
    port = machine.layout.parse(text)
    find_ports(machine, (), (port,))
    return port


def parse_output(machine: Machine, text: str) -> Output:
    """Return the output that a text names: a joint, MuJoCo sensor, difference or direction.

    Args:
        machine: with its sensors and points.
        text: ``joint:ty_tx``, ``encoder``, ``imu.2`` for the third number of a sensor,
            ``stage-frame:+tx``, or a label such as ``acc11:+tx``.

    Raises:
        UsageError: the text names none of these.
    """
    port = machine.layout.parse(text)
    find_ports(machine, (port,), ())
    return port


def direction_selection(dofs: Sequence[Port], point: str) -> Real:
    """Return the signed direction of a point that each label means; (n, 6).

    Args:
        dofs: labels.
        point: name of the point; rows of labels at other points are zero.
    """
    matrix = np.zeros((len(dofs), 6))
    for row, dof in zip(matrix, dofs, strict=True):
        if isinstance(dof, Dof) and dof.point == point:
            row[dof.axis] = dof.sign
    return matrix


def apply_point_changes(
    ports: Ports, changes: Sequence[Change], outputs: Sequence[Output], inputs: Sequence[Input]
) -> Ports:
    """Return ports with the changes of Parts at sensors and hammer points.

    Args:
        ports: as drawn.
        changes: in the slots sensor and hammer.
        outputs: labels of the outputs.
        inputs: labels of the inputs.
    """
    if not changes:
        return ports
    readout, force = ports.readout.copy(), ports.force.copy()
    of_outputs, of_inputs = group_by_point(outputs), group_by_point(inputs)
    for change in changes:
        added = change.left @ change.core[0] @ change.right.T
        if change.slot == "sensor":
            channels = of_outputs.get(change.point, NO_CHANNELS)
            readout[channels.rows] += channels.directions @ added
        else:
            channels = of_inputs.get(change.point, NO_CHANNELS)
            force[:, channels.rows] += (channels.directions @ added).T
    return replace(ports, readout=readout, force=force)
