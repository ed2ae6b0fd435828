"""The library `everyday` that ships: `python -m recipes.everyday [--without-people P ...]`.

Learned from HDM05, UI-PRMD and CMU, and designed by editing. What rests on HDM05 lies in a
folder of its own, under its licence; the other folder owes nothing to it, its prior included.
The same files give the same bytes on one machine with the same versions of packages.
"""

import argparse
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from motionary.features import FULL_BODY, FeatureSequence
from motionary.models.library import (
    ClassLibrary,
    MotionClass,
    Prototype,
    Scoring,
    calibrate_scores,
    fold_sides,
    measure_fractions,
    merge_libraries,
)
from motionary.models.library.classes import ClassKind
from motionary.models.library.editing import CALIBRATION, mirror_prototype, write_calibration
from motionary.models.library.training import learn_prototype
from motionary.models.templates import template_from_text
from recipes.judging import judge_people
from recipes.sources import (
    Example,
    Sources,
    exercise_examples,
    hash_files,
    hdm05_examples,
    read_sources,
    run_examples,
    takes_of,
    walk_examples,
)

FREE, HDM05 = "everyday", "everyday_hdm05"
PARTS = {FREE: ("cmu_everyday", "ui_prmd"), HDM05: ("hdm05",)}
HOME = Path(__file__).parents[1] / "src" / "motionary" / "libraries"
DESIGNS = Path(__file__).parent / "designs"

PROVENANCE = {
    FREE: "CMU Graphics Lab Motion Capture Database (mocap.cs.cmu.edu, funded by NSF "
    "EIA-0196217); Vakanski, Jun, Paul, Baker: A Data Set of Human Body Movements for Physical "
    "Rehabilitation Exercises (UI-PRMD), Data 3(1):2, 2018; classes designed by hand",
    HDM05: "Müller, Röder, Clausen, Eberhardt, Krüger, Weber: Documentation Mocap Database HDM05, "
    "CG-2007-2, Universität Bonn, 2007",
}
LICENCE = {FREE: "Apache-2.0", HDM05: "CC BY-SA 3.0"}

GAITS = ("walk", "run", "sneak", "walk backwards", "run backwards", "side step", "skip", "crawl")
STATES = (*GAITS, "T-pose", "lie")
#: Parts of the body that classes need, where not all: who walks may turn around meanwhile.
PARTS_OF_BODY: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(GAITS, ("arms", "legs")),
    "turn around": ("trunk",),
}
#: Least scores, where they are not the common one: chosen on streams of HDM05's bd, bk, dg,
#: UI-PRMD's s01 to s04 and CMU's 02, 05, 07, 16, 35, each labelled by a library without the
#: person, and on ACCAD's Male1 and Bandai's normal style. Short motions that ask little can not
#: score high; postures, and motions that begin others, would take these apart.
LEAST_SCORES = {
    "hop": 4.0, "pick up": 4.5, "cartwheel": 5.0, "punch": 5.0, "run backwards": 5.0,
    "jump": 5.5, "throw": 5.5, "turn around": 5.5, "kick": 6.0, "side step": 7.0, "skip": 7.0,
    "T-pose": 7.5, "arm raise sideways": 7.5, "arm raise backward": 8.0, "crouch": 9.0,
    "rise from crouch": 9.0, "crawl": 12.0, "lie": 12.0,
}  # fmt: skip
#: Of all others, chosen alike.
LEAST_SCORE = 6.5
#: Of these a template of each person stands beside the common one: people jump in many ways.
BY_PERSON = ("jump",)
#: Gaits are found by one, two and three cycles in a row.
CYCLES = (1, 2, 3)
#: Designs count as so many examples.
DESIGN_WEIGHS = 4
#: What turns round when time does, and says nothing of a motion run backwards.
_DIRECTED = (1, 2, 5, 6, 10, 11, 12, 13, 14, 23, 24, 35, 36, 40)


