"""Where the recordings of an index lie: folders, chosen files, and whatever fsspec reaches.

Of several sources each has a label, the end of its address, that stands before the names of its
recordings. No label begins another, so that names stay unique over all of them.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from glob import has_magic
from itertools import pairwise
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from motionary.errors import (
    InvalidInput,
    MotionaryError,
    UnreadableFile,
    check_path,
    describe_cause,
)
from motionary.io import (
    MOTION_SUFFIXES,
    FileState,
    file_of,
    find_recordings,
    has_sidecar,
    read_text,
    scan_folder,
    split_files,
)

#: Stands before the name of a list of files.
LIST_MARK = "@"
_URL_MARK = "://"
_SKELETON_SUFFIX = ".asf"
# What file systems call that which changes with a file.
_STATE_KEYS = (
    "ETag", "etag", "md5Hash", "content_md5", "LastModified", "last_modified", "updated",
    "modified", "mtime", "created",
)  # fmt: skip


class Source(NamedTuple):
    """A folder, here or behind a URL, that is searched to the bottom, or chosen files of it.

    Attributes
    ----------
    folder : path or URL
    label : stands before the names of its recordings; empty if it is the only source
    chosen : names of its files; None for all
    """

    folder: str
    label: str = ""
    chosen: tuple[str, ...] | None = None

    @property
    def is_remote(self) -> bool:
        """Whether its files are fetched before they are read."""
        return is_url(self.folder)

    @property
    def prefix(self) -> str:
        """What stands before the names of its recordings."""
        return f"{self.label}/" if self.label else ""

    def address(self, name: str) -> str:
        """Path or URL of a recording, by its name in this source."""
        return f"{self.folder}/{name}" if self.is_remote else str(Path(self.folder) / name)

    def scan(self, *, on_skip: Callable[[str], None]) -> dict[str, FileState]:
        """States of its files by name, sorted; a chosen file that is not there has size -1.

        Raises
        ------
        InvalidInput
            If no package reads such a URL.
        UnreadableFile
            If the source is missing, or may not be read.
        """
        if self.is_remote:
            return _scan_remote(self)
        if self.chosen is None:
            return scan_folder(self.folder, on_skip=on_skip)
        return {name: _state_of(self.address(name)) for name in self.chosen}

    def split(self, name: str) -> list[str]:
        """Names of the recordings of a file."""
        if not self.is_remote:
            return list(split_files({name: Path(self.folder) / name}))
        # Opened only where a format may hold several.
        with TemporaryDirectory() as place:
            try:
                return list(split_files({name: fetch(self.address(name), Path(place))}))
            except UnreadableFile:
                return [name]


def is_url(path: str) -> bool:
    """Whether an address is a URL."""
    return _URL_MARK in path


def cache_key(sources: Sequence[Source]) -> Path:
    """A path that stands for sources where the cache looks for their index."""
    if len(sources) == 1 and not sources[0].is_remote and sources[0].chosen is None:
        return Path(sources[0].folder)
    said = [(s.folder if s.is_remote else str(Path(s.folder).resolve()), s.chosen) for s in sources]
    digest = hashlib.blake2b(repr(said).encode("utf-8", "surrogateescape"), digest_size=8)
    return Path(Path.cwd().anchor, f"sources-{digest.hexdigest()}")


def is_list(path: str) -> bool:
    """Whether an address means a list of files: `@list.txt`."""
    return path.startswith(LIST_MARK) and not Path(path).exists()


def find_address(name: str, by_label: Mapping[str, Source]) -> str:
    """Path or URL of a recording; of one that lies in no source, its name."""
    ends = [0, *(i for i, letter in enumerate(name) if letter == "/")]
    source = next((by_label[name[:end]] for end in ends if name[:end] in by_label), None)
    return name if source is None else source.address(name.removeprefix(source.prefix))


def find_sources(given: str | Path | Sequence[str | Path]) -> tuple[Source, ...]:
    """Sources that folders, files, lists and URLs mean; what lies in another counts once.

    Parameters
    ----------
    given : paths, patterns such as "take_*.bvh", and URLs, a path alone is a folder; `@list.txt`
        is a text file with one of them a line, relative to it

    Raises
    ------
    WrongKind
        If something else is given.
    UnreadableFile
        If a list cannot be read, or nothing has a name like a pattern.
    InvalidInput
        If there is no source.
    """
    several = given if isinstance(given, list | tuple) else [given]
    for one in several:
        check_path(one, remedy="give the name of a folder")
    paths = [str(path) for path in several]
    if several is not given and not (is_url(paths[0]) or is_list(paths[0])):
        return (Source(paths[0]),)
    found: dict[str, tuple[str, set[str] | None]] = {}
    for path in _expand(paths):
        folder, name = _divide(path)
        key = folder if is_url(folder) else str(Path(folder).resolve())
        _, chosen = found.setdefault(key, (folder, set()))
        if name is None:
            found[key] = folder, None
        elif chosen is not None:
            chosen.add(name)
    if not found:
        raise InvalidInput("expected a folder, a file or a URL, got none; is the list empty?")
    parts = {key: _parts(key) for key in found}
    whole = {parts[key] for key, (_, chosen) in found.items() if chosen is None}
    kept = [
        key
        for key in sorted(found)
        if not any(parts[key][:depth] in whole for depth in range(is_url(key), len(parts[key])))
    ]
    labels = _label([parts[key] for key in kept])
    return tuple(
        Source(folder, label, None if chosen is None else tuple(sorted(chosen)))
        for label, (folder, chosen) in zip(labels, map(found.__getitem__, kept), strict=True)
    )


def _expand(given: Iterable[str]) -> Iterator[str]:
    """The same without lists and patterns."""
    for path in given:
        for one in _read_list(path) if is_list(path) else [path]:
            if not is_url(one) and has_magic(one) and not file_of(one).exists():
                yield from map(str, find_recordings(one))
            else:
                yield one


def _read_list(path: str) -> list[str]:
    """Paths in a list, relative to it; one that looks like a list is a folder there."""
    file = Path(path.removeprefix(LIST_MARK))
    lines = [line.strip() for line in read_text(file).splitlines()]
    named = (line for line in lines if line and not line.startswith("#"))
    return [one if is_url(one) else str(file.parent / one) for one in named]


def _divide(path: str) -> tuple[str, str | None]:
    """The folder of an address, and the file in it; None for all of the folder."""
    is_file = path.lower().endswith(tuple(MOTION_SUFFIXES))
    if is_url(path):
        path = path.rstrip("/")
        folder, _, name = path.rpartition("/")
        return (folder, name) if is_file else (path, None)
    if Path(path).is_file() or (is_file and not Path(path).is_dir()):
        return str(Path(path).parent), Path(path).name
    return path, None


def _parts(key: str) -> tuple[str, ...]:
    parts = key.split("/") if is_url(key) else PurePath(key).parts
    return tuple(part for part in (p.strip("/\\") for p in parts) if part)


def _label(sources: Sequence[tuple[str, ...]]) -> list[str]:
    """As many last parts of each address as keep every label from beginning another."""
    if len(sources) == 1:
        return [""]
    for depth in range(1, max(map(len, sources)) + 1):
        ends = [parts[-depth:] for parts in sources]
        # In sequence, whatever begins another stands right before one that it begins.
        ranked = sorted(ends)
        if all(b[: len(a)] != a for a, b in pairwise(ranked)):
            break
    return ["/".join(end) for end in ends]


def _state_of(path: str) -> FileState:
    try:
        stat = Path(path).stat()
    except OSError:
        return FileState(0, -1, 0)
    return FileState(stat.st_mtime_ns, stat.st_size, stat.st_ctime_ns)


# -- files behind URLs --------------------------------------------------------------------


@contextmanager
def _reaching(url: str, tried: str, name: str = "") -> Iterator[tuple[Any, str]]:
    """The file system of a URL and the path in it; whatever goes wrong is an error of ours."""
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise InvalidInput(
            "URLs need fsspec: pip install 'motionary[cloud]', here and where workers run"
        ) from error
    protocol = url.partition(_URL_MARK)[0]
    try:
        system, root = url_to_fs(url)
    except ImportError as error:
        raise InvalidInput(
            f"{protocol}{_URL_MARK} needs another package: {describe_cause(error)}; install it "
            "here and where workers run"
        ) from error
    except ValueError as error:
        raise InvalidInput(
            f"expected a URL that fsspec knows, such as s3{_URL_MARK}bucket/folder, got {url}: "
            f"{describe_cause(error)}"
        ) from error
    except Exception as error:
        raise UnreadableFile(f"{tried}: {describe_cause(error)}", file=name or url) from error
    try:
        yield system, root
    except MotionaryError:
        raise
    except FileNotFoundError as error:
        raise UnreadableFile(f"{tried}: there is no such place", file=name or url) from error
    except Exception as error:
        # Each service has errors of its own, some of no class of Python's.
        problem = f"{tried}: {describe_cause(error)}; check the address and your rights"
        raise UnreadableFile(problem, file=name or url) from error


def _scan_remote(source: Source) -> dict[str, FileState]:
    with _reaching(source.folder, "cannot be searched") as (system, root):
        # Listings are kept for as long as a program runs.
        system.invalidate_cache()
        # What may not be listed is passed over by `find`.
        listed = system.ls(root, detail=True)
        if source.chosen is None:
            infos = system.find(root, detail=True)
        else:
            infos = {info["name"]: info for info in listed}
    cut = len(root.rstrip("/")) + 1
    files = {path[cut:]: info for path, info in infos.items()}
    names = files if source.chosen is None else source.chosen
    return {name: _remote_state(name, files) for name in sorted(names) if _is_recording(name)}


def _is_recording(name: str) -> bool:
    is_hidden = any(part.startswith(".") for part in name.split("/"))
    return not is_hidden and name.lower().endswith(tuple(MOTION_SUFFIXES))


def _remote_state(name: str, files: Mapping[str, Mapping[str, Any]]) -> FileState:
    """Of an Acclaim motion, a state that changes with the skeletons beside it, too."""
    if name not in files:
        return FileState(0, -1, 0)
    read = [name]
    if has_sidecar(name):
        folder = name.rpartition("/")[0]
        read += sorted(n for n in files if n.rpartition("/")[0] == folder and _is_skeleton(n))
    said = [[n, files[n].get("size"), *map(files[n].get, _STATE_KEYS)] for n in read]
    digest = hashlib.blake2b(repr(said).encode(), digest_size=8).digest()
    # Within what a column of times holds.
    return FileState(int.from_bytes(digest, "little") >> 1, files[name].get("size") or 0, 0)


def _is_skeleton(name: str) -> bool:
    return name.lower().endswith(_SKELETON_SUFFIX)


def fetch(url: str, place: Path) -> Path:
    """A copy of the file of a recording in a folder; with the skeletons beside it if it needs one.

    Returns
    -------
    path of the recording there

    Raises
    ------
    InvalidInput, UnreadableFile
    """
    name = PurePath(url).name
    file = file_of(name).name
    take = name.removeprefix(file)
    with _reaching(url.removesuffix(take), "cannot be fetched", name) as (system, path):
        place.mkdir(parents=True, exist_ok=True)
        wanted = [path]
        if has_sidecar(file):
            beside = system.ls(path.rpartition("/")[0], detail=False)
            wanted += [one for one in beside if _is_skeleton(one)]
        for one in wanted:
            target = place / PurePath(one).name
            if not target.exists():
                system.get_file(one, str(target))
    return place / (file + take)
