"""Where many flights are flown: options that several verbs share."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from command_line.options import ContradictionError, OneOf, option
from command_line.values import existing_file, whole

if TYPE_CHECKING:
    from studies.campaign.campaign import Campaign

_WHERE: Final = OneOf()


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterOptions:
    """Processes of this machine, or the workers of a running scheduler of Dask."""

    workers: int = option(
        "--workers N",
        "processes on this machine; 0 flies in this one (default one a core)",
        whole(0, 1024),
        default=os.cpu_count() or 1,
        one_of=_WHERE,
    )
    scheduler: str | None = option(
        "--scheduler ADDR",
        "fly on the workers of this Dask scheduler, tcp://HOST:PORT or tls://HOST:PORT",
        one_of=_WHERE,
    )
    scheduler_file: Path | None = option(
        "--scheduler-file FILE",
        "fly on the workers of the Dask scheduler that wrote this file",
        existing_file,
        one_of=_WHERE,
    )
    tls_ca_file: Path | None = option("--tls-ca-file FILE", "the CA for TLS, PEM", existing_file)
    tls_cert: Path | None = option("--tls-cert FILE", "own certificate for TLS, PEM", existing_file)
    tls_key: Path | None = option("--tls-key FILE", "its key, PEM", existing_file)

    def __post_init__(self) -> None:
        """Refuse files of TLS that would not be used.

        Raises:
            ContradictionError: There is no connection for them, or one file is missing.
        """
        files = (self.tls_ca_file, self.tls_cert, self.tls_key)
        if any(files) and not self.running:
            raise ContradictionError(
                "--tls-ca-file, --tls-cert and --tls-key are for a scheduler: give --scheduler "
                "or --scheduler-file with them"
            )
        if (self.tls_cert or self.tls_key) and not all(files):
            raise ContradictionError("--tls-cert and --tls-key need each other and --tls-ca-file")

    @property
    def running(self) -> bool:
        """Whether a scheduler that runs already is named."""
        return self.scheduler is not None or self.scheduler_file is not None

    @property
    def words(self) -> str:
        """How a sentence says where."""
        if self.running:
            return f"scheduler {self.scheduler or self.scheduler_file}"
        return f"{self.workers} workers" if self.workers != 1 else "1 worker"


def campaign_of(options: ClusterOptions, journal: Path | None, **more: Any) -> Campaign[Any]:
    """What flies where the options say; ``more`` are fields of ``Campaign``."""
    from studies.campaign.campaign import Campaign
    from studies.campaign.ports import Scheduler

    scheduler = Scheduler(
        address=options.scheduler,
        file=options.scheduler_file,
        tls_ca_file=options.tls_ca_file,
        tls_cert=options.tls_cert,
        tls_key=options.tls_key,
    )
    return Campaign(
        workers=options.workers,
        journal=journal,
        scheduler=scheduler if options.running else None,
        **more,
    )
