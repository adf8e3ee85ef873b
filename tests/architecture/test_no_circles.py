"""No module imports itself by way of others, not even inside a function or for types alone."""

from __future__ import annotations

from graphlib import TopologicalSorter

import grimp

PACKAGES = ("pandion", "fsw", "sitl", "messages", "command_line", "studies", "view", "benchmarks")


def test_no_module_imports_itself_by_way_of_others() -> None:
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    imports = {one: graph.find_modules_directly_imported_by(one) for one in graph.modules}
    assert len(imports) > 500
    TopologicalSorter(imports).prepare()
