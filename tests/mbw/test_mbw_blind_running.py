"""Where the cases of ``mbw blind`` run: executors, lost workers, shards that are merged."""

import functools
import json
import multiprocessing
import os
import shutil
import signal
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from blind_verdicts import empty_verdict
from typer.testing import CliRunner

from mbw.blind import case as blind_case
from mbw.blind.case import BlindCase
from mbw.blind.running import sort_longest_first
from mbw.command import app
from truth import draw_case, read_station, write_answer, write_campaign
from truth.campaign.case_design import deal_cards
from truth.campaign.file_formats import model_xml
from truth.machine.random_tree import draw_tree
from tuning import Minimum

RUNNER = CliRunner()
HERE = "tests.mbw.test_mbw_blind_running"
SEED = 11
RESULT = ("grades.json", "grades.txt", "blind.html", "hashes.txt", "asked.json")
THREADS = ("--executor", f"{HERE}:threads")
FORKS = ("--executor", f"{HERE}:forks")

MINIMUM = Minimum(np.zeros(1), 1.0, 1, "converged", "")
threads = functools.partial(ThreadPoolExecutor, 3)


def forks():
    """Processes that inherit what a test replaces."""
    return ProcessPoolExecutor(2, multiprocessing.get_context("fork"))


def run(model, out, *options, seed=SEED):
    arguments = ["blind", str(model), "--out", str(out), "--seed", str(seed), *map(str, options)]
    return RUNNER.invoke(app, arguments)


def merge(out, *folders):
    return RUNNER.invoke(app, ["blind", "merge", *map(str, folders), "--out", str(out)])


