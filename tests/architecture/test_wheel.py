"""The wheel is complete: what an editable install finds in the tree, a user finds installed."""

import os
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = (
    *("pandion", "fsw", "sitl", "vehicles"),
    *("messages", "command_line", "studies", "view"),
)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (built,) = folder.glob("pandion-*.whl")
    return built


@pytest.fixture(scope="module")
def wheel_names(wheel):
    with ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_the_wheel_carries_the_generated_dialect_and_its_definition(wheel_names):
    inside = {"pandion/packages/messages/dialect.py", "pandion/packages/messages/pandion.xml"}
    assert inside <= wheel_names


@pytest.mark.parametrize("package", PACKAGES)
def test_the_wheel_carries_every_module_and_scenario(wheel_names, package):
    files = {
        path.relative_to(ROOT).as_posix()
        for pattern in ("*.py", "*.toml")
        for path in (ROOT / package).rglob(pattern)
    }
    only_for_building = {"messages/build_hook.py"}
    assert files
    place = "" if package == "pandion" else "pandion/packages/"
    assert {f"{place}{name}" for name in files - only_for_building} <= wheel_names


def test_the_wheel_has_one_name_among_those_of_other_distributions(wheel_names):
    """A ``messages`` or a ``view`` of somebody else's would be overwritten, or overwrite ours."""
    tops = {name.split("/")[0] for name in wheel_names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"pandion", "pandion.pth"}
    assert {name.split("/")[2] for name in wheel_names if name.startswith("pandion/packages/")} == {
        *PACKAGES
    } - {"pandion"}


def test_an_installed_wheel_finds_its_packages_and_its_own_first(wheel, tmp_path):
    """Unpacked as pip does, in a folder that Python takes for one of packages."""
    site, foreign = tmp_path / "site", tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "messages.py").write_text('raise SystemExit("another one")\n', encoding="utf-8")
    with ZipFile(wheel) as archive:
        archive.extractall(site)
    code = (
        f"import site, sys; sys.path[:] = [p for p in sys.path if p != {str(ROOT)!r}]; "
        f"site.addsitedir({str(site)!r}); sys.path.insert(0, {str(foreign)!r}); "
        "import pandion.__main__, messages.dialect, sitl; "
        "print(messages.dialect.__file__, sitl.__file__, sep='\\n')"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env={**os.environ, "PYTHONPATH": str(foreign)}, cwd=tmp_path, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    inside = site / "pandion" / "packages"
    assert {Path(line).parents[1] for line in done.stdout.splitlines()} == {inside}
