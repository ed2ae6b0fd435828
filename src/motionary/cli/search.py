"""`motionary search`: where recordings hold a motion like an example, a class or keyframes."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from motionary.cli import screen
from motionary.cli.convert import cut_labels
from motionary.cli.index import IndexOptions, open_recordings
from motionary.cli.options import (
    LIBRARY_FILE,
    AsJson,
    LabelFile,
    LibraryDefault,
    TableOptions,
    argument,
    check_library,
    check_page,
    check_picture,
    check_target,
    given_options,
    option,
    refuse,
)
from motionary.cli.query import Query, QueryOptions, Ranks, read_query, read_ranks
from motionary.cli.recordings import WorkOptions, read_recording
from motionary.io.options import ReadOptions

if TYPE_CHECKING:
    from motionary.batch import Workers
    from motionary.labels import LabelTrack
    from motionary.retrieval.index import Collection
    from motionary.retrieval.index.opening import Opened
    from motionary.retrieval.search import QueryExpansion, SearchResult

_KEYS = ("start_s", "end_s", "start_frame", "end_frame", "cost", "known")
_COLUMNS = (">rank", "recording", ">start_s", ">end_s", ">frames", ">cost", ">known")
_MOST_COMPARED = 3
#: Longer examples hold several motions, as a rule.
_LONG_S = 6.0


@dataclass(frozen=True, kw_only=True)
class HitOptions:
    """Which hits count."""

    threshold: float | None = option(
        "--threshold COST",
        "Largest cost of a hit; by default the class's own, none for an example.",
        min=0.0,
    )
    limit: int = option(
        "--limit N",
        "Most hits; 0: all.",
        LibraryDefault("motionary.retrieval.search:search", "limit"),
        min=0,
    )
    fast: bool | None = option(
        "--fast/--thorough",
        "Match only around keyframes, derived where there are none: faster, and misses some; or "
        "everywhere. By default around the keyframes of a class that has some.",
    )


@dataclass(frozen=True, kw_only=True)
class ResultOptions(TableOptions):
    """What becomes of the hits, and of what they were found with."""

    output: LabelFile = None
    cut: str | None = option("--cut FOLDER", "Write each hit as a clip.")
    sheet: str | None = option("--sheet PNG", "Draw the hits as stick figures below the example.")
    report: str | None = option(
        "--report HTML",
        "Write a page that plays the hits side by side, in step, and takes yes and no.",
    )
    template: str | None = option("--template PNG", "Draw the template that was learned.")
    save_query: str | None = option(
        "--save-query FILE", "Write the keyframes, to be changed and used again."
    )
    save_class: str | None = option(
        "--save-class LIB", "Add the learned template to a library, as a class."
    )

    @property
    def holds_labels(self) -> bool:
        """Hits become labels."""
        return True

    def check(self, *, as_json: bool) -> None:
        """Fail before the work where something cannot be written."""
        check_page("--report", self.report)
        check_picture("--sheet", self.sheet)
        check_picture("--template", self.template)
        check_target(self.save_query, replace=self.force)
        check_target(self.cut, is_folder=True)
        if self.save_class is not None:
            check_library(self.save_class, replace=True)
        super().check(as_json=as_json)


def search(
    folder: Annotated[list[str], argument("FOLDER", "Folders, files or patterns to search.")],
    options: QueryOptions,
    which: HitOptions,
    results: ResultOptions,
    index: IndexOptions,
    as_json: AsJson = False,
    *,
    work: WorkOptions,
    reading: ReadOptions,
) -> int:
    """Find more motions like an example, all of a class, or wherever keyframes are shown.

    An example needs no training: it is compared window by window, by quantities ranked in
    everyday motion, so that other people and styles are found; and by a template that is learned
    from it and its nearest hits. What the template fixes and leaves open stands above the hits,
    below them in which quantities the first ones are alike. A cost of 0 agrees everywhere. What
    was read of a folder is kept for the next search.

    motionary search recordings/ --like take.bvh --from 1.2 --to 3.4 --sheet hits.png
    motionary search recordings/ --like take.bvh --report hits.html
    motionary search recordings/ --like take.bvh --relevant 1,2,5 --irrelevant 3
    motionary search recordings/ --class squat --library my-classes
    motionary search recordings/ --query "right hand fast, then within 0.5 s right hand low"
    """
    options.check()
    if options.like is None:
        learned = {"--template": results.template, "--save-class": results.save_class}
        refuse(learned, "goes with --like FILE")
    results.check(as_json=as_json)
    ranks = read_ranks(options)
    query = _read_example(options, reading, fast=bool(which.fast))
    with work.open() as workers:
        opened, code = open_recordings(
            folder, index, reading=reading, feature_set=query.feature_set, jobs=workers
        )
        answer = _find(query, ranks, options, which, opened, jobs=work.searching(workers))
    given = given_options(options, which, index, reading, without=("relevant", "irrelevant"))
    answer.write(results, _command_of(folder, given), reading)
    if as_json:
        answer.print_json()
    elif not results.takes_stdout:
        answer.print()
    is_cut = not results.cut or cut_labels(
        answer.tracks, opened.files, results.cut,
        reading=reading, jobs=work.jobs, replace=results.force,
    )  # fmt: skip
    return code or (0 if is_cut and answer.result.hits else 1)


def _read_example(options: QueryOptions, reading: ReadOptions, *, fast: bool) -> Query:
    """What is looked for; says where a whole file may be more than was meant."""
    query = read_query(options, reading, fast=fast)
    is_whole = options.start is None and options.stop is None
    duration_s = query.example.features.duration_s if query.example else 0.0
    if is_whole and duration_s > _LONG_S:
        screen.warn(
            f"the whole file is the example, {duration_s:.0f} s in parts of 2 s: recordings are "
            "found that hold most of them; choose one motion by --from and --to"
        )
    return query


def _command_of(folder: Sequence[str], options: Sequence[str]) -> str:
    """The command that searches so again, as it is typed in a shell."""
    names = (Path(path).name or path for path in folder)
    return shlex.join(["motionary", "search", *names, *options])


def _find(
    query: Query,
    ranks: Ranks,
    options: QueryOptions,
    which: HitOptions,
    opened: "Opened",
    *,
    jobs: "Workers",
) -> "_Answer":
    """Hits before and after those that a person judged; the same where there are none."""
    from motionary.retrieval.search import QueryExpansion
    from motionary.retrieval.search import search as search_for

    expansion = QueryExpansion(hits=options.expand, published=options.published)
    find = partial(
        search_for, recordings=opened.collection, threshold=which.threshold,
        expansion=expansion, preselect=query.keyframes or which.fast, jobs=jobs,
    )  # fmt: skip
    limit = which.limit or None
    if not (query.example and ranks.most):
        result = find(query.what, limit=limit)
        return _Answer(query, ranks, expansion, opened, result, result)
    features = query.example.features
    first = find(features, limit=None if limit is None else max(ranks.most, limit))
    result = find(ranks.to_feedback(features, first), limit=limit)
    return _Answer(query, ranks, expansion, opened, first, result)


@dataclass(frozen=True)
class _Answer:
    """Hits, and with what they were found.

    Attributes
    ----------
    query, ranks, expansion, opened : what was looked for, how, and where
    first, result : hits before and after those that a person judged
    """

    query: Query
    ranks: Ranks
    expansion: "QueryExpansion"
    opened: "Opened"
    first: "SearchResult"
    result: "SearchResult"

    @cached_property
    def tracks(self) -> "list[LabelTrack]":
        """A track a hit: rows of a table in the sequence of the ranks."""
        from motionary.labels import Label, LabelTrack

        return [
            LabelTrack(
                hit.recording,
                (Label(self.query.name, **{key: getattr(hit, key) for key in _KEYS}),),
            )
            for hit in self.result
        ]

    # -- printed ------------------------------------------------------------------------

    def print_json(self) -> None:
        """Print a JSON object a hit."""
        for hit in self.result:
            keys = {key: getattr(hit, key) for key in _KEYS}
            screen.print_json({"recording": hit.recording.name} | keys)
        if not self.result:
            screen.warn(self.result.nearest)

    def print(self) -> None:
        """Print what is looked for, the hits, and in what the first ones are alike."""
        if self.query.example:
            screen.say(*self._learned_lines(), "")
        rows = [
            (
                str(rank), hit.recording.name, f"{hit.start_s:.2f}", f"{hit.end_s:.2f}",
                f"{hit.start_frame}–{hit.end_frame}", f"{hit.cost:.3f}", screen.percent(hit.known),
            )
            for rank, hit in enumerate(self.result, start=1)
        ]  # fmt: skip
        if rows:
            screen.print_table(_COLUMNS, rows)
            screen.say(*self._comparison_lines())
        else:
            screen.say(self.result.nearest)

    def _learned_lines(self) -> list[str]:
        """The template that was learned, and the keyframes around which was matched."""
        from motionary.models.keyframes import format_queries
        from motionary.models.templates import describe_template

        template, feature_set = self.result.templates[0], self._published.feature_set
        lines = describe_template(
            template, tolerance=self.expansion.tolerance, feature_set=feature_set
        )
        if self.expansion.hits and template.n_examples == 1 and not self.ranks.most:
            lines.append("  nothing was near enough to learn from what may vary")
        if self.result.queries:
            fraction = 100 * self.result.fraction_matched
            lines.append(f"  matched in {fraction:.0f} % of the frames, around keyframes:")
            text = format_queries(self.result.queries, vocabulary=feature_set)
            shown = [line for line in text.splitlines() if not line.startswith("features: ")]
            lines += [f"    {line}" for line in shown]
        return lines

    def _comparison_lines(self) -> list[str]:
        """In which quantities the first hits that are not the example are like it."""
        from motionary.retrieval.explanation import describe_comparison

        compared = [
            (rank, describe_comparison(hit.comparison))
            for rank, hit in enumerate(self.result, start=1)
            if hit.comparison and hit.cost > 0
        ]
        lines = [
            f"{rank if i == 0 else '':>4}  {line}"
            for rank, lines in compared[:_MOST_COMPARED]
            for i, line in enumerate(lines)
        ]
        return ["", *lines] if lines else []

    @property
    def _published(self) -> "Collection":
        return self.opened.collection.published

    # -- written ------------------------------------------------------------------------

    def write(self, results: ResultOptions, command: str, reading: ReadOptions) -> None:
        """Write and draw the hits and what they were found with."""
        if results.output:
            from motionary.io import write_labels

            write_labels(self.tracks, results.output, excel=results.excel)
        if results.sheet:
            self._draw_sheet(results.sheet, reading)
        if results.template:
            from motionary.plots import plot_template, save

            template = self.result.templates[0]
            save(plot_template(template, tolerance=self.expansion.tolerance), results.template)
        if results.save_query:
            from motionary.io import write_text
            from motionary.models.keyframes import format_queries
            from motionary.retrieval.search import suggest_queries

            queries = self.result.queries or suggest_queries(self.result.templates, self._published)
            text = format_queries(queries, vocabulary=self._published.feature_set)
            write_text(results.save_query, text)
        if results.save_class:
            self._save_class(results.save_class)
        if results.report:
            self._write_page(results.report, command, reading)

    def _save_class(self, folder: str) -> None:
        """Add the template to a library, in place of a class of its name; or to a new library."""
        from motionary.models.library import ClassLibrary, load_library
        from motionary.retrieval.search import class_of_result

        learned = class_of_result(self.result, self.query.name, self._published, self.expansion)
        library = ClassLibrary((), self._published.feature_set)
        if Path(folder, LIBRARY_FILE).exists():
            library = load_library(folder)
        others = tuple(one for one in library if one.name != learned.name)
        replace(library, classes=(*others, learned)).save(folder)

    def _draw_sheet(self, path: str, reading: ReadOptions) -> None:
        """Stick figures of an example and its hits; without an example the best hit leads."""
        from motionary.plots import plot_sheets, save_pages
        from motionary.retrieval.search import cut_frames

        read = cache(lambda name: read_recording(self.opened.files[name], reading))
        rows = []
        if self.query.example is not None:
            part = self.query.example.features.recording
            last = part.first_frame + part.n_frames - 1
            title = f"example: {self.query.example.title}"
            rows.append((title, *cut_frames(self.query.example.motion, part.first_frame, last)))
        for rank, hit in enumerate(self.result, start=1):
            name = hit.recording.name
            title = f"{rank}: {name} {hit.start_s:.2f}–{hit.end_s:.2f} s, cost {hit.cost:.3f}"
            rows.append((title, *cut_frames(read(name), hit.start_frame, hit.end_frame)))
        if rows:
            screen.warn_of_pages(path, save_pages(plot_sheets(rows[0], rows[1:]), path))

    def _write_page(self, path: str, command: str, reading: ReadOptions) -> None:
        """A page of the hits beside the example; on it a person judges them for the command."""
        from motionary.reporting import Judging, MotionFiles, rank_among, report_hits

        example = judging = None
        if self.query.example is not None:
            part, motion = self.query.example.features.recording, self.query.example.motion
            start = part.first_frame - motion.first_frame
            example = motion.cut(start, start + part.n_frames)
            judging = Judging(command, rank_among(self.result, self.first), *self.ranks)
        report_hits(
            self.result, MotionFiles(self.opened.files, reading), path,
            query=example, judging=judging, title=self.query.name,
        )  # fmt: skip
        screen.say_size(path)
