"""How long does one way take beside another?

Runs are interleaved, so that a busy moment of the machine meets all ways alike, and
medians are compared, so that a single stall decides nothing. Only ratios hold across
machines.
"""

import statistics
import time
from collections.abc import Callable, Mapping


def compare(ways: Mapping[str, Callable[[], object]], *, runs: int = 9) -> dict[str, float]:
    """Median seconds of each way, from interleaved runs.

    Each way runs once beforehand, unmeasured: caches fill and compilers finish.

    Parameters
    ----------
    ways : what to call, by name
    runs : measured calls of each way
    """
    if runs < 1:
        raise ValueError(f"runs must be at least 1, got {runs}")
    for call in ways.values():
        call()
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(runs):
        for name, call in ways.items():
            start = time.perf_counter()
            call()
            seconds[name].append(time.perf_counter() - start)
    return {name: statistics.median(measured) for name, measured in seconds.items()}


def print_ratios(medians: Mapping[str, float], *, reference: str) -> None:
    """Print each median and how many times faster than `reference` it is."""
    width = max(len(name) for name in medians)
    for name, median in medians.items():
        ratio = medians[reference] / median
        print(f"  {name:<{width}}  {median * 1e3:12.3f} ms  {ratio:8.2f} x")
