"""RotorPy's SE(3) controller and a user's MPC in do-mpc on our plant, judged by our referee.

Skipped without these packages: ``pip install rotorpy do-mpc`` into an environment of its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pandion
from tests.fsw.paper_arm import LENGTHS
from tests.paper_vehicle import PAPER, ROTOR_ARM, YAW_PER_THRUST

MIRROR = np.diag([1.0, -1.0, -1.0])  # NED to north, west, up; FRD to forward, left, up


class RotorPySE3:
    """Its law for the rotors; the arm is held as it begins by a PD law."""

    def __init__(self, scenario: str, attitude: tuple[float, float] = (60.0, 14.0)) -> None:
        module = pytest.importorskip("rotorpy.controllers.quadrotor_control")
        a, kp, kd = pandion.AIRFRAME, *attitude
        places = {"rear": (-1, 0), "left": (0, 1), "front": (1, 0), "right": (0, -1)}
        unused = ["Ixy", "Ixz", "Iyz", "c_Dx", "c_Dy", "c_Dz", "k_d", "k_z", "k_flap"]
        unused += ["rotor_speed_min", "rotor_speed_max"]
        params: dict[str, Any] = dict.fromkeys(unused, 0.0)
        params |= {
            "mass": a.mass,
            "Ixx": PAPER.base.inertia[0],
            "Iyy": PAPER.base.inertia[1],
            "Izz": PAPER.base.inertia[2],
            "num_rotors": 4,
            "rotor_pos": {k: ROTOR_ARM * np.array([*p, 0.0]) for k, p in places.items()},
            "rotor_directions": np.array([-1, 1, -1, 1]),
            "k_eta": 1.0,
            "k_m": YAW_PER_THRUST,
            "tau_m": a.rotor_lag,
            "kp_att": kp,
            "kd_att": kd,
        }
        self.law = module.SE3Control(params)
        sim = pandion.Simulator(scenario)
        seen = sim.observe()
        self.above, self.q_arm = seen.p_WB - seen.p_WE, seen.q_arm
        self.thrust, self.torque = sim.hover

    def __call__(self, seen: pandion.Observation) -> Any:
        attitude = Rotation.from_matrix(MIRROR @ seen.R_WB @ MIRROR).as_quat()
        state = {"x": MIRROR @ seen.p_WB, "v": MIRROR @ seen.v_WB, "q": attitude}
        state["w"] = MIRROR @ seen.w_WB_B
        wanted: dict[str, Any] = {
            "x": MIRROR @ (seen.p_target + self.above),
            "x_dot": MIRROR @ seen.v_target,
            "x_ddot": MIRROR @ seen.a_target,
            "yaw": 0.0,
            "yaw_dot": 0.0,
        }
        thrust = self.law.update(seen.t, state, wanted)["cmd_motor_thrusts"]
        # What the arm's weight asks of the rotors is not in its model.
        thrust = thrust + self.thrust - self.thrust.mean()
        torque = self.torque - 2.0 * (seen.q_arm - self.q_arm) - 0.15 * seen.qd_arm
        return np.clip(thrust, 0.0, pandion.AIRFRAME.weakest_thrust), torque


@pytest.mark.long
def test_rotorpys_controller_flies_the_workspace() -> None:
    result = pandion.fly(
        "workspace-calm", duration_s=30.0, controller=RotorPySE3("workspace-calm"), log=False
    )
    assert result.completed, result.reason
    assert result.overridden_s == 0.0
    assert result.tracking_rms is not None
    assert result.tracking_rms < 0.05


class DoMpcPlanner:
    """An MPC as its tutorial writes one: a point mass with a lag, walls as soft rows."""

    LAG = 0.25  # s, of the acceleration behind its command

    def __init__(self) -> None:
        self.mpc: Any = None

    def _begin(self, request: pandion.PlanRequest) -> Any:
        do_mpc = pytest.importorskip("do_mpc")
        import casadi as ca

        model = do_mpc.model.Model("continuous")
        p, v, a = (model.set_variable("_x", name, (3, 1)) for name in "pva")
        q, w = (model.set_variable("_x", name, (2, 1)) for name in "qw")
        wanted = model.set_variable("_u", "wanted", (3, 1))
        turned = model.set_variable("_u", "turned", (2, 1))
        aim, speed = (model.set_variable("_tvp", name, (3, 1)) for name in ("aim", "speed"))
        for name, rate in zip("pvaqw", (v, a, (wanted - a) / self.LAG, w, turned), strict=True):
            model.set_rhs(name, rate)
        l1, l2 = LENGTHS
        yaw, both = request.start.yaw, q[0] + q[1]
        ahead, below = l1 * ca.sin(q[0]) + l2 * ca.sin(both), l1 * ca.cos(q[0]) + l2 * ca.cos(both)
        tool = p + ca.vertcat(ahead * np.cos(yaw), ahead * np.sin(yaw), below)
        cost = 100.0 * ca.sumsqr(tool - aim) + ca.sumsqr(q - np.array(request.start.q_arm))
        model.set_expression("cost", cost + 5.0 * ca.sumsqr(v - speed) + 0.1 * ca.sumsqr(w))
        rows = [ca.SX(-1.0)]
        for zone in request.safe_set.zones:
            if zone.shape.kind == "half-space":
                *normal, offset = zone.shape.numbers
                behind = [offset - ca.dot(np.array(normal), point) for point in (p, tool)]
                rows += [zone.clearance + row for row in behind]
        model.set_expression("beyond", ca.vertcat(*rows))  # m, of the clearance
        model.setup()
        mpc = do_mpc.controller.MPC(model)
        mpc.settings.n_horizon, mpc.settings.t_step = len(request.targets) - 1, 0.1
        mpc.settings.store_full_solution = False
        mpc.settings.supress_ipopt_output()
        mpc.set_objective(lterm=model.aux["cost"], mterm=model.aux["cost"])
        mpc.set_rterm(wanted=0.02, turned=0.001)
        for name, limit in (("wanted", 2.0), ("turned", 10.0)):
            mpc.bounds["lower", "_u", name], mpc.bounds["upper", "_u", name] = -limit, limit
        mpc.set_nl_cons(
            "walls", model.aux["beyond"], 0.0, soft_constraint=True, penalty_term_cons=1e3
        )
        self.given = mpc.get_tvp_template()
        mpc.set_tvp_fun(lambda _: self.given)
        mpc.setup()
        return mpc

    def plan(self, request: pandion.PlanRequest) -> Any:
        first = self.mpc is None
        if first:
            self.mpc = self._begin(request)
        for k, target in enumerate(request.targets):
            self.given["_tvp", k, "aim"] = np.array(target.p_WE)
            self.given["_tvp", k, "speed"] = np.array(target.v_WE)
        x = request.start
        x0 = np.array([*x.p, *x.v, *x.a, *x.q_arm, *x.qd_arm])
        self.mpc.x0 = x0
        if first:
            self.mpc.set_initial_guess()
        self.mpc.make_step(x0)
        inputs = self.mpc.opt_x_num_unscaled["_u", :, 0]
        return [[*one.full().ravel()[:3], 0.0, *one.full().ravel()[3:]] for one in inputs]


@pytest.mark.long
def test_an_mpc_of_do_mpc_flies_the_workspace() -> None:
    # Between walls it leaves its path after 10.2 s, 2.5 mm beyond their clearance.
    result = pandion.fly(
        "workspace-calm", duration_s=20.0, planner=DoMpcPlanner(), log=False, allow_slow=True
    )
    assert result.completed, result.reason
    assert result.tracking_rms is not None
    assert result.tracking_rms < 0.05
