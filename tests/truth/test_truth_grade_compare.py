"""The drawing against a measurement made of it, with faults put in by hand."""

from dataclasses import replace

import numpy as np
import pytest

from truth.campaign.file_formats import model_xml, uff_bytes
from truth.campaign.measure import Measurement
from truth.errors import TruthError
from truth.grade.compare import compare
from truth.machine import rig
from truth.machine.station import Hammer

FREQ = 10.0 + 0.5 * np.arange(120)
LABELS = tuple((node, axis) for node in (3, 1, 2) for axis in (1, 2, 3))
REFERENCES = ((1, 1), (1, 2), (1, 3))


def exact(station, freq=FREQ):
    hammers = tuple(Hammer(1, *station.aim(1), axis) for axis in np.eye(3))
    return rig.accelerance(rig.build(rig.Prepared(station, hammers)), freq)


def write(folder, station, *tests, extra=""):
    (folder / "model.xml").write_text(model_xml(station))
    lines = ['model = "model.xml"']
    for number, test in enumerate(tests):
        (folder / f"t{number}.uff").write_bytes(uff_bytes(test))
        lines += ["[[test]]", f'file = "t{number}.uff"', "averages = 6"]
    (folder / "campaign.toml").write_text("\n".join([*lines, extra]) + "\n")
    return folder


def measured(frf, coherence=None, labels=LABELS, references=REFERENCES, freq=FREQ):
    return Measurement(freq, frf, coherence, labels, references)


def channel(comparison, node, axis):
    return [one for one in comparison.channels if (one.node, one.axis) == (node, axis)]


def test_an_exact_drawing_agrees_to_single_precision(two_bodies, tmp_path):
    found = compare(write(tmp_path, two_bodies, measured(exact(two_bodies))))
    assert len(found.channels) == 27
    assert found.nodes == (1,)
    assert max(one.residual for one in found.channels) < 1e-6
    assert min(one.frac for one in found.channels) == pytest.approx(1, abs=1e-6)
    assert list(found.coordinates) == list(LABELS)
    assert min(found.coordinates.values()) == pytest.approx(1, abs=1e-6)


def test_a_gain_is_a_residual_and_no_loss_of_correlation(two_bodies, tmp_path):
    frf = exact(two_bodies)
    frf[:, 4] *= 1.25
    found = compare(write(tmp_path, two_bodies, measured(frf)))
    for one in channel(found, *LABELS[4]):
        assert one.residual == pytest.approx(0.2, rel=1e-5)
        assert one.frac == pytest.approx(1, abs=1e-6)
    assert found.coordinates[LABELS[4]] == pytest.approx(1, abs=1e-6)


def test_the_measures_are_those_of_the_formulas(two_bodies, tmp_path):
    drawn = exact(two_bodies)
    random = np.random.default_rng(1)
    noise = random.standard_normal((2, *drawn.shape))
    frf = drawn * (1 + 0.3 * (noise[0] + 1j * noise[1]))
    found = compare(write(tmp_path, two_bodies, measured(frf)))
    h, d = frf[:, 7, 1], drawn[:, 7, 1]
    one = channel(found, *LABELS[7])[1]
    frac = abs(np.vdot(d, h)) ** 2 / (np.vdot(h, h) * np.vdot(d, d)).real
    assert one.frac == pytest.approx(frac, rel=1e-5)
    assert one.residual == pytest.approx(np.linalg.norm(h - d) / np.linalg.norm(h), rel=1e-5)
    h, d = abs(frf[:, 7]), abs(drawn[:, 7])
    comac = (h * d).sum() ** 2 / ((h**2).sum() * (d**2).sum())
    assert found.coordinates[LABELS[7]] == pytest.approx(comac, rel=1e-5)


def test_a_coordinate_is_taken_over_all_files(two_bodies, tmp_path):
    frf = exact(two_bodies)
    other = frf * np.linspace(0.5, 2, len(FREQ))[:, None, None]
    found = compare(write(tmp_path, two_bodies, measured(frf), measured(other)))
    assert len(found.channels) == 54
    d, h = np.concatenate([abs(frf[:, 2])] * 2), np.concatenate([abs(frf[:, 2]), abs(other[:, 2])])
    comac = (h * d).sum() ** 2 / ((h**2).sum() * (d**2).sum())
    assert found.coordinates[LABELS[2]] == pytest.approx(comac, rel=1e-5)


def test_channels_go_by_their_labels_and_signs(two_bodies, tmp_path):
    frf = exact(two_bodies)
    order = [8, 2, 5, 0]
    labels = tuple(LABELS[i] for i in order)
    turned = ((*labels[:1], (labels[1][0], -labels[1][1]), *labels[2:]), ((1, 3), (1, -1)))
    values = frf[:, order][:, :, [2, 0]] * np.array([1, -1, 1, 1])[:, None] * np.array([1, -1])
    found = compare(write(tmp_path, two_bodies, measured(values, None, *turned)))
    assert [(one.node, one.axis) for one in found.channels[::2]] == list(labels)
    assert max(one.residual for one in found.channels) < 1e-6


