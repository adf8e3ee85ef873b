"""One declaration an option: words make a value, the value makes the same words again."""

from __future__ import annotations

import os
import re
from argparse import ArgumentTypeError
from dataclasses import dataclass, fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.download import DownloadOptions
from benchmarks.flood import FloodOptions
from benchmarks.lockstep import LockstepOptions
from benchmarks.loop import LoopOptions
from benchmarks.mpc import MpcOptions
from benchmarks.values import several
from command_line.options import as_words, option, read, switch
from command_line.parser import unknown_name
from command_line.values import number, one_of, output_file, seconds, whole
from fsw.arguments import FswOptions
from fsw.autopilot.parameters.control_choice import ControlChoice
from fsw.autopilot.signals import Origin
from fsw.link.link_choice import LinkChoice
from pandion import __main__ as pandion_main
from pandion.certify import CertifyOptions
from pandion.dialect import DialectOptions
from pandion.export import ExportOptions
from pandion.falsify_options import FalsifyOptions
from pandion.fly_verb import FlyOptions
from pandion.replay import ReplayOptions
from pandion.report import ReportOptions
from pandion.reproduce import ReproduceOptions
from sitl.arguments import SitlOptions, speed
from tests.cli.command import one_sentence

PROGRAMS = (
    FlyOptions, FswOptions, SitlOptions, ReplayOptions, ReproduceOptions, ExportOptions,
    FalsifyOptions,
    LoopOptions, LockstepOptions, FloodOptions, DownloadOptions, MpcOptions,
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    name: str = option("NAME", "a name", required=True)
    count: int = option("--count N", "how many", whole(1, 9), default=3)
    kind: str = option("--kind K", "which", one_of("kind", "a", "b", old={"z": "a"}), default="b")
    loud: bool = switch("--loud", "say more", old="--noisy", off="--silent")


def refused(kind: type[Any], *words: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as stop:
        read(kind, "test", "Test.", list(words))
    assert stop.value.code == 2
    reported = capsys.readouterr().err
    assert one_sentence(reported), reported
    return reported


@given(
    st.from_regex(r"[a-z]+", fullmatch=True),
    st.integers(1, 9),
    st.sampled_from("ab"),
    st.booleans(),
)
def test_the_words_of_a_value_make_the_same_value(
    name: str, count: int, kind: str, loud: bool
) -> None:
    value = Example(name=name, count=count, kind=kind, loud=loud)
    assert read(Example, "test", "Test.", as_words(value)) == value


@dataclass(frozen=True, slots=True, kw_only=True)
class Needed:
    out: Path = option("--out FILE", "where to", Path, required=True)


def test_an_option_without_a_default_must_be_given(capsys: pytest.CaptureFixture[str]) -> None:
    assert "--out" in refused(Needed, capsys=capsys)
    assert read(Needed, "test", "Test.", ["--out=x"]) == Needed(out=Path("x"))


def test_what_the_processes_are_started_with_survives_the_command_line() -> None:
    links = LinkChoice(
        gcs="udp:127.0.0.1:9", api="none", allow_remote=True, autopilot="generic",
        origin=Origin(-33.123456789012, 0.1, 2.0), keys=Path("a b"),
    )  # fmt: skip
    control = ControlChoice(
        controller="hc",
        tracking="pid",
        lambda_="paper-5",
        solver="slsqp",
        body="points",
        allow_inconsistent=True,
    )
    fsw = FswOptions(links=links, control=control, out=Path("o"), wait_s=0.1 + 0.2, seed=0)
    sitl = SitlOptions(scenario="x.toml", seed=2**63 - 1, realtime=True, speed=1.5, out=Path("o"))
    for value in (fsw, sitl):
        assert read(type(value), "test", "Test.", as_words(value)) == value
    # Nothing is forgotten: every option above differs from its default.
    assert len(as_words(links)) == len(fields(links))
    assert len(as_words(control)) == len(fields(control))


def test_an_old_name_works_and_is_answered_by_the_new_one(
    capsys: pytest.CaptureFixture[str],
) -> None:
    old = ["--soft", "--inner", "tracking", "--robustness=paper-1"]
    new = ["--allow-inconsistent", "--tracking", "lqr", "--lambda=paper-1"]
    chosen = read(ControlChoice, "test", "Test.", old)
    reported = capsys.readouterr().err.splitlines()
    assert chosen == read(ControlChoice, "test", "Test.", new)
    assert len(reported) == 3
    for line, name, today in zip(
        reported,
        ("--soft", "--inner", "--robustness"),
        ("--allow-inconsistent", "--tracking", "--lambda"),
        strict=True,
    ):
        assert f"{name} is now {today};" in line
    assert capsys.readouterr().err == "", "the new names are not worth a word"


@pytest.mark.parametrize("program", PROGRAMS)
def test_help_names_every_option_but_the_old_ones(
    program: type[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        read(program, "test", "Test.", ["--help"])
    assert stop.value.code == 0
    shown = capsys.readouterr().out
    for field in fields(program):
        one = field.metadata.get("option")
        assert one is None or one.flag in shown
    assert not any(old in shown for old in ("--soft", "--inner", "--robustness"))


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_program_refuses_an_unknown_option(
    program: type[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["table3" if program is ReproduceOptions else "x"] * sum(
        field.metadata["option"].required for field in fields(program) if "option" in field.metadata
    )
    group = ["--csv", "x"] if program is ExportOptions else []
    reported = refused(program, *words, *group, "--jsno", "x", capsys=capsys)
    assert "--jsno" in reported


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], "NAME"),
        (["a", "--count", "10"], "'10' is not a whole number from 1 to 9"),
        (["a", "--count"], "--count"),
        (["a", "--kind", "c"], "known: a, b"),
        (["a", "--cuont", "1"], "did you mean --count?"),
        (["a", "--rate", "1"], "known: -h, --help, --count"),
        (["a", "b"], "b"),
        (["a", "--loud", "--silent"], "not allowed with"),
    ],
)
def test_a_refusal_says_what_is_allowed(
    words: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert expected in refused(Example, *words, capsys=capsys)


@pytest.mark.parametrize(
    ("parse", "good", "value", "bad"),
    [
        (whole(), "7", 7, ["-1", "1.5", "", "x", str(2**63)]),
        (seconds, "0.5", 0.5, ["0", "-1", "nan", "inf", "x", ""]),
        (number(1.0, 2.0, "m"), "1.5", 1.5, ["0.9", "2.1", "nan", "x"]),
        (several(whole(0, 9), "1,2"), "0,9", (0, 9), ["", "1,", "1,10", "x"]),
        (speed, "max", None, ["0.01", "inf", "nan", "fast"]),
    ],
)
def test_each_kind_of_value(parse: Any, good: str, value: object, bad: list[str]) -> None:
    assert parse(good) == value
    for text in bad:
        with pytest.raises(ArgumentTypeError, match=re.escape(repr(text.split(",")[-1]))):
            parse(text)


def test_a_result_goes_to_a_file_that_can_be_made() -> None:
    assert output_file("-") == "-"
    for text in ("no/such/file", "."):
        with pytest.raises(ArgumentTypeError, match=f"cannot write {re.escape(text)}"):
            output_file(text)


@pytest.mark.parametrize("kind", [FlyOptions, FswOptions])
def test_a_lambda_that_would_not_arm_is_refused_before_anything_starts(
    kind: type[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("paper-1", "paper-5"):
        assert "add --allow-inconsistent" in refused(kind, f"--lambda={name}", capsys=capsys)
        allowed = read(kind, "test", "Test.", [f"--lambda={name}", "--allow-inconsistent"])
        assert allowed.control.lambda_ == name
        # Another controller has no barrier.
        read(kind, "test", "Test.", [f"--lambda={name}", "--controller=hc"])


def test_a_word_too_many_is_no_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert "'extra' is one word too many" in refused(FlyOptions, "walls", "extra", capsys=capsys)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["n", "--loud=yes"], "test: --loud: takes no value; 'yes' was given\n"),
        (["n", "--count"], "test: --count: a value must follow it\n"),
        ([], "test: NAME must be given\n"),
        (["n", "--count=argument expected one argument"], "test: --count: 'argument expected"),
    ],
)
def test_what_is_missing_or_too_much_is_said_in_our_words(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert refused(Example, *words, capsys=capsys).startswith(sentence)


@dataclass(frozen=True, slots=True, kw_only=True)
class Several:
    names: tuple[str, ...] = option("--name N", "names", str, default=(), repeated=True)


@given(st.lists(st.text(st.characters(categories=["L"]), min_size=1), max_size=4))
def test_an_option_that_may_be_given_again_keeps_all(names: list[str]) -> None:
    value = Several(names=tuple(names))
    assert read(Several, "test", "Test.", as_words(value)) == value


@pytest.mark.parametrize(
    ("kind", "old", "new", "words"),
    [
        (ReproduceOptions, "--suite=mocap", "--sensors=mocap", ["robustness"]),
        (ReportOptions, "--out=a.html", "--html=a.html", ["log"]),
        (CertifyOptions, "--out=a.html", "--html=a.html", ["folder"]),
        (DialectOptions, "--to=a", "--out=a", ["xml"]),
    ],
)
def test_names_of_the_last_release_still_work(
    kind: type[Any], old: str, new: str, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert read(kind, "test", "Test.", [*words, old]) == read(kind, "test", "Test.", [*words, new])
    said = capsys.readouterr().err
    assert f"{old.partition('=')[0]} is now {new.partition('=')[0]};" in said
    assert len(said.splitlines()) == 1


def test_of_many_names_none_is_listed_where_none_is_like_it() -> None:
    many = [f"PID_{k:03}" for k in range(200)]
    assert unknown_name("parameter", "PID007", many).endswith("did you mean PID_007?")
    assert len(unknown_name("parameter", "nothing", many)) < 100
    assert unknown_name("verb", "nothing", ["fly", "view"]).endswith("known: fly, view")


def test_numerics_have_one_thread_before_a_verb_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    """NumPy's own would spin when ``pandion fly`` looks for processors that are idle."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    threads = []

    def load(_: str) -> SimpleNamespace:
        threads.append(os.environ["OPENBLAS_NUM_THREADS"])
        return SimpleNamespace(main=lambda _: 0)

    monkeypatch.setattr("pandion.__main__.import_module", load)
    assert pandion_main.main(["fly"]) == 0
    assert threads == ["1"]
