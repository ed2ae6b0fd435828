"""Times of several ways of doing the same.

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


def print_ratios(
    medians: Mapping[str, float], *, reference: str, seconds: float | None = None
) -> None:
    """Print each median, and how many times as fast as the reference it is.

    Parameters
    ----------
    medians : seconds by name
    reference : one of these names; or, with `seconds`, what took so long elsewhere
    """
    width = max(len(name) for name in medians)
    compared = medians[reference] if seconds is None else seconds
    for name, median in medians.items():
        ratio = f"{compared / median:8.2f} x {reference}" if name != reference else "reference"
        print(f"  {name:<{width}}  {median * 1e3:12.3f} ms  {ratio}")
