"""A controller's own record: the plant inside a closed loop, from references, without bias."""

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
import scipy.io
import scipy.signal
import scipy.stats
from mcap.writer import Writer
from mcap_ros2.writer import Writer as RosWriter

from identification import read_campaign, read_layout, read_settings
from identification.continuous import estimate_continuous_frf, remove_hold
from identification.readers.drive_log import _bring_together
from identification.words import Dof, InputError, Records

RATE_HZ = 1000.0
POINT = Dof("axis", "+tx")
# A motor of 12 kg drives a load of 8 kg by a spring, a mode at 75 Hz; its own position is measured.
STIFFNESS, RATES = 1.07e6, (40.0, 60.0)  # of the spring; of guide and spring
A = np.array(
    [
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [-STIFFNESS / 12, STIFFNESS / 12, -sum(RATES) / 12, RATES[1] / 12],
        [STIFFNESS / 8, -STIFFNESS / 8, RATES[1] / 8, -RATES[1] / 8],
    ]
)
B, C = np.array([[0.0], [0.0], [1 / 12], [0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]])
STEP, PUSH, *_ = scipy.signal.cont2discrete((A, B, C, np.zeros((1, 1))), 1 / RATE_HZ)
GAIN, RATE_GAIN = 3e5, 1.5e3


def run_loop(reference, noise, seed, measured=0):
    """Command and a state under PD control; the noise is a force on the motor."""
    disturbance = noise * np.random.default_rng(seed).standard_normal(len(reference))
    state, before = np.zeros(4), 0.0
    command, motion = np.zeros(len(reference)), np.zeros(len(reference))
    for k, wanted in enumerate(reference):
        motion[k] = state[measured]
        error = wanted - state[0]
        command[k] = GAIN * error + RATE_GAIN * (error - before) * RATE_HZ
        before = error
        state = STEP @ state + PUSH[:, 0] * (command[k] + disturbance[k])
    return command, motion


def exact(freq_hz):
    """Position by command, as sampled with a hold; (n_freq,)."""
    z = np.exp(2j * np.pi * freq_hz / RATE_HZ)
    inverse = np.linalg.inv(z[:, None, None] * np.eye(4) - STEP)
    return (C @ inverse @ PUSH)[:, 0, 0]


@pytest.fixture(scope="module")
def record():
    reference = 1e-4 * np.random.default_rng(1).standard_normal(60_000)
    command, position = run_loop(reference, noise=60.0, seed=2)
    return reference, command, position


def records_of(reference, command, position, **changes):
    set_points = {} if reference is None else {"set_points": reference[None, None]}
    return Records(
        RATE_HZ,
        command[None],
        position[None, None],
        (POINT,),
        POINT,
        "receptance",
        test="trace.csv",
        **(set_points | changes),
    )


def squares_and_bias(records):
    result = estimate_continuous_frf(records)
    frf = result.estimate.frf
    band = (frf.freq_hz > 10) & (frf.freq_hz < 150)  # below, references hardly move the motor
    truth = exact(frf.freq_hz[band])
    error = frf.values[band, 0, 0] - truth
    squares = np.abs(error) ** 2 / result.estimate.variance[band, 0, 0]
    return squares, float(np.abs((error / truth).mean())), result


def test_references_remove_the_bias_that_a_closed_loop_gives(record):
    squares, bias, result = squares_and_bias(records_of(*record))
    assert 0.5 < squares.mean() < 1.5
    bound = scipy.stats.f.ppf(0.95, 2, 2 * (result.estimate.averages - 1))
    assert (squares < bound).mean() > 0.93
    _, direct, _ = squares_and_bias(records_of(None, *record[1:]))
    assert direct > 0.1
    assert bias < direct / 4


def test_periods_of_a_reference_are_instruments_by_themselves():
    period = 1e-4 * np.random.default_rng(3).standard_normal(4096)
    reference = np.tile(period, 16)
    command, position = run_loop(reference, noise=60.0, seed=4)
    squares, bias, result = squares_and_bias(records_of(reference, command, position))
    assert result.blocks.kind == "periodic"
    assert 0.4 < squares.mean() < 1.6
    assert bias < 0.1


