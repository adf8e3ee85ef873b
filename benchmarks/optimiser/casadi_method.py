"""CasADi with IPOPT and FATROP on the planner's problem: for comparison only, never flown.

Neither is needed anywhere else; without the optional dependency `bench` they are reported as
not installed. CasADi writes its functions in C, which are compiled where there is a C compiler;
elsewhere its virtual machine runs them.
"""

from __future__ import annotations

import contextlib
import importlib.util
import shutil
import tempfile
from typing import Any

import numpy as np

from benchmarks.optimiser.instances import INPUTS, STATES, Instance
from benchmarks.optimiser.solved import Solved, timed
from fsw.autopilot.barriers.barrier_function import cbf_lower_bound
from fsw.autopilot.barriers.safe_approach import safe_approach_speed
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.body import body_of
from fsw.autopilot.model.kinematics import position, velocity
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import (
    YAW,
    Array,
    P,
    V,
    condense,
    to_vector,
)
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.shapes.ball import outward_axis
from fsw.autopilot.signals import PlanRequest, SafeSet

SOLVERS = ("ipopt", "fatrop")
_TOLERANCE = 1e-6  # as Clarabel's
_COMPILERS = ("cc", "gcc", "clang")
# What is compiled has no loop and no call in it; higher levels take minutes for it.
_FLAGS = ("-O1", "-march=native")


def compiler() -> str | None:
    """The C compiler of this machine, if there is one."""
    return next((name for name in _COMPILERS if shutil.which(name)), None)


def given() -> str:
    """In what form CasADi's functions run here."""
    name = compiler()
    if name is None:
        return "functions run by CasADi's virtual machine: no C compiler (cc, gcc or clang) here"
    return f"functions in C, compiled by {name} {' '.join(_FLAGS)}"


def installed(solver: str) -> bool:
    """Whether CasADi is there and brings the solver."""
    if importlib.util.find_spec("casadi") is None:
        return False
    import casadi

    return bool(casadi.has_nlpsol(solver))