def build(sources: Sources, *, without: Collection[str] = ()) -> dict[str, ClassLibrary]:
    """Both parts of the library, by folder, without what some people did."""
    free = [*walk_examples(sources, without), *exercise_examples(sources, without)]
    free_runs = run_examples(sources, without)
    bound = hdm05_examples(sources, without)
    prior, corpus = measure_prior(free, takes_of(sources, None, without))
    learned = {FREE: learn_all(free), HDM05: learn_all([*bound, *free_runs])}
    learned[FREE] += list(designed(learned[FREE]))
    learned[HDM05] += [
        (name, restrict(one, "lower"))
        for name, one in learned[HDM05]
        if name in ("kick", "run") and one.name == name
    ]
    scoring = Scoring(corpus, threshold=LEAST_SCORE)
    return {part: assemble(learned[part], part, prior=prior, scoring=scoring) for part in PARTS}


def build_whole(sources: Sources, *, without: Collection[str] = ()) -> ClassLibrary:
    """Both parts as one library, as it is loaded."""
    return merge_libraries(list(build(sources, without=without).values()), clash="both")


def calibrate(
    sources: Sources, parts: Mapping[str, ClassLibrary], *, without: Collection[str], jobs: int = 1
) -> ClassLibrary:
    """The whole library with what people who taught nothing tell of its labels."""
    judged = judge_people(sources, partial(build_whole, sources), without=without, jobs=jobs)
    whole = merge_libraries(list(parts.values()), clash="both")
    labels = [label for one in judged for label in one.labels]
    return calibrate_scores(whole, labels, minutes=sum(one.free_minutes for one in judged))


def learn_all(examples: Iterable[Example]) -> list[tuple[str, Prototype]]:
    """A prototype of each class, of gaits by several cycles, of some classes by person."""
    by_class: dict[str, list[FeatureSequence]] = {}
    by_person: dict[tuple[str, str], list[FeatureSequence]] = {}
    for one in examples:
        by_class.setdefault(one.name, []).append(one.sequence)
        if one.name in BY_PERSON:
            by_person.setdefault((one.name, one.person), []).append(one.sequence)
    found = []
    for name, items in by_class.items():
        if name in GAITS:
            found += repeat(name, learn_prototype(name, items))
        else:
            found.append((name, learn_prototype(name, fold_sides(items))))
    for number, ((name, _), items) in enumerate(sorted(by_person.items()), 1):
        own = learn_prototype(name, fold_sides(items))
        found.append((name, replace(own, name=f"{name}, one person ({number})")))
    return found


def repeat(name: str, one: Prototype) -> list[tuple[str, Prototype]]:
    """A gait by one, two and three cycles."""
    found = []
    for n in CYCLES:
        t = one.template
        values, weights = np.tile(t.values, (n, 1)), np.tile(t.weights, n)
        called = one.name if n == 1 else f"{one.name}, {n} cycles"
        found.append((name, Prototype(called, replace(t, values=values, weights=weights))))
    return found


def designed(learned: Sequence[tuple[str, Prototype]]) -> Iterable[tuple[str, Prototype]]:
    """Classes by editing: of texts, and of templates run backwards."""
    drawn = [_read_design(path) for path in sorted(DESIGNS.glob("*.txt"))]
    for name, one in drawn:
        yield from repeat(name, one) if name in GAITS else [(name, one)]
    first = dict(reversed(drawn))
    crawl = backwards(first["crawl"], "crawl backwards, designed")
    yield from repeat("crawl", crawl)
    yield from repeat("run backwards", backwards(first["run"], "run backwards, designed"))
    yield "rise from crouch", backwards(first["crouch"], "rise from crouch, designed")
    yield "lie down", backwards(first["get up"], "lie down, designed")
    walk = next(one for name, one in learned if name == "walk")
    free = [FULL_BODY.ids.index(f"F{number}") for number in _DIRECTED]
    yield from repeat("walk backwards", backwards(walk, "walk backwards, designed", free))


