"""The page of vehicles names every one that comes with Pandion, with its mass."""

from __future__ import annotations

import re
from pathlib import Path

from vehicles.vehicle_file import load_vehicle, vehicle_names

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "vehicles.md"


def test_every_packaged_vehicle_has_its_row_with_its_mass() -> None:
    table = PAGE.read_text(encoding="utf-8").split("\n\n")[2]
    rows = dict(re.findall(r"^\| `([^`]+)` \| .*?(\d[\d.]*) kg", table, re.M))
    assert rows.keys() == {*vehicle_names()}
    for name, mass in rows.items():
        assert abs(load_vehicle(name).mass - float(mass)) < 0.006
