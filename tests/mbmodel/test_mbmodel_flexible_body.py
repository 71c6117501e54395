"""A body that bends: the truth's dynamics with the same shape, exact slopes, nothing as drawn."""

import numpy as np
import pytest
import scipy.linalg
from mbmodel_examples import STATION

from identification.words import Dof
from mbmodel import (
    BendingMode,
    FrfRequest,
    Model,
    add_bending_mode,
    as_drawn,
    linearise,
    load_machine,
    release_rigid_directions,
    spring_parts,
    transport,
)
from truth import read_station
from truth.campaign.draw import NO_TOLERANCE, draw_hammers
from truth.effects.flexible_body import bend_of
from truth.machine.dynamics import Flex, assemble, hammer_columns, sensor_rows

BODY, FREQUENCY, DAMPING = "ty", 92.0, 0.015
HERTZ = np.linspace(4.0, 180.0, 60)


@pytest.fixture(scope="module")
def machine():
    return release_rigid_directions(load_machine(STATION), float(HERTZ[-1]))[0]


@pytest.fixture(scope="module")
def bending(machine):
    extended = add_bending_mode(machine, BODY)
    layout = extended.layout
    sites = tuple(p for p in layout.points if layout.body_name(p) == BODY)
    return BendingMode(extended, BODY, FREQUENCY, sites, (sites[0],))


def frf_request_of(bending):
    sites = (*bending.sensors, "acc1", "acc17")
    outputs = tuple(Dof.parse(f"{point}:+t{axis}") for point in sites for axis in "xyz")
    hits = tuple(
        Dof.parse(f"{point}:+t{axis}") for point in (bending.sensors[0], "acc1") for axis in "xyz"
    )
    return FrfRequest(HERTZ, outputs, hits)


def with_part(bending):
    return Model(bending.machine, (*spring_parts(bending.machine), bending.part()))


def test_as_drawn_nothing_bends(machine, bending):
    model, frf_request = with_part(bending), frf_request_of(bending)
    plain = as_drawn(machine)
    assert linearise(model, model.drawn, frf_request).values == pytest.approx(
        linearise(plain, plain.drawn, frf_request).values, rel=1e-9
    )


def test_it_answers_as_the_truth_with_the_same_shape(machine, bending):
    """The truth's shape refers to the centre of mass, the model's to the joint below."""
    station = read_station(STATION)
    index = station.index(BODY)
    stage = station.stages[index]
    shape = bend_of(station, index, (0.5, -0.7, 0.4))
    flex = Flex(index, shape, stage.mass, FREQUENCY, DAMPING)
    model, frf_request = with_part(bending), frf_request_of(bending)
    layout = bending.machine.layout
    below = next(axle for axle in bending.machine.axles if axle.stage == BODY).anchor
    centre = layout.centres[layout.bodies.index(BODY)]
    rigid = -transport(centre - below) @ shape(below)
    values = {}
    for name, site in [(s, s) for s in bending.sensors] + [
        (f"hammer({s})", s) for s in bending.hit_points
    ]:
        at = layout.points.index(site)
        along = layout.axes[at].T @ shape(layout.positions[at])[:3]
        values |= {f"{name}_{axis}": v for axis, v in zip("xyz", along, strict=True)}
    frames = {"momentum": rigid}
    for name, axle in bending.joints_above.items():
        frames[name] = transport(axle.anchor - centre) @ rigid + shape(axle.anchor)
    for name, motion in frames.items():
        scaled = motion * np.repeat([1.0, bending.shape_radius], 3)
        values |= {
            f"{name}_{a}": v for a, v in zip(("x", "y", "z", "rx", "ry", "rz"), scaled, strict=True)
        }
    begin = bending.start_values(values)
    begin[f"{BODY}.bending_damping"] = np.log(DAMPING / 0.01) / 0.5
    theta = np.array([begin.get(p.name, p.drawn) for p in model.parameters])
    values_of_model = linearise(model, theta, frf_request).values

    truth = assemble(station, (flex,))
    free = scipy.linalg.null_space(truth.rigid)
    nodes = [sensor.node for _, sensor in station.sensors()]
    reading = sensor_rows(station, (flex,))
    rows = [3 * nodes.index(int(d.point[3:])) + d.axis for d in frf_request.outputs]
    nodes_hit = [int(frf_request.inputs[k].point[3:]) for k in (0, 3)]
    hammers = tuple(
        hammer for n in nodes_hit for hammer in draw_hammers(station, n, NO_TOLERANCE, 1)
    )
    columns = hammer_columns(station, hammers, (flex,))
    if columns.shape[0] != truth.mass.shape[0]:
        columns = columns.T
    expected = np.array(
        [
            s**2
            * reading[rows]
            @ free
            @ np.linalg.solve(
                free.T @ (s**2 * truth.mass + s * truth.damping + truth.stiffness) @ free,
                free.T @ columns,
            )
            for s in frf_request.laplace
        ]
    )
    size = np.abs(expected).max(axis=0)
    assert (
        np.abs(values_of_model - expected).max(axis=0) / size
    ).max() < 2e-4  # rigid directions are stiff here
    plain = as_drawn(machine)
    stiff = linearise(plain, plain.drawn, frf_request).values
    assert (np.abs(stiff - expected).max(axis=0) / size).max() > 0.5


def test_its_slopes_are_exact(bending):
    model, frf_request = with_part(bending), frf_request_of(bending)
    count = len(bending.names)
    random = np.random.default_rng(5)
    theta = model.drawn.copy()
    theta[-count:] = 3 * random.standard_normal(count)
    columns = linearise(model, theta, frf_request).columns()[..., -count:]
    way = random.standard_normal(count)
    step = 1e-5
    ends = []
    for sign in (1, -1):
        moved = theta.copy()
        moved[-count:] += sign * step * way
        ends.append(linearise(model, moved, frf_request).values)
    slope = (ends[0] - ends[1]) / (2 * step)
    assert columns @ way == pytest.approx(slope, rel=1e-5, abs=1e-7 * np.abs(slope).max())
    gradient = linearise(model, theta, frf_request).gradient(slope)[-count:]
    assert gradient == pytest.approx(np.einsum("foi,foip->p", slope.conj(), columns).real, rel=1e-7)


def test_it_is_reciprocal(bending):
    model = with_part(bending)
    theta = model.drawn.copy()
    theta[-len(bending.names) :] = 2 * np.random.default_rng(6).standard_normal(len(bending.names))
    # What a point reads of the shape is what a hit there pushes it with.
    names = list(model.parameters)
    number_of = {p.name: k for k, p in enumerate(names)}
    site = bending.sensors[0]
    for axis in "xyz":
        of_sensor = number_of[f"{BODY}.bending_{site}_{axis}"]
        theta[number_of[f"{BODY}.bending_hammer({site})_{axis}"]] = theta[of_sensor]
    here, there = (tuple(Dof.parse(f"{p}:+t{a}") for a in "xyz") for p in (site, "acc1"))
    way = linearise(model, theta, FrfRequest(HERTZ, there, here)).values
    back = linearise(model, theta, FrfRequest(HERTZ, here, there)).values
    assert way == pytest.approx(back.swapaxes(1, 2), rel=1e-8)
