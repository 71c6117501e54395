"""Columns of a log against the nominal model before any fit: units of encoders and motors."""

from dataclasses import replace

import numpy as np
import pytest

from identification.words import InputError, Signal
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine
from tuning import find_wrong_exports, open_campaign, open_session
from tuning.checks.data_against_model import _is_shown_by_column
from tuning.checks.export_faults import ExportFault
from tuning.checks.export_finding import ExportFinding, describe_wrong_exports

AXIS = """
<mujoco model="axis">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="slide">
      <joint name="drive" type="slide" axis="1 0 0" damping="40"/>
      <inertial pos="0 0 0" mass="12" diaginertia="1 1 1"/>
      <body name="load">
        <joint name="flex" type="{joint}" axis="{axis}"
               stiffness="{stiffness}" damping="{damping}"/>
        <inertial pos="0 0 0.05" mass="8" diaginertia="0.1 0.1 0.1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="drive"/></actuator>
  <sensor><jointpos name="enc" joint="drive"/><jointpos name="beam" joint="flex"/></sensor>
</mujoco>
"""
SLIDE = {"joint": "slide", "axis": "1 0 0", "stiffness": "1.07e6", "damping": "60"}
HINGE = {"joint": "hinge", "axis": "0 1 0", "stiffness": "2e4", "damping": "0.5"}


@pytest.mark.parametrize(
    ("spring", "factors", "said"),
    [
        (SLIDE, {"Pos": 1e3}, ["enc (column 'Pos') over motor (column 'Cmd')", "1e+03", "mm/N"]),
        (SLIDE, {"Pos": 1e6}, ["enc (column 'Pos')", "1e+06", "um/N"]),
        (SLIDE, {"Beam": 1e6}, ["beam (column 'Beam')", "um/N"]),
        (SLIDE, {"Cmd": 1e-3}, ["enc (column 'Pos')", "m/kN"]),
        (HINGE, {"Beam": 1e3}, ["beam (column 'Beam')", "mrad/(N m)"]),
        (SLIDE, {}, None),
        (HINGE, {}, None),
    ],
)
def test_a_column_of_a_log_in_another_unit_is_named(tmp_path, spring, factors, said):
    write_log(tmp_path, spring, factors)
    source, machine, campaign = open_campaign(tmp_path)
    findings = find_wrong_exports(source, as_drawn(machine), campaign)
    remarks = " ".join(finding.sentence for finding in findings)
    if said is None:
        assert "nominal model" not in remarks
        assert len(open_session(tmp_path).campaign.tests) == 1
        return
    for words in said:
        assert words in remarks
    with pytest.raises(InputError, match=r"as if values in .* under \[log\].*as_stated = true"):
        open_session(tmp_path)
    file = tmp_path / "campaign.toml"
    file.write_text(file.read_text() + "as_stated = true\n")
    assert any("as if values in" in remark for remark in open_session(tmp_path).campaign.remarks)


def test_degrees_of_one_encoder_beside_another_are_a_remark(tmp_path):
    write_log(tmp_path, HINGE, {"Beam": 180 / np.pi})
    remarks = " ".join(open_session(tmp_path).campaign.remarks)
    assert "beam (column 'Beam')" in remarks
    assert "deg/(N m)" in remarks


def test_counts_of_an_encoder_are_a_remark(tmp_path):
    write_log(tmp_path, SLIDE, {"Pos": 8.1e6})
    remarks = " ".join(open_session(tmp_path).campaign.remarks)
    assert (
        "enc (column 'Pos') over motor (column 'Cmd'): measured FRFs are 8.1e+06 times" in remarks
    )
    assert 'gain = "unknown"' in remarks


def test_times_in_milliseconds_are_named_by_their_key(tmp_path):
    write_log(tmp_path, SLIDE, {})
    lines = (tmp_path / "trace.csv").read_text().splitlines()
    rows = [line.split(",", 1) for line in lines[1:]]
    rows = [f"{1e3 * float(time) + 0.5:.6f},{cells}" for time, cells in rows]
    (tmp_path / "trace.csv").write_text("\n".join(["Time" + lines[0][6:], *rows]))
    source, machine, campaign = open_campaign(tmp_path)
    said = find_wrong_exports(source, as_drawn(machine), campaign)[0].sentence
    assert 'as if times in ms were read as s: set time_unit = "ms" under [log]' in said


