"""How does a folder of examples become a library?"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from motionary.errors import InvalidInput
from motionary.features import FULL_BODY, FeatureSequence, FeatureSet, compute_features
from motionary.io import ReadOptions
from motionary.models.library.classes import ClassLibrary
from motionary.models.library.examples import read_examples
from motionary.models.library.thresholds import apply_calibrations, calibrate_thresholds
from motionary.models.library.training import TrainingOptions, learn_classes
from motionary.motion import Motion


def learn(
    examples: str | Path | Mapping[str, Sequence[Motion | FeatureSequence]],
    *,
    mirror: bool = False,
    calibrate: bool = False,
    training: TrainingOptions | None = None,
    reading: ReadOptions | None = None,
    feature_set: FeatureSet = FULL_BODY,
    jobs: int = 1,
) -> ClassLibrary:
    """Library of classes learned from examples.

    Parameters
    ----------
    examples : a folder with one folder per class, or examples by class name
    mirror : also learn every class's mirror image, as a subclass of the same name
    suggest : choose each class's threshold on examples held out, and keep what it promises
        for motion that is done as the examples are; see `suggest_thresholds`, which can also
        be told of groups and of other recordings
    teaching : further settings
    reading : what the files do not say themselves
    feature_set : relations that are measured
    jobs : processes

    Raises
    ------
    InvalidInput, UnreadableFile
        If there are no examples, examples of a class have nothing in common, or one of
        them cannot be read.
    """
    settings = training or TrainingOptions()
    if mirror:
        settings = replace(settings, mirror=True)
    if isinstance(examples, str | Path):
        read = read_examples(Path(examples), reading=reading, feature_set=feature_set, jobs=jobs)
        if read.failures:
            raise read.failures[0].error
        nested = {name: dict(prototypes) for name, prototypes in read.classes.items()}
    else:
        nested = {name: {name: _sequences(items, feature_set)} for name, items in examples.items()}
    if not nested:
        raise InvalidInput("there are no examples to learn from; give at least one class")
    library = learn_classes(nested, training=settings)
    if calibrate:
        calibrations = calibrate_thresholds(nested, training=settings, jobs=jobs)
        library = apply_calibrations(library, calibrations)
    return library


def _sequences(
    items: Sequence[Motion | FeatureSequence], feature_set: FeatureSet
) -> list[FeatureSequence]:
    return [
        item
        if isinstance(item, FeatureSequence)
        else compute_features(item, feature_set=feature_set)
        for item in items
    ]