def test_a_position_that_drifts_does_not_leak_into_the_lines_of_a_period():
    """Nothing holds this axis: by its disturbance it moves on within each period."""
    period = 20.0 * np.random.default_rng(21).standard_normal(4096)
    force, rng = np.tile(period, 12), np.random.default_rng(22)
    state, position = np.zeros(4), np.zeros(len(force))
    for k, push in enumerate(force + 2.0 * rng.standard_normal(len(force))):
        position[k] = state[0]
        state = STEP @ state + PUSH[:, 0] * push
    squares, bias, result = squares_and_bias(records_of(None, force, position))
    assert result.blocks.kind == "periodic"
    assert 0.7 < squares.mean() < 1.3  # the scatter of periods alone says a tenth of the error
    assert bias < 0.01


def test_a_command_that_is_held_acts_half_a_sample_late(record):
    held = estimate_continuous_frf(records_of(*record))
    free = remove_hold(held, RATE_HZ).estimate
    band = (free.frf.freq_hz > 15) & (free.frf.freq_hz < 150)
    s = 2j * np.pi * free.frf.freq_hz[band, None, None]
    truth = (C @ np.linalg.inv(s * np.eye(4) - A) @ B)[:, 0, 0]
    squares = np.abs(free.frf.values[band, 0, 0] - truth) ** 2 / free.variance[band, 0, 0]
    assert 0.4 < squares.mean() < 1.6
    late = np.abs(held.estimate.frf.values[: len(band)][band, 0, 0] - truth) ** 2
    assert (late / held.estimate.variance[: len(band)][band, 0, 0]).mean() > 5
    np.testing.assert_allclose(free.coherence, held.estimate.coherence[: len(band)])


def test_images_of_a_held_command_are_taken_off():
    """At a fifth of the rate they are 1.2 % of an inertia's receptance, 14 % of its mobility."""
    reference = 1e-4 * np.random.default_rng(11).standard_normal(30_000)
    command, position = run_loop(reference, noise=0.0, seed=12)
    speed = run_loop(reference, noise=0.0, seed=12, measured=2)[1]
    for quantity, motion, bound in (("receptance", position, 1e-3), ("mobility", speed, 5e-3)):
        records = replace(records_of(reference, command, motion), quantity=quantity)
        free = remove_hold(estimate_continuous_frf(records), RATE_HZ).estimate
        band = free.frf.freq_hz > 150
        assert free.frf.freq_hz[-1] > 199
        s = 2j * np.pi * free.frf.freq_hz[band, None, None]
        truth = (C @ np.linalg.inv(s * np.eye(4) - A) @ B)[:, 0, 0]
        truth = truth * s[:, 0, 0] if quantity == "mobility" else truth
        assert abs((free.frf.values[band, 0, 0] / truth - 1).mean()) < bound, quantity


def test_fewer_references_than_motors_are_refused(record):
    reference, command, position = record
    records = records_of(
        reference,
        command,
        position,
        further_forces=np.random.default_rng(5).standard_normal((1, 1, len(command))),
        further_references=(Dof("axis", "+ty"),),
    )
    with pytest.raises(InputError, match="1 references for 2 motors: record a reference"):
        estimate_continuous_frf(records)


LAYOUT = (
    '[body.axis]\ncentre = [0.0, 0.0, 0.0]\n[site.acc1]\nbody = "axis"\nposition = [0.1, 0, 0]\n'
)
LOG = """
layout = "layout.toml"
[log]
file = "{file}"
motors = {{ "acc1:+x" = "{motor}" }}
encoders = {{ "acc1:+x" = "{encoder}" }}
unit = "m/N"
"""


def read(folder, text):
    (folder / "layout.toml").write_text(LAYOUT)
    (folder / "campaign.toml").write_text(text)
    source, settings = read_settings(folder)
    return read_campaign(source, settings, read_layout(folder / "layout.toml"))


