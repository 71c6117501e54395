"""Runs of tiny commands: bounded, resumable, and entries from the page alone."""

import importlib.util
import json
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

from gapbench.__main__ import BUNDLED, main
from gapbench.run import open_set, read_rows
from gapbench.seed import seed_of
from truth.grade.verdict import Row, StatedVerdict

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "gapbench" / "examples"
SAYS_NONE = 'print(\'{"format": 1, "none": 1.0}\')'


@pytest.fixture
def cases(tmp_path):
    """A set of three cases without any FRF."""
    folder = tmp_path / "set"
    keys = {"format": 1, "seed": 7, "effects": {"mass_error": "body"}, "cases": {}}
    for number in range(3):
        (folder / f"case{number}").mkdir(parents=True)
        (folder / f"case{number}" / "campaign.toml").write_text(f"# {number}", encoding="utf-8")
        keys["cases"][f"case{number}"] = {"stratum": "exact", "causes": [], "background": []}
    (folder / "keys.json").write_text(json.dumps(keys), encoding="utf-8")
    return folder


def run(cases, tmp_path, code, *options):
    words = ["run", "--set", str(cases), "--out", str(tmp_path / "answers.jsonl"), *options]
    return main([*words, "--", sys.executable, "-c", code])


def test_a_run_keeps_every_answer_and_its_cost(cases, tmp_path, capsys):
    assert run(cases, tmp_path, SAYS_NONE) == 0
    _, rows = read_rows(tmp_path / "answers.jsonl")
    assert [*rows] == ["case0", "case1", "case2"]
    assert all(row["answer"] == {"format": 1, "none": 1.0} for row in rows.values())
    assert all(0 < row["core_seconds"] < 10 for row in rows.values())
    assert "3/3 case2: answered" in capsys.readouterr().err
    assert main(["grade", "--set", str(cases), str(tmp_path / "answers.jsonl")]) == 0
    assert [row["right"] for row in json.loads(capsys.readouterr().out)] == [1.0, 1.0, 1.0]


def test_an_interrupted_run_goes_on_and_a_line_that_is_cut_is_made_again(cases, tmp_path):
    seen = tmp_path / "seen"
    code = f"import sys; open({str(seen)!r}, 'a').write('.'); {SAYS_NONE}"
    assert run(cases, tmp_path, code, "--limit", "2") == 0
    answers = tmp_path / "answers.jsonl"
    answers.write_text(answers.read_text("utf-8")[:-20], encoding="utf-8")
    assert run(cases, tmp_path, code) == 0
    assert len(read_rows(answers)[1]) == 3
    assert seen.read_text("utf-8") == "." * 4  # two, the cut one again, and the last
    assert run(cases, tmp_path, SAYS_NONE) == 3  # another command


def test_ctrl_c_ends_the_entry_too_and_keeps_what_is_answered(cases, tmp_path):
    answers, seen = tmp_path / "answers.jsonl", tmp_path / "seen"
    code = (
        f"import time; n = open({str(seen)!r}, 'a'); n.write('.'); n.close();"
        f"time.sleep(60 if len(open({str(seen)!r}).read()) == 2 else 0); {SAYS_NONE}"
    )
    words = ["-m", "gapbench", "run", "--set", str(cases), "--out", str(answers), "--"]
    command = [sys.executable, *words, sys.executable, "-c", code]
    process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True)
    while not (seen.is_file() and len(seen.read_text("utf-8")) == 2):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    assert "goes on from here" in process.communicate(timeout=20)[1]
    assert process.returncode == 130
    assert [*read_rows(answers)[1]] == ["case0"]
    assert subprocess.run(command, cwd=ROOT, check=False, capture_output=True).returncode == 0
    assert [*read_rows(answers)[1]] == ["case0", "case1", "case2"]


def test_a_case_is_bounded_and_its_children_end_too(cases, tmp_path):
    child = f"import time; time.sleep(4); open({str(tmp_path / 'late')!r}, 'w')"
    code = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    assert run(cases, tmp_path, code, "--seconds", "0.3", "--limit", "1") == 0
    _, rows = read_rows(tmp_path / "answers.jsonl")
    assert rows["case0"]["error"] == "no answer within 1.5 s"
    assert rows["case0"]["seconds"] < 3.5
    time.sleep(3)
    assert not (tmp_path / "late").exists()


