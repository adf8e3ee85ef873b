"""Sphinx: the site that ``make docs`` builds (docs/decisions/0022-documentation-site.md)."""

from __future__ import annotations

import json
import re
import site
import sys
import sysconfig
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

ROOT = Path(__file__).parents[1]
# The API pages import the code. What it needs is in .venv already; this environment is .docs.
INSTALLED = Path(sysconfig.get_path("purelib", vars={"base": str(ROOT / ".venv")}))
sys.path.insert(0, str(ROOT))
site.addsitedir(str(INSTALLED))

# A page each of the API; what is not there (yet) is left out.
API = {
    "fsw.autopilot.signals": "Values that cross a boundary of the flight software",
    "fsw.autopilot.ports": "Protocols that the loop uses",
    "fsw.autopilot.flight": "The autopilot: tick, state, commander, modes, failsafes",
    "fsw.autopilot.barriers": "Barrier functions",
    "fsw.autopilot.mpc": "The model predictive controller",
    "fsw.autopilot.control": "The 500 Hz laws",
    "fsw.autopilot.model": "Kinematics, dynamics and prediction model of the vehicle",
    "fsw.autopilot.estimation": "From sensors to the state estimate",
    "fsw.autopilot.geometry": "Rotations and map projection",
    "fsw.autopilot.parameters": "Configuration, parameters and the consistency check",
    "sitl.plant": "The simulated vehicle",
}

project = "Pandion"
author = copyright = "the Pandion authors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["images/*.md"]
html_theme = "furo"
html_title = "Pandion"
html_copy_source = False
html_show_sphinx = False
html_math_renderer = "mathml"

myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4

autodoc_default_options = {"members": True, "member-order": "bysource", "undoc-members": True}
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
add_module_names = False
# What has a page must resolve. Without a network there is no inventory of other projects, and of
# our own packages only those above have pages.
_PAGES = "|".join(re.escape(package) for package in API)
nitpick_ignore_regex = [
    (r"py:.*", rf"(?!({_PAGES})\.).*"),
    (r"py:.*", r".*\.[A-Z]"),  # type variables
]


def plain_math(_app: Sphinx, _name: str, source: list[str]) -> None:
    """GitHub's $`x`$, which protects mathematics from Markdown, is $x$ to MyST."""
    source[0] = re.sub(r"\$`(.+?)`\$", r"$\1$", source[0])


def absolute_values(
    _app: Sphinx, _what: str, _name: str, _object: object, _options: object, lines: list[str]
) -> None:
    """Docstrings write |x| for an absolute value, which is a substitution to reStructuredText."""
    if any(line.startswith(".. math::") for line in lines):
        return
    for k, line in enumerate(lines):
        if "`" not in line:
            lines[k] = line.replace(
                "|", "\N{DIVIDES}"
            )  # looks alike, as long: tables keep their shape


def inline_formula(writer: HTML5Translator, node: nodes.math) -> None:
    """A formula as MathML, which a browser draws without a script from a network."""
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def displayed_formula(writer: HTML5Translator, node: nodes.math_block) -> None:
    """The same on a line of its own."""
    writer.body.append(f'<div class="math">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


def write_api_pages(app: Sphinx) -> None:
    """One page a package, with all of its modules, so that a moved module needs no edit here."""
    folder = Path(app.srcdir) / "reference" / "api"
    folder.mkdir(exist_ok=True)
    for stale in folder.glob("*.md"):
        stale.unlink()
    for package, title in API.items():
        path = ROOT / package.replace(".", "/")
        files = sorted(path.rglob("*.py")) if path.is_dir() else [path.with_suffix(".py")]
        modules = [
            ".".join(file.relative_to(ROOT).with_suffix("").parts)
            for file in files
            if file.is_file() and file.stem != "__init__"
        ]
        sections = [
            f"## `{module}`\n\n```{{eval-rst}}\n.. automodule:: {module}\n```\n"
            for module in modules
        ]
        if modules:
            page = "\n".join([f"# {title}\n", *sections])
            (folder / f"{package}.md").write_text(page, encoding="utf-8")


def write_notebook_pages(app: Sphinx) -> None:
    """One page a notebook: its text, and its code as blocks."""
    folder = Path(app.srcdir) / "tutorials" / "notebooks"
    for notebook in folder.glob("*.ipynb"):
        parts = []
        for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
            text = "".join(cell["source"])
            parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
        notebook.with_suffix(".md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Hooks of this project."""
    app.connect("builder-inited", write_api_pages)
    app.connect("builder-inited", write_notebook_pages)
    app.connect("source-read", plain_math)
    app.connect("autodoc-process-docstring", absolute_values)
    app.add_html_math_renderer("mathml", (inline_formula, None), (displayed_formula, None))
