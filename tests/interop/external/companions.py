"""Programs of companion computers as their users call them; run in an environment of their own.

``python companions.py CLIENT PORT`` speaks to a vehicle that expects programs at a port, and prints
what it learnt, as JSON.
"""

import asyncio
import json
import os
import sys
from collections.abc import Callable
from typing import Any

os.environ["MAVLINK20"] = "1"


def use_mavpilot(port: int) -> dict[str, Any]:
    """Write its safety parameters, each verified, and wait until it may fly."""
    from mavpilot import DroneController  # type: ignore[import-not-found]

    async def prepare() -> None:
        drone = DroneController(f"udp:127.0.0.1:{port}", enable_viz=False)
        await drone.connect()
        await drone.apply_safe_params()
        await drone.wait_until_ready(20.0)
        await drone.aclose()

    asyncio.run(asyncio.wait_for(prepare(), 60.0))
    return {"ready": True}


def use_autopilot_tools(port: int) -> dict[str, Any]:
    """Set parameters of both types, reset them, and fetch the beginning of the newest log."""
    from autopilot_tools.mavlink_interface import (  # type: ignore[import-not-found]
        MavlinkInterface,
    )
    from autopilot_tools.parameters import ParametersInterface  # type: ignore[import-not-found]
    from autopilot_tools.vehicle import Devices, Vehicle  # type: ignore[import-not-found]

    vehicle = Vehicle()
    vehicle.device, vehicle.device_path = Devices.udp, f"udpin:127.0.0.1:{port}"
    vehicle._connect_once()
    link = MavlinkInterface(vehicle.master)
    parameters = ParametersInterface(link, vehicle.autopilot)
    for name, value in (("NAV_DLL_ACT", 3), ("MIS_TAKEOFF_ALT", 1.5)):
        assert parameters.set(name, value)
    written = [parameters.read("NAV_DLL_ACT"), parameters.read("MIS_TAKEOFF_ALT")]
    link.command_long_send_reset_params_to_default()
    while parameters.read("NAV_DLL_ACT") == written[0]:
        pass
    on_card = vehicle.mav_ftp.get_last_log("/fs/microsd/log/")
    log = vehicle.mav_ftp.get_last_log(vehicle.get_log_folder())
    log.size = min(log.size, 50_000)
    log.materialize()  # the last: it takes what is left of this for the next answer
    return {
        "written": written,
        "reset": parameters.read("NAV_DLL_ACT"),
        "log": log.data[:7].hex(),
        "names": [on_card.name, log.name],
    }


def use_dronekit(port: int) -> dict[str, Any]:
    """Wait as its examples do."""
    from dronekit import connect  # type: ignore[import-not-found]

    vehicle = connect(f"udpin:127.0.0.1:{port}", wait_ready=False)
    vehicle.wait_ready("gps_0", "armed", "mode", "attitude", "parameters", timeout=60)
    found = {"fix": vehicle.gps_0.fix_type, "parameters": len(vehicle.parameters)}
    vehicle.close()
    return found


def use_mavkit(port: int) -> dict[str, Any]:
    """Wait for a fix, and list the parameters with their types."""
    import mavkit  # type: ignore[import-not-found]

    async def look() -> dict[str, Any]:
        vehicle = await mavkit.Vehicle.connect_udp(f"127.0.0.1:{port}")
        while vehicle.gps.fix_type != mavkit.GpsFixType.Fix3d:
            await asyncio.sleep(0.1)
        store = await vehicle.download_params()
        kinds = {one.name: str(one.param_type).partition(".")[2] for one in store.values()}
        return {"types": kinds}

    return asyncio.run(asyncio.wait_for(look(), 60.0))


CLIENTS: dict[str, Callable[[int], dict[str, Any]]] = {
    "mavpilot": use_mavpilot,
    "autopilot-tools": use_autopilot_tools,
    "dronekit": use_dronekit,
    "mavkit": use_mavkit,
}

if __name__ == "__main__":
    print(json.dumps(CLIENTS[sys.argv[1]](int(sys.argv[2]))), flush=True)
    os._exit(0)  # their threads do not end by themselves