class CasadiMethod:
    """One program for one horizon and safe set, its functions compiled where that is possible."""

    def __init__(
        self, config: PlannerConfig, airframe: Airframe, safe_set: SafeSet, solver: str
    ) -> None:
        import casadi

        from benchmarks.optimiser.ocp import build, sphere_of

        self._config, self._safe_set = config, safe_set
        self._sphere = sphere_of(safe_set)
        self._model = condense(airframe, config.period, config.horizon)
        self._horizon = Linearisation(self._model)
        program, parameters = build(config, airframe, safe_set)
        self._states, self._controls = program.states, program.controls
        self._bounds = {
            "lbx": program.lower,
            "ubx": program.upper,
            "lbg": np.zeros(len(program.row_upper)),
            "ubg": program.row_upper,
        }
        equality = [upper == 0.0 for upper in program.row_upper]
        functions = {
            "x": casadi.vertcat(*program.unknowns),
            "f": program.cost,
            "g": casadi.vertcat(*program.rows),
            "p": parameters,
        }
        options = _options(
            solver, config.horizon, program.path_rows, self._states, self._controls, equality
        )
        # CasADi writes the C files into the working directory and loads what becomes of them.
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            self._solve = casadi.nlpsol("planner", solver, functions, options | _compiled())

    def solve(self, instance: Instance, guess: Array, optimum: Array) -> Solved:
        """See ``Method``; ``guess`` and ``optimum`` (6 n,) [m/s^2, rad/s^2]."""
        parameters = self._parameters(instance.request, optimum)
        initial = self._unknowns(instance.request, guess)
        found, spent = timed(lambda: self._solve(x0=initial, p=parameters, **self._bounds))
        if not self._solve.stats()["success"]:
            return Solved(spent, None, None)
        return Solved(spent, self._inputs(np.array(found["x"]).ravel()), None)

    def _unknowns(self, request: PlanRequest, inputs: Array) -> Array:
        """States that follow from the inputs, stage by stage, and no slack."""
        states = self._model.phi @ to_vector(request.start) + self._model.gamma @ inputs
        parts: list[Array] = [states[0]]
        for i, controls in enumerate(self._controls):
            u = inputs[INPUTS * i : INPUTS * (i + 1)]
            parts.append(np.concatenate((u, np.zeros(controls - len(u)))))
            if i + 1 < len(self._states):
                parts.append(states[i + 1])
        return np.concatenate(parts)

    def _inputs(self, x: Array) -> Array:
        """The inputs among the unknowns, (6 n,)."""
        inputs, at = [], STATES
        for controls in self._controls[:-1]:
            inputs.append(x[at : at + INPUTS])
            at += controls + STATES
        return np.concatenate(inputs)

    def _parameters(self, request: PlanRequest, optimum: Array) -> Array:
        """Start, targets, directions at the optimum and the h that eq 25 requires."""
        start = to_vector(request.start)
        self._horizon.refill(start, optimum)
        yaws = self._horizon.states[:, YAW]
        parts: list[Any] = [start]
        for i in range(1, self._config.horizon + 1):
            target = request.targets[i]
            turns = np.round((yaws[i] - target.yaw) / (2.0 * np.pi))  # the short way round
            frame = np.eye(3)
            if self._sphere is not None:
                centre = np.array(target.p_WE) + self._sphere.shape.numbers[:3]
                x, y, z = self._horizon.states[i, P : P + 3] - centre
                frame = np.array([outward_axis(x, y, z, which) for which in (0, 2, 4)])
            parts += [target.p_WE, target.v_WE, [target.yaw + 2.0 * np.pi * turns], frame.ravel()]
            parts.append(self._required(request, i, frame))
        return np.concatenate(parts)

    def _required(self, request: PlanRequest, i: int, frame: Array) -> Array:
        h_start: list[float] = []
        if self._sphere is None:
            tuning = self._config.walls
            parts = body_of("points", self._model.airframe).parts
            start = self._horizon.horizon.frames[0]
            points = [
                (position(start, part.on, part.begin), velocity(start, part.on, part.begin))
                for part in parts
            ]
            for wall in self._safe_set.zones:
                normal, offset = wall.shape.numbers[:3], wall.shape.numbers[3]
                for p, v in points:
                    gap = float(np.dot(normal, p)) - offset - wall.clearance
                    speed = float(np.dot(normal, v))
                    h_start.append(safe_approach_speed(gap, tuning.alpha, tuning.slope) + speed)
        else:
            tuning = self._config.workspace
            start, target = self._horizon.states[0], request.targets[0]
            *centre, radius = self._sphere.shape.numbers
            e = start[P : P + 3] - target.p_WE - np.array(centre)
            w = start[V : V + 3] - target.v_WE
            for axis in frame:
                for n in (axis, -axis):
                    room = float(radius - n @ e)
                    h_start.append(
                        safe_approach_speed(room, tuning.alpha, tuning.slope) - float(n @ w)
                    )
        return np.array(
            [cbf_lower_bound(h, i, tuning.numbers(self._config.period)) for h in h_start]
        )


def _compiled() -> dict[str, Any]:
    """Options that compile the functions; none without a compiler."""
    name = compiler()
    if name is None:
        return {}
    # The linker too, which would otherwise be another compiler.
    shell = {"compiler": name, "linker": name, "flags": list(_FLAGS)}
    return {"jit": True, "compiler": "shell", "jit_options": shell}


def _options(
    solver: str,
    horizon: int,
    path_rows: list[int],
    states: list[int],
    controls: list[int],
    equality: list[bool],
) -> dict[str, Any]:
    options: dict[str, Any] = {"print_time": False, "error_on_fail": False}
    if solver == "ipopt":
        return options | {
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.tol": _TOLERANCE,
            "ipopt.max_iter": 200,
        }
    return options | {
        "structure_detection": "manual",
        "N": horizon,
        "nx": states,
        "nu": controls,
        "ng": path_rows,
        "equality": equality,
        "fatrop.print_level": 0,
        "fatrop.tol": _TOLERANCE,
        "fatrop.max_iter": 200,
    }
