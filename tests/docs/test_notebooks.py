"""The notebooks of the tutorials run from top to bottom, as a user would run them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.docs.fences import DOCS

FOLDER = DOCS / "tutorials" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def cells(notebook: Path) -> list[tuple[str, str]]:
    """Kind and text of each cell."""
    content = json.loads(notebook.read_text(encoding="utf-8"))
    assert (content["nbformat"], content["nbformat_minor"]) == (4, 5)
    return [(one["cell_type"], "".join(one["source"])) for one in content["cells"]]


@pytest.mark.long
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs(notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict[str, Any] = {"__name__": notebook.stem}
    for k, (kind, text) in enumerate(cells(notebook)):
        if kind == "code":
            exec(compile(text, f"{notebook.stem}, cell {k}", "exec"), names)


def test_the_page_lists_them_and_they_are_kept_without_outputs() -> None:
    page = (DOCS / "tutorials" / "notebooks.md").read_text(encoding="utf-8")
    for notebook in NOTEBOOKS:
        assert f"notebooks/{notebook.name}" in page
        content = json.loads(notebook.read_text(encoding="utf-8"))
        assert not any(one.get("outputs") for one in content["cells"])
        for kind, text in cells(notebook):
            if kind == "code":
                compile(text, notebook.stem, "exec")
