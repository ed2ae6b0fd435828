"""Who does the work of a command: processes of this computer, or the workers of a cluster."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from motionary.cli.options import LibraryDefault, option, wrong

if TYPE_CHECKING:
    from motionary.batch import Workers


@dataclass(frozen=True, kw_only=True)
class WorkOptions:
    """How many processes, or whose."""

    jobs: int = option(
        "--jobs --workers N",
        "Processes that read files; the answer is the same.",
        LibraryDefault("motionary.batch:map_ordered", "jobs"),
        min=1,
    )
    scheduler: str | None = option(
        "--scheduler ADDRESS",
        "Dask scheduler whose workers do it instead, as tcp://host:8786; they see files and index "
        "under the same paths.",
    )

    @contextmanager
    def open(self) -> "Iterator[Workers]":
        """What `map_ordered` takes; of a cluster only as long as it is needed.

        Raises
        ------
        BadParameter
            If processes are asked for as well.
        Unreachable
            If the scheduler does not answer, or has no workers that can do it.
        """
        if self.scheduler is None:
            yield self.jobs
            return
        if self.jobs > 1:
            raise wrong("--scheduler", "its workers do the work; leave out --jobs")
        from motionary.batch import Cluster

        # It reports by itself what is told in one line here.
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        with Cluster(self.scheduler) as cluster:
            yield cluster

    def searching(self, workers: "Workers") -> "Workers":
        """Who searches: a cluster where there is one; processes start more slowly than they pay."""
        return 1 if self.scheduler is None else workers
