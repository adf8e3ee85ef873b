"""``pandion certify``: readers that leave, rows of others, certificates that are none."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from command_line.output import complain
from pandion.certify import main
from studies.campaign.page import page as campaign_page
from studies.campaign.store import JOURNAL, read
from studies.search.tune import EXAMPLE
from studies.statistics.certificate import certificate, digest
from tests.studies.campaign.test_store import begun, put


@pytest.mark.long
def test_a_reader_that_leaves_is_nothing_to_complain_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(BrokenPipeError):
        complain("pandion certify", BrokenPipeError(32, "Broken pipe"))
    assert capsys.readouterr().err == ""
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(4))
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-m", "pandion", "certify", str(directory)],
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
        timeout=120.0,
        check=False,
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, "")


def test_rows_of_another_command_are_named_and_change_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(4))
    before = certificate(read(directory), directory, 0.95)
    put(directory, plan, range(4), own_key="of pandion tune", contact=True)
    assert certificate(read(directory), directory, 0.95) == before
    assert main([str(directory)]) == 0
    assert "4 lines of journal.jsonl are not counted" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        ("pandion.tune", ["{example}"]),
        ("pandion.splitting", ["{file}"]),
        ("pandion.falsify", ["--over={file}"]),
        ("pandion.reproduce", ["table3"]),
    ],
)
def test_other_commands_leave_the_directory_of_a_campaign_alone(
    verb: str, words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, directory, plan = begun(tmp_path)
    put(directory, plan, range(4))
    before = {path.name: path.read_bytes() for path in directory.iterdir()}
    told = [word.format(example=EXAMPLE, file=file) for word in words]
    assert import_module(verb).main([*told, f"--out={directory}", "--workers=0"]) == 2
    assert "is the directory of a campaign; give another --out" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in directory.iterdir()} == before


@pytest.mark.parametrize("number", ["NaN", "1e999", "-Infinity"])
def test_a_certificate_with_numbers_that_are_none_is_refused(
    number: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(4))
    kept = tmp_path / "kept.json"
    assert main([str(directory), f"--json={kept}"]) == 0
    assert main([str(directory), f"--verify={kept}"]) == 0
    text = kept.read_text()
    assert '"flights": 4' in text
    kept.write_text(text.replace('"flights": 4', f'"flights": {number}', 1))
    capsys.readouterr()
    assert main([str(directory), f"--verify={kept}"]) == 2
    assert "a number is not finite" in capsys.readouterr().err


def test_a_damaged_row_is_told_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(4))
    journal = directory / JOURNAL
    journal.write_text(journal.read_text().replace('"margin_m": 0.1', '"margin_m": 1e999', 1))
    assert main([str(directory)]) == 2
    assert "1 of 4 flights have no row" in capsys.readouterr().err


@pytest.mark.parametrize("margin_m", [float("nan"), -1e308])
def test_a_margin_of_any_size_is_certified_and_not_drawn(margin_m: float, tmp_path: Path) -> None:
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(3))
    put(directory, plan, range(3, 4), margin_m=margin_m, te_m=1e308, completed=False)
    assert main([str(directory)]) == 0
    assert campaign_page(read(directory), (), directory).count("<svg") >= 1


def test_the_margin_of_a_flight_that_diverged_has_a_digest(tmp_path: Path) -> None:
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(3))
    put(directory, plan, range(3, 4), margin_m=float("nan"), completed=False)
    stated = certificate(read(directory), directory, 0.95)
    assert stated["flights"] == 4
    assert json.loads(json.dumps(stated, allow_nan=False)) == stated
    assert digest([0.1, float("nan")]) != digest([0.1, None])