def test_a_trace_of_a_drive_is_a_campaign(tmp_path, record):
    reference, command, position = record
    time = np.arange(len(command)) / RATE_HZ
    lines = ["Trace tool 3.1", "time;Cmd;Pos;Ref", "s;N;m;m"]
    rows = zip(time, command, position, reference, strict=True)
    lines += [";".join(f"{value:.9e}".replace(".", ",") for value in row) for row in rows]
    (tmp_path / "trace.csv").write_text("\n".join(lines) + "\n")
    text = LOG.format(file="trace.csv", motor="Cmd N", encoder="Pos m")
    campaign = read(tmp_path, text + 'references = ["Ref m"]\n')
    (test,) = campaign.tests
    expected = estimate_continuous_frf(records_of(*record)).estimate
    np.testing.assert_allclose(test.estimate.frf.values, expected.frf.values, rtol=1e-5)
    assert not any("biased" in remark for remark in campaign.remarks)
    direct = read(tmp_path, text)
    assert any("which no coherence shows" in remark for remark in direct.remarks)


CONTROLLER = """
[log.controllers."acc1:+x"]
encoder = "acc1:+x"
controller = {{ zeros = [{zero}], poles = [0.0], gain = {gain}, period = 1e-3 }}
"""


def test_a_stated_controller_stands_in_for_a_reference_that_nobody_recorded(tmp_path, record):
    _, command, position = record
    np.savez(tmp_path / "trace.npz", i_q=command, x_1=position, rate_hz=RATE_HZ)
    text = LOG.format(file="trace.npz", motor="i_q", encoder="x_1")
    difference = RATE_GAIN * RATE_HZ  # u = G e + D (e - e_before): K(z) = ((G + D) z - D) / z
    gain = GAIN + difference
    stated = CONTROLLER.format(zero=difference / gain, gain=gain)
    campaign = read(tmp_path, text + stated)
    estimate = campaign.tests[0].estimate
    by_reference = estimate_continuous_frf(records_of(*record)).estimate
    lines = np.isin(estimate.frf.freq_hz, by_reference.frf.freq_hz)
    chosen = np.isin(by_reference.frf.freq_hz, estimate.frf.freq_hz)
    assert lines.mean() > 0.9
    np.testing.assert_allclose(
        estimate.frf.values[lines], by_reference.frf.values[chosen], rtol=0.02
    )
    assert any("would be off by" in remark for remark in campaign.remarks)
    with pytest.raises(InputError, match=r"acc2:\+x is none of the encoders"):
        read(tmp_path, text + stated.replace('encoder = "acc1:+x"', 'encoder = "acc2:+x"'))
    slower = stated.replace("period = 1e-3", "period = 2e-3")
    for wrong, sentence in (
        (slower, "period of 0.002 s, and the record a sample each 0.001 s"),
        (stated.replace("poles = [0.0]", "poles = [1.2]"), "has a pole that grows"),
    ):
        with pytest.raises(InputError, match=sentence):
            read(tmp_path, text + wrong)
    assert read(tmp_path, text + stated.replace("poles = [0.0]", "poles = [-1.0]")).tests
    with pytest.raises(InputError, match="need no controllers"):
        read(tmp_path, text + 'references = ["i_q"]\n' + stated)


@pytest.mark.parametrize("clock", ["rate_hz", "time"])
def test_signals_may_be_variables_of_matlab(tmp_path, record, clock):
    reference, command, position = record
    times = {"rate_hz": RATE_HZ, "time": np.arange(len(command)) / RATE_HZ}
    content = {"i_q": command, "x_1": position, "x_ref": reference, clock: times[clock]}
    scipy.io.savemat(tmp_path / "trace.mat", content)
    text = LOG.format(file="trace.mat", motor="i_q", encoder="x_1")
    (test,) = read(tmp_path, text + 'references = ["x_ref"]\n').tests
    expected = estimate_continuous_frf(records_of(*record)).estimate
    np.testing.assert_allclose(test.estimate.frf.values, expected.frf.values, rtol=1e-6)
    with pytest.raises(InputError, match=r"no variable 'ref' .* correct its name under"):
        read(tmp_path, text + 'references = ["ref"]\n')


