"""``pandion certify``: readers that leave, rows of others, certificates that are none."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

from command_line.output import print_error
from command_line.version import version
from pandion.campaign import main as campaign
from pandion.certify import main
from studies.campaign.journal import Journal
from studies.campaign.page import page as campaign_page
from studies.campaign.plan import load_plan
from studies.campaign.store import FACTS, JOURNAL, begin, read
from studies.search.tune import EXAMPLE
from studies.statistics.certificate import certificate, digest
from tests.cli.command import one_sentence
from tests.studies.campaign.test_store import FILE, begun, put, seal, write_anew


@pytest.mark.long
def test_a_reader_that_leaves_is_nothing_to_complain_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(BrokenPipeError):
        print_error("pandion certify", BrokenPipeError(32, "Broken pipe"))
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
    assert "every number must be finite" in capsys.readouterr().err


def test_a_damaged_row_is_told_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(4))
    journal = directory / JOURNAL
    journal.write_text(journal.read_text().replace('"margin_m": 0.1', '"margin_m": 1e999', 1))
    assert main([str(directory)]) == 2
    assert "journal.jsonl, line 1 is none that" in capsys.readouterr().err


def small(folder: Path, seed: int = 0) -> tuple[Path, list[bytes]]:
    """The directory of a campaign of four whole flights of a tenth of a second, and its journal."""
    source, directory = folder / "tiny.toml", folder / f"of-{seed}"
    folder.mkdir(exist_ok=True)
    source.write_text(FILE.replace("duration_s = 2.0", f"duration_s = 0.1\nseed = {seed}"))
    assert campaign([str(source), f"--out={directory}", "--workers=0"]) == 0
    return directory, (directory / JOURNAL).read_bytes().splitlines(keepends=True)


def one_refusal(directory: Path, capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The one sentence with which a certificate is refused."""
    capsys.readouterr()
    assert main([str(directory), *words, "--workers=0"]) != 0
    err = capsys.readouterr().err
    assert one_sentence(err), err
    return err


@pytest.mark.long
def test_a_campaign_that_is_not_as_it_was_flown_is_not_certified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    directory, kept = small(tmp_path)
    _, other = small(tmp_path, seed=1)
    journal = directory / JOURNAL
    assert main([str(directory)]) == 0
    rows = [json.loads(line) for line in kept]
    better = [json.dumps(row | {"margin_m": 9.9}).encode() + b"\n" for row in rows]
    for forged in (
        better,
        kept[::-1],
        kept[1:],
        [*kept, kept[0]],
        [*other[:1], *kept[1:]],
        [*kept[:3], other[3]],
        [*kept[:3], kept[3][:-10]],
        [*kept, b"x" * (1 << 22)],
    ):
        journal.write_bytes(b"".join(forged))
        assert "journal.jsonl, line " in one_refusal(directory, capsys)
    # Whole lines that are missing at the end, and another journal that verifies by itself.
    for forged in (kept[:3], other, []):
        journal.write_bytes(b"".join(forged))
        assert "which are not the 4 that campaign.json was" in one_refusal(directory, capsys)
    journal.unlink()
    (tmp_path / "elsewhere").write_bytes(b"".join(kept))
    journal.symlink_to(tmp_path / "elsewhere")
    assert "it is a symbolic link" in one_refusal(directory, capsys)
    journal.unlink()
    journal.write_bytes(b"".join(kept))
    assert main([str(directory)]) == 0


