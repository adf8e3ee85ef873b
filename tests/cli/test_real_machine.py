"""What a user's machine brings does not break a start: shells, locales, homes, owners, copies."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from command_line import folders, revision
from command_line.output import print_anything
from fsw.link.ground_links import _key_file
from fsw.link.link_choice import LinkChoice
from fsw.link.signing.key_file import SigningKey
from pandion import dialect, health_checks
from pandion.display import Display

ROOT = Path(__file__).parents[2]
SHELL = {
    "PIP_USER": "1",
    "PIP_TARGET": "/nowhere",
    "PIP_REQUIRE_VIRTUALENV": "1",
    "PIP_INDEX_URL": "kept",
    "UV_SYSTEM_PYTHON": "1",
    "UV_DEFAULT_INDEX": "kept",
    "UV_INDEX_OURS_USERNAME": "kept",
    "PYTHONPATH": "/nowhere",
    "PYTHONHOME": "/nowhere",
    "PYTHONOPTIMIZE": "2",
    "PYTHONWARNINGS": "error",
    "PYTHONIOENCODING": "ascii",
    "VIRTUAL_ENV": "/nowhere",
}


def make(*words: str, cwd: Path = ROOT, **shell: str) -> str:
    done = subprocess.run(
        ["make", "--no-print-directory", *words],
        # Named, the index is not asked for: pip takes half a second to answer.
        cwd=cwd, env={**os.environ, "MAKEFLAGS": "", "UV_DEFAULT_INDEX": "kept", **shell},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_make_keeps_where_packages_come_from_and_nothing_else_that_a_shell_says() -> None:
    shown = make("-s", "--eval", "show: ; @env", "show", **SHELL).splitlines()
    seen = dict(line.split("=", 1) for line in shown if "=" in line)
    kept = {name for name in SHELL if name in seen}
    assert kept == {
        "PIP_INDEX_URL",
        "UV_DEFAULT_INDEX",
        "UV_INDEX_OURS_USERNAME",
        "PYTHONIOENCODING",
    }


# What uv does to folders; what it is asked is kept.
UV = """#!/bin/sh
echo "$@" >> {asked}
[ "$1" = --version ] && exit
[ "$1" = venv ] || exit 0
for folder in "$@"; do :; done
mkdir -p $folder/bin
ln -sf {python} $folder/bin/python
mkdir -p $folder/lib/python3/site-packages
touch $folder/lib/python3/site-packages/_pandion.pth
echo 'relocatable = true' > $folder/pyvenv.cfg
"""


def checkout(folder: Path, asked: Path) -> Path:
    """What make looks at, with a uv that installs nothing."""
    locks = (path.relative_to(ROOT).as_posix() for path in ROOT.glob("requirements*.lock"))
    for name in ("Makefile", "pyproject.toml", "messages/build_hook.py", *locks):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    for name in ("pandion.xml", "upstream.xml", "generate.py", "dialect.py"):
        (folder / "messages" / name).touch()
    (folder / ".boot").mkdir()
    (folder / ".boot" / "uv").write_text(
        UV.format(asked=asked, python=sys.executable), encoding="utf-8"
    )
    (folder / ".boot" / "uv").chmod(0o755)
    return folder


def created(asked: Path) -> int:
    """How often an environment was made."""
    return sum(line.startswith("venv") for line in asked.read_text(encoding="utf-8").splitlines())


def test_an_environment_is_ready_for_what_the_files_say_and_whatever_their_dates(
    tmp_path: Path,
) -> None:
    asked = tmp_path / "asked"
    one = checkout(tmp_path / "one", asked)
    make("setup", cwd=one)
    assert created(asked) == 1
    for name in ("requirements-dev.lock", "pyproject.toml", "Makefile"):
        (one / name).touch()
    make("setup", cwd=one)
    assert created(asked) == 1, "a date is no reason to install"
    with (one / "requirements-dev.lock").open("a", encoding="utf-8") as lock:
        lock.write("# another version\n")
    os.utime(one / "requirements-dev.lock", (0, 0))  # as a copy with its dates has it
    make("setup", cwd=one)
    assert created(asked) == 2
    lines = asked.read_text(encoding="utf-8").splitlines()
    assert all("--relocatable" in line for line in lines if line.startswith("venv"))
    path_file = one / ".venv" / "lib" / "python3" / "site-packages" / "_pandion.pth"
    assert not Path(path_file.read_text(encoding="utf-8").strip()).is_absolute()
    two = tmp_path / "two"
    one.rename(two)
    make("setup", cwd=two)
    assert created(asked) == 2, "an environment can be moved"
    (two / ".venv" / "bin" / "python").unlink()
    (two / ".venv" / "bin" / "python").symlink_to("/nowhere/python")  # the system has a newer one
    make("setup", cwd=two)
    assert created(asked) == 3


@pytest.fixture
def shell_of_ros(tmp_path: Path) -> dict[str, str]:
    """An environment whose PYTHONPATH brings modules of our names, and a plugin for pytest."""
    for name in ("messages", "numpy", "ros_plugin"):
        (tmp_path / f"{name}.py").write_text(f'raise SystemExit("{name} of ROS")\n', "utf-8")
    (tmp_path / "p-1.dist-info").mkdir()
    plugin = "[pytest11]\nros = ros_plugin\n"
    (tmp_path / "p-1.dist-info" / "entry_points.txt").write_text(plugin, "utf-8")
    metadata = "Metadata-Version: 2.1\nName: p\nVersion: 1\n"
    (tmp_path / "p-1.dist-info" / "METADATA").write_text(metadata, "utf-8")
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}


# What a verb imports, in its process and in one that it starts.
IMPORTS = """
import subprocess, sys
import pandion.__main__
import messages, numpy
code = "import messages, numpy, sitl; print(messages.__file__)"
subprocess.run([sys.executable, "-P", "-c", code], check=True)
print(messages.__file__)
"""


def test_modules_of_other_workspaces_are_not_taken_for_ours(
    shell_of_ros: dict[str, str], tmp_path: Path
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", IMPORTS],
        env=shell_of_ros, cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert {Path(line).parents[1] for line in done.stdout.splitlines()} == {ROOT}


def test_plugins_of_other_workspaces_are_not_loaded(shell_of_ros: dict[str, str]) -> None:
    test = "tests/messages/test_busy_poll.py"
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "--collect-only", "-q", test],
        env=shell_of_ros, cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("encoding", ["ascii", "koi8-r", "iso-8859-1", "cp1252"])
def test_a_result_is_printed_whatever_the_terminal_shows(
    encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = io.BytesIO()
    stream = io.TextIOWrapper(shown, encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stream)
    print_anything()
    display = Display(stream)
    display.say("✓ ready, ×19.3, λ ≥ 0.2, Größe, 漢字")
    result = {"completed": True, "end_reason": "flew 2.0 s – done", "logs": {}}
    display.result(result, [("minimum margin", "±1.0 mm …")], [("error", "±1.0 mm …")])
    stream.flush()
    text = shown.getvalue().decode(encoding)
    assert "ready" in text
    assert "PASS" in text
    assert "??" in text, "each sign without a plain form is one question mark"
    if encoding == "ascii":
        assert "+ ready, x19.3, lambda >= 0.2, Grosse, ??" in text


def no_home(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", homeless)
    for name in ("XDG_STATE_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)


def test_without_a_home_links_are_open_and_no_key_can_be_set(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    no_home(monkeypatch)
    keys = _key_file(LinkChoice(), "gcs")
    assert keys.read(0) is None
    with pytest.raises(OSError, match="no home directory") as refused:
        keys.write(SigningKey(bytes(32), 0))
    assert refused.value.strerror  # what the operator is told
    keys.remove()
    keys.close()
    kept = _key_file(LinkChoice(keys=tmp_path), "gcs")
    kept.write(SigningKey(bytes(range(32)), 0))
    kept.close()
    assert (tmp_path / "signing-gcs.json").exists()


def test_without_a_home_a_sentence_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    no_home(monkeypatch)
    for what in ("install", "wireshark"):
        assert dialect.main([what]) != 0
        assert capsys.readouterr().err == (
            "pandion dialect: this user has no home directory; set HOME\n"
        )
    found = health_checks.home()
    assert found.state == health_checks.WARN
    assert "no home directory" in found.found


def test_a_relative_folder_of_the_specification_is_ignored(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", "state")
    assert folders.state_folder() == tmp_path / ".local" / "state" / "pandion"
    monkeypatch.setenv("XDG_STATE_HOME", "/var/state")
    assert folders.state_folder() == Path("/var/state/pandion")


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a repository")
def test_the_commit_of_another_users_checkout_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    ours = revision.revision()
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")
    assert revision.revision() == ours
    assert len(ours.partition("-")[0]) == 40


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a repository")
def test_the_commit_is_that_of_this_checkout_in_a_hook_of_another_repository(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    ours = revision.revision()
    subprocess.run(["git", "init", "--quiet", str(tmp_path)], check=True)
    monkeypatch.setenv("GIT_DIR", str(tmp_path / ".git"))
    monkeypatch.setenv("GIT_INDEX_FILE", str(tmp_path / ".git" / "index"))
    assert revision.revision() == ours


def test_a_commit_that_cannot_be_read_is_said_to_be_unknown(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / ".git").mkdir()
    monkeypatch.setattr(revision, "_SOURCE", tmp_path)
    said = revision.revision()
    assert "commit unknown: fatal: not a git repository" in said
    assert "\n" not in said
    monkeypatch.setenv("PATH", "/nowhere")
    assert "commit unknown" in revision.revision()
    assert health_checks.code().state == health_checks.WARN


def test_modules_from_two_places_are_found(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert health_checks.modules().state == health_checks.OK
    monkeypatch.setattr(
        health_checks, "_found", lambda name: tmp_path if name == "messages" else ROOT
    )
    found = health_checks.modules()
    assert found.state == health_checks.FAIL
    assert str(tmp_path) in found.found


HOSTILE = {"PIP_USER": "1", "PIP_TARGET": "/nowhere", "LC_ALL": "ru_RU.KOI8-R"}


@pytest.mark.long
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a repository")
def test_a_fresh_clone_is_set_up_flies_and_tests_on_a_real_machine(
    shell_of_ros: dict[str, str], tmp_path: Path
) -> None:
    """Under another user's habits, then moved, then copied and changed."""
    locales = tmp_path / "locales"
    locales.mkdir()
    localedef = ["localedef", "-i", "ru_RU", "-f", "KOI8-R", str(locales / "ru_RU.KOI8-R")]
    if shutil.which("localedef") is not None:
        subprocess.run(localedef, check=False, capture_output=True)
    shell = {**shell_of_ros, **HOSTILE, "LOCPATH": str(locales)}
    # Without this checkout: the clone is to find its own code.
    shell["PYTHONPATH"] = shell["PYTHONPATH"].partition(os.pathsep)[0]
    for name in ("HOME", "MAKEFLAGS", "MAKELEVEL"):  # the last two of a make that runs this test
        shell.pop(name, None)
    clone, moved, copy = (tmp_path / name for name in ("clone", "moved", "copy"))
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)

    def run(*words: str, cwd: Path, fails: bool = False) -> str:
        done = subprocess.run(
            words, cwd=cwd, env=shell, capture_output=True, encoding="koi8-r", check=False
        )
        assert (done.returncode != 0) == fails, done.stdout + done.stderr
        return done.stdout + done.stderr

    flight = ("fly", "walls-calm", "--duration", "1", "--out")
    run("make", "setup", cwd=clone)
    assert "PASS" in run(".venv/bin/pandion", *flight, "one", cwd=clone)
    clone.rename(moved)
    assert run("make", "setup", cwd=moved) == "setup: .venv is ready\n"
    assert "PASS" in run(".venv/bin/pandion", *flight, "two", cwd=moved)
    tests = run(
        "make", "-s", "--eval", "part: ; @$(call check,part,$(BIN)/pytest tests/messages)", "part",
        cwd=moved,
    )  # fmt: skip
    assert "passed" in tests
    shutil.copytree(moved, copy, symlinks=True)
    (copy / "pandion" / "fly.py").write_text('raise SystemExit("changed")\n', "utf-8")
    assert "changed" in run(".venv/bin/pandion", *flight, "three", cwd=copy, fails=True)
