"""The JSON files that a flight leaves beside its log, as far as a page uses them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from command_line.bounded_json import JsonError, read_json

_MAX_BYTES: Final = 16 * 1024 * 1024  # of a file
_NUMBER: Final = (int, float)
_MAYBE_NUMBER: Final = (int, float, type(None))
_WORDS: Final = {
    str: "a text",
    int: "a number",
    float: "a number",
    bool: "true or false",
    list: "a list",
}


class _Each(NamedTuple):
    """An object of any keys whose values are alike."""

    value: Any


class _Needed(NamedTuple):
    """An object that must have all of these keys, not only no wrong one."""

    keys: Mapping[str, Any]


# Types of a value, an object of known keys, or one of the above. Keys that are not here are of no
# use to a page; one that is missing is as after no flight.
_SUMS: Final = {"sum": _NUMBER, "mean": _NUMBER}
_LIMIT: Final = _Needed(
    {
        "unit": (str,),
        "most": _NUMBER,
        "largest": _NUMBER,
        "at_s": _NUMBER,
        "beyond_s": _NUMBER,
        "kept": (bool,),
    }
)
_TIMES: Final = {"p50_us": _MAYBE_NUMBER, "p99_us": _MAYBE_NUMBER, "max_us": _MAYBE_NUMBER}
_INNER: Final = {
    "p50_us": _MAYBE_NUMBER,
    "p99_us": _MAYBE_NUMBER,
    "late_share": _MAYBE_NUMBER,
}
_COUNT: Final = (int, type(None))
_SHAPES: Final[Mapping[str, Mapping[str, Any]]] = {
    "result": {
        "vehicle": (str, type(None)),
        "sensors": (str, type(None)),
        "duration_s": _NUMBER,
        "completed": (bool,),
        "end_reason": (str,),
        "tracking_error_rms_m": _MAYBE_NUMBER,
        "control_effort": _SUMS,
        "control_smoothness": _SUMS,
        "margins_m": _Each(_NUMBER),
        "min_margin_m": _MAYBE_NUMBER,
        "limits": _Each(_LIMIT),
        "surfaces_m": _Each(_NUMBER),
        "beyond_s": _Each(_NUMBER),
        "safety": {"breaches": _COUNT, "departures": _COUNT, "interventions": _COUNT},
        "mpc": {**_TIMES, "missed_deadlines": _COUNT, "fallbacks": _COUNT},
        "inner": _INNER,
        "real_time_factor": _NUMBER,
        "unwritten": (list,),
    },
    "sitl": {
        "min_margin_m": _MAYBE_NUMBER,
        "min_margin_time_s": _MAYBE_NUMBER,
        "min_margin_key": (str, type(None)),
        "tracking_error_max_m": _MAYBE_NUMBER,
    },
    "fsw": {
        "mpc": _TIMES,
        "stages": _Each(_Needed({"p50_us": _NUMBER, "p99_us": _NUMBER, "max_us": _NUMBER})),
    },
}
_TOGETHER: Final = {
    "result": (("mpc", tuple(_TIMES)), ("inner", tuple(_INNER))),
    "sitl": (("", ("min_margin_m", "min_margin_time_s", "min_margin_key")),),
    "fsw": (("mpc", tuple(_TIMES)),),
}


def results_beside(log: Path) -> tuple[dict[str, Any], tuple[str, ...]]:
    """``result.json``, ``sitl.json`` and ``fsw.json`` by stem, and why others cannot be used."""
    found, refused = dict[str, Any](), list[str]()
    for stem, shape in _SHAPES.items():
        path = log.parent / f"{stem}.json"
        try:
            read = read_json(path, _MAX_BYTES)
            _check(read, shape, "")
            for inside, keys in _TOGETHER[stem]:
                _check_together(read.get(inside, {}) if inside else read, inside, keys)
        except FileNotFoundError:
            continue
        except JsonError as problem:
            refused.append(f"{path} {problem}")
        else:
            found[stem] = read
    return found, tuple(refused)


def _check(value: Any, shape: Any, name: str) -> None:
    """Refuse a value that no flight writes in its place."""
    if isinstance(shape, tuple) and not isinstance(shape, _Each | _Needed):
        if not isinstance(value, shape) or (isinstance(value, bool) and bool not in shape):
            raise JsonError(f"has a wrong value: {name} must be {_words(shape)}")
        return
    if not isinstance(value, dict):
        raise JsonError(f"has a wrong value: {name} must be an object")
    if isinstance(shape, _Each):
        for key, part in value.items():
            _check(part, shape.value, _dotted(name, key))
        return
    known = shape.keys if isinstance(shape, _Needed) else shape
    for key, inner in known.items():
        if key in value:
            _check(value[key], inner, _dotted(name, key))
        elif isinstance(shape, _Needed):
            raise JsonError(f"has no {_dotted(name, key)}: it is of another build, or damaged")


def _check_together(table: Mapping[str, Any], name: str, keys: tuple[str, ...]) -> None:
    """Refuse some of these values where the first is there and another is not."""
    if table.get(keys[0]) is not None:
        for key in keys:
            if table.get(key) is None:
                raise JsonError(f"has no {_dotted(name, key)}: it is of another build, or damaged")


def _dotted(name: str, key: str) -> str:
    return f"{name}.{key}" if name else key


def _words(shape: tuple[type, ...]) -> str:
    words = dict.fromkeys(_WORDS[kind] for kind in shape if kind in _WORDS)
    return " or ".join([*words, *(["null"] if type(None) in shape else [])])