@pytest.mark.long
def test_a_row_that_was_forged_with_its_digests_is_found_by_flying_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    directory, kept = small(tmp_path)
    assert main([str(directory), "--refly=9", "--workers=0"]) == 0
    assert "4 flights flown again, each as its row says: 0, 1, 2, 3" in capsys.readouterr().out
    # Whoever knows how a chain is made can write another one.
    rows = [json.loads(line) for line in kept]
    rows[2]["te_m"] *= 1.0 + 1e-9
    (directory / JOURNAL).unlink()
    journal = Journal(directory / JOURNAL)
    for row in rows:
        del row["digest"]
        journal.append([(row.pop("key"), row)])
    journal.close()
    seal(directory)
    assert main([str(directory)]) == 0, "digests do not show who wrote it"
    (directory / "certificate.html").unlink()
    capsys.readouterr()
    assert main([str(directory), "--refly=4", "--workers=0"]) == 1
    assert "flight 2 does not fly as its row says: te_m is" in capsys.readouterr().out
    assert not (directory / "certificate.html").exists()


def test_flights_of_other_code_are_not_flown_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    directory, _ = small(tmp_path)
    facts = json.loads((directory / FACTS).read_text())
    facts["digests"]["packages"] = "0" * 32
    write_anew(directory, **facts)
    assert main([str(directory)]) == 0
    assert "was flown by other packages (00000000" in one_refusal(directory, capsys, "--refly=1")


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


def required(tmp_path: Path, *texts: str, **changed: object) -> tuple[int, Path]:
    """The exit code of a certificate that requires something, and the campaign's directory."""
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(4), **changed)
    return main([str(directory), *(f"--require={text}" for text in texts)]), directory


def test_a_requirement_decides_the_exit_code_and_is_in_the_certificate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, directory = required(tmp_path, "margin>=0.01", "p<0.9@90%")
    assert code == 0
    said = capsys.readouterr().out
    assert "met: margin>=0.01; minimum margin 0.1000 m, flight 0" in said
    page = (directory / "certificate.html").read_text(encoding="utf-8")
    assert page.count(">PASS<") == 2
    assert main([str(directory), "--verify", str(directory / "certificate.html")]) == 0
    assert main([str(directory), "--require=p<0.01@95%"]) == 1
    assert "NOT met: p<0.01@95%; 0 of 4 flights, at most 0.527 at 95 %" in capsys.readouterr().out
    assert main([str(directory), "--verify", str(directory / "certificate.html")]) == 0


def test_a_requirement_is_not_met_by_flights_that_prove_nothing(tmp_path: Path) -> None:
    source, directory = tmp_path / "small.toml", tmp_path / "out"
    source.write_text('design = "sobol"\n' + FILE, encoding="utf-8")
    plan = load_plan(source)
    begin(directory, source, plan, 4)
    put(directory, plan, range(4))
    assert main([str(directory), "--require=p<0.9@60%"]) == 1
    assert main([str(directory), "--require=margin>=0.01"]) == 0


@pytest.mark.parametrize("text", ["p>0.1", "speed<3", "margin", "p<0.\u0661", "p<1e", "p<1@9.9.9%"])
def test_what_is_no_requirement_is_refused(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path), f"--require={text}"])
    assert ended.value.code == 2
    assert one_sentence(capsys.readouterr().err)


def test_a_changed_requirement_of_a_certificate_is_seen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, directory = required(tmp_path, "p<0.01")
    page = directory / "certificate.html"
    text = page.read_text(encoding="utf-8")
    changed = text.replace('"text":"p\\u003c0.01"', '"text":"p\\u003c0.9"')
    assert changed != text
    page.write_text(changed, encoding="utf-8")
    assert main([str(directory), "--verify", str(page)]) == 1
    assert "its digest is not that of its statement" in capsys.readouterr().out
    page.write_text(text.replace('"text":"p\\u003c0.01"', '"text":7'), encoding="utf-8")
    assert main([str(directory), "--verify", str(page)]) == 2


