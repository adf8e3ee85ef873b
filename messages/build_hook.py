"""Build hook of hatchling: generates the dialect before a wheel or an editable install is made."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class DialectBuildHook(BuildHookInterface):  # type: ignore[type-arg]  # it has no configuration
    """Writes ``messages/dialect.py``, which git ignores and the wheel carries."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Generate the module; `version` and `build_data` are hatchling's and stay as they are."""
        # The project is not importable while it is being built: load the generator by its path.
        path = Path(self.root, "messages", "generate.py")
        spec = spec_from_file_location("messages_generate", path)
        if spec is None or spec.loader is None:
            raise RuntimeError(f"cannot load the dialect generator {path.name}")
        generator = module_from_spec(spec)
        spec.loader.exec_module(generator)
        generator.generate()