def two_motors(folder, realisations):
    """Two motors at once, two signals one after the other, in five periods each."""
    random = np.random.default_rng(8)
    forces = np.tile(random.standard_normal((2, 2, 400)), 5).swapaxes(0, 1).reshape(2, -1)
    position = 2 * forces[0] - 3 * forces[1] + 1e-3 * random.standard_normal(4000)
    content = {"m_1": forces[0], "m_2": forces[1], "pos": position, "rate_hz": RATE_HZ}
    scipy.io.savemat(folder / "trace.mat", content)
    layout = LAYOUT + '[site.acc2]\nbody = "axis"\nposition = [0.2, 0, 0]\n'
    (folder / "layout.toml").write_text(layout)
    (folder / "campaign.toml").write_text(
        'layout = "layout.toml"\n[log]\nfile = "trace.mat"\nunit = "m/N"\n'
        'motors = { "acc1:+x" = "m_1", "acc2:+x" = "m_2" }\nencoders = { "acc1:+x" = "pos" }\n'
        f"realisations = {realisations}\n"
    )
    source, settings = read_settings(folder)
    return read_campaign(source, settings, read_layout(folder / "layout.toml"))


def test_several_motors_at_once_take_as_many_realisations(tmp_path):
    first, second = two_motors(tmp_path, 2).tests
    assert first.estimate.averages == 8  # the first period of either settles
    np.testing.assert_allclose(first.estimate.frf.values, 2, rtol=0.02)
    np.testing.assert_allclose(second.estimate.frf.values, -3, rtol=0.02)


def test_two_motors_of_signals_apart_need_no_realisations(tmp_path):
    random = np.random.default_rng(9)
    forces = random.standard_normal((2, 30_000))
    position = 2 * forces[0] - 3 * forces[1] + 1e-3 * random.standard_normal(30_000)
    content = {"m_1": forces[0], "m_2": forces[1], "pos": position, "rate_hz": RATE_HZ}
    scipy.io.savemat(tmp_path / "apart.mat", content)
    two_motors(tmp_path, 2)
    text = (tmp_path / "campaign.toml").read_text().replace("realisations = 2\n", "")
    (tmp_path / "campaign.toml").write_text(text.replace("trace.mat", "apart.mat"))
    source, settings = read_settings(tmp_path)
    tests = read_campaign(source, settings, read_layout(tmp_path / "layout.toml")).tests
    for test, value in zip(tests, (2, -3), strict=True):
        np.testing.assert_allclose(test.estimate.frf.values, value, rtol=0.02)


@pytest.mark.parametrize(
    ("headings", "has_units"),
    [
        ("time;i_q;x_1;ref\nms;kN;mm;kN", True),
        ("time;i_q;x_1;ref\nms;kN;mm;kN", False),
        ("time [ms];i_q [kN];x_1 [mm];ref", False),
    ],
)
def test_units_of_the_headings_of_a_trace_count(tmp_path, record, headings, has_units):
    reference, command, position = record
    times = 1e3 * np.arange(len(command)) / RATE_HZ
    rows = np.column_stack([times, 1e-3 * command, 1e3 * position, reference])
    lines = [";".join(f"{value:.9g}" for value in row) for row in rows]
    (tmp_path / "trace.csv").write_text("\n".join([headings, *lines]))
    names = headings.splitlines()
    motor, encoder, ref = (
        " ".join(cells) if has_units else cells[0].split(" [")[0]
        for cells in list(zip(*(line.split(";") for line in names), strict=True))[1:]
    )
    text = LOG.format(file="trace.csv", motor=motor, encoder=encoder).replace('unit = "m/N"', "")
    campaign = read(tmp_path, text + f'references = ["{ref}"]\n')
    expected = estimate_continuous_frf(records_of(*record)).estimate
    np.testing.assert_allclose(
        campaign.tests[0].estimate.frf.values, expected.frf.values, rtol=1e-4
    )
    assert any("the unit mm/kN" in remark for remark in campaign.remarks)