@pytest.mark.parametrize(
    ("shown", "forged"),
    [
        ("<b>0 of 4", "<b>NO VIOLATION IS POSSIBLE. 0 of 4"),
        ("at most", "surely below"),
        ("52.7 %", "0.01 %"),
        ("<path fill=", "<path hidden fill="),
        ("</style>", "ul { display: none }</style>"),
        ("DIR --verify", "ELSEWHERE --verify"),
        ("</html>\n", "</html>\n<script>document.body.textContent = 'SAFE'</script>\n"),
    ],
)
def test_a_page_on_which_anything_was_changed_is_refused(
    shown: str, forged: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, directory = required(tmp_path)
    page = directory / "certificate.html"
    assert main([str(directory), f"--verify={page}"]) == 0
    text = page.read_text(encoding="utf-8")
    assert shown in text
    page.write_text(text.replace(shown, forged), encoding="utf-8")
    capsys.readouterr()
    assert main([str(directory), f"--verify={page}"]) == 1
    said = capsys.readouterr().out
    assert "of the page is not as it is written for its statement" in said
    assert "is what" not in said


def test_a_page_is_the_same_without_a_drawing_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, directory = required(tmp_path)
    page = directory / "certificate.html"
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") == 1
    assert "+100.0 mm" in text
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main([str(directory), f"--verify={page}"]) == 0


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("confidence", "high", "must be a number from 0.5 to 0.999999"),
        ("confidence", 1, "must be a number from"),
        ("confidence", 0.9999999, "must be a number from"),
        ("refits", True, "must be a whole number from 1 to 100000"),
        ("refits", 0, "must be a whole number from"),
        ("required", 7, "must be an array of objects"),
        ("required", [7], "must be an array of objects"),
        ("required", [{"text": 7}], "must be an array of objects"),
        ("required", {"a": 1}, "must be an array of objects"),
        ("required", [{"text": "speed<3"}], "'speed<3' is no requirement; write p<0.01@95%"),
        ("format", ["pandion-certificate-3"], "holds no certificate of this version"),
    ],
)
def test_a_certificate_with_another_type_of_value_is_refused_in_a_sentence(
    key: str, value: object, allowed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, directory = required(tmp_path)
    stated = certificate(read(directory), directory, 0.95)
    kept = tmp_path / "kept.json"
    kept.write_text(json.dumps(stated | {key: value}))
    assert allowed in one_refusal(directory, capsys, f"--verify={kept}")


@pytest.mark.parametrize("value", [None, 7, "seven", [7], {"a": 7}])
def test_a_value_of_any_type_in_any_other_place_is_a_difference(
    value: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, directory = required(tmp_path)
    stated = certificate(read(directory), directory, 0.95)
    kept = tmp_path / "kept.json"
    for key in sorted(stated.keys() - {"confidence", "refits", "format"}):
        kept.write_text(json.dumps(stated | {key: value}))
        capsys.readouterr()
        assert main([str(directory), f"--verify={kept}"]) == 1
        assert f"{key}" in capsys.readouterr().out


def test_a_certificate_with_a_name_twice_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, directory = required(tmp_path)
    kept = tmp_path / "kept.json"
    assert main([str(directory), f"--json={kept}"]) == 0
    text = kept.read_text()
    kept.write_text(text.replace('"flights": 4,', '"flights": 6000, "flights": 4,', 1))
    said = one_refusal(directory, capsys, f"--verify={kept}")
    assert "it has 'flights' 2 times in one object: leave one" in said


def test_the_version_that_flew_is_known_by_the_code_alone(tmp_path: Path) -> None:
    _, directory = required(tmp_path)
    write_anew(directory, version="9.9.9-certified-by-TUV")
    stated = certificate(read(directory), directory, 0.95)
    assert stated["versions"] == {"flown": version(), "certified": version()}
    other = replace(read(directory), digests=replace(read(directory).digests, code="a" * 64))
    stated = certificate(other, directory, 0.95)
    assert stated["versions"]["flown"] == "not known: by other code"


def test_a_certificate_says_the_same_of_a_directory_that_was_moved(tmp_path: Path) -> None:
    _, directory = required(tmp_path)
    moved = directory.rename(tmp_path / "moved")
    assert main([str(moved), f"--verify={moved / 'certificate.html'}"]) == 0