def _read_design(path: Path) -> tuple[str, Prototype]:
    """Class and prototype of a text; of "kick.high" the class is kick."""
    called = path.stem.replace("_", " ")
    name = called.split(".")[0]
    template = template_from_text(path.read_text("utf-8"), name=called)
    own = called.replace(".", " ")
    return name, Prototype(f"{own}, designed", replace(template, n_examples=DESIGN_WEIGHS))


def backwards(one: Prototype, name: str, free: Sequence[int] = ()) -> Prototype:
    """A template in the opposite order of time, some features freed."""
    values = one.template.values[::-1].copy()
    values[:, list(free)] = 0.5
    template = replace(
        one.template,
        values=values,
        weights=one.template.weights[::-1].copy(),
        provenance=f"{name.removesuffix(', designed')}, designed by editing",
    )
    return Prototype(name, template)


def restrict(one: Prototype, group: str) -> Prototype:
    """A template of the features of one group alone."""
    values = one.template.values.copy()
    values[:, [i for i, f in enumerate(FULL_BODY.features) if f.group != group]] = 0.5
    return Prototype(f"{one.name}, {group} body", replace(one.template, values=values))


def measure_prior(
    examples: Sequence[Example], others: Sequence[FeatureSequence]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Prior of all classes, and the corpus in it; each class and each take counts alike."""
    by_class: dict[str, list[FeatureSequence]] = {}
    for one in examples:
        by_class.setdefault(one.name, []).append(one.sequence)
    own: Mapping[str, np.ndarray] = {
        name: measure_fractions(items, FULL_BODY) for name, items in by_class.items()
    }
    corpus = np.mean([measure_fractions([one], FULL_BODY) for one in others], axis=0)
    prior = (np.mean(list(own.values()), axis=0) + corpus) / 2
    prior = (prior + prior[FULL_BODY.mirror_order]) / 2
    return _round(prior), _round(corpus)


def assemble(
    learned: Sequence[tuple[str, Prototype]],
    part: str,
    *,
    prior: tuple[float, ...],
    scoring: Scoring,
) -> ClassLibrary:
    """A library of prototypes and their mirror images."""
    classes = []
    for name in sorted({name for name, _ in learned}):
        own = [one for called, one in learned if called == name]
        own += [mirror_prototype(one, FULL_BODY) for one in own]
        kind: ClassKind = "state" if name in STATES else "event"
        classes.append(
            MotionClass(
                name, tuple(own), prior=prior, kind=kind, parts=PARTS_OF_BODY.get(name, ()),
                score_threshold=LEAST_SCORES.get(name),
            )
        )  # fmt: skip
    return ClassLibrary(tuple(classes), FULL_BODY, PROVENANCE[part], LICENCE[part], scoring=scoring)


def _round(fractions: np.ndarray) -> tuple[float, ...]:
    return tuple(round(float(x), 6) for x in np.clip(fractions, 1e-6, 1 - 1e-6))


def main(arguments: Sequence[str] | None = None) -> None:
    """Make both folders."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--without-people", nargs="*", default=(), metavar="PERSON")
    parser.add_argument("--output", type=Path, default=HOME)
    options = parser.parse_args(arguments)
    sources = read_sources(Path(os.environ["MOTIONARY_DATA"]), jobs=2)
    parts = build(sources, without=options.without_people)
    for part, library in parts.items():
        folder = options.output / part
        library.save(folder)
        hashes = hash_files(sources, PARTS[part], options.without_people)
        (folder / "SOURCES.txt").write_text("\n".join(hashes) + "\n", "utf-8")
    whole = calibrate(sources, parts, without=options.without_people, jobs=2)
    # Some of the people are HDM05's, so that it goes with what is under its licence.
    write_calibration(whole, options.output / HDM05 / CALIBRATION)


if __name__ == "__main__":
    main()