def test_a_motor_in_amperes_counts_in_the_unit_of_its_control(tmp_path, record):
    reference, command, position = record
    table = np.column_stack([np.arange(len(command)) / RATE_HZ, command, 1e3 * position, reference])
    heading = "time,Cmd [A],Pos [mm],Ref"
    np.savetxt(tmp_path / "trace.csv", table, "%.12g", ",", header=heading, comments="")
    text = LOG.format(file="trace.csv", motor="Cmd", encoder="Pos").replace('unit = "m/N"', "")
    campaign = read(tmp_path, text + 'references = ["Ref"]\n')
    (said,) = [remark for remark in campaign.remarks if "headings" in remark]
    assert "mm/A: A count as" in said
    assert 'gain = "unknown"' in said
    expected = estimate_continuous_frf(records_of(*record)).estimate.frf.values
    np.testing.assert_allclose(campaign.tests[0].estimate.frf.values, expected, rtol=1e-4)


def test_a_motor_that_is_its_own_reference_is_said(tmp_path, record):
    table = np.column_stack([np.arange(len(record[1])) / RATE_HZ, *record[1:]])
    np.savetxt(tmp_path / "trace.csv", table, "%.12g", ",", header="time,Cmd,Pos", comments="")
    text = LOG.format(file="trace.csv", motor="Cmd", encoder="Pos") + 'references = ["Cmd"]\n'
    assert any(
        "right only where no loop was closed" in said for said in read(tmp_path, text).remarks
    )


def test_a_sample_that_is_missing_is_named(tmp_path, record):
    table = np.column_stack([np.arange(len(record[1])) / RATE_HZ, *record[1:]])
    table = np.delete(table, 4321, axis=0)
    np.savetxt(tmp_path / "trace.csv", table, "%.12g", ",", header="time,Cmd,Pos", comments="")
    with pytest.raises(InputError, match=r"step 4321, after the time 4.32, .*without a gap"):
        read(tmp_path, LOG.format(file="trace.csv", motor="Cmd", encoder="Pos"))


def test_more_realisations_than_samples_are_refused(tmp_path):
    with pytest.raises(InputError, match="correct realisations under"):
        two_motors(tmp_path, 5000)


def test_a_log_needs_a_motor_and_an_encoder(tmp_path):
    with pytest.raises(InputError, match="encoders"):
        read(tmp_path, 'layout = "layout.toml"\n[log]\nfile = "a.mat"\nmotors = { m = "a" }\n')


def write_hdf5(path, time, signals):
    with h5py.File(path, "w") as file:
        file["time"] = time
        for name, values in signals.items():
            file[f"log/{name}"] = values
    return {name: f"log/{name}" for name in signals}


def write_parquet(path, time, signals):
    pyarrow.parquet.write_table(pyarrow.table({"time": time, **signals}), path)
    return {name: name for name in signals}


def write_mcap(path, time, signals, drop=()):
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("numbers", "jsonschema", b"{}")
        channels = {name: writer.register_channel(f"/{name}", "json", schema) for name in signals}
        for k, moment in enumerate(time):
            if k in drop:
                continue
            nanoseconds = 1_700_000_000_000_000_000 + round(moment * 1e9)
            for name, values in signals.items():
                data = json.dumps({"data": [float(values[k]), 1.0], "frame": "a"}).encode()
                writer.add_message(channels[name], nanoseconds, data, nanoseconds)
        writer.finish()
    return {name: f"/{name}.data[0]" for name in signals}