def test_core_seconds_are_bounded(cases, tmp_path):
    assert run(cases, tmp_path, "while True: pass", "--seconds", "1", "--limit", "1") == 0
    row = read_rows(tmp_path / "answers.jsonl")[1]["case0"]
    assert row["error"].endswith("core seconds; at most 1")
    assert 0.5 < row["core_seconds"] < 3


@pytest.mark.parametrize(
    ("code", "says"),
    [
        ("raise SystemExit('no licence')", "ended with 1: no licence"),
        ("print('?')", "not JSON"),
        ('print(\'{"format": 1, "none": 2}\')', "sum to 2"),
    ],
)
def test_what_went_wrong_is_kept_and_counts_as_no_answer(cases, tmp_path, capsys, code, says):
    assert run(cases, tmp_path, code, "--limit", "1") == 0
    assert says in read_rows(tmp_path / "answers.jsonl")[1]["case0"]["error"]
    main(["grade", "--set", str(cases), str(tmp_path / "answers.jsonl")])
    assert json.loads(capsys.readouterr().out)[0]["right"] == 0


def test_an_entry_sees_a_copy_without_keys_and_may_write_its_answer(cases, tmp_path):
    code = (
        "import sys, os, json; f = sys.argv[-1]; assert os.listdir(f) == ['campaign.toml'];"
        "assert os.listdir(os.path.dirname(f)) == ['campaign'];"
        "json.dump({'format': 1, 'none': 1.0}, open(f + '/answer.json', 'w'))"
    )
    assert run(cases, tmp_path, code) == 0
    assert all("answer" in row for row in read_rows(tmp_path / "answers.jsonl")[1].values())
    assert not (cases / "case0" / "answer.json").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["grade", "absent.jsonl"], "absent.jsonl"),
        (["run", "--set", "absent", "--", "true"], "keys.json"),
        (["draw", "somewhere"], "--seed"),
        (["draw", "somewhere", "--archive", "a.zip"], "--beacon"),
    ],
)
def test_wrong_input_ends_with_a_sentence(words, says, capsys):
    assert main(words) == 3
    assert says in capsys.readouterr().err


def test_the_seed_is_a_hash_of_archive_and_beacon():
    # sha256(sha256(b"entry") + b"8d61"), computed by sha256sum and xxd.
    assert seed_of(b"entry", " 8D61\n") == seed_of(b"entry", "8d61") == 0x73A83BAE2D934D74
    assert seed_of(b"entry", "8d62") != seed_of(b"entry", "8d61") != seed_of(b"Entry", "8d61")


@pytest.mark.parametrize("name", ["stub.py", "stub.m"])
def test_the_entries_of_the_page_answer(name, tmp_path):
    command = {"stub.py": [sys.executable], "stub.m": ["octave", "--no-gui", "--quiet"]}[name]
    if shutil.which(command[0]) is None:
        pytest.skip("octave is not installed")
    out = tmp_path / "answers.jsonl"
    words = ["run", "--out", str(out), "--limit", "2", "--", *command, str(EXAMPLES / name)]
    assert main(words) == 0
    rows = read_rows(out)[1]
    assert len(rows) == 2
    for row in rows.values():
        assert row["answer"]["sets"][0]["causes"][0]["places"] == ["body:stage3"]


def test_the_grader_needs_numpy_alone(cases, tmp_path):
    assert run(cases, tmp_path, SAYS_NONE) == 0
    code = """
import importlib.abc, sys
class Refuse(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        top = name.partition(".")[0]
        if top not in {"numpy", "gapbench", *sys.stdlib_module_names}:
            raise ImportError(name)
sys.meta_path.insert(0, Refuse())
from gapbench.__main__ import main
sys.exit(main(["table", "--set", sys.argv[1], "nothing=" + sys.argv[2]]))
"""
    words = [sys.executable, "-c", code, str(cases), str(tmp_path / "answers.jsonl")]
    done = subprocess.run(words, cwd=ROOT, check=False, capture_output=True, text=True)
    assert "| nothing | 3 | 100 % [44, 100] |" in done.stdout
    assert done.returncode == 0


