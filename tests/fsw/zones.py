"""Zones of one kind, for tests that know how many there must be."""

from __future__ import annotations

from fsw.autopilot.signals import SafeSet, Zone


def walls_of(safe_set: SafeSet) -> tuple[Zone, ...]:
    return of_kind(safe_set, "half-space")


def of_kind(safe_set: SafeSet, kind: str) -> tuple[Zone, ...]:
    return tuple(zone for zone in safe_set.zones if zone.shape.kind == kind)