@pytest.mark.parametrize(
    ("suffix", "write"),
    [(".h5", write_hdf5), (".parquet", write_parquet), (".mcap", write_mcap)],
)
def test_a_record_may_be_that_of_a_robot(tmp_path, record, suffix, write):
    count = 16_384
    reference, command, position = (signal[:count] for signal in record)
    signals = {"cmd": command, "pos": position, "ref": reference}
    names = write(tmp_path / f"trace{suffix}", np.arange(count) / RATE_HZ, signals)
    text = LOG.format(file=f"trace{suffix}", motor=names["cmd"], encoder=names["pos"])
    (test,) = read(tmp_path, text + f'references = ["{names["ref"]}"]\n').tests
    expected = estimate_continuous_frf(records_of(reference, command, position)).estimate
    if suffix == ".mcap":  # times in nanoseconds round, and the last sample ends the time base
        assert len(test.estimate.frf.freq_hz) == len(expected.frf.freq_hz)
        np.testing.assert_allclose(test.estimate.frf.values, expected.frf.values, rtol=1e-3)
    else:
        np.testing.assert_allclose(test.estimate.frf.values, expected.frf.values, rtol=1e-6)
    with pytest.raises(InputError, match=r"no variable 'nothing' .* correct its name"):
        read(tmp_path, text + 'references = ["nothing"]\n')


def test_messages_that_are_missing_are_refused(tmp_path, record):
    signals = {"cmd": record[1][:2000], "pos": record[2][:2000]}
    drop = set(range(100, 2000, 20)) | set(range(101, 2000, 20))
    names = write_mcap(tmp_path / "trace.mcap", np.arange(2000) / RATE_HZ, signals, drop)
    text = LOG.format(file="trace.mcap", motor=names["cmd"], encoder=names["pos"])
    with pytest.raises(InputError, match=r"missing or late, up to 0\.003 s apart"):
        read(tmp_path, text)


def together(*topics):
    """Signals of topics, each times and values, on one time base."""
    names = [f"/{k}" for k in range(len(topics))]
    times, values = zip(*topics, strict=True)
    return _bring_together(Path("trace.mcap"), names, times, values)


def test_topics_of_two_rates_are_read_at_the_slower_one():
    fast, slow = np.arange(4001) / 1000, np.arange(1000) / 250 + 1e-4
    (first, second), rate = together((fast, np.sin(20 * fast)), (slow, np.cos(20 * slow)))
    assert rate == pytest.approx(250)
    inside = slice(50, -50)  # a low-pass needs samples on both sides
    np.testing.assert_allclose(first[inside], np.sin(20 * slow[: len(first)])[inside], atol=2e-3)
    np.testing.assert_allclose(second[inside], np.cos(20 * slow[: len(first)])[inside], atol=1e-6)


def test_what_the_slower_topic_cannot_show_is_no_alias():
    fast, slow = np.arange(4001) / 1000, np.arange(400) / 100
    (first, _), _ = together((fast, np.sin(2 * np.pi * 180 * fast)), (slow, slow))
    assert np.abs(first[50:-50]).max() < 1e-2


@pytest.mark.parametrize(("share", "error"), [(0.5, 1e-3), (0.8, 0.085)])
def test_messages_half_a_sample_beside_each_other_keep_gain_and_phase(share, error):
    time, omega = np.arange(4000) / 500, 2 * np.pi * share * 250
    later = time + 0.001
    (first, second), _ = together((time, np.sin(omega * time)), (later, np.sin(omega * later)))
    inside = slice(100, -100)
    deviation = np.abs(second - np.sin(omega * later[: len(second)]))[inside].max()
    assert deviation < 1e-6  # its own samples are the base
    phases = np.exp(1j * omega * later[: len(first)])[inside]
    amplitude = 2 * np.mean(first[inside] * phases.conj() * 1j)
    assert abs(amplitude - 1) < error


@pytest.mark.parametrize(
    ("times", "said"),
    [
        (np.zeros(100), "equal or falling times"),
        (np.arange(100) / 100 + 1e6, "hardly any time in common"),
    ],
)
def test_clocks_that_are_of_no_use_are_named(times, said):
    with pytest.raises(InputError, match=said):
        together((np.arange(100) / 100, np.zeros(100)), (times, np.zeros(100)))


