"""What the paper prints: Tables III and IV."""

from __future__ import annotations

from typing import Any, NamedTuple

HEADERS = ("paper TE m", "paper c_s", "paper c_e")


class Completion(NamedTuple):
    """One cell block of Table IV."""

    completed: bool
    te_m: float
    cs: float
    ce: float


class Ablation(NamedTuple):
    """One column of Table III."""

    tc_s: float
    te_m: float
    cs: float
    ce: float


Printed = Completion | Ablation


def as_json(kind: type[Printed], printed: Printed | None) -> dict[str, Any]:
    """What the paper prints, by name; null where it prints nothing."""
    names = [f"paper_{name}" for name in kind._fields]
    return dict(zip(names, printed or (None,) * len(names), strict=True))


def cells(printed: Printed | None) -> tuple[str, ...]:
    """The same for a table, under ``HEADERS``."""
    if printed is None:
        return ("–",) * len(HEADERS)
    return (f"{printed.te_m:.4f}", f"{printed.cs:.4f}", f"{printed.ce:.4f}")


# (controller, case, disturbance)
TABLE_4: dict[tuple[str, str, bool], Completion] = {
    ("naive", "I", False): Completion(False, 0.02432, 0.00557, 0.01427),
    ("naive", "II", False): Completion(False, 0.02429, 0.00612, 0.01489),
    ("hc", "I", False): Completion(False, 0.02657, 0.02880, 0.04787),
    ("hc", "II", False): Completion(False, 0.02386, 0.04981, 0.06572),
    ("sc", "I", False): Completion(True, 0.04482, 0.00443, 0.02326),
    ("sc", "II", False): Completion(False, 0.09731, 0.00698, 0.02229),
    ("blf", "I", False): Completion(True, 0.02629, 0.00732, 0.022771),
    ("blf", "II", False): Completion(True, 0.04750, 0.03212, 0.04531),
    ("naive", "I", True): Completion(False, 0.07366, 0.08933, 0.17720),
    ("naive", "II", True): Completion(False, 0.06735, 0.08942, 0.20924),
    ("hc", "I", True): Completion(False, 0.05430, 0.10546, 0.18921),
    ("hc", "II", True): Completion(False, 0.05490, 0.11304, 0.18301),
    ("sc", "I", True): Completion(False, 0.07708, 0.08933, 0.21039),
    ("sc", "II", True): Completion(False, 0.11384, 0.07915, 0.08328),
    ("blf", "I", True): Completion(True, 0.07164, 0.15592, 0.23040),
    ("blf", "II", True): Completion(True, 0.06589, 0.07720, 0.07887),
}

# (horizon, lambda)
TABLE_3: dict[tuple[int, float], Ablation] = {
    (1, 1.0): Ablation(0.0313, 0.1943, 0.1593, 0.1432),
    (1, 5.0): Ablation(0.0309, 0.1839, 0.1603, 0.1248),
    (5, 1.0): Ablation(0.1712, 0.0738, 0.0746, 0.0801),
    (5, 5.0): Ablation(0.1603, 0.0658, 0.0772, 0.0788),
    (10, 1.0): Ablation(1.370, 0.0701, 0.0716, 0.0939),
    (10, 5.0): Ablation(1.232, 0.0623, 0.0694, 0.0942),
}
