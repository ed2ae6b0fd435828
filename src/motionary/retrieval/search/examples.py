"""Search by an example over the everyday set: windows first, then the published features.

Windows are compared with every recording, the published features with the nearest ones, around
the place where the windows fit best. Both costs are laid together.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motionary.batch import Workers
from motionary.features import FULL_BODY, FeatureSequence
from motionary.matching import distance_function
from motionary.models.templates import MotionTemplate
from motionary.retrieval.explanation import Comparison, Evidence
from motionary.retrieval.index import Collection
from motionary.retrieval.search.expansion import QueryExpansion, RelevanceFeedback, expand
from motionary.retrieval.search.ranking import Hit, SearchPattern, SearchResult, hit_of, match
from motionary.retrieval.search.similar import (
    Place,
    WindowMatches,
    WindowSettings,
    find_equal,
    published_path,
    repeats,
    sample_windows,
    smallest_costs,
    travels,
    windows_of,
)

Floats = NDArray[np.float64]

# Of copies, windows of one cost nothing in another.
_LEAST_MEAN = 0.02
_TOO_SHORT = "nothing is like the example: recordings are too short, or too little of them was seen"


def search_by_windows(
    feedback: RelevanceFeedback,
    collection: Collection,
    expansion: QueryExpansion,
    *,
    threshold: float,
    limit: int | None,
    jobs: Workers = 1,
) -> SearchResult:
    """Ranked hits of an example over the everyday set, or of one with relevance feedback.

    Parameters
    ----------
    feedback : the example; relevant hits are looked for beside it
    collection : over the everyday set
    expansion : how the published features of the example become a template
    threshold, limit : largest cost, and most hits; None for all
    jobs : who compares windows with all recordings
    """
    matches = ExampleMatches(feedback, collection, expansion, jobs=jobs)
    hits = tuple(matches.rank(threshold=threshold, limit=limit))
    nearest = ""
    if not hits:
        best = next(iter(matches.rank(threshold=np.inf, limit=1)), None)
        nearest = (
            f"nearest is {best.recording.name} {best.cost:.3f} at {best.start_s:.1f} s, "
            f"threshold {threshold:.3f}"
            if best
            else _TOO_SHORT
        )
    return SearchResult(hits, (matches.template,), collection.failures, nearest)


class _Priced(NamedTuple):
    """A place and what it costs: in all, and by the published features; sorts as hits do."""

    cost: float
    number: int
    start: int
    place: Place
    published: float


@dataclass(frozen=True, eq=False)
class ExampleMatches:
    """Costs of an example in a collection, computed once for any ranking.

    Attributes
    ----------
    feedback, collection, expansion : as of `search_by_windows`
    settings : how windows are compared
    jobs : who compares them with all recordings
    """

    feedback: RelevanceFeedback
    collection: Collection
    expansion: QueryExpansion
    settings: WindowSettings = field(default_factory=WindowSettings)
    jobs: Workers = 1

    @property
    def template(self) -> MotionTemplate:
        """Template of the published features."""
        return self._expanded[0]

    @cached_property
    def weight(self) -> float:
        """Weight of the published features."""
        if travels(self.feedback.example):
            return self.settings.published_travelling
        return self.settings.published

    @cached_property
    def windows(self) -> WindowMatches:
        """Windows of the example, and of hits found relevant, in all recordings."""
        example = self.feedback.example
        found = [
            hit.comparison.found if isinstance(hit, Hit) and hit.comparison else hit
            for hit in self.feedback.relevant
        ]
        examples = [example, *(f for f in found if isinstance(f, FeatureSequence))]
        windows = windows_of(examples, travelling=travels(example), settings=self.settings)
        n_frames = max(len(one) for one in examples)
        return WindowMatches(
            windows, self.collection, n_frames=n_frames, settings=self.settings, jobs=self.jobs
        )

    @cached_property
    def smallest(self) -> Floats:
        """Cost of every recording at its best place, shape (recordings,); inf where none fits."""
        windows, numbers = self.windows.smallest, self._nearest
        published = np.ones(len(windows))
        published[numbers] = np.minimum(match([self._pattern], self._near).smallest, 1.0)
        cost = self._join(windows * self._factors, published)
        cost[windows >= self.settings.most_cost - 1e-6] = np.inf
        return cost

    def rank(self, *, threshold: float, limit: int | None) -> list[Hit]:
        """Hits over all recordings, best first."""
        wanted = limit
        while True:
            priced = self._price_all(threshold, wanted)
            made = (self._hit(one.place, one.cost, one.published) for one in priced)
            hits = [hit for hit in made if hit.evidence.is_assessed]
            # Of what was hardly seen there is no hit: others take its place.
            if limit is None or wanted is None or len(hits) >= limit or len(priced) < wanted:
                return hits[:limit]
            wanted *= 2

    def _price_all(self, threshold: float, limit: int | None) -> list[_Priced]:
        """Costs of the best places over all recordings, best first."""
        found: list[_Priced] = []
        most = threshold
        # No place of a recording costs less than its windows do.
        bounds = self._join(self.windows.smallest * self._factors, 0.0)
        for number in np.argsort(self.smallest, kind="stable").tolist():
            least = float(self.smallest[number])
            if not np.isfinite(least) or (limit and len(found) >= limit and least > most):
                break
            if bounds[number] > most:
                continue
            for one in self._price(number):
                if self._join(one.place.cost, 0.0) > most:
                    break
                if one.cost <= threshold:
                    found.append(one)
            if limit and len(found) >= limit:
                found = sorted(found)[:limit]
                most = min(most, found[-1].cost)
        return sorted(found)

    def _price(self, number: int) -> Iterator[_Priced]:
        """Places in a recording that do not repeat each other, by the cost of their windows."""
        sequence = self.collection.sequences[number]
        pattern = self._pattern.pattern
        length = max(len(self.feedback.example), len(pattern))
        seen = sequence.leading(FULL_BODY)
        published = distance_function(pattern, seen.packed, seen.known)
        taken: list[Place] = []
        for place in self.windows.places(number):
            cost = float(published[place.start : place.stop + length].min(initial=1.0))
            equal = find_equal(self.feedback.example, sequence, place)
            place = place._replace(cost=place.cost * self._factors[number])
            if equal is not None:
                place, cost = equal, 0.0
            if not any(repeats(place, other) for other in taken):
                taken.append(place)
                joined = float(self._join(place.cost, cost))
                yield _Priced(joined, number, place.start, place, cost)

    def _hit(self, place: Place, cost: float, published_cost: float) -> Hit:
        sequence = self.collection.sequences[place.number]
        published = sequence.leading(FULL_BODY)
        item = self._pattern
        path = published_path(item.pattern, published, place)
        evidence = Evidence(item.name, item.template, item.pattern, published, path)
        part = sequence.part(place.start, place.stop)
        start_s, end_s = sequence.segment(place.start, place.stop)
        return replace(
            hit_of(evidence),
            start_s=start_s,
            end_s=end_s,
            start_frame=sequence.recording.frame_at(start_s),
            end_frame=sequence.recording.last_frame_before(end_s),
            cost=cost,
            comparison=Comparison(self.feedback.example, part, place.cost, published_cost),
        )

    def _join(self, windows: Floats | float, published: Floats | float) -> Floats:
        return np.asarray((windows + self.weight * published) / (1 + self.weight))

    @cached_property
    def _nearest(self) -> list[int]:
        order = np.argsort(self.windows.smallest, kind="stable")
        return [int(number) for number in order[: self.settings.candidates]]

    @cached_property
    def _regions(self) -> Collection:
        """Frames around the best places of the nearest recordings."""
        sequences = self.collection.sequences
        regions = [sequences[number].part(*self.windows.region(number)) for number in self._nearest]
        return Collection(tuple(regions), self.collection.feature_set)

    @cached_property
    def _near(self) -> Collection:
        """The published features there."""
        return self._regions.published

    @cached_property
    def _factors(self) -> Floats:
        """What the windows count in each recording, shape (recordings,).

        Less where hardly any window of the collection fits; so that recordings in which many
        do, as of somebody who stands, are not near to every example.
        """
        factors = np.ones(len(self.collection))
        samples = sample_windows(
            self.collection, travelling=travels(self.feedback.example), settings=self.settings
        )
        cost = np.array([smallest_costs(window, self._regions) for _, window in samples])
        own = np.array(self._nearest) == np.array([number for number, _ in samples])[:, np.newaxis]
        count = np.count_nonzero(~own, axis=0)
        mean = np.where(own, 0.0, cost).sum(axis=0) / np.maximum(count, 1)
        if (count > 0).all():
            mean = np.maximum(mean, _LEAST_MEAN)
            factors[self._nearest] = (mean.mean() / mean) ** self.settings.hub
        return factors

    @cached_property
    def _expanded(self) -> tuple[MotionTemplate, SearchPattern]:
        feedback = RelevanceFeedback(
            self.feedback.example.leading(FULL_BODY),
            tuple(map(_published, self.feedback.relevant)),
            tuple(map(_published, self.feedback.irrelevant)),
        )
        prior = self.collection.published.feature_prior
        return expand(feedback, self._near, self.expansion, prior=prior)

    @property
    def _pattern(self) -> SearchPattern:
        return self._expanded[1]


def _published(hit: Hit | FeatureSequence) -> Hit | FeatureSequence:
    return hit.leading(FULL_BODY) if isinstance(hit, FeatureSequence) else hit
