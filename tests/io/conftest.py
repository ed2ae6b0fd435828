"""Expects to fail what `NOT_YET` lists, and notices what passes all the same."""

import pytest

from reading_cases import NOT_YET, WAITS


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of files that are not read right yet."""
    for item in items:
        callspec = getattr(item, "callspec", None)
        name = callspec.id if callspec is not None else item.name
        if item.path.name in ("test_faults.py", "test_wild.py") and name in NOT_YET:
            run = name not in WAITS
            item.add_marker(pytest.mark.xfail(strict=True, run=run, reason="not yet"))
