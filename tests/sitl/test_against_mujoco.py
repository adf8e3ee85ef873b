"""Two seconds of free motion against MuJoCo."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from sitl.plant.parameters import GRAVITY, Motors, Vehicle
from tests.sitl.free_motion import flown, frictionless, tumbling
from tests.sitl.state_view import StateView

SECONDS = 2.0
# Both integrate with RK4, but MuJoCo advances the attitude on the sphere and we renormalise, so
# they agree only up to truncation: ours at 1 ms is 1e-9 after a second of this motion (see the
# test of the order), MuJoCo's at 0.25 ms is less than 1 % of that. Ten times as much is allowed.
TOLERANCE = 1e-8  # m, rad, m/s and rad/s


def _mjcf(vehicle: Vehicle) -> str:
    """A free base and two hinges about +y, links along +z, in MuJoCo's own terms."""
    first, second = vehicle.links

    def inertial(mass: float, z: float, x_y_z: tuple[float, float, float]) -> str:
        ixx, iyy, izz = x_y_z
        return f'<inertial mass="{mass}" pos="0 0 {z}" diaginertia="{ixx} {iyy} {izz}"/>'

    # The link frame's x runs along the link, which hangs along z_B; its y and z values are equal.
    along1, across1, _ = first.inertia
    along2, across2, _ = second.inertia
    return f"""
    <mujoco>
      <option timestep="0.00025" integrator="RK4" gravity="0 0 {vehicle.gravity}"/>
      <worldbody>
        <body name="base">
          <freejoint/>
          {inertial(vehicle.base_mass, 0.0, vehicle.base_inertia)}
          <body name="link1">
            <joint type="hinge" axis="0 1 0" armature="{vehicle.motors.inertia}"/>
            {inertial(first.mass, 0.5 * first.a, (across1, across1, along1))}
            <body name="link2" pos="0 0 {first.a}">
              <joint type="hinge" axis="0 1 0" armature="{vehicle.motors.inertia}"/>
              {inertial(second.mass, 0.5 * second.a, (across2, across2, along2))}
            </body>
          </body>
        </body>
      </worldbody>
    </mujoco>"""


@pytest.mark.parametrize("motors", [0.0, 0.0025])
def test_two_seconds_of_free_motion_agree(motors: float) -> None:
    vehicle = replace(frictionless(GRAVITY), motors=Motors(inertia=motors))
    model = mujoco.MjModel.from_xml_string(_mjcf(vehicle))
    data = mujoco.MjData(model)
    start = StateView(tumbling())
    data.qpos[:] = np.concatenate([start.p_WB, start.q_WB, start.q_arm])
    data.qvel[:] = np.concatenate([start.v_WB, start.w_WB_B, start.qd_arm])
    for _ in range(round(SECONDS / model.opt.timestep)):
        mujoco.mj_step(model, data)
    ours = StateView(flown(vehicle, start.vector, SECONDS, 0.001))
    place = np.concatenate([ours.p_WB, ours.q_WB, ours.q_arm])
    motion = np.concatenate([ours.v_WB, ours.w_WB_B, ours.qd_arm])
    worst = max(np.abs(place - data.qpos).max(), np.abs(motion - data.qvel).max())
    print(f"\nworst difference after {SECONDS:g} s: {worst:.1e}")
    assert worst <= TOLERANCE
