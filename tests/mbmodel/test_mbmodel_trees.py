"""Random trees of 3 to 12 stages: what holds for every machine, and exudyn beside them."""

from xml.etree import ElementTree

import numpy as np
import pytest
from exudyn_twin import exudyn_twin
from hypothesis import given, settings
from hypothesis import strategies as st
from mbmodel_examples import mjcf, numbers, random_request, random_tree, worst_of_channels
from scipy.spatial.transform import Rotation

from identification.words import Dof
from mbmodel import FrfRequest, as_drawn, linearise

FREQ = np.linspace(2, 300, 17)
TREES = st.tuples(st.integers(0, 10_000), st.integers(3, 12))
TWENTY = settings(max_examples=20, deadline=None)


def tree(from_text, seed, count, **changed):
    return as_drawn(from_text(random_tree(seed, n_body=count, **changed), name="tree.xml"))


@TWENTY
@given(TREES)
def test_force_and_motion_can_be_exchanged(from_text, chosen):
    model = tree(from_text, *chosen)
    frf_request = random_request(model.machine, FREQ, n_out=6, n_in=1)
    both = FrfRequest(FREQ, frf_request.outputs, frf_request.outputs)
    values = linearise(model, model.drawn, both).values
    assert worst_of_channels(values.transpose(0, 2, 1), values) < 1e-8


@TWENTY
@given(TREES)
def test_mass_and_stiffness_are_positive_definite_and_no_hit_gains_energy(from_text, chosen):
    model = tree(from_text, *chosen)
    matrices = model.matrices(model.drawn)
    for matrix in (matrices.mass, matrices.stiffness, matrices.damping):
        np.testing.assert_allclose(matrix, matrix.T, atol=1e-12 * np.abs(matrix).max())
        assert np.linalg.eigvalsh(matrix).min() > 0
    dofs = random_request(model.machine, FREQ, n_out=5, n_in=1).outputs
    mobility = linearise(model, model.drawn, FrfRequest(FREQ, dofs, dofs, "mobility")).values
    power = np.linalg.eigvalsh((mobility + mobility.conj().transpose(0, 2, 1)) / 2)
    assert (power.min(axis=1) >= -1e-9 * np.abs(power).max(axis=1)).all()


@TWENTY
@given(TREES, st.randoms(use_true_random=False))
def test_the_order_of_bodies_in_the_file_does_not_matter(from_text, chosen, random):
    text = random_tree(chosen[0], n_body=chosen[1])
    root = ElementTree.fromstring(text)
    for parent in [root.find("worldbody"), *root.iter("body")]:
        bodies = parent.findall("body")
        for body in bodies:
            parent.remove(body)
        random.shuffle(bodies)
        parent.extend(bodies)
    shuffled = ElementTree.tostring(root, encoding="unicode")
    model, reordered = (as_drawn(from_text(t, name="tree.xml")) for t in (text, shuffled))
    frf_request = random_request(model.machine, FREQ)
    expected = linearise(model, model.drawn, frf_request).values
    assert (
        worst_of_channels(linearise(reordered, reordered.drawn, frf_request).values, expected)
        < 1e-9
    )


@TWENTY
@given(TREES, st.tuples(*[st.floats(-3, 3, allow_subnormal=False)] * 3))
def test_the_origin_does_not_matter(from_text, chosen, offset):
    here, there = (tree(from_text, *chosen, offset=place) for place in ((0, 0, 0), offset))
    frf_request = random_request(here.machine, FREQ)
    expected = linearise(here, here.drawn, frf_request).values
    assert worst_of_channels(linearise(there, there.drawn, frf_request).values, expected) < 1e-8


def sprung_tree(seed, count):
    """Stages on six springs each along turned axes through one skew point, turned bodies."""
    rng = np.random.default_rng(seed)
    parents = [-1, *(int(rng.integers(0, k)) for k in range(1, count))]

    def body(k):
        turn = Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix()
        inertia = turn @ np.diag(rng.uniform(1, 1.6, 3)) @ turn.T
        axes = Rotation.random(random_state=int(rng.integers(1 << 31))).as_matrix()
        place = numbers(rng.uniform(-0.3, 0.3, 3))
        joints = "".join(
            f'<joint name="b{k}_{short}{"xyz"[j]}" type="{kind}" axis="{numbers(axes[:, j])}" '
            f'pos="{place}" stiffness="{10 ** rng.uniform(5, 7):.17g}" '
            f'damping="{10 ** rng.uniform(1, 3):.17g}"/>'
            for short, kind in (("t", "slide"), ("r", "hinge"))
            for j in range(3)
        )
        full = numbers(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
        head = (
            f'<body name="b{k}" pos="{numbers(rng.uniform(-0.5, 0.5, 3))}" '
            f'quat="{numbers(rng.normal(size=4))}">'
            f'<inertial pos="{numbers(rng.uniform(-0.2, 0.2, 3))}" '
            f'mass="{rng.uniform(5, 60):.17g}" fullinertia="{full}"/>'
        )
        site = (
            f'<site name="acc{k + 1}" pos="{numbers(rng.uniform(-0.4, 0.4, 3))}" '
            f'quat="{numbers(rng.normal(size=4))}"/>'
        )
        children = "".join(body(c) for c in range(count) if parents[c] == k)
        return head + joints + site + children + "</body>"

    return mjcf(body(0))


@pytest.mark.parametrize(("seed", "count"), [(0, 3), (1, 4), (2, 6), (3, 9), (4, 12)])
def test_exudyn_gives_a_turned_tree_the_same_frfs(from_text, tmp_path, seed, count):
    text = sprung_tree(seed, count)
    model = as_drawn(from_text(text))
    path = tmp_path / "tree.xml"
    path.write_text(text)
    twin = exudyn_twin(path)
    names = model.machine.layout.points
    dofs = tuple(Dof.of(name, axis) for name in names for axis in range(3))
    pairs = [(name, axis) for name in names for axis in range(3)]
    expected = twin.accelerance(FREQ, pairs, pairs[:3])
    values = linearise(model, model.drawn, FrfRequest(FREQ, dofs, dofs[:3])).values
    # exudyn differentiates its damping numerically: 1e-10 of C
    assert worst_of_channels(values, expected) < 1e-9
