"""How does a folder of examples become a library?"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence, Reading, compute_features
from motionary.library.classes import ClassLibrary
from motionary.library.examples import read_examples
from motionary.library.teaching import Teaching, learn_classes
from motionary.motion import Motion


def learn(
    examples: str | Path | Mapping[str, Sequence[Motion | FeatureSequence]],
    *,
    mirror: bool = False,
    teaching: Teaching | None = None,
    reading: Reading | None = None,
    jobs: int = 1,
) -> ClassLibrary:
    """Library of classes learned from examples.

    Parameters
    ----------
    examples : a folder with one folder per class, or examples by class name
    mirror : also learn every class's mirror image, as a subclass of the same name
    teaching : further settings
    reading : what the files do not say themselves
    jobs : processes that read

    Raises
    ------
    InvalidInput, UnreadableFile
        If there are no examples, examples of a class have nothing in common, or one of
        them cannot be read.
    """
    settings = teaching or Teaching()
    if mirror:
        settings = replace(settings, mirror=True)
    if isinstance(examples, str | Path):
        read = read_examples(Path(examples), reading=reading, jobs=jobs)
        if read.failures:
            raise read.failures[0].error
        nested = {name: dict(subclasses) for name, subclasses in read.classes.items()}
    else:
        nested = {name: {name: _sequences(items)} for name, items in examples.items()}
    if not nested:
        raise InvalidInput("there are no examples to learn from; give at least one class")
    return learn_classes(nested, teaching=settings)


def _sequences(items: Sequence[Motion | FeatureSequence]) -> list[FeatureSequence]:
    return [i if isinstance(i, FeatureSequence) else compute_features(i) for i in items]
