"""`motionary cut`: hits or labels as files of their own."""

from dataclasses import replace
from typing import Annotated

import typer

from motionary.cli.cutting import cut_labels
from motionary.cli.inputs import check_target, find_files
from motionary.cli.options import Jobs, ReadingOptions
from motionary.cli.screen import warn


def cut(
    labels: Annotated[str, typer.Argument(metavar="LABELS", help="Table of hits or labels (CSV).")],
    recordings: Annotated[
        list[str],
        typer.Argument(metavar="RECORDINGS", help="Folders, files or patterns they belong to."),
    ],
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="FOLDER", help="Folder to write clips to.")
    ],
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="LABEL", help="Cut labels of this name; may be repeated."),
    ] = None,
    *,
    jobs: Jobs,
    reading: ReadingOptions,
) -> int:
    """Write each hit or label of a table as a clip, in the rig and rate of its recording.

    BVH and AMC files are cut line by line, so that nothing is computed anew. The frames of
    a clip count from 0 (BVH) or 1 (AMC); an AMC clip gets its skeleton beside it.

    motionary cut labels.csv recordings/ -o clips
    with labels.csv from `motionary annotate -o` or `motionary search -o`
    """
    from motionary.io import read_labels

    check_target(output, is_folder=True)
    tracks = read_labels(labels)
    if only:
        names = {label.name for track in tracks.values() for label in track}
        unknown = sorted(set(only) - names)
        if unknown:
            raise typer.BadParameter(
                f"no label is called {', '.join(unknown)}; there are {', '.join(sorted(names))}",
                param_hint="--only",
            )
        tracks = {
            name: replace(track, labels=tuple(label for label in track if label.name in only))
            for name, track in tracks.items()
        }
    found = find_files(recordings)
    for error in found.missing.values():
        warn(str(error))
    done = cut_labels(tracks.values(), found.files, output, reading=reading.reading(), jobs=jobs)
    return 0 if done and not found.missing else 1