@pytest.mark.parametrize("heading", ["Time ms", "Time [ms]", "time_ms", "t (ms)"])
def test_times_are_in_the_unit_of_their_heading(tmp_path, record, heading):
    count = 8192
    lines = [f"{heading};u;y"]
    rows = zip(np.arange(count), record[1][:count], record[2][:count], strict=True)
    lines += [";".join(f"{value:.9e}" for value in row) for row in rows]
    (tmp_path / "trace.csv").write_text("\n".join(lines) + "\n")
    text = LOG.format(file="trace.csv", motor="u", encoder="y")
    (test,) = read(tmp_path, text).tests
    assert test.estimate.frf.freq_hz[-1] == pytest.approx(400, rel=0.01)


def test_whole_numbers_of_no_unit_are_no_times(tmp_path, record):
    rows = "\n".join(
        f"{k},{u:.6g},{y:.6g}" for k, (u, y) in enumerate(zip(*record[1:], strict=True))
    )
    (tmp_path / "trace.csv").write_text("Time,u,y\n" + rows)
    text = LOG.format(file="trace.csv", motor="u", encoder="y")
    with pytest.raises(InputError, match="whole numbers without a unit"):
        read(tmp_path, text)
    (test,) = read(tmp_path, text + 'time_unit = "ms"\n').tests
    assert test.estimate.frf.freq_hz[-1] == pytest.approx(400, rel=0.01)


def test_the_unit_of_times_may_be_stated_and_must_make_sense(tmp_path, record):
    count = 8192
    time = np.arange(count) * 1_000_000 + 1_700_000_000_000_000_000
    content = {"time": time, "u": record[1][:count], "y": record[2][:count]}
    pyarrow.parquet.write_table(pyarrow.table(content), tmp_path / "trace.parquet")
    text = LOG.format(file="trace.parquet", motor="u", encoder="y")
    with pytest.raises(InputError, match='or state time_unit = "ms" or "s" under'):
        read(tmp_path, text)
    (test,) = read(tmp_path, text + 'time_unit = "ns"\n').tests
    assert test.estimate.frf.freq_hz[-1] == pytest.approx(400, rel=0.01)
    content["time"] = pyarrow.array(time, pyarrow.timestamp("ns"))
    pyarrow.parquet.write_table(pyarrow.table(content), tmp_path / "trace.parquet")
    (stamped,) = read(tmp_path, text).tests
    values = test.estimate.frf.values
    np.testing.assert_allclose(stamped.estimate.frf.values, values, atol=1e-12 * abs(values).max())


def test_an_encoder_is_no_reference(tmp_path):
    text = LOG.format(file="trace.csv", motor="Cmd", encoder="Pos") + 'references = ["Pos"]\n'
    with pytest.raises(InputError, match=r"'Pos' of encoder acc1:\+x, which holds the noise"):
        read(tmp_path, text)


def test_structures_of_matlab_and_simulink_are_read_with_their_clock(tmp_path, record):
    count = 8192
    time, both = np.arange(count) / RATE_HZ, np.column_stack([each[:count] for each in record[1:]])
    structure = {"time": time, "signals": {"values": both, "label": "u, y"}}
    contents = {
        "plain": ({"time": time, "u": both[:, 0], "y": both[:, 1]}, "u", "y"),
        "structure": ({"log": structure}, "log.signals.values(:,1)", "log.signals.values(2)"),
        "simulink": ({"tout": time, "yout": both}, "yout(1)", "yout(2)"),
    }
    values = []
    for name, (content, motor, encoder) in contents.items():
        scipy.io.savemat(tmp_path / f"{name}.mat", content, do_compression=True)
        campaign = read(tmp_path, LOG.format(file=f"{name}.mat", motor=motor, encoder=encoder))
        values.append(campaign.tests[0].estimate.frf.values)
    np.testing.assert_array_equal(values[1], values[0])
    np.testing.assert_array_equal(values[2], values[0])
    with pytest.raises(InputError, match=r"no variable 'yout\(3\)'"):
        read(tmp_path, LOG.format(file="simulink.mat", motor="yout(1)", encoder="yout(3)"))


