"""Units of universal files: labels, dataset 164, and what campaign.toml states."""

from dataclasses import replace

import numpy as np
import pytest
from identification_examples import FIRST, SECOND, THIRD, read_small, uff, units

from identification.readers.units import (
    STANDARD_GRAVITY,
    force_label_factor,
    motion_label_factor,
)
from identification.words import InputError

TEST = 'model = "model.xml"\n[[test]]\nfile = "a.uff"\n'


@pytest.fixture
def read(tmp_path):
    def build(stated="", dataset=b"", **labels):
        functions = [replace(f, **labels) for f in (FIRST, SECOND, THIRD)]
        return read_small(tmp_path, TEST + stated, a_uff=dataset + uff(*functions))

    return build


def values(campaign):
    return [test.estimate.frf.values for test in campaign.tests]


def ratio(campaign, plain):
    pairs = zip(values(campaign), values(plain), strict=True)
    ratios = np.concatenate([(a[b != 0] / b[b != 0]).ravel() for a, b in pairs])
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-12)
    return ratios[0].real


@pytest.mark.parametrize("dataset", [b"", units(1.0, 1.0)])
@pytest.mark.parametrize("label", ["g", "G", "[g]", "gn"])
def test_a_motion_labelled_g_is_converted_with_or_without_dataset_164(read, label, dataset):
    plain = read(dataset=dataset)
    labelled = read(dataset=dataset, motion_unit=label)
    assert ratio(labelled, plain) == pytest.approx(STANDARD_GRAVITY, rel=1e-12)
    assert any(f"labelled {label}" in remark for remark in labelled.remarks)
    assert len(labelled.remarks) == len(plain.remarks) + 1  # once, not for each record


@pytest.mark.parametrize(
    ("labels", "factor"),
    [
        ({"motion_unit": "mm/s^2"}, 1e-3),
        ({"motion_unit": "mm/s2"}, 1e-3),
        ({"motion_unit": "in/s**2"}, 0.0254),
        ({"force_unit": "lbf"}, 1 / 4.4482216152605),
        ({"force_unit": "kN"}, 1e-3),
        ({"motion_unit": "m/s^2", "force_unit": "N"}, 1.0),
        ({"motion_unit": "V", "force_unit": "counts"}, 1.0),
    ],
)
def test_labels_count_where_no_dataset_164_stands(read, labels, factor):
    plain, labelled = read(), read(**labels)
    assert ratio(labelled, plain) == pytest.approx(factor, rel=1e-12)
    assert (len(labelled.remarks) > len(plain.remarks)) == (factor != 1.0)


def test_dataset_164_counts_over_a_length_and_the_contradiction_is_told(read):
    millimetres = units(1000.0, 1.0)
    plain, labelled = read(dataset=millimetres), read(dataset=millimetres, motion_unit="m/s^2")
    assert ratio(labelled, plain) == 1.0
    assert any("the label m/s^2 contradicts dataset 164" in text for text in labelled.remarks)


@pytest.mark.parametrize("labels", [{}, {"motion_unit": "g"}, {"motion_unit": "mm/s^2"}])
def test_a_stated_unit_overrides_the_file(read, labels):
    stated = read('unit = "g/N"\n', **labels)
    assert ratio(stated, read()) == pytest.approx(STANDARD_GRAVITY, rel=1e-12)
    overrides = [text for text in stated.remarks if 'unit = "g/N" of campaign.toml' in text]
    assert len(overrides) == (0 if labels == {"motion_unit": "g"} else 1)


def test_a_stated_unit_of_another_quantity_is_refused(read):
    with pytest.raises(InputError, match="'mm/N' is not a unit of accelerance"):
        read('unit = "mm/N"\n')


def test_labels_are_read_by_quantity():
    assert motion_label_factor("g", "mobility") is None
    assert motion_label_factor("mm/s", "mobility") == 1e-3
    assert motion_label_factor("µm", "receptance") == 1e-6
    assert motion_label_factor("NONE", "accelerance") is None
    assert force_label_factor("MN") == 1e6
    assert force_label_factor("mN") == 1e-3
    assert force_label_factor("NONE") is None