@pytest.fixture
def entry():
    """The entry of this repository as a module."""
    spec = importlib.util.spec_from_file_location("entry", EXAMPLES / "ours.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_our_own_entry_translates_a_verdict(entry):
    rows = (
        Row(
            "mass_error",
            "body:b",
            0.9,
            parameters={"mass": (3.0,)},
            interval={"mass": ((2.0, 4.0),)},
        ),
        Row("stiffness", "joint:b", 0.4, parameters={"change": (-5.0,), "factor": (0.9,)}),
    )
    verdict = StatedVerdict(
        "explained", none=0.05, several=0.35, causes=rows, retuned=4.0, after=1.1
    )
    said = entry.answer(verdict)
    assert [len(row["causes"]) for row in said["sets"]] == [1, 1, 2]
    assert said["sets"][0]["causes"][0] == {
        "effect": "mass_error",
        "places": ["body:b"],
        "size": 3.0,
        "interval": [2.0, 4.0],
    }
    assert said["sets"][1]["causes"][0]["size"] == -5.0
    assert said["sets"][2]["probability"] == pytest.approx(0.35)
    assert sum(row["probability"] for row in said["sets"]) + said["none"] <= 1 + 1e-9
    assert said["gap"] == [4.0, 1.1]


def test_our_entry_states_the_smallest_fraction_of_supports(entry):
    row = Row("support_loss", "joint:b", 0.9, parameters={"fraction": (1.0, 0.4, 1.0)})
    assert entry.cause(row)["size"] == 0.4
    link = Row("parallel_path", "pair:a-b", 0.9, parameters={"stiffness": (3.0, 4.0, float("nan"))})
    assert entry.cause(link)["size"] == 5.0


def test_the_bundled_set_is_whole_and_small():
    assert BUNDLED.stat().st_size < 15e6
    with open_set(BUNDLED) as (folder, keys):
        strata = [key["stratum"] for key in keys["cases"].values()]
        assert {strata.count(stratum) for stratum in strata} == {5}
        assert len(set(strata)) == 6
        for name in keys["cases"]:
            assert (folder / name / "campaign.toml").is_file()
            assert (folder / name / "model.xml").is_file()
            if keys["cases"][name]["stratum"] == "real":
                assert (folder / name / "LICENSE").is_file()


def test_the_wheel_has_the_whole_package_and_the_shared_statistics(tmp_path):
    words = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path)]
    subprocess.run([*words, str(ROOT / "gapbench")], check=True, capture_output=True)
    (wheel,) = tmp_path.glob("gapbench-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info" not in name}
        shared = archive.read("gapbench/rates.py")
    files = {p for kind in ("*.py", "*.m", "*.zip") for p in (ROOT / "gapbench").rglob(kind)}
    assert names == {str(path.relative_to(ROOT)) for path in files}
    assert shared == (ROOT / "truth" / "grade" / "rates.py").read_bytes()


def test_answers_of_another_set_are_not_graded(cases, tmp_path, capsys):
    assert run(cases, tmp_path, SAYS_NONE) == 0
    answers = tmp_path / "answers.jsonl"
    assert main(["grade", str(answers)]) == 3  # by the bundled keys
    assert "of seed 7, not of 930000: name its set by --set" in capsys.readouterr().err
    answers.write_text(answers.read_text("utf-8").partition("\n")[0] + "\n", encoding="utf-8")
    assert main(["table", "--set", str(cases), f"mine={answers}"]) == 3
    assert "holds no answers yet" in capsys.readouterr().err
    assert main(["table", "--set", str(cases), str(answers)]) == 3
    assert "give NAME=ANSWERS" in capsys.readouterr().err


@pytest.mark.parametrize("option", [("--seconds", "nan"), ("--limit", "0"), ("--strata", "foo")])
def test_numbers_and_strata_that_make_no_sense_are_refused(cases, tmp_path, option):
    with pytest.raises(SystemExit) as ended:
        run(cases, tmp_path, SAYS_NONE, *option)
    assert ended.value.code == 2
    assert not (tmp_path / "answers.jsonl").exists()


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ([], "give the command that answers"),
        (["no-such-entry"], "no-such-entry: there is no such command: name a program in PATH"),
        (["python mine.py"], "do not quote it as one word: gapbench run -- python mine.py"),
    ],
)
def test_a_command_that_is_not_there_leaves_no_answers(cases, tmp_path, capsys, command, said):
    answers = tmp_path / "answers.jsonl"
    assert main(["run", "--set", str(cases), "--out", str(answers), "--", *command]) == 3
    assert said in capsys.readouterr().err
    assert not answers.exists()
