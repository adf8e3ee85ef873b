"""Quantities as the text of a table's cell; a dash where there is none."""

from __future__ import annotations


def degrees(value: float | None) -> str:
    """An angle ``value`` [deg] for a table."""
    return "–" if value is None else f"{value:.1f}"


def metres(value: float | None) -> str:
    """A length ``value`` [m] for a table."""
    return "–" if value is None else f"{value:.4f}"


def error_mm(value: float | None) -> str:
    """A tracking error ``value`` [m] for a table, in millimetres."""
    return "–" if value is None else f"{1000.0 * value:.1f}"


def millimetres(value: float | None) -> str:
    """A margin ``value`` [m] for a table, in millimetres and with its sign."""
    return "–" if value is None else f"{1000.0 * value:+.1f}"
