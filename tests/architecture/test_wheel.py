"""The wheel is complete: what an editable install finds in the tree, a user finds installed."""

import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("pandion", "fsw", "sitl", "messages", "command_line", "studies", "view")


@pytest.fixture(scope="module")
def wheel_names(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("pandion-*.whl")
    with ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_the_wheel_carries_the_generated_dialect_and_its_definition(wheel_names):
    assert {"messages/dialect.py", "messages/pandion.xml"} <= wheel_names


@pytest.mark.parametrize("package", PACKAGES)
def test_the_wheel_carries_every_module_and_scenario(wheel_names, package):
    files = {
        path.relative_to(ROOT).as_posix()
        for pattern in ("*.py", "*.toml")
        for path in (ROOT / package).rglob(pattern)
    }
    only_for_building = {"messages/build_hook.py"}
    assert files
    assert files - only_for_building <= wheel_names


def test_the_wheel_carries_no_tests(wheel_names):
    tops = {name.split("/")[0] for name in wheel_names}
    assert {top for top in tops if not top.endswith(".dist-info")} == set(PACKAGES)
