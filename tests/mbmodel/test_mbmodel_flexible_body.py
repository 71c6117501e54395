"""A body that bends: the truth's dynamics with the same shape, exact slopes, nothing as drawn."""

import numpy as np
import pytest
import scipy.linalg
from mbmodel_examples import STATION

from identification.words import Dof
from mbmodel import (
    Bending,
    Model,
    Question,
    as_drawn,
    linearise,
    load_machine,
    loosened,
    spring_parts,
    transport,
    with_bending,
)
from truth import read_station
from truth.campaign.draw import NO_TOLERANCE, draw_hammers
from truth.effects.flexible_body import bend_of
from truth.machine.dynamics import Flex, assemble, hammer_columns, sensor_rows

BODY, FREQUENCY, DAMPING = "ty", 92.0, 0.015
HERTZ = np.linspace(4.0, 180.0, 60)


@pytest.fixture(scope="module")
def machine():
    return loosened(load_machine(STATION), float(HERTZ[-1]))[0]


@pytest.fixture(scope="module")
def bending(machine):
    wider = with_bending(machine, BODY)
    layout = wider.layout
    read = tuple(p for p in layout.points if layout.body_name(p) == BODY)
    return Bending(wider, BODY, FREQUENCY, read, (read[0],))


def asked(bending):
    read = (*bending.read, "acc1", "acc17")
    outputs = tuple(Dof.parse(f"{point}:+t{axis}") for point in read for axis in "xyz")
    hits = tuple(
        Dof.parse(f"{point}:+t{axis}") for point in (bending.read[0], "acc1") for axis in "xyz"
    )
    return Question(HERTZ, outputs, hits)


def with_part(bending):
    return Model(bending.machine, (*spring_parts(bending.machine), bending.part()))


def test_nothing_bends_as_drawn(machine, bending):
    model, question = with_part(bending), asked(bending)
    plain = as_drawn(machine)
    assert linearise(model, model.drawn, question).values == pytest.approx(
        linearise(plain, plain.drawn, question).values, rel=1e-9
    )


def test_it_answers_as_the_truth_with_the_same_shape(machine, bending):
    """The truth counts from the centre of mass, we from the joint below: d is between them."""
    station = read_station(STATION)
    index = station.index(BODY)
    stage = station.stages[index]
    shape = bend_of(station, index, (0.5, -0.7, 0.4))
    flex = Flex(index, shape, stage.mass, FREQUENCY, DAMPING)
    model, question = with_part(bending), asked(bending)
    layout = bending.machine.layout
    below = next(one for one in bending.machine.axles if one.stage == BODY).anchor
    centre = layout.centres[layout.bodies.index(BODY)]
    rigid = -transport(centre - below) @ shape(below)
    values = {}
    for name, site in [(s, s) for s in bending.read] + [(f"hammer({s})", s) for s in bending.hit]:
        at = layout.points.index(site)
        along = layout.axes[at].T @ shape(layout.positions[at])[:3]
        values |= {f"{name}_{axis}": v for axis, v in zip("xyz", along, strict=True)}
    frames = {"momentum": rigid}
    for name, axle in bending.above.items():
        frames[name] = transport(axle.anchor - centre) @ rigid + shape(axle.anchor)
    for name, motion in frames.items():
        scaled = motion * np.repeat([1.0, bending.reach], 3)
        values |= {
            f"{name}_{a}": v for a, v in zip(("x", "y", "z", "rx", "ry", "rz"), scaled, strict=True)
        }
    begin = bending.begin(values)
    begin[f"{BODY}.bending_damping"] = np.log(DAMPING / 0.01) / 0.5
    theta = np.array([begin.get(p.name, p.drawn) for p in model.parameters])
    ours = linearise(model, theta, question).values

    found = assemble(station, (flex,))
    free = scipy.linalg.null_space(found.rigid)
    nodes = [sensor.node for _, sensor in station.sensors()]
    reading = sensor_rows(station, (flex,))
    rows = [3 * nodes.index(int(d.point[3:])) + d.axis for d in question.outputs]
    nodes_hit = [int(question.inputs[k].point[3:]) for k in (0, 3)]
    hammers = tuple(one for n in nodes_hit for one in draw_hammers(station, n, NO_TOLERANCE, 1))
    columns = hammer_columns(station, hammers, (flex,))
    if columns.shape[0] != found.mass.shape[0]:
        columns = columns.T
    theirs = np.array(
        [
            s**2
            * reading[rows]
            @ free
            @ np.linalg.solve(
                free.T @ (s**2 * found.mass + s * found.damping + found.stiffness) @ free,
                free.T @ columns,
            )
            for s in question.laplace
        ]
    )
    size = np.abs(theirs).max(axis=0)
    assert (
        np.abs(ours - theirs).max(axis=0) / size
    ).max() < 2e-4  # rigid directions are stiff here
    plain = as_drawn(machine)
    stiff = linearise(plain, plain.drawn, question).values
    assert (np.abs(stiff - theirs).max(axis=0) / size).max() > 0.5


def test_its_slopes_are_exact(bending):
    model, question = with_part(bending), asked(bending)
    count = len(bending.names)
    random = np.random.default_rng(5)
    theta = model.drawn.copy()
    theta[-count:] = 3 * random.standard_normal(count)
    columns = linearise(model, theta, question).columns()[..., -count:]
    way = random.standard_normal(count)
    step = 1e-5
    ends = []
    for sign in (1, -1):
        moved = theta.copy()
        moved[-count:] += sign * step * way
        ends.append(linearise(model, moved, question).values)
    slope = (ends[0] - ends[1]) / (2 * step)
    assert columns @ way == pytest.approx(slope, rel=1e-5, abs=1e-7 * np.abs(slope).max())
    gradient = linearise(model, theta, question).gradient(slope)[-count:]
    assert gradient == pytest.approx(np.einsum("foi,foip->p", slope.conj(), columns).real, rel=1e-7)


def test_it_is_reciprocal(bending):
    model = with_part(bending)
    theta = model.drawn.copy()
    theta[-len(bending.names) :] = 2 * np.random.default_rng(6).standard_normal(len(bending.names))
    # What a point reads of the shape is what a hit there pushes it with.
    names = list(model.parameters)
    place = {p.name: k for k, p in enumerate(names)}
    site = bending.read[0]
    for axis in "xyz":
        own = place[f"{BODY}.bending_{site}_{axis}"]
        theta[place[f"{BODY}.bending_hammer({site})_{axis}"]] = theta[own]
    here, there = (tuple(Dof.parse(f"{p}:+t{a}") for a in "xyz") for p in (site, "acc1"))
    way = linearise(model, theta, Question(HERTZ, there, here)).values
    back = linearise(model, theta, Question(HERTZ, here, there)).values
    assert way == pytest.approx(back.swapaxes(1, 2), rel=1e-8)