def contents(out):
    files = [*(out / name for name in RESULT), *(out / "cases").rglob("*.json")]
    files += (out / "sealed").iterdir()
    return {str(path.relative_to(out)): path.read_bytes() for path in files}


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A model, and one case of it: its campaign and its answer."""
    place = tmp_path_factory.mktemp("drawn")
    (place / "small.xml").write_text(model_xml(draw_tree(2, 2)))
    campaign = draw_case(read_station(place / "small.xml"), SEED, 0).campaign
    write_campaign(campaign, place / "campaign", sealed=True)
    write_answer(campaign, place / "answer.toml")
    return place


@pytest.fixture
def model(drawn, monkeypatch):
    """The model; cases are copies of one, and their verdicts tell their numbers."""

    def draw(case):
        shutil.copytree(drawn / "campaign", case.campaign, dirs_exist_ok=True)
        case.sealed.parent.mkdir(exist_ok=True)
        answer = (drawn / "answer.toml").read_text()
        case.sealed.write_text(f"# {case.number}\n{answer}")
        case.answer_hash.write_text(blind_case._hash_files(case.sealed) + "\n")
        return blind_case._hash_files(case.sealed)

    def judge(case):
        if case.number == 5:
            raise RuntimeError("the diagnosis fell over")
        verdict = empty_verdict(1 / (1 + case.number), 2.0 + case.number)
        case.verdict.write_text(json.dumps(verdict))
        case.refit.write_text(json.dumps({"excess": 1.0}))
        case.checksum.write_text(blind_case._hash_files(*case.results))

    monkeypatch.setattr(blind_case, "_draw", draw)
    monkeypatch.setattr(blind_case, "_judge", judge)
    return drawn / "small.xml"


@pytest.fixture
def whole(model, tmp_path):
    """The test of seven cases, one of which fails, without shards in one process."""
    result = run(model, tmp_path / "whole", "--cases", 7)
    assert result.exit_code == 0, result.stderr
    return tmp_path / "whole"


def test_any_executor_and_any_number_of_workers_give_the_same_files(model, whole, tmp_path):
    for name, options in (("threads", THREADS), ("forks", FORKS)):
        result = run(model, tmp_path / name, "--cases", 7, *options)
        assert result.exit_code == 0, result.stderr
        assert contents(tmp_path / name) == contents(whole)


@pytest.mark.filterwarnings("ignore")  # of Dask itself
def test_cases_run_on_a_dask_cluster(model, whole, tmp_path):
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    with distributed.LocalCluster(
        n_workers=2, processes=False, protocol="tcp", dashboard_address=None, silence_logs=50
    ) as cluster:
        out = tmp_path / "cluster"
        result = run(model, out, "--cases", 7, "--cluster", cluster.scheduler_address)
    assert result.exit_code == 0, result.stderr
    assert contents(out) == contents(whole)


def test_a_case_whose_worker_dies_is_done_again_and_named(model, whole, tmp_path, monkeypatch):
    judge = blind_case._judge

    def die_once(case):
        mark = tmp_path / f"{case.number}.died"
        if case.number == 3 and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        judge(case)

    monkeypatch.setattr(blind_case, "_judge", die_once)
    result = run(model, tmp_path / "out", "--cases", 7, *FORKS)
    assert result.exit_code == 0, result.stderr
    assert "case 0003 was done again: it was not finished when its worker ended (" in result.stderr
    assert contents(tmp_path / "out") == contents(whole)
    assert not list((tmp_path / "out").rglob("worker.txt"))


def test_a_case_that_kills_each_worker_fails_by_name_and_the_rest_go_on(
    model, tmp_path, monkeypatch
):
    judge = blind_case._judge

    def die(case):
        if case.number == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        judge(case)

    monkeypatch.setattr(blind_case, "_judge", die)
    out = tmp_path / "out"
    result = run(model, out, "--cases", 3, *FORKS)
    assert result.exit_code == 0, result.stderr
    assert "seed 11, case 1: its worker process died again and again" in result.stderr
    assert "case 0001 could not be run: WorkerDiedError" in (out / "blind.html").read_text()
    assert json.loads((out / "grades.json").read_text())["failed"].keys() == {"0001"}


def test_an_interrupted_diagnosis_continues_from_its_finished_refits(drawn, tmp_path, monkeypatch):
    steps = []

    def diagnose(session, *, checkpoint):
        del session
        steps.append(len(checkpoint))
        checkpoint.keep(f"refit {len(checkpoint) + 1}", MINIMUM)
        raise KeyboardInterrupt

    case = BlindCase(str(drawn / "small.xml"), SEED, 0, tmp_path)
    shutil.copytree(drawn / "campaign", case.campaign)
    monkeypatch.setattr(blind_case, "diagnose", diagnose)
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            blind_case._judge(case)
    kept = json.loads(case.checkpoint.read_text())
    case.checkpoint.write_text(json.dumps(kept | {"fingerprint": "of other inputs"}))
    with pytest.raises(KeyboardInterrupt):
        blind_case._judge(case)
    assert steps == [0, 1, 0]


def test_the_longest_cases_start_first():
    cases = [BlindCase("trees", SEED, number, Path()) for number in range(60)]
    order = sort_longest_first(cases)
    dealt = deal_cards(SEED)
    cards = [next(dealt) for _ in cases]
    kinds = [cards[case.number].kind for case in order]
    names = [set(cards[case.number].names) for case in order]
    is_nonlinear = [bool(each & {"friction", "backlash", "hardening"}) for each in names]
    assert is_nonlinear == sorted(is_nonlinear, reverse=True)
    assert set(kinds[-4:]) == {"nothing"}
    assert {case.number for case in order} == set(range(60))


def test_merged_shards_are_the_whole_test(model, whole, tmp_path):
    shards = [tmp_path / f"shard{number}" for number in (1, 2, 3)]
    for number, out in enumerate(shards, start=1):
        assert run(model, out, "--cases", 7, "--shard", f"{number}/3").exit_code == 0
    result = merge(tmp_path / "merged", *reversed(shards))
    assert result.exit_code == 0, result.stderr
    assert contents(tmp_path / "merged") == contents(whole)
    # The merged folder is that of the whole test: the same call continues it, here with one more.
    assert run(model, tmp_path / "merged", "--cases", 8).exit_code == 0
    assert run(model, whole, "--cases", 8).exit_code == 0
    assert contents(tmp_path / "merged") == contents(whole)
    assert merge(tmp_path / "merged", *shards).exit_code == 0
    assert run(model, shards[0], "--cases", 7, "--shard", "2/3").exit_code == 3


def test_shards_that_do_not_make_one_test_are_refused_with_one_sentence(model, whole, tmp_path):
    def shard(name, text, *options, seed=SEED, machine=model):
        out = tmp_path / name
        result = run(machine, out, "--cases", 4, "--shard", text, *options, seed=seed)
        assert result.exit_code == 0, result.stderr
        return out

    other = tmp_path / "other.xml"
    other.write_text(model.read_text().replace("<worldbody>", "<worldbody><!-- changed -->"))
    first = shard("first", "1/2")
    refused = {
        "another model": shard("model", "2/2", machine=other),
        "another seed": shard("seed", "2/2", seed=12),
        "another band": shard("band", "2/2", "--band", 20, 60),
        "another choice": shard("choice", "2/2", "--dirt", 5),
        "are both shard 1/2": first,
        "one of 3 shards": shard("thirds", "2/3"),
        "whole test": whole,
        "does not exist": tmp_path / "nowhere",
    }
    for sentence, folder in refused.items():
        result = merge(tmp_path / "out", first, folder)
        assert result.exit_code == 3, sentence
        assert sentence in result.stderr
        assert result.stderr.count("\n") == 1
        assert not (tmp_path / "out").exists()
    alone = merge(tmp_path / "out", first)
    assert alone.exit_code == 3
    assert "shard 2/2 is missing" in alone.stderr
    second = shard("second", "2/2")
    (second / "cases" / "0001" / "verdict.json").write_text("{}")
    altered = merge(tmp_path / "out", first, second)
    assert altered.exit_code == 3
    assert "case 0001" in altered.stderr


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--shard", "4/3"), "give i/n"),
        (("--shard", "one"), "give i/n"),
        (("--cases", 2, "--shard", "1/3"), "2 cases cannot be shared among 3"),
        (("--executor", "nothing"), "package:factory"),
        (("--executor", f"{HERE}:threads", "--cluster", "tcp://x:1"), "exclude each other"),
    ],
)
def test_a_wrong_option_is_a_usage_error(model, tmp_path, options, sentence):
    result = run(model, tmp_path / "out", *options)
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert not (tmp_path / "out").exists()


def test_a_worker_that_does_not_see_the_folder_ends_the_test_with_one_sentence(drawn, tmp_path):
    case = BlindCase(str(drawn / "small.xml"), SEED, 0, tmp_path / "elsewhere")
    with pytest.raises(blind_case.InputError, match=r"does not see .*elsewhere"):
        blind_case.run_case(case)
