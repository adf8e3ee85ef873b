"""A few steps before a flight, so that nothing is compiled in it."""

from __future__ import annotations

from sitl.faults.keys import Fault
from sitl.simulation import Controls, Simulation


def rehearse(simulation: Simulation) -> None:
    """Take two steps of a simulation that is thrown away, so that every kernel is compiled.

    In the second a joint seizes: no other fault needs kernels that a step without does not.
    """
    simulation.inject(Fault("joint", "stuck"))
    off = Controls.off(simulation.vehicle)
    controls = off._replace(thrust=tuple(0.5 for _ in off.thrust), armed=True)
    for _ in range(2):
        simulation.sense()
        simulation.advance(controls)
    simulation.sense()
