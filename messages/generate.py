"""Generate ``messages/dialect.py`` from ``pandion.xml`` with pymavlink's mavgen.

Run by the build hook for every wheel and editable install, and by hand after an edit of the XML:
``python -m messages.generate``. The definitions that the XML includes come from the installed
pymavlink, so the same pymavlink always gives the same bytes. The standard modes (AVAILABLE_MODES,
CURRENT_MODE), which MAVLink has in common.xml by now, still wait in pymavlink's development.xml:
the module carries that as well, what `upstream.xml` adds, and tests pin these messages.

At its end the module says how many fields of each message are extensions, which mavgen leaves out
and MAVLink 1, which has none, asks for.
"""

import contextlib
import io
import shutil
import sys
import tempfile
import xml.etree.ElementTree as ET
from importlib.util import find_spec
from pathlib import Path

DEFINITION = Path(__file__).with_name("pandion.xml")
GENERATED = Path(__file__).with_name("dialect.py")
_COMMON = "common.xml"
_DEVELOPMENT = "development.xml"
_UPSTREAM = Path(__file__).with_name("upstream.xml")


class GenerationError(RuntimeError):
    """mavgen refused the XML; the message carries what it printed."""


def generate(
    definition: Path = DEFINITION, destination: Path = GENERATED, language: str = "Python3"
) -> None:
    """Write what mavgen makes of a dialect in one of its one-file languages: Python3, WLua.

    The definition may include any that is shipped with pymavlink. The destination is replaced in
    one step, so that a reader never sees half of it.

    Raises:
        GenerationError: The XML is invalid or clashes with what it includes.
    """
    with tempfile.TemporaryDirectory(dir=destination.parent) as folder:
        # mavgen resolves includes beside the including file and takes the dialect's name from
        # the output, so both live in one folder under the name of the definition.
        for included in pymavlink_definitions().glob("*.xml"):
            shutil.copy(included, folder)
        source = Path(folder, definition.name)
        shutil.copy(definition, source)
        module = source.with_suffix(destination.suffix)
        upstream = Path(folder, _UPSTREAM.name)
        shutil.copy(_UPSTREAM, upstream)
        _extend(Path(folder, _COMMON), upstream)
        sources = [source, Path(folder, _DEVELOPMENT), upstream]
        _run_mavgen(sources, module, language)
        if language == "Python3":
            with module.open("a", encoding="utf-8") as file:
                file.write(f"\nEXTENSION_FIELDS = {_extension_fields(sources)}\n")
        module.replace(destination)


def pymavlink_definitions() -> Path:
    """The folder of the definitions that come with pymavlink.

    Raises:
        GenerationError: There is no pymavlink.
    """
    spec = find_spec("pymavlink")
    if spec is None or spec.origin is None:
        raise GenerationError("pymavlink is not installed; run `make setup`")
    return Path(spec.origin).parent / "dialects" / "v20"


def _extend(known: Path, upstream: Path) -> None:
    """Move the extension fields that ``upstream`` adds to messages of ``known`` over there."""
    known_tree, upstream_tree = ET.parse(known), ET.parse(upstream)
    by_id = {message.get("id"): message for message in known_tree.iter("message")}
    added = upstream_tree.find("messages")
    assert added is not None
    for message in list(added):
        old = by_id.get(message.get("id"))
        if old is None:
            continue
        if old.find("extensions") is None:
            old.append(ET.Element("extensions"))
        named = {field.get("name") for field in old.iter("field")}
        old.extend(field for field in message.iter("field") if field.get("name") not in named)
        added.remove(message)
    known_tree.write(known, encoding="utf-8")
    upstream_tree.write(upstream, encoding="utf-8")


def _extension_fields(sources: list[Path]) -> dict[int, int]:
    """Number of extension fields by message id, of every message that has some."""
    counts: dict[int, int] = {}
    waiting, seen = list(sources), set(sources)
    while waiting:
        tree = ET.parse(waiting.pop())
        for message in tree.iter("message"):
            tags = [child.tag for child in message]
            if "extensions" in tags:
                counts[int(message.get("id", ""))] = tags[tags.index("extensions") :].count("field")
        for include in tree.iter("include"):
            path = sources[0].with_name(include.text or "")
            if path not in seen:
                seen.add(path)
                waiting.append(path)
    return dict(sorted(counts.items()))


def _run_mavgen(sources: list[Path], module: Path, language: str) -> None:
    from pymavlink.generator import mavgen, mavparse

    options = mavgen.Opts(
        str(module), wire_protocol=mavparse.PROTOCOL_2_0, language=language, validate=True
    )
    chatter = io.StringIO()
    with contextlib.redirect_stdout(chatter), contextlib.redirect_stderr(chatter):
        try:
            accepted = mavgen.mavgen(options, [str(source) for source in sources])
        except SystemExit as refusal:  # mavgen's way to report an XML that breaks the schema
            accepted = False
            print(refusal.code, file=chatter)
        except (SyntaxError, FileNotFoundError) as refusal:  # not XML at all, or a missing include
            accepted = False
            print(refusal, file=chatter)
    if not accepted or not module.exists():
        raise GenerationError(f"mavgen refused {sources[0].name}:\n{chatter.getvalue().strip()}")


if __name__ == "__main__":
    try:
        generate()
    except GenerationError as error:
        sys.exit(str(error))
    print(f"generated {GENERATED.name} from {DEFINITION.name}")
