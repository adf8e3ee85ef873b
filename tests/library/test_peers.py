"""RotorPy's SE(3) controller on our plant, judged by our referee; skipped without the package.

``pip install rotorpy`` into an environment of its own: nothing here needs it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pandion

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
            "Ixx": a.inertia[0],
            "Iyy": a.inertia[1],
            "Izz": a.inertia[2],
            "num_rotors": 4,
            "rotor_pos": {k: a.rotor_arm * np.array([*p, 0.0]) for k, p in places.items()},
            "rotor_directions": np.array([-1, 1, -1, 1]),
            "k_eta": 1.0,
            "k_m": a.yaw_per_thrust,
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
        return np.clip(thrust, 0.0, pandion.AIRFRAME.rotor_thrust_max), torque


@pytest.mark.long
def test_rotorpys_controller_flies_the_workspace() -> None:
    result = pandion.fly(
        "workspace-calm", duration_s=30.0, controller=RotorPySE3("workspace-calm"), log=False
    )
    assert result.completed, result.reason
    assert result.overridden_s == 0.0
    assert result.tracking_rms is not None
    assert result.tracking_rms < 0.05
