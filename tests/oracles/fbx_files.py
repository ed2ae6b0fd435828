"""FBX files as text, of bones that turn about one axis and a root that moves."""

TICKS = 46186158000


def fbx_text(bones, turns, moves, *, fps=30, up="y", unit_cm=1.0):
    """Text of a file.

    `bones`: (name, parent's place or -1, offset); `turns`: per bone a list of degrees about
    z, one a frame; `moves`: x of the first bone, one a frame.
    """
    n_frames = len(moves)
    key_times = ",".join(str(round(i / fps * TICKS)) for i in range(n_frames))
    axis, sign = {"y": (1, 1), "z": (2, 1)}[up]
    front, coord = {"y": ((2, 1), (0, 1)), "z": ((1, -1), (0, 1))}[up]
    lines = ["; FBX 7.4.0 project file", "FBXHeaderExtension:  {", "\tFBXVersion: 7400", "}"]
    lines += ["GlobalSettings:  {", "\tVersion: 1000", "\tProperties70:  {"]
    for name, value in (
        ("UpAxis", axis),
        ("UpAxisSign", sign),
        ("FrontAxis", front[0]),
        ("FrontAxisSign", front[1]),
        ("CoordAxis", coord[0]),
        ("CoordAxisSign", coord[1]),
        ("TimeMode", 14),
    ):
        lines.append(f'\t\tP: "{name}", "int", "Integer", "",{value}')
    lines += [f'\t\tP: "UnitScaleFactor", "double", "Number", "",{unit_cm}']
    lines += [f'\t\tP: "CustomFrameRate", "double", "Number", "",{fps}', "\t}", "}"]
    lines += ["Objects:  {"]
    links = []
    for i, (name, parent, offset) in enumerate(bones):
        lines += [f'\tModel: {100 + i}, "Model::{name}", "LimbNode" {{', "\t\tVersion: 232"]
        place = ",".join(map(str, offset))
        lines += ["\t\tProperties70:  {"]
        lines += [f'\t\t\tP: "Lcl Translation", "Lcl Translation", "", "A",{place}', "\t\t}", "\t}"]
        lines += [f'\tNodeAttribute: {200 + i}, "NodeAttribute::{name}", "LimbNode" {{']
        lines += ['\t\tTypeFlags: "Skeleton"', "\t}"]
        links += [("OO", 200 + i, 100 + i), ("OO", 100 + i, 100 + parent if parent >= 0 else 0)]
        what = ("R", "d|Z", "Lcl Rotation", 100 + i)
        links += _animate(lines, 300 + i, 400 + i, *what, turns[i], key_times)
    what = ("T", "d|X", "Lcl Translation", 100)
    links += _animate(lines, 390, 490, *what, moves, key_times, bones[0][2])
    end = round((n_frames - 1) / fps * TICKS)
    lines += ['\tAnimationStack: 900, "AnimStack::take", "" {', "\t\tProperties70:  {"]
    lines += [f'\t\t\tP: "LocalStop", "KTime", "Time", "",{end}', "\t\t}", "\t}"]
    lines += ['\tAnimationLayer: 901, "AnimLayer::base", "" {', "\t}", "}"]
    links.append(("OO", 901, 900))
    lines += ["Connections:  {"]
    for kind, child, parent, *rest in links:
        lines.append(f'\tC: "{kind}",{child},{parent}' + "".join(f', "{r}"' for r in rest))
    return "\n".join([*lines, "}", ""])


def _animate(lines, node, curve, kind, channel, target, model, values, key_times, rest=(0, 0, 0)):
    lines += [f'\tAnimationCurveNode: {node}, "AnimCurveNode::{kind}", "" {{']
    lines += ["\t\tProperties70:  {"]
    lines += [
        f'\t\t\tP: "d|{axis}", "Number", "", "A",{value}'
        for axis, value in zip("XYZ", rest, strict=True)
    ]
    lines += ["\t\t}", "\t}", f'\tAnimationCurve: {curve}, "AnimCurve::", "" {{', "\t\tDefault: 0"]
    n, texts = len(values), ",".join(map(str, values))
    lines += ["\t\tKeyVer: 4008", f"\t\tKeyTime: *{n} {{", f"\t\t\ta: {key_times}", "\t\t}"]
    lines += [f"\t\tKeyValueFloat: *{n} {{", f"\t\t\ta: {texts}", "\t\t}"]
    # Straight lines between the keys.
    lines += ["\t\tKeyAttrFlags: *1 {", "\t\t\ta: 4", "\t\t}"]
    lines += ["\t\tKeyAttrDataFloat: *4 {", "\t\t\ta: 0,0,0,0", "\t\t}"]
    lines += ["\t\tKeyAttrRefCount: *1 {", f"\t\t\ta: {n}", "\t\t}", "\t}"]
    return [
        ("OO", node, 901),
        ("OP", node, model, target),
        ("OP", curve, node, channel),
    ]
