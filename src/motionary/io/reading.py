"""How is a recording of any known format read?"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from motionary.errors import InvalidInput, UnreadableFile
from motionary.io.motion.acclaim import read_amc
from motionary.io.motion.bvh import read_bvh
from motionary.motion import Motion
from motionary.skeletons import named_mapping


def _read_amc(
    path: Path,
    asf: str | Path | None,
    rate_hz: float | None,
    unit: float | str | None,
) -> Motion:
    if unit is not None:
        raise InvalidInput(f"{path.name}: an Acclaim skeleton states its unit; leave out unit=")
    return read_amc(path, asf=asf, rate_hz=rate_hz)


def _read_bvh(
    path: Path,
    asf: str | Path | None,
    rate_hz: float | None,
    unit: float | str | None,
) -> Motion:
    if asf is not None:
        raise InvalidInput(f"{path.name}: a BVH file has its own skeleton; leave out asf=")
    return read_bvh(path, rate_hz=rate_hz, unit=unit)


_Reader = Callable[[Path, str | Path | None, float | None, float | str | None], Motion]

_READERS: dict[str, _Reader] = {".amc": _read_amc, ".bvh": _read_bvh}

MOTION_SUFFIXES = tuple(_READERS)


def read(
    path: str | Path,
    *,
    asf: str | Path | None = None,
    rate_hz: float | None = None,
    skeleton: str | Path | None = None,
    unit: float | str | None = None,
) -> Motion:
    """Read a recording; the suffix of its name says how.

    Parameters
    ----------
    path : the file
    asf : skeleton file of an Acclaim motion; by default looked for by name
    rate_hz : frames per second, where the file does not say it or says it wrong
    skeleton : name of a known skeleton, where the joint names do not tell it; of an
        Acclaim motion also the path of its skeleton file
    unit : "m", "cm", "mm", "inch" or metres per unit of the file, where the size of
        the body does not tell it

    Returns
    -------
    Motion, positions in metres, y up

    Raises
    ------
    UnreadableFile
        If the file is missing, broken, or of an unknown format.
    InvalidInput
        If an argument does not go with the format.
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise UnreadableFile(
            f"{path}: unknown format {path.suffix!r}; known are {', '.join(MOTION_SUFFIXES)}"
        )
    if rate_hz is not None and not 0 < rate_hz < 1e6:
        raise InvalidInput(f"rate_hz must be a positive number, got {rate_hz}")
    if skeleton is not None and str(skeleton).lower().endswith(".asf"):
        asf, skeleton = skeleton, None
    motion = reader(path, asf, rate_hz, unit)
    if skeleton is None:
        return motion
    return replace(motion, mapping=named_mapping(str(skeleton), motion.names))
