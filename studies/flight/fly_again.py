"""A flight that was found, kept as files that fly it again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.storage.parameter_file import save
from sitl.scenario_file import load_scenario
from sitl.scenario_text import write_scenario
from studies.flight.job import Job, Outcome


def keep(job: Job, controller: str, stem: Path, comment: str, program: str = "pandion") -> str:
    """Write ``stem``.toml, and .params where parameters differ; the command that flies it."""
    scenario, params = stem.with_suffix(".toml"), stem.with_suffix(".params")
    write_scenario(job.scenario, scenario, comment)
    changed = changed_parameters(job.config)
    if changed:
        save(params, changed)
    return fly_command(program, job, controller, scenario, params if changed else None)


def changed_parameters(config: FlightConfig) -> dict[str, float]:
    """Parameters of a configuration that are not the default."""
    return {
        name: value for name, one in BY_NAME.items() if (value := one.read(config)) != one.default
    }


def fly_command(
    program: str, job: Job, controller: str, scenario: Path, params: Path | None
) -> str:
    """The command that flies the same over the link: equal but for what the link rounds."""
    config = job.config
    if config.own_planner or config.own_controller:
        given = [repr(str(scenario)), str(job.seed)]
        given += [f"params={str(params)!r}"] if params is not None else []
        for name in ("planner", "controller"):
            part = getattr(config, f"own_{name}").partition("@")[0]
            given += [f"{name}={part!r}"] if part else []
        return f'python -c "import pandion; print(pandion.fly({", ".join(given)}))"'
    return " ".join([program, *fly_words(job, controller, str(scenario), params)])


def fly_words(job: Job, controller: str, scenario: str, params: Path | None) -> list[str]:
    """The same with our own parts, in words."""
    words = ["fly", scenario, f"--seed={job.seed}"]
    if params is not None:
        words.append(f"--params={params}")
    if controller != "blf":
        words.append(f"--controller={controller}")
    if job.config.inner == "pid":
        words.append("--tracking=pid")
    if job.config.planner.body != job.scenario.body:
        words.append(f"--body={job.config.planner.body}")
    if job.config.soft:
        words.append("--allow-inconsistent")
    return words


def flown_again(job: Job, stem: Path) -> Outcome:
    """The row of a kept flight, from its file."""
    scenario = load_scenario(str(stem.with_suffix(".toml")))
    return replace(job, scenario=replace(scenario, name=job.scenario.name)).row()
