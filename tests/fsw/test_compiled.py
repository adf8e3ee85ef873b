"""When a start compiles in a child."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsw import compiled


def test_compiling_is_due_until_kernels_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = tmp_path / "__pycache__" / "numba-0"
    monkeypatch.setattr(compiled, "_CACHE", str(cache))
    assert compiled.compiling_is_due()
    cache.mkdir(parents=True)
    assert not compiled.compiling_is_due()


def test_compiling_is_never_due_where_nothing_can_be_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A child would compile, or load, for nothing at every start."""
    monkeypatch.setattr(compiled, "_CACHE", str(tmp_path / "numba-0"))
    monkeypatch.setattr("os.access", lambda path, mode: False)
    assert not compiled.compiling_is_due()
