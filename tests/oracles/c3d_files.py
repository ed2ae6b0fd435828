"""C3D files byte by byte, on three kinds of machine, as the C3D user guide has them."""

import struct

import numpy as np

INTEL, DEC, MIPS = 84, 85, 86


def c3d_bytes(
    positions,
    labels,
    *,
    machine=INTEL,
    scale=-1.0,
    rate_hz=100.0,
    first=1,
    residuals=None,
    analog=0,
    point=None,
    groups=None,
    words=None,
):
    """A file of points (frames, points, 3) in file units.

    `residuals` is (frames, points), -1 for a point that was not seen; `point` and `groups`
    add parameters; `words` overrules numbers of the header.
    """
    n_frames, n_points = positions.shape[:2]
    order = ">" if machine == MIPS else "<"
    header = {
        "n_points": n_points,
        "n_analog": analog,
        "first": first,
        "last": first + n_frames - 1,
        **(words or {}),
    }
    parameters = {
        "POINT": {
            "USED": np.int16(n_points),
            "SCALE": float(scale),
            "RATE": float(rate_hz),
            "FRAMES": np.uint16(n_frames).astype(np.int16),
            "LABELS": list(labels),
            "UNITS": ["mm"],
            **(point or {}),
        },
        **(groups or {}),
    }
    parameters["POINT"] = {k: v for k, v in parameters["POINT"].items() if v is not None}
    section = _section(parameters, machine, order)
    data_block = 2 + len(section) // 512
    block = bytearray(512)
    block[:2] = bytes((2, 0x50))
    counts = (header["n_points"], header["n_analog"], header["first"], header["last"])
    block[2:10] = struct.pack(f"{order}4H", *(c & 0xFFFF for c in counts))
    block[12:16] = _float(scale, machine)
    block[16:20] = struct.pack(f"{order}2H", data_block, analog)
    block[20:24] = _float(rate_hz, machine)
    frames = [
        _frame(frame, seen, scale, machine, order, analog)
        for frame, seen in zip(
            positions,
            np.zeros((n_frames, n_points)) if residuals is None else residuals,
            strict=True,
        )
    ]
    return bytes(block) + section + b"".join(frames)


def _frame(points, residuals, scale, machine, order, analog):
    raw = b""
    for (x, y, z), residual in zip(points.tolist(), residuals.tolist(), strict=True):
        if scale < 0:
            raw += b"".join(_float(value, machine) for value in (x, y, z, residual))
        else:
            numbers = (round(x / scale), round(y / scale), round(z / scale), int(residual))
            raw += struct.pack(f"{order}4h", *numbers)
    if scale < 0:
        return raw + b"".join(_float(float(i), machine) for i in range(analog))
    return raw + struct.pack(f"{order}{analog}h", *range(analog))


def _float(value, machine):
    if machine == MIPS:
        return struct.pack(">f", value)
    if machine == INTEL:
        return struct.pack("<f", value)
    # VAX: exponent two higher, halves exchanged.
    low, high = struct.unpack("<2H", struct.pack("<f", value * 4))
    return struct.pack("<2H", high, low)


def _section(parameters, machine, order):
    raw = b""
    for number, (group, content) in enumerate(parameters.items(), start=1):
        raw += _record(group, -number, b"\x00", order)
        for name, value in content.items():
            raw += _record(name, number, _value(value, machine, order), order)
    raw = bytes((1, 0x50, 1, machine)) + raw + b"\x00\x00"
    blocks = -(-len(raw) // 512)
    return raw[:2] + bytes((blocks,)) + raw[3:].ljust(512 * blocks - 3, b"\x00")


def _record(name, number, body, order):
    return (
        struct.pack("bb", len(name), number)
        + name.encode()
        + struct.pack(f"{order}h", 2 + len(body))
        + body
    )


def _value(value, machine, order):
    if isinstance(value, list):
        texts = [text.encode("latin-1") for text in value]
        width = max(map(len, texts), default=0)
        return bytes((255, 2, width, len(texts))) + b"".join(t.ljust(width) for t in texts) + b"\0"
    array = np.asarray(value)
    flat = array.flatten(order="F").tolist()
    shape = bytes((len(array.shape), *array.shape))
    if array.dtype == np.int16:
        return b"\x02" + shape + struct.pack(f"{order}{len(flat)}h", *flat) + b"\0"
    return b"\x04" + shape + b"".join(_float(v, machine) for v in flat) + b"\0"