def write_log(folder, spring, factors):
    """A log of a motor and two encoders, whose stiffness is 20 % off the drawing."""
    text = AXIS.format(**spring)
    (folder / "model.xml").write_text(text)
    true = folder / "true.xml"
    softer = {**spring, "stiffness": str(0.8 * float(spring["stiffness"]))}
    true.write_text(AXIS.format(**softer))
    rate, rng = 1000.0, np.random.default_rng(4)
    force = np.tile(rng.standard_normal(4096), 6)
    freq = np.fft.rfftfreq(len(force), 1 / rate)
    request = FrfRequest(
        freq[1:], (Signal("enc"), Signal("beam")), (Signal("motor"),), "receptance"
    )
    values = Evaluator(as_drawn(load_machine(true)), request).at(as_drawn(load_machine(true)).drawn)
    spectrum = np.fft.rfft(force)[1:, None] * values.values[:, :, 0]
    motion = np.fft.irfft(np.vstack([np.zeros((1, 2)), spectrum]), len(force), axis=0)
    motion += 1e-4 * motion.std(axis=0) * rng.standard_normal(motion.shape)
    columns = {"Cmd": force, "Pos": motion[:, 0], "Beam": motion[:, 1]}
    table = [np.arange(len(force)) / rate]
    table += [factors.get(name, 1.0) * column for name, column in columns.items()]
    heading = "Time s," + ",".join(columns)
    rows = np.column_stack(table)
    np.savetxt(folder / "trace.csv", rows, "%.12e", ",", header=heading, comments="")
    (folder / "campaign.toml").write_text(
        'model = "model.xml"\n[log]\nfile = "trace.csv"\nmotors = { motor = "Cmd" }\n'
        'encoders = { enc = "Pos", beam = "Beam" }\n'
    )


def test_many_pairs_of_encoder_and_motor_share_a_sentence():
    """A way across the machine that the drawing hardly has is in one pair."""
    findings = [
        ExportFinding("d.npz", factor, (), is_certain=False, columns=f", enc{factor:g} over drive")
        for factor in (4.8, 0.3, 55.0)
    ]
    assert len(describe_wrong_exports(findings[:2])) == 2
    other = replace(findings[0], file="e.npz")
    first, second = describe_wrong_exports([*findings, other])
    assert "3 pairs of encoder and motor have FRFs from 1/3.3 of to 55 times the nominal" in first
    assert "(the last, enc55 over drive)" in first
    assert "e.npz, enc4.8 over drive: measured FRFs are 4.8 times" in second
    assert "in its [[test]]" in second


def find(factor, name="mm"):
    """A finding whose fault is a unit."""
    return ExportFinding("log.csv", factor, (ExportFault(name, ""),), is_certain=True)


@pytest.mark.parametrize(
    ("found", "is_certain"),
    [
        ({("a", "x"): find(4.2)}, True),  # alone in its file
        ({("a", "x"): find(4.2), ("b", "y"): None}, False),  # a way across, drawn too stiff
        ({("a", "x"): find(4.2), ("a", "y"): find(4.4)}, True),  # all of an encoder
        ({("a", "x"): find(4.2), ("b", "x"): find(4.4)}, True),  # all of a motor
        ({("a", "x"): find(4.2), ("b", "x"): find(0.2, "lbf")}, False),  # another fault each
        ({("a", "x"): find(4.2), ("b", "x"): None, ("a", "y"): None}, False),
        ({("a", "x"): find(55.0), ("b", "x"): None}, False),
        ({("a", "x"): find(1e3), ("b", "x"): None}, True),  # no machine makes that difference
    ],
)
def test_a_unit_of_a_column_is_certain_where_all_of_its_frfs_show_it(found, is_certain):
    of_file = {("log.csv", *names): finding for names, finding in found.items()}
    of_file["other.csv", "a", "x"] = None
    assert _is_shown_by_column(of_file, ("log.csv", "a", "x")) is is_certain
