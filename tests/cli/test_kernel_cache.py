"""Where kernels are kept, when they are due, and what is said while they are compiled."""

from __future__ import annotations

from pathlib import Path

import pytest

import fsw.compiled
import sitl.compiled
from command_line.compile_progress import CompileProgress
from command_line.kernel_cache import KernelCache, kept_in, kernel_cache

NO_WAY_TO_WRITE = "command_line.kernel_cache.os.access"


def package(folder: Path) -> Path:
    """A package with two kernels."""
    made = folder / "law"
    made.mkdir(parents=True)
    (made / "compiled.py").write_text("def kernel(law): ...\n", encoding="utf-8")
    text = "from law.compiled import kernel\n@kernel\ndef a(): ...\n\n\n@kernel\ndef b(): ...\n"
    (made / "laws.py").write_text(text, encoding="utf-8")
    return made


def test_compiling_is_due_until_all_kernels_are_noted(tmp_path: Path) -> None:
    cache = KernelCache(tmp_path / "numba-0", 2, "numba-1")
    assert cache.is_due("blf")
    cache.note("blf")  # without a folder there can be none
    assert cache.is_due("blf")
    (tmp_path / "numba-0").mkdir()
    (tmp_path / "numba-0" / "some.nbi").touch()  # of a command that was interrupted
    assert cache.is_due("blf")
    cache.note("blf")
    assert not cache.is_due("blf")
    assert cache.is_due("sc"), "another controller has others"


def test_an_edit_of_a_kernel_and_another_place_of_the_checkout_have_other_folders(
    tmp_path: Path,
) -> None:
    made = package(tmp_path / "one")
    first = kernel_cache(made, "", "numba")
    assert (first.kernels, first.folder) == (2, kernel_cache(made, "", "numba").folder)
    (made / "unrelated.py").write_text("a = 1\n", encoding="utf-8")
    assert kernel_cache(made, "", "numba").folder == first.folder
    (made / "laws.py").write_text("from law.compiled import kernel\n", encoding="utf-8")
    assert kernel_cache(made, "", "numba").folder != first.folder
    moved = package(tmp_path / "two")
    folder = kernel_cache(moved, "", "numba").folder
    assert first.folder is not None
    assert folder is not None
    assert folder.name != first.folder.name
    assert not (moved / "__pycache__").exists(), "asking makes nothing"


def test_a_checkout_that_cannot_be_written_has_its_kernels_with_the_users_caches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = package(tmp_path / "checkout")
    closed = {made}
    monkeypatch.setattr(NO_WAY_TO_WRITE, lambda path, mode: path not in closed)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = kernel_cache(made, "", "numba").folder
    assert folder is not None
    assert folder.parent == tmp_path / "cache" / "pandion"
    closed.add(tmp_path)  # neither there
    nowhere = kernel_cache(made, "", "numba")
    assert nowhere.folder is None
    assert not nowhere.is_due("blf"), "a child would compile, or load, for nothing at every start"


def test_without_a_home_kernels_are_not_kept_and_nothing_is_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = package(tmp_path)
    monkeypatch.setattr(NO_WAY_TO_WRITE, lambda path, mode: False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)

    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", homeless)
    assert kernel_cache(made, "", "numba").folder is None


def test_the_number_of_kernels_is_that_of_what_numba_was_handed() -> None:
    for half, least in ((fsw.compiled, 50), (sitl.compiled, 50)):
        assert half.cache().kernels > least


def test_progress_counts_what_is_new_and_states_the_time_left(tmp_path: Path) -> None:
    now = [0.0]
    progress = CompileProgress(lambda: now[0])
    assert progress.look() is None, "nothing compiles"
    (tmp_path / "of_an_interrupted_start.nbi").touch()
    progress.add(tmp_path, 21)
    now[0] = 1.0
    assert progress.look() == (1, 21, "1 of 21 kernels")
    for number in range(10):
        (tmp_path / f"{number}.nbi").touch()
    assert progress.look() is None, "it looks at the disk twice a second at most"
    now[0] = 5.0
    assert progress.look() == (11, 21, "11 of 21 kernels, about 5 s left")
    progress.end()
    now[0] = 9.0
    assert progress.look() is None


def test_a_flight_with_every_kernel_on_disk_keeps_as_many_as_the_sources_have() -> None:
    """Nearly: a law or two is compiled for one controller only."""
    for half in (fsw.compiled, sitl.compiled):
        cache = half.cache()
        if cache.folder is not None and not cache.is_due("campaign"):
            assert kept_in(cache.folder) >= cache.kernels - 5
            # Tests and examples leave kernels of their own there.
            modules = {path.stem for path in Path(half.__file__).parent.rglob("*.py")}
            ours = [
                one for one in cache.folder.rglob("*.nbi") if one.name.partition(".")[0] in modules
            ]
            assert abs(len(ours) - cache.kernels) <= 5


def test_compiling_is_announced_with_its_kernels_and_where_they_can_be_watched(
    tmp_path: Path,
) -> None:
    said: list[tuple[str, str, dict[str, object]]] = []

    class Listener:
        def report(self, name: str, sentence: str, **details: object) -> None:
            said.append((name, sentence, details))

    KernelCache(tmp_path, 84, "numba").announce("fsw", Listener())
    KernelCache(None, 84, "numba").announce("fsw", Listener())
    assert said[0] == (
        "compiling", "fsw: compiling 84 kernels", {"kernels": 84, "folder": str(tmp_path)},
    )  # fmt: skip
    assert "nowhere can they be kept" in said[1][1]
    assert said[1][2]["folder"] is None
