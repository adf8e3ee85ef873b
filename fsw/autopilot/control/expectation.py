"""What the commands sent last make of joints and vehicle: the filter goes by it, or against it."""

from __future__ import annotations

from fsw.autopilot.control.actuator_watch import felt_inside
from fsw.autopilot.control.joints import accelerate_joints
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.multibody import move_bodies
from fsw.autopilot.model.rotors import lag_rotor, motion_state
from fsw.autopilot.tick_record import BEGINS_ANEW, JUDGES, Expected, Tick
from fsw.compiled import compilable


@compilable
def tell_filter(
    r: Tick, airframe: Airframe, rotor_decay: float, found: Expected, explains: bool, judged: bool
) -> None:
    """Write what is expected of the next tick, after which ``rotor_decay`` [1] of a lag is left.

    Of a vehicle that stands thrust does not say how it moves: then it ``explains`` nothing.
    Encoders are ``judged`` unless a joint has failed. Reads estimate, sent, rotors, health, watch,
    pressing, observed, payload; writes bodies, mixer.
    """
    for i in range(int(airframe.rotors)):
        settling_at = r.health.effectiveness[i] * r.sent.rotor_thrust[i]
        r.mixer.mean[i] = lag_rotor(r.rotors[i], settling_at, rotor_decay)
    move_bodies(r.bodies, airframe.bodies, airframe.joint_armature, r.estimate)
    motion = motion_state(airframe, r, r.mixer.mean, r.sent.joint_torque)
    # The accelerometer knows of gusts, and of the ground.
    field = 0.0, 0.0, r.estimate.specific_force
    accelerate_joints(r, airframe.bodies, field, motion.turning)
    felt_inside(r, airframe, found.felt)
    for i in range(int(airframe.bodies.joints)):
        found.u[i], found.undone[i] = r.bodies.work[i], r.watch.undone[i]
        found.unseen[i] = r.watch.unseen[i]
    for i in range(3):
        found.pushed[i] = r.observed.known[i]
        found.model[i] = motion.turning[i] if explains else 0.0
    # Not by the mass that is flown: it goes by the accelerometer, which this is a witness against.
    lift = motion.thrust / (airframe.mass + r.payload.mass)
    found.model[3] = lift if explains else 0.0
    found.judges = JUDGES if judged else BEGINS_ANEW
