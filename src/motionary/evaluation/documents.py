"""Which predicted and true labels belong to the same recording?

Conventions: a recording is known by its name, as the two sides write it; times in
seconds.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Literal, NamedTuple, TypeAlias

from motionary.errors import InvalidInput
from motionary.evaluation.tables import LabelLike, Segment, to_segments

Recordings: TypeAlias = (
    Mapping[str, Iterable[LabelLike]] | Iterable[tuple[str, Iterable[LabelLike]]]
)
Missing: TypeAlias = Literal["error", "skip", "empty"]

# So many names fit an error that is still read.
_SHOWN = 5


class Document(NamedTuple):
    """Both tables of one recording.

    Attributes
    ----------
    recording : name
    predicted, truth : in seconds
    seconds : length of the recording, at least up to its last label
    """

    recording: str
    predicted: list[Segment]
    truth: list[Segment]
    seconds: float


def pair_recordings(
    predicted: Recordings,
    truth: Recordings,
    *,
    durations_s: Mapping[str, float],
    missing: Missing = "error",
    classes: Collection[str] | None = None,
) -> tuple[list[Document], tuple[str, ...]]:
    """Documents, sorted by name, and the names of recordings that were left out.

    Parameters are those of `motionary.evaluation.evaluate`.
    """
    claimed = _to_mapping(predicted, side="the prediction")
    real = _to_mapping(truth, side="the truth")
    chosen = _choose(set(claimed), set(real), missing)
    documents = [
        _to_document(name, claimed.get(name, ()), real.get(name, ()), durations_s.get(name))
        for name in sorted(chosen)
    ]
    if classes is not None:
        kept = _check_classes(classes)
        documents = [_keep(document, kept) for document in documents]
    return documents, tuple(sorted((set(claimed) | set(real)) - chosen))


def _choose(claimed: set[str], real: set[str], missing: Missing) -> set[str]:
    if missing not in ("error", "skip", "empty"):
        raise InvalidInput(f'missing must be "error", "skip" or "empty", got {missing!r}')
    if missing == "error" and claimed != real:
        raise InvalidInput(
            "prediction and truth must label the same recordings; "
            f"only in the prediction: {_enumerate(sorted(claimed - real))}; "
            f"only in the truth: {_enumerate(sorted(real - claimed))}; "
            'pass missing="skip" to leave them out, "empty" to count them as without labels'
        )
    chosen = claimed | real if missing == "empty" else claimed & real
    if not chosen:
        raise InvalidInput(
            "there is no recording to evaluate; "
            f"in the prediction: {_enumerate(sorted(claimed))}; "
            f"in the truth: {_enumerate(sorted(real))}"
        )
    return chosen


def _to_mapping(recordings: Recordings, *, side: str) -> dict[str, Iterable[LabelLike]]:
    items = recordings.items() if isinstance(recordings, Mapping) else recordings
    mapping: dict[str, Iterable[LabelLike]] = {}
    for item in items:
        if not (isinstance(item, tuple) and len(item) == 2 and isinstance(item[0], str)):
            raise InvalidInput(
                f"{side}: expected a mapping of recording to labels or pairs "
                f"(recording, labels), got {item!r}"
            )
        name, labels = item
        if name in mapping:
            raise InvalidInput(f"{side}: recording {name!r} comes twice; join its labels")
        mapping[name] = labels
    return mapping


def _enumerate(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_SHOWN]) or "none"
    return shown if len(names) <= _SHOWN else f"{shown} and {len(names) - _SHOWN} more"


def _to_document(
    recording: str,
    predicted: Iterable[LabelLike],
    truth: Iterable[LabelLike],
    duration_s: float | None,
) -> Document:
    told = (duration_s, getattr(truth, "duration_s", None), getattr(predicted, "duration_s", None))
    seconds = next((value for value in told if value is not None), 0.0)
    if not (math.isfinite(seconds) and seconds >= 0):
        raise InvalidInput(
            f"the duration of {recording} must be finite and not negative, got {seconds}"
        )
    claimed = to_segments(predicted, where=f"the prediction of {recording}")
    real = to_segments(truth, where=f"the truth of {recording}")
    # A table may be rounded up past the end of its recording.
    last = max((segment.end for segment in (*claimed, *real)), default=0.0)
    return Document(recording, claimed, real, max(seconds, last))


def _check_classes(classes: Collection[str]) -> frozenset[str]:
    if isinstance(classes, str):
        raise InvalidInput(f"classes need a list of names, got the one text {classes!r}")
    return frozenset(classes)


def _keep(document: Document, classes: frozenset[str]) -> Document:
    return document._replace(
        predicted=[segment for segment in document.predicted if segment.name in classes],
        truth=[segment for segment in document.truth if segment.name in classes],
    )