def test_a_channel_of_noise_does_not_count(two_bodies, tmp_path):
    frf = exact(two_bodies)
    coherence = np.full(frf.shape, 0.99)
    coherence[:, 3, 1] = 0.3  # noise^2 = 0.7 / (0.3 x 5), 0.68 of the signal
    frf[:, 3, 1] *= -40
    found = compare(write(tmp_path, two_bodies, measured(frf, coherence)))
    assert len(found.channels) == 26
    assert len(channel(found, *LABELS[3])) == 2
    assert found.coordinates[LABELS[3]] == pytest.approx(1, abs=1e-6)


def test_noise_is_told_from_the_coherence_and_the_averages(two_bodies, tmp_path):
    # Of six hits: noise^2 = (1 - g2) / (5 g2), 0.31 and 0.29 for these.
    frf = exact(two_bodies)
    coherence = np.full(frf.shape, 0.99)
    coherence[:, 3, 1], coherence[:, 4, 2] = 1 / (1 + 5 * 0.31**2), 1 / (1 + 5 * 0.29**2)
    found = compare(write(tmp_path, two_bodies, measured(frf, coherence)))
    assert len(channel(found, *LABELS[3])) == 2
    assert len(channel(found, *LABELS[4])) == 3


def test_noise_is_weighed_by_the_power_of_its_lines(two_bodies, tmp_path):
    # Half the lines are poor, 40 % of noise; they count by how strong they are.
    frf = exact(two_bodies)
    coherence = np.full(frf.shape, 0.999)
    coherence[60:, 0] = 1 / (1 + 5 * 0.4**2)
    frf[:60, 0], frf[60:, 0] = 1.0, [1.0, 0.5, 2.0]
    # 0.4^2 times the poor half's part of the power: 1/2, 1/5, 4/5.
    found = compare(write(tmp_path, two_bodies, measured(frf, coherence)))
    assert len(channel(found, *LABELS[0])) == 2
    frf[60:, 0, 0] = 1.3  # 0.4^2 x 0.628 = 0.317^2
    found = compare(write(tmp_path, two_bodies, measured(frf, coherence)))
    assert len(channel(found, *LABELS[0])) == 1
    frf[60:, 0, 0] = 1.05  # 0.4^2 x 0.524 = 0.290^2
    found = compare(write(tmp_path, two_bodies, measured(frf, coherence)))
    assert len(channel(found, *LABELS[0])) == 2


def test_lines_without_coherence_at_the_ends_do_not_count(two_bodies, tmp_path):
    frf = exact(two_bodies)
    coherence = np.full(frf.shape, 0.99)
    coherence[:10] = coherence[100:] = 0.4
    coherence[50] = 0.4
    frf[:10], frf[100:] = 1e3, 1e3
    found = compare(write(tmp_path, two_bodies, measured(frf, coherence)))
    assert max(one.residual for one in found.channels) < 1e-6
    for place, line in enumerate((10, 50, 99)):  # inside the band every line counts
        frf[line, 0, place] *= 2
    found = compare(write(tmp_path, two_bodies, measured(frf, coherence)))
    assert min(one.residual for one in channel(found, *LABELS[0])) > 1e-3


def test_the_line_at_zero_hertz_does_not_count(two_bodies, tmp_path):
    freq = 0.5 * np.arange(120)
    frf = exact(two_bodies, freq)
    frf[0] = 1e3
    found = compare(write(tmp_path, two_bodies, measured(frf, freq=freq)))
    assert max(one.residual for one in found.channels) < 1e-6
    frf[1] = 1e3
    found = compare(write(tmp_path, two_bodies, measured(frf, freq=freq)))
    assert min(one.residual for one in found.channels) > 0.9


def test_an_empty_channel_does_not_count(two_bodies, tmp_path):
    frf = exact(two_bodies)
    frf[:, 6] = 0
    found = compare(write(tmp_path, two_bodies, measured(frf)))
    assert not channel(found, *LABELS[6])
    assert len(found.channels) == 24


def test_what_cannot_be_compared_is_refused(two_bodies, tmp_path):
    good = measured(exact(two_bodies))
    cases = {
        "no sensor acc9|no acc9": replace(good, responses=((9, 1), *LABELS[1:])),
        "no site hit9 or acc9": replace(good, references=((9, 1), *REFERENCES[1:])),
        "no line has": replace(good, coherence=np.full(good.frf.shape, 0.1)),
        "stands out of its noise": replace(good, frf=np.zeros(good.frf.shape, complex)),
    }
    for words, test in cases.items():
        with pytest.raises(TruthError, match=words):
            compare(write(tmp_path, two_bodies, test))


@pytest.mark.parametrize(
    ("extra", "words"),
    [("window_tau = 0.5", "exponential window"), ("[sensor.acc1]", "not handled"), ("=", "TOML")],
)
def test_corrections_are_refused(two_bodies, tmp_path, extra, words):
    folder = write(tmp_path, two_bodies, measured(exact(two_bodies)), extra=extra)
    with pytest.raises(TruthError, match=words):
        compare(folder)


@pytest.mark.parametrize("name", ["campaign.toml", "model.xml", "t0.uff"])
def test_a_missing_file_is_named(two_bodies, tmp_path, name):
    folder = write(tmp_path, two_bodies, measured(exact(two_bodies)))
    (folder / name).unlink()
    with pytest.raises(TruthError, match=f"{name}: cannot be read"):
        compare(folder)
