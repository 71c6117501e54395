"""campaign.toml: its defaults, and every way in which it can be wrong."""

import pytest
from identification_examples import write_campaign

from identification import read_settings
from identification.words import InputError, Tolerance

HEAD = 'model = "model.xml"\n'
ONE = HEAD + '[[test]]\nfile = "a.uff"\n'


@pytest.fixture
def settings_of(tmp_path):
    return lambda text: read_settings(write_campaign(tmp_path, text))[1]


@pytest.fixture
def refusal(tmp_path):
    def message(text):
        with pytest.raises(InputError) as caught:
            read_settings(write_campaign(tmp_path, text))
        assert str(tmp_path / "campaign.toml") in str(caught.value)
        return str(caught.value)

    return message


def test_the_smallest_campaign_has_the_defaults(settings_of):
    settings = settings_of(ONE)
    (test,) = settings.test
    assert (settings.model, settings.layout, settings.sensor) == ("model.xml", None, {})
    assert (test.file, test.averages, test.level, test.setup) == ("a.uff", None, None, None)
    assert (test.spindle_speed, test.window_tau, test.time_sign) == (0.0, 0.0, "+")
    assert (test.channels, test.references, test.quantity, test.unit) == (None,) * 4
    assert settings.tuning.model_dump() == {
        "free": [],
        "fix": [],
        "prior": {},
        "bounds": {},
        "tie": [],
    }


def test_the_tolerances_of_a_campaign_default_to_those_of_the_words(settings_of):
    assert Tolerance(**settings_of(ONE).tolerance.model_dump()) == Tolerance()


def test_every_key_of_the_contract_is_taken(settings_of):
    settings = settings_of(
        """
        layout = "layout.toml"
        [[test]]
        file = "b.mat"
        averages = 7
        level = 150.0
        spindle_speed = 3.5
        setup = "b"
        hammer = "small"
        window_tau = 0.25
        channels = "nodes 1..23, xyz"
        references = ["11:+x", "11:+y"]
        columns = ["H1", 3]
        quantity = "mobility"
        unit = "mm/s/N"
        time_sign = "-"
        frequency_unit = "rad/s"
        as_stated = true
        block_s = 2.5
        pretrigger_s = 0.0625
        force_window_s = 0.03
        exponential_tau = 0.75
        estimator = "Hv"
        reject = false
        coherence = "multiple"
        input_spectra = "Sff"
        ignore_hz = [[49.5, 50.5]]
        [[test]]
        file = "c.npz"
        channels = ["1:+x"]
        level = 200
        [sensor.acc7]
        flip = ["z"]
        turn = [0.1, 0, -0.3]
        ignore = ["x", "y"]
        body = "ty"
        gain = "unknown"
        gain_tolerance = 0.2
        delay_tolerance = 1e-3
        mass = 0.01
        resolution = 1e-8
        [hammer.small]
        gain = "unknown"
        mass = 0.02
        stinger = { diameter = 0.002, length = 0.05 }
        [tolerance]
        mass = 0.011
        inertia = 0.012
        com = 0.013
        joint_position = 0.014
        sensor_gain = 0.015
        sensor_angle = 0.016
        sensor_position = 0.017
        sensor_delay = 1e-5
        sensor_cross = 0.021
        hammer_angle = 0.018
        hammer_position = 0.0
        hammer_gain = 0.022
        hammer_delay = 3e-5
        stiffness = 1.5
        damping = 2.5
        [tuning]
        free = ["acc7.gain_x", "head_*.damping"]
        fix = ["base.mass"]
        tie = [["leg1.stiffness", "leg?.stiffness"], ["foot.damping"]]
        [tuning.prior]
        "head.mass" = 0.2
        "head.com_?" = 1
        [tuning.bounds]
        "leg1.stiffness" = [1e6, 20000000]
        """
    )
    first, second = settings.test
    assert first.model_dump() == {
        "file": "b.mat",
        "averages": 7,
        "model": None,  # one of its own needs a model of the campaign, in place of a layout
        "pose": {},
        "log": None,
        "as_stated": True,
        "level": 150.0,
        "hammer": "small",
        "spindle_speed": 3.5,
        "setup": "b",
        "state": None,
        "window_tau": 0.25,
        "channels": "nodes 1..23, xyz",
        "references": ["11:+x", "11:+y"],
        "columns": ["H1", 3],
        "quantity": "mobility",
        "unit": "mm/s/N",
        "time_sign": "-",
        "frequency_unit": "rad/s",
        "block_s": 2.5,
        "pretrigger_s": 0.0625,
        "force_window_s": 0.03,
        "exponential_tau": 0.75,
        "estimator": "Hv",
        "reject": False,
        "coherence": "multiple",
        "input_spectra": "Sff",
        "ignore_hz": [[49.5, 50.5]],
    }
    assert (second.channels, second.level, second.window_tau) == (["1:+x"], 200.0, 0.0)
    assert settings.sensor["acc7"].model_dump() == {
        "flip": ["z"],
        "turn": [0.1, 0.0, -0.3],
        "ignore": ["x", "y"],
        "body": "ty",
        "gain": "unknown",
        "gain_tolerance": 0.2,
        "delay_tolerance": 1e-3,
        "resolution": 1e-8,
        "mass": 0.01,
    }
    hammer = settings.hammer["small"]
    assert (hammer.gain, hammer.mass) == ("unknown", 0.02)
    assert hammer.stinger.model_dump() == {"diameter": 0.002, "length": 0.05, "modulus": 2.1e11}
    assert settings.tolerance.model_dump() == {
        "mass": 0.011,
        "inertia": 0.012,
        "com": 0.013,
        "joint_position": 0.014,
        "sensor_gain": 0.015,
        "sensor_angle": 0.016,
        "sensor_position": 0.017,
        "sensor_delay": 1e-5,
        "sensor_cross": 0.021,
        "hammer_angle": 0.018,
        "hammer_position": 0.0,
        "hammer_gain": 0.022,
        "hammer_delay": 3e-5,
        "stiffness": 1.5,
        "damping": 2.5,
    }
    assert settings.tuning.model_dump() == {
        "free": ["acc7.gain_x", "head_*.damping"],
        "fix": ["base.mass"],
        "prior": {"head.mass": 0.2, "head.com_?": 1.0},
        "bounds": {"leg1.stiffness": [1e6, 2e7]},
        "tie": [["leg1.stiffness", "leg?.stiffness"], ["foot.damping"]],
    }