def test_units_in_the_names_of_variables_count_and_are_said(tmp_path, record):
    count = 8192
    time, command, position = (np.arange(count), *(each[:count] for each in record[1:]))
    content = {"Time [ms]": time, "Cmd [N]": command, "Pos [mm]": 1e3 * position}
    pyarrow.parquet.write_table(pyarrow.table(content), tmp_path / "trace.parquet")
    text = LOG.format(file="trace.parquet", motor="Cmd", encoder="Pos [mm]")
    campaign = read(tmp_path, text.replace('unit = "m/N"\n', ""))
    assert any("name the unit mm/N" in remark for remark in campaign.remarks)
    plain = {"time": time / RATE_HZ, "u": command, "y": position}
    pyarrow.parquet.write_table(pyarrow.table(plain), tmp_path / "plain.parquet")
    expected = read(tmp_path, LOG.format(file="plain.parquet", motor="u", encoder="y"))
    first, second = (each.tests[0].estimate.frf for each in (campaign, expected))
    np.testing.assert_allclose(first.freq_hz, second.freq_hz)
    np.testing.assert_allclose(first.values, second.values, rtol=1e-9)


def test_the_clock_of_a_group_counts_and_must_fit(tmp_path, record):
    count = 8192
    for rows, error in ((count, None), (count - 5, "different lengths")):
        with h5py.File(tmp_path / "trace.h5", "w") as file:
            file["log/u"], file["log/y"] = record[1][:count], record[2][:count]
            file["log/time"] = np.arange(rows) / RATE_HZ
            file["log/note"] = h5py.Empty("f8")
        text = LOG.format(file="trace.h5", motor="log/u", encoder="log/y")
        if error:
            with pytest.raises(InputError, match=error):
                read(tmp_path, text)
        else:
            (test,) = read(tmp_path, text).tests
            assert test.estimate.frf.freq_hz[-1] == pytest.approx(400, rel=0.01)


@pytest.mark.parametrize("suffix", [".h5", ".parquet", ".mcap"])
def test_a_damaged_record_is_refused_in_one_sentence(tmp_path, suffix):
    (tmp_path / f"trace{suffix}").write_bytes(b"no such file" * 100)
    text = LOG.format(file=f"trace{suffix}", motor="a", encoder="b")
    with pytest.raises(InputError, match=f"trace{suffix} cannot be read"):
        read(tmp_path, text)


def test_messages_of_ros_2_go_by_their_stamp(tmp_path, record):
    count = 8192
    _, command, position = (signal[:count] for signal in record)
    path = tmp_path / "trace.mcap"
    header = "std_msgs/Header header\nfloat64[] position\nfloat64[] effort\n"
    parts = (
        "=" * 80 + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        + "=" * 80 + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )  # fmt: skip
    late = np.random.default_rng(6).uniform(0, 4e-4, count)  # on its way to the recorder
    with path.open("wb") as stream:
        writer = RosWriter(stream)
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", header + parts)
        for k in range(count):
            seconds, rest = divmod(1_700_000_000_000_000_000 + k * 1_000_000, 1_000_000_000)
            message = {
                "header": {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": ""},
                "position": [0.0, position[k]],
                "effort": [command[k]],
            }
            arrived = seconds * 1_000_000_000 + rest + round(1e9 * late[k])
            writer.write_message("/joint_states", schema, message, arrived, arrived)
        writer.finish()
    names = {"motor": "/joint_states.effort[0]", "encoder": "/joint_states.position[1]"}
    (test,) = read(tmp_path, LOG.format(file="trace.mcap", **names)).tests
    expected = estimate_continuous_frf(records_of(None, command, position)).estimate
    np.testing.assert_allclose(test.estimate.frf.values, expected.frf.values, rtol=1e-3)
