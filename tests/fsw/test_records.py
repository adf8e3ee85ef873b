"""Records, and what of numba they rely on beside its documentation."""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from fsw.compiled import compilable, kernel
from fsw.record import JOINTS, PerJoint, Record, Three


class Joints(Record):
    momentum: PerJoint  # N m s
    turns: int


class Vehicle(Record):
    p: Three  # m
    mass: float  # kg
    joints: Joints


@compilable
def push(r: Vehicle, by: float) -> None:
    for i in range(len(r.joints.momentum)):
        r.joints.momentum[i] += by * (i + 1.0)
    r.joints.turns += 3
    r.mass = math.sqrt(r.mass) + r.p[2]


@kernel
def pushed(vehicles: Any, by: float) -> None:
    push(vehicles[0], by)


def some() -> Vehicle:
    one = Vehicle()
    one.p = (1.0, 2.0, 3.0)  # type: ignore[assignment]
    one.mass, one.joints.turns = 2.0, 2**53 + 1
    one.joints.momentum[1] = 0.25
    return one


def test_a_law_does_in_python_what_it_does_as_machine_code() -> None:
    plain, ours = some(), some()
    push(plain, 0.1)
    pushed(ours.array, 0.1)
    assert plain == ours
    assert ours.mass == math.sqrt(2.0) + 3.0
    assert ours.joints.turns == 2**53 + 4
    assert ours.joints.momentum.tolist() == [
        0.1 * (i + 1.0) + 0.25 * (i == 1) for i in range(JOINTS)
    ]


def test_a_copy_has_the_same_numbers_and_memory_of_its_own() -> None:
    one = some()
    for other in (one.copy(), pickle.loads(pickle.dumps(one))):
        assert other == one
        other.joints.momentum[0] = 7.0
        assert other != one
        other.joints = one.joints
        assert other == one
        assert other.joints.momentum is not one.joints.momentum
    assert "joints=Joints(momentum=array([0.  , 0.25" in repr(one)


def test_the_layout_is_what_the_annotations_say() -> None:
    assert Vehicle.dtype.names == ("p", "mass", "joints")
    assert Vehicle.size == 3 + 1 + JOINTS + 1
    assert Vehicle.dtype["joints"] == Joints.dtype
    assert Joints.dtype["turns"] == np.int64


# ---------------------------------------------------------------- what numba is relied on for


def test_kernels_make_no_array_and_no_slice() -> None:
    """``_nrt=False``: what would need memory of its own does not compile."""

    @kernel
    def makes(x: Any) -> float:
        return float(np.empty(3)[0] + x[0])

    with pytest.raises(numba.TypingError, match="built-in function empty"):
        makes(np.zeros(3))


def test_the_size_of_an_array_in_a_record_is_a_constant() -> None:
    """So loops over joints cost what the joints written out cost: none is left after compiling."""

    @kernel
    def total(vehicles: Any) -> float:
        so_far = 0.0
        for i in range(len(vehicles[0].joints.momentum)):
            so_far += vehicles[0].joints.momentum[i]
        return so_far

    assert total(some().array) == 0.25
    total.recompile()  # type: ignore[attr-defined]  # its text is not on disk
    ((text,),) = [list(total.inspect_llvm().values())]  # type: ignore[attr-defined]
    body = text.split("define")[1].split("\n}")[0]
    assert body.count("fadd") == JOINTS
    assert " br " not in body


def test_a_longer_record_is_refused_where_a_shorter_one_was_compiled() -> None:
    short = np.zeros(1, np.dtype([("a", float)]))
    longer = np.zeros(1, np.dtype([("a", float), ("b", float)]))

    @numba.njit  # type: ignore[untyped-decorator]
    def first(record: Any) -> float:
        return float(record.a)

    assert first(short[0]) == 0.0
    first.disable_compile()  # what there is has to do
    with pytest.raises(TypeError, match="No matching definition"):
        first(longer[0])


_INTERLEAVED = """
import sys
import numpy as np
from {door}.compiled import kernel

A = np.dtype([("x", float), ("y", float)])
B = np.dtype([("y", float), ("x", float)])

@kernel
def inner(record):
    total = 0.0
    for k in range(40):  # too long to be taken into its caller
        total += record.x
    for k in range(int(record.x)):
        total = total * 1.0 + np.sin(record.y) * 0.0
    return total

@kernel
def outer(records):
    return inner(records[0]) + records[0].x

for layout in sys.argv[1]:
    record = np.zeros(1, dict(A=A, B=B)[layout])
    record["x"], record["y"] = 1.0, 7.0
    print(layout, outer(record))
"""


@pytest.mark.long
@pytest.mark.parametrize("door", ["fsw", "sitl"])
def test_two_layouts_from_two_processes_do_not_run_each_others_code(
    tmp_path: Path, door: str
) -> None:
    program = tmp_path / "interleaved.py"
    program.write_text(_INTERLEAVED.format(door=door))
    kept = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    kept["PYTHONPATH"] = str(Path(__file__).parents[2])
    said = []
    for layouts in ("A", "BA", "AB"):
        ran = subprocess.run(
            [sys.executable, str(program), layouts],
            env=kept,
            capture_output=True,
            text=True,
            check=True,
        )
        said += ran.stdout.splitlines()
    assert said == [f"{layout} 41.0" for layout in "ABAAB"]