def test_the_file_itself_may_be_named(tmp_path):
    folder = write_campaign(tmp_path, ONE)
    path, settings = read_settings(folder / "campaign.toml")
    assert path == folder / "campaign.toml"
    assert settings.test[0].file == "a.uff"


def test_a_folder_without_campaign_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"campaign\.toml does not exist"):
        read_settings(tmp_path)


def test_a_fault_of_syntax_is_named_by_its_line(refusal):
    message = refusal(HEAD + "\n[[test]]\nfile = = 3\n")
    assert "line 4" in message
    assert "correct that line" in message


def test_a_key_given_twice_is_named_by_its_line(refusal):
    assert "line 4" in refusal(ONE + 'file = "b.uff"\n')


def test_text_that_is_not_utf8_is_refused(tmp_path):
    (tmp_path / "campaign.toml").write_bytes(ONE.encode() + b"# M\xfcller\n")
    with pytest.raises(InputError, match="UTF-8"):
        read_settings(tmp_path)


@pytest.mark.parametrize(
    ("text", "key", "advice"),
    [
        ('colour = "red"\n' + ONE, "colour", "correct its spelling or remove it"),
        (ONE + "avarages = 3\n", "test.1.avarages", "did you mean averages?"),
        (ONE + "Window-Tau = 3\n", "test.1.Window-Tau", "did you mean window_tau?"),
        (ONE.replace("file =", "fiel ="), "test.1.fiel", "did you mean file?"),
        (ONE + '[[test]]\nfile = "b.uff"\nwindow = 0.1\n', "test.2.window", "mean window_tau?"),
        (ONE + "[sensor.acc7]\nflipp = []\n", "sensor.acc7.flipp", "did you mean flip?"),
        (ONE + "[tolerance]\nmas = 0.1\n", "tolerance.mas", "did you mean mass?"),
        (ONE + "[band]\nlow = 1\n", "band", "correct its spelling or remove it"),
        (ONE + "[tuning]\nties = []\n", "tuning.ties", "did you mean tie?"),
    ],
)
def test_an_unknown_key_is_named_with_its_place_and_the_nearest_key(refusal, text, key, advice):
    message = refusal(text)
    assert f"unknown key {key}: " in message
    assert message.endswith(advice)


