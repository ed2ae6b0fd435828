"""`motionary index`: read a folder once, so that searches of it answer at once."""

from typing import Annotated

import typer

from motionary.cli import STOPPED_BY_KEYBOARD, screen
from motionary.cli.indexed import list_missing, update_index
from motionary.cli.inputs import warn_of_all
from motionary.cli.options import AsJson, Jobs, ReadingOptions


def index(
    folder: Annotated[
        str, typer.Argument(metavar="FOLDER", help="Recordings, searched to the bottom.")
    ],
    place: Annotated[
        str | None,
        typer.Option(
            "--index",
            metavar="PATH",
            help="Folder to keep what was read in; by default in the cache.",
        ),
    ] = None,
    as_json: AsJson = False,
    *,
    jobs: Jobs,
    reading: ReadingOptions,
) -> int:
    """Read what is new or changed in a folder, and say what could not be read.

    `motionary search` does the same by itself. An interrupted run is taken up where it
    ended. What could not be read is tried again when it has changed.

    motionary index recordings/ --jobs 4
    motionary index //server/recordings --index recordings-index
    """
    from motionary.features import SEQUENCE_HZ
    from motionary.retrieval.index import Index

    opened = Index.open(folder, at=place, reading=reading.reading())
    changes = opened.changes()
    stopped = update_index(opened, changes, jobs=jobs)
    n_read = opened.count_ready(changes.to_read)
    missing = list_missing(opened)
    failed = warn_of_all(missing, opened.failures)
    hours = opened.n_frames / SEQUENCE_HZ / 3600
    if as_json:
        screen.print_json(
            {
                "recordings": len(opened),
                "words": opened.n_frames,
                "read": n_read,
                "gone": len(changes.gone),
                "failed": len(opened.failures),
                "place": str(opened.place),
            }
        )
    else:
        screen.say(
            f"{len(opened)} recordings, {hours:.2f} hours; read {n_read}, "
            f"{len(changes.gone)} gone, {len(opened.failures)} could not be read",
            f"kept in {opened.place}",
        )
    if stopped:
        return STOPPED_BY_KEYBOARD
    return 1 if failed else 0
