"""`motionary demo`: the main job, once through, on real recordings where they are at hand."""

import os
from pathlib import Path
from typing import Annotated

import typer

DATA = "MOTIONARY_DATA"


def demo(
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder for labels and pictures.")
    ] = Path("demo-output"),
    jobs: Annotated[int, typer.Option(help="Processes that read.")] = 2,
) -> None:
    """Search by one example, teach classes, label unseen recordings, score the labels.

    With real recordings in the folder that MOTIONARY_DATA names; without them on
    synthetic motions.

    Example: motionary demo --output demo-output
    """
    folder = os.environ.get(DATA, "")
    if folder and Path(folder, "hdm05").is_dir():
        from motionary.cli._demo_real import run
    else:
        from motionary.cli._demo_synthetic import run

        folder = ""
    for line in run(Path(folder), output, jobs):
        typer.echo(line)