@pytest.mark.parametrize(
    ("line", "key"),
    [
        ('averages = "ten"', "test.1.averages"),
        ("averages = 0", "test.1.averages"),
        ("averages = 2.5", "test.1.averages"),
        ("level = 0.0", "test.1.level"),
        ("level = -200.0", "test.1.level"),
        ("level = nan", "test.1.level"),
        ("level = inf", "test.1.level"),
        ("level = [200.0]", "test.1.level"),
        ("spindle_speed = inf", "test.1.spindle_speed"),
        ("setup = 3", "test.1.setup"),
        ("window_tau = -0.1", "test.1.window_tau"),
        ("window_tau = nan", "test.1.window_tau"),
        ("channels = 23", "test.1.channels"),
        ("channels = [1, 2]", "test.1.channels"),
        ('references = "11:+x"', "test.1.references"),
        ('quantity = "inertance"', "test.1.quantity"),
        ("unit = 9.81", "test.1.unit"),
        ('time_sign = "-i"', "test.1.time_sign"),
        ("[sensor.acc7]\nflip = ['w']", "sensor.acc7.flip"),
        ("[sensor.acc7]\nflip = 'x'", "sensor.acc7.flip"),
        ("[sensor.acc7]\nturn = [1, 2]", "sensor.acc7.turn"),
        ("[sensor.acc7]\nturn = [1, 2, nan]", "sensor.acc7.turn"),
        ("[sensor.acc7]\nignore = ['rx']", "sensor.acc7.ignore"),
        ("[sensor.acc7]\nbody = 3", "sensor.acc7.body"),
        ("[sensor]\nacc7 = 'x'", "sensor.acc7"),
        ("[tolerance]\nmass = -0.1", "tolerance.mass"),
        ("[tolerance]\ncom = nan", "tolerance.com"),
        ("[tolerance]\ncom = 'small'", "tolerance.com"),
        ("[tuning]\nfree = 'acc7.*'", "tuning.free"),
        ("[tuning]\nfix = [7]", "tuning.fix.1"),
        ("[tuning.prior]\na = 0", "tuning.prior.a"),
        ("[tuning.prior]\na = -0.1", "tuning.prior.a"),
        ("[tuning.prior]\na = inf", "tuning.prior.a"),
        ("[tuning.prior]\na = '10 %'", "tuning.prior.a"),
        ("[tuning.bounds]\na = [1.0]", "tuning.bounds.a"),
        ("[tuning.bounds]\na = [1.0, 2.0, 3.0]", "tuning.bounds.a"),
        ("[tuning.bounds]\na = [1.0, nan]", "tuning.bounds.a.2"),
        ("[tuning.bounds]\na = 1.0", "tuning.bounds.a"),
        ("[tuning]\ntie = ['a', 'b']", "tuning.tie.1"),
        ("[tuning]\ntie = [[]]", "tuning.tie.1"),
    ],
)
def test_a_wrong_value_is_named_with_its_key(refusal, line, key):
    assert key in refusal(ONE + line + "\n")


@pytest.mark.parametrize(
    "line",
    ['averages = "10"', 'level = "200"', "averages = true", "level = true", "window_tau = false"],
)
def test_text_or_truth_in_place_of_a_number_is_refused(refusal, line):
    assert line.split()[0] in refusal(ONE + line + "\n")


@pytest.mark.parametrize("text", [HEAD, HEAD + "test = []\n", HEAD + 'test = "a.uff"\n'])
def test_a_campaign_without_tests_is_refused(refusal, text):
    assert "test" in refusal(text)


def test_a_test_without_file_is_refused(refusal):
    assert "key test.1.file is missing: add it" in refusal(HEAD + "[[test]]\naverages = 3\n")


@pytest.mark.parametrize(
    "head", ["", 'model = "m.xml"\nlayout = "l.toml"\n'], ids=["neither", "both"]
)
def test_exactly_one_of_model_and_layout_is_asked_for(refusal, head):
    assert "must name either a model or a layout" in refusal(head + '[[test]]\nfile = "a.uff"\n')


def test_a_keyframe_needs_a_model(refusal):
    text = 'layout = "l.toml"\nkey = "home"\n[[test]]\nfile = "a.uff"\n'
    assert "key = 'home' names a keyframe" in refusal(text)


def test_a_test_in_one_bracket_is_told_of_two(refusal):
    assert "write [[test]], in two brackets" in refusal(HEAD + '[test]\nfile = "a.uff"\n')


def test_a_value_instead_of_a_table_is_refused_without_names_of_classes(refusal):
    message = refusal(HEAD + "test = [1]\n")
    assert "test.1 = 1: Input should be a table" in message
    assert "Settings" not in message


def test_an_empty_file_is_refused(refusal):
    assert "missing" in refusal("")


def test_a_million_ranges_of_lines_are_counted_and_not_quoted(refusal):
    rows = ", ".join(f"[{k}, {k}.5]" for k in range(10_001))
    message = refusal(f"ignore_hz = [{rows}]\n{ONE}")
    assert message.endswith("ignore_hz has 10001 entries, at most 10000 are read: give fewer")


def test_a_file_of_millions_of_characters_is_refused_before_it_is_parsed(refusal):
    rows = "[49.5, 50.5], " * 400_000
    message = refusal(f"ignore_hz = [{rows}]\n{ONE}")
    assert "holds 5.6 million characters" in message
    assert message.endswith("most of all ignore_hz")
