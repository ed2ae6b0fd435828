"""What all tests share: recordings, seeded hypothesis, no network, a count of what ran.

Recordings are not part of the repository. `MOTIONARY_DATA` names their folder; without
it the tests that ask for them skip, and the run says how many did.
"""

import ipaddress
import os
import pickle
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# Workers share the cores already; threads of matrix products would only wait for each other.
# Read when NumPy is imported, by processes that tests start too.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

# A process that tests start, a worker too, else compiles again what it imports: half a second.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

VARIABLE = "MOTIONARY_DATA"
RECORDING_FIXTURES = {"data", "golden", "hdm05"}
MARK = "recordings"
SLOW = {
    line
    for line in Path(__file__).with_name("slow.txt").read_text("utf-8").splitlines()
    if not line.startswith("#")
}

# Derandomised: the same commit gives the same verdict everywhere. No deadline: a shared
# machine stalls now and then, which says nothing about the code.
settings.register_profile(
    "motionary",
    derandomize=True,
    deadline=None,
    max_examples=15,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
# More, for `make coverage`.
settings.register_profile("thorough", settings.get_profile("motionary"), max_examples=40)
# Some of the inputs, for `make quick`; a test with a number of its own keeps that.
settings.register_profile("quick", settings.get_profile("motionary"), max_examples=6)
settings.load_profile("motionary")


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of the recordings."""
    return _folder(Path(_named_folder()))


@pytest.fixture(scope="session")
def golden() -> Path:
    """Folder of the published matrices and tables, beside the recordings."""
    return _folder(Path(_named_folder()).resolve().parent / "reference" / "golden")


@pytest.fixture(scope="session")
def hdm05(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Features of the 288 clips of HDM05, by file name without suffix; read once in a run."""
    from motionary.features import read_features

    # Workers of one run share what the first of them read.
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID", "")
    shared = tmp_path_factory.getbasetemp().parent / f"hdm05-{run}.pickle"
    if run and shared.exists():
        return pickle.loads(shared.read_bytes())
    paths = sorted((data / "hdm05").rglob("*.[aA][mM][cC]"))
    clips = {Path(s.source).stem: s for s in read_features((path.name, path) for path in paths)}
    assert len(clips) == 288
    if run:
        beside = shared.with_suffix(f".{os.getpid()}")
        beside.write_bytes(pickle.dumps(clips))
        beside.replace(shared)
    return clips


@pytest.fixture(scope="session")
def _started() -> Iterator[Any]:
    from motionary.batch import _make_pool

    with _make_pool(2) as pool:
        yield pool


@pytest.fixture
def two_processes(_started: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work of two processes is done by those of the tests before: starting them takes longest."""

    class Kept:
        submit = staticmethod(_started.submit)

        def shutdown(self) -> None:
            """They go on for the next test."""

    def keep(jobs: int) -> Kept:
        assert jobs == 2
        return Kept()

    monkeypatch.setattr("motionary.batch._make_pool", keep)


@pytest.fixture
def motionary(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Any:
    """Runs a command in this process."""
    from cli_cases import run

    return lambda *arguments: run(capsys, monkeypatch, *arguments)


@pytest.fixture(scope="session")
def examples() -> Any:
    """Four synthetic motions of each of a few classes, each class of one prototype."""
    from cli_cases import CLASSES
    from motionary.features import compute_features
    from motionary.samples import synthetic_motion

    return {
        name: {name: [compute_features(synthetic_motion(name, seed=seed)) for seed in range(4)]}
        for name in CLASSES
    }


def _named_folder() -> str:
    named = os.environ.get(VARIABLE, "")
    if not named:
        pytest.skip(f"{VARIABLE} is not set: no recordings to test on")
    return named


def _folder(path: Path) -> Path:
    # A wrong path must not look like a machine without recordings.
    if not path.is_dir():
        pytest.fail(f"{VARIABLE} is set, but there is no folder {path}")
    return path


@pytest.fixture(autouse=True, scope="session")
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep what commands remember out of this user's cache."""
    patch = pytest.MonkeyPatch()
    patch.setenv("MOTIONARY_CACHE", str(tmp_path_factory.mktemp("cache")))
    yield
    patch.undo()


@pytest.fixture(autouse=True, scope="session")
def _no_network() -> Iterator[None]:
    """Fail a test that connects to another machine."""
    patch = pytest.MonkeyPatch()
    for name in ("connect", "connect_ex"):
        patch.setattr(socket.socket, name, _local_only(getattr(socket.socket, name)))
    yield
    patch.undo()


def _local_only(connect: Any) -> Any:
    def guarded(self: socket.socket, address: Any) -> Any:
        if self.family != getattr(socket, "AF_UNIX", None) and not _is_local(address[0]):
            pytest.fail(f"a test tried to reach {address[0]}; tests use no network")
        return connect(self, address)

    return guarded


def _is_local(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def pytest_configure(config: pytest.Config) -> None:
    """Register the marks that select tests; keep what is compiled for the run."""
    # Where nothing is to be written beside the source, each process that a test starts would
    # compile the package anew. Workers of the run have its environment.
    if not hasattr(config, "workerinput") and os.environ.pop("PYTHONDONTWRITEBYTECODE", ""):
        place = tempfile.TemporaryDirectory(prefix="motionary-tests-")
        config.add_cleanup(place.cleanup)
        os.environ["PYTHONPYCACHEPREFIX"] = place.name
    config.addinivalue_line("markers", f"{MARK}: asks for real recordings (set by itself)")
    config.addinivalue_line("markers", "slow: left out of `make quick` (set by tests/slow.txt)")


@pytest.hookimpl(tryfirst=True)  # before -m selects by them
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark tests that ask for recordings, and slow ones; marks travel from workers."""
    for item in items:
        if RECORDING_FIXTURES & set(getattr(item, "fixturenames", ())):
            item.add_marker(MARK)
        if getattr(item, "originalname", item.name) in SLOW:
            item.add_marker("slow")


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Say how many tests used real recordings and how many lacked them."""
    ran, skipped = set(), set()
    for status, reports in terminalreporter.stats.items():
        for report in reports:
            if MARK not in getattr(report, "keywords", ()):
                continue
            if status == "skipped":
                if VARIABLE in str(report.longrepr):
                    skipped.add(report.nodeid)
            elif getattr(report, "when", "") == "call":  # deselected tests have none
                ran.add(report.nodeid)
    terminalreporter.write_line(
        f"real recordings: {len(ran)} tests used them, "
        f"{len(skipped)} skipped for want of them ({VARIABLE})"
    )
