"""Pages of classes: their templates, examples side by side, and what they are confused with."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from motionary.errors import InvalidInput
from motionary.features import FeatureSequence, compute_features
from motionary.io import match_recording
from motionary.matching import distance_function
from motionary.models.library import ClassLibrary, MotionClass, Prototype
from motionary.motion import Motion
from motionary.reporting.contents import PAGE_HZ, describe_features
from motionary.reporting.galleries import (
    Cell,
    Motions,
    cell_of_hit,
    describe_template,
    find_motions,
    make_gallery,
    warp_by,
)
from motionary.reporting.html import Block, Page, build_page, check_rate
from motionary.retrieval.index import Collection
from motionary.retrieval.search import Hit, search

#: Examples of a template that play side by side.
MOST_EXAMPLES = 12

_MOST_CONFUSED = 6


def report_library(
    library: ClassLibrary,
    path: str | Path | None = None,
    *,
    names: Sequence[str] | None = None,
    recordings: Motions | None = None,
    rate_hz: float = PAGE_HZ,
    title: str = "classes",
) -> Page:
    """A page of classes: what each asks for, its examples in step, what is near to it.

    Parameters
    ----------
    library : of the classes
    path : file to write, .html; otherwise `Page.save` does, and notebooks show the page
    names : of the classes; by default all
    recordings : where examples are shown from: those that the library keeps, by the names of
        their recordings, otherwise the nearest matches
    rate_hz : most frames a second that are kept
    title : of the page

    Raises
    ------
    InvalidInput
        If there is no class, or none of such a name.
    UnwritableFile
    """
    check_rate(rate_hz)
    chosen = [library[name] for name in (library.names if names is None else names)]
    if not chosen:
        raise InvalidInput("the library has no classes to show")
    motions = None if recordings is None else find_motions(recordings)
    sequences = [
        compute_features(motion, feature_set=library.feature_set).renamed(name)
        for name, motion in (motions or {}).items()
        if motion.mapping is not None
    ]
    at_hand = Collection(sequences, library.feature_set)
    galleries: list[dict[str, Any]] = []
    blocks: list[Block] = []
    for motion_class in chosen:
        for gallery, cells in _galleries(library, motion_class, motions, at_hand):
            key = f"g{len(galleries)}"
            shown, own = make_gallery(cells, key=key, rate_hz=rate_hz)
            galleries.append(shown | gallery)
            blocks += own
    content = {"features": describe_features(library.feature_set), "galleries": galleries}
    return build_page(content, blocks, title=title, path=path)


def find_confusions(library: ClassLibrary, motion_class: MotionClass) -> list[str]:
    """The nearest other classes, a line each.

    Costs are those of other classes' templates in the examples that the class keeps, or in
    its own templates where it keeps none.
    """
    shown = [example for one in motion_class.prototypes for example in one.examples]
    what = "its examples" if shown else "its template"
    if not shown:
        shown = [
            FeatureSequence(one.packed_values, one.packed_fixed, library.feature_set)
            for one, prototype in zip(motion_class.quantised, motion_class.prototypes, strict=True)
            if not prototype.mirror_of
        ]
    own = np.array([_least(motion_class, one) for one in shown])
    found = []
    for other in library:
        if other.name == motion_class.name:
            continue
        costs = np.array([_least(other, one) for one in shown])
        cost, n_nearer = float(np.min(costs)), int((costs < own).sum())
        if not np.isfinite(cost):
            continue
        text = f"{other.name}: costs {cost:.3f} at least in {what}"
        if cost <= other.threshold:
            text += f", below its threshold {other.threshold:.3g}: may be taken for it"
        if n_nearer:
            text += f"; nearer than the class itself in {n_nearer} of {len(shown)}"
        found.append((cost, text))
    return [text for _, text in sorted(found)[:_MOST_CONFUSED]]


def _least(motion_class: MotionClass, sequence: FeatureSequence) -> float:
    """Smallest cost of a class in a sequence; infinite where none of its templates fits."""
    return min(
        float(distance_function(pattern, sequence.packed, sequence.known).min(initial=np.inf))
        for _, pattern in motion_class.patterns
    )


def _galleries(
    library: ClassLibrary,
    motion_class: MotionClass,
    motions: Mapping[str, Motion] | None,
    at_hand: Collection,
) -> Iterator[tuple[dict[str, Any], list[Cell]]]:
    """What stands beside the clips of each template that is no mirror image, and the clips."""
    confusions = find_confusions(library, motion_class) or ["no other class fits into it"]
    hits: tuple[Hit, ...] = ()
    if at_hand.sequences:
        # The nearest are shown with their costs, whatever the threshold lets pass as a label.
        most = MOST_EXAMPLES * len(motion_class.prototypes)
        hits = search(motion_class, at_hand, threshold=np.inf, limit=most).hits
    own = [i for i, one in enumerate(motion_class.prototypes) if not one.mirror_of]
    for index in own:
        prototype = motion_class.prototypes[index]
        cells, said = _examples(motion_class, index, hits, motions)
        several = f" / {prototype.name}" if len(own) > 1 else ""
        yield (
            {
                "duration_s": round(prototype.template.duration_s, 4),
                "name": f"{motion_class.name}{several}",
                "facts": _facts(library, motion_class, prototype),
                "template": describe_template(motion_class.quantised[index]),
                "lists": [["Near to it", confusions], ["Examples", said]],
            },
            cells,
        )


def _facts(library: ClassLibrary, motion_class: MotionClass, prototype: Prototype) -> list[str]:
    n = prototype.template.n_examples
    facts = [
        "1 example" if n == 1 else f"{n} examples",
        f"{prototype.template.duration_s:.2f} s",
        f"threshold {motion_class.threshold:.3g}",
    ]
    for name, value in (
        ("precision", motion_class.estimated_precision),
        ("recall", motion_class.estimated_recall),
    ):
        if value is not None:
            facts.append(f"estimated {name} {100 * value:.0f} %")
    licence = motion_class.licence or library.licence
    return [*facts, *([f"licence {licence}"] if licence else [])]


def _examples(
    motion_class: MotionClass, index: int, hits: Sequence[Hit], motions: Mapping[str, Motion] | None
) -> tuple[list[Cell], list[str]]:
    """Clips of a template's examples, and what they are."""
    if motions is None:
        return [], ["a library keeps no positions; give recordings to see examples"]
    prototype = motion_class.prototypes[index]
    cells: list[Cell] = []
    for example in prototype.examples:
        motion = _cut_example(example, motions)
        if motion is not None and len(cells) < MOST_EXAMPLES:
            warp = warp_by(motion_class.patterns[index].pattern, example, motion)
            cells.append(Cell(example.source, f"{example.duration_s:.2f} s", motion, warp))
    if cells:
        return cells, [f"{len(cells)} of the {len(prototype.examples)} that it was learned from"]
    group = {prototype.name} | {
        one.name for one in motion_class.prototypes if one.mirror_of == prototype.name
    }
    templates = [
        template
        for template, one in zip(motion_class.quantised, motion_class.prototypes, strict=True)
        if one.name in group
    ]
    own = [hit for hit in hits if any(hit.evidence.template is one for one in templates)]
    cells = [
        cell_of_hit(rank, hit, motions[hit.recording.name])
        for rank, hit in enumerate(own[:MOST_EXAMPLES], start=1)
    ]
    if not cells:
        return [], ["nothing in the recordings at hand fits this template best"]
    return cells, [
        f"the library keeps none: the {len(cells)} nearest matches in the recordings at hand, "
        "with what they cost; mirror images of the template count"
    ]


def _cut_example(example: FeatureSequence, motions: Mapping[str, Motion]) -> Motion | None:
    """The motion that an example was measured of, where its recording is at hand."""
    name = match_recording(example.source, list(motions))
    if not example.source or name is None:
        return None
    motion, part = motions[name], example.recording
    first = part.first_frame - motion.first_frame
    if not 0 <= first < first + part.n_frames <= motion.n_frames:
        return None
    return motion.cut(first, first + part.n_frames).renamed(name)
