"""A measured suspension: coils push the test mass against its recoil mass, in counts.

The campaigns that came with the data put a light auxiliary body in place of the pair of forces.
Here pairs, unknown gains and lags are stated as such.
"""

import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from tuning import open_session, predict

SUSPENSION = Path(__file__).parents[3] / "shared" / "real" / "kagra"
DRIVES = {"hit3:+tx": "coil-magnet:+tx", "hit3:+ry": "coil-magnet:+ry"}
GAIN = '\n[hammer."{drive}"]\ngain = "unknown"\ndelay_tolerance = 0.02\n'
pytestmark = pytest.mark.skipif(not SUSPENSION.is_dir(), reason="the measurements are not there")


def with_pairs(name, folder, further):
    """Write one of the campaigns with pairs of forces instead of the auxiliary body."""
    tree = ET.parse(SUSPENSION / "model_linear.xml")
    world, tendons = (tree.getroot().find(tag) for tag in ("worldbody", "tendon"))
    for body in list(world):
        if body.get("name") == "PAIR":
            world.remove(body)
        if body.get("name") in ("TM", "RM"):
            site = "coil" if body.get("name") == "TM" else "magnet"
            ET.SubElement(body, "site", name=site, pos="0 0 0")
    for tendon in list(tendons):
        if tendon.get("name").startswith("PAIR"):
            tendons.remove(tendon)
    tree.write(folder / "model.xml")
    for file in (SUSPENSION / name).glob("*.npz"):
        shutil.copy(file, folder / file.name)
    text = (SUSPENSION / name / "campaign.toml").read_text(encoding="utf-8")
    for old, new in (("../model_linear.xml", "model.xml"), ('"PAIR*", ', ""), ('"PAIR*"', "")):
        text = text.replace(old, new)
    for hit, drive in DRIVES.items():
        if hit in text:
            text = text.replace(hit, drive) + further.format(drive=drive)
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", ["clean", "focus", "linear_once"])
def test_pairs_of_forces_are_the_auxiliary_body_without_its_mass(name, tmp_path):
    session = open_session(with_pairs(name, tmp_path, ""))
    usual = open_session(SUSPENSION / name)
    assert {str(test.condition.reference) for test in session.campaign.tests} <= set(
        DRIVES.values()
    )
    pairs = zip(
        predict(session.model, session.model.drawn, session.campaign),
        predict(usual.model, usual.model.drawn, usual.campaign),
        strict=True,
    )
    for ours, theirs in pairs:
        size = np.abs(theirs).max(axis=0)
        assert (np.abs(ours - theirs).max(axis=0) <= 3e-3 * size).all()


def test_gains_in_counts_and_lags_are_stated_for_each_drive(tmp_path):
    session = open_session(with_pairs("clean", tmp_path, GAIN))
    names = [parameter.name for parameter in session.model.parameters]
    nominal = session.campaign.unknown_gains.nominal
    assert {gain.location for gain in nominal} == {f"hammer:{drive}" for drive in DRIVES.values()}
    scale = session.parametrisation.scale
    for drive in DRIVES.values():
        assert scale[names.index(f"hammer({drive}).delay")] == pytest.approx(0.02)
        assert scale[names.index(f"hammer({drive}).gain")] == pytest.approx(1.0)
