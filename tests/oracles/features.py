"""The 40 relations, frame by frame, as their definitions read.

After Müller and Röder (2006), appendix A, with the authors' thresholds. NumPy only.
Positions are dicts of joint to array (frames, 3), metres, y up.
"""

import math
from itertools import pairwise

import numpy as np

GENERIC_JOINTS = (
    "root", "lhip", "lknee", "lankle", "ltoes", "rhip", "rknee", "rankle", "rtoes",
    "belly", "chest", "neck", "head", "headtop",
    "lclavicle", "lshoulder", "lelbow", "lwrist", "lfingers",
    "rclavicle", "rshoulder", "relbow", "rwrist", "rfingers",
)  # fmt: skip
IDS = [f"F{i}" for i in range(1, 41)]
NAN = float("nan")


# -- one frame --------------------------------------------------------------------------


def n(a, b):
    """Unit vector from a to b."""
    return unit(b - a)


def unit(v):
    size = math.sqrt(float(np.sum(v * v)))
    return v / size if size > 0 else v * NAN


def plane(a, b, c, q):
    """Signed distance of q from the plane with normal (a - c) x (b - c) through c."""
    return float(np.sum(unit(np.cross(a - c, b - c)) * (q - c)))


def nplane(a, b, c, q):
    return float(np.sum(n(a, b) * (q - c)))


def angle(v, w):
    return math.degrees(math.acos(max(-1.0, min(1.0, float(np.sum(unit(v) * unit(w)))))))


def angle_or_nan(v, w):
    return NAN if np.isnan(unit(v)).any() or np.isnan(unit(w)).any() else angle(v, w)


# -- along time -------------------------------------------------------------------------


def smoothed_velocity(track, window_ms, rate_hz=120):
    """Forward differences, last one repeated, boxcar, ends reflected with the edge."""
    count = len(track)
    if count == 1:
        return np.full(track.shape, NAN)
    steps = [track[i + 1] - track[i] for i in range(count - 1)]
    steps.append(steps[-1])
    width = max(1, -(-window_ms * rate_hz // 1000))
    result = []
    for i in range(count):
        first, last = i - math.ceil(width / 2) + 1, i + width // 2
        window = [steps[reflect(k, count)] for k in range(first, last + 1)]
        assert len(window) == width
        result.append(sum(window) / width * rate_hz)
    return np.array(result)


def reflect(index, count):
    """..., 1, 0, 0, 1, ..., count - 1, count - 1, count - 2, ..."""
    while not 0 <= index < count:
        index = -1 - index if index < 0 else 2 * count - 1 - index
    return index


def hysteresis(strong, weak, known, on=False):
    """On where strong becomes true, off where weak fails; unknown frames start afresh."""
    was_strong = on
    result = []
    for s, w, k in zip(strong, weak, known, strict=True):
        if not k:
            on = was_strong = False
        else:
            if s and not was_strong:
                on = True
            if not w:
                on = False
            was_strong = s
        result.append(on)
    return np.array(result, dtype=bool)


# -- the table --------------------------------------------------------------------------


def length(P, *joints):
    """Sum of segments: first frame, or median of the frames that see both ends."""
    total = 0.0
    for a, b in pairwise(joints):
        sizes = [math.sqrt(float(np.sum((p - q) ** 2))) for p, q in zip(P[a], P[b], strict=True)]
        seen = [size for size in sizes if not math.isnan(size)]
        if not seen:
            return NAN
        total += sizes[0] if not math.isnan(sizes[0]) else float(np.median(seen))
    return total if total > 0 else NAN


def table(P, rate_hz=120):
    """Per id: quantity (frames,) in its unit, test, weak, strong."""
    frames = len(P["root"])
    hl, hl_left = length(P, "rshoulder", "relbow"), length(P, "lshoulder", "lelbow")
    sw, hw = length(P, "lshoulder", "rshoulder"), length(P, "lhip", "rhip")
    ch = length(P, "chest", "neck")
    height = length(P, "rankle", "rknee", "rhip") + length(
        P, "root", "belly", "chest", "neck", "head", "headtop"
    )

    def each(quantity, *joints):
        return np.array([quantity(*(P[j][t] for j in joints)) for t in range(frames)])

    def velocity(q, c=None, window_ms=0):
        return smoothed_velocity(P[q] if c is None else P[q] - P[c], window_ms, rate_hz)

    def speed(q, window_ms=0):
        return np.array([math.sqrt(float(np.sum(v * v))) for v in velocity(q, None, window_ms)])

    def dotted(direction, *joints, v):
        return np.array(
            [float(np.sum(direction(*(P[j][t] for j in joints)) * v[t])) for t in range(frames)]
        )

    def normal(a, b, c):
        return unit(np.cross(a - c, b - c))

    def lowest(t, without=()):
        seen = [P[j][t][1] for j in GENERIC_JOINTS if j not in without]
        seen = [y for y in seen if not math.isnan(y)]
        feet = [P[j][t][1] for j in ("lankle", "rankle", "ltoes", "rtoes")]
        # Feet stand lowest: without any of them the lowest joint is not known.
        return min(seen) if seen and not all(math.isnan(y) for y in feet) else NAN

    def highest(t):
        seen = [P[j][t][1] for j in GENERIC_JOINTS if not math.isnan(P[j][t][1])]
        return max(seen) if seen else NAN

    def above(joint, without=()):
        return np.array([P[joint][t][1] - lowest(t, without) for t in range(frames)])

    rows = {}
    for k, s in enumerate("rl"):
        wrist, fingers, elbow, shoulder = s + "wrist", s + "fingers", s + "elbow", s + "shoulder"
        toes, ankle, knee, hip = s + "toes", s + "ankle", s + "knee", s + "hip"
        moved = dotted(normal, "neck", "rhip", "lhip", v=velocity(wrist, "lhip", 250))
        rows[1 + k] = (moved / hl_left, ">", 1.3, 1.8)
        rows[3 + k] = (each(nplane, "chest", "neck", "neck", wrist) / ch, ">=", 0, 0.2)
        moved = dotted(n, "chest", "neck", v=velocity(wrist, "neck", 250))
        rows[5 + k] = (moved / hl_left, ">", 1.3, 1.8)
        bent = each(lambda e, a, b: angle_or_nan(a - e, b - e), elbow, shoulder, wrist)
        rows[7 + k] = (bent, "<=", 120, 110)
        moved = dotted(n, "root", wrist, v=velocity(wrist, "root"))
        rows[11 + k] = (moved / hl, ">=", 1.2, 1.4)
        rows[13 + k] = (speed(fingers, 100) / hl, ">=", 2, 2.5)
        rows[17 + k] = (above(toes) / hl, ">=", 1, 1.2)
        bent = each(lambda e, a, b: angle_or_nan(a - e, b - e), knee, hip, ankle)
        rows[20 + k] = (bent, "<=", 120, 110)
        rows[25 + k] = (np.minimum(speed(toes, 100), speed(ankle, 100)) / hl, ">=", 2, 2.5)
        off = each(lambda a, b, c, d: angle_or_nan(b - a, d - c), "root", "neck", shoulder, elbow)
        rows[27 + k] = (off, "<", 155, 150)
        off = each(lambda a, b, c, d: angle_or_nan(b - a, d - c), "root", "neck", knee, hip)
        rows[29 + k] = (off, ">", 45, 50)
        rows[33 + k] = (above(fingers, (fingers, wrist)) / hl, "<", 1.4, 1.2)
    wide = abs(each(nplane, "lshoulder", "rshoulder", "lwrist", "rwrist"))
    rows[9] = (wide / sw, ">=", 2, 2.5)
    rows[10] = (
        dotted(n, "lwrist", "rwrist", v=velocity("lwrist", "rwrist", 100)) / hl, ">=", 1.2, 1.4
    )  # fmt: skip
    rows[15] = (each(plane, "root", "lhip", "lankle", "rankle") / hl, ">=", 0, 0.375)
    rows[16] = (each(plane, "root", "rankle", "rhip", "lankle") / hl, ">=", 0, 0.375)
    rows[19] = (abs(each(nplane, "lhip", "rhip", "lankle", "rankle")) / hl, ">=", 1.8, 2.1)
    crossed = each(nplane, "lhip", "rhip", "lhip", "rankle") - each(
        nplane, "lhip", "rhip", "lhip", "lankle"
    )
    rows[22] = (crossed / hw, "<=", 0, -0.125)
    # The table measures both ankles relative to rhip, which cancels.
    closing = dotted(n, "lhip", "rhip", v=velocity("lankle", "rankle", 100))
    rows[23] = (closing / hl, ">=", 1.3, 1.5)
    rows[24] = (-closing / hl, ">=", 1.3, 1.5)
    rows[31] = (each(plane, "lankle", "neck", "rankle", "root") / hl, "<", -0.35, -0.5)
    up = np.array([0.0, 1.0, 0.0])
    rows[32] = (each(lambda a, b: angle_or_nan(b - a, up), "root", "neck"), "in", 30, 20)
    turned = each(plane, "rhip", "lhip", "neck", "lshoulder") - each(
        plane, "rhip", "lhip", "neck", "rshoulder"
    )
    rows[35] = (turned / hl_left, ">", 0.35, 0.40)
    rows[36] = (turned / hl_left, "<", -0.35, -0.40)
    extent = np.array([highest(t) - lowest(t) for t in range(frames)])
    extent[np.isnan(P["headtop"][:, 1])] = NAN
    rows[37] = (extent / height, "<=", 0.9, 0.8)
    rows[38] = (each(widest, "lankle", "rankle", "lwrist", "rwrist", "headtop", "root") / hl,
                ">=", 3, 3.25)  # fmt: skip
    rows[39] = (speed("root") / hl, ">=", 2, 2.3)
    rows[40] = (turning(P["rhip"], P["lhip"], rate_hz), ">=", 50, 100)
    return {f"F{i}": rows[i] for i in sorted(rows)}


def widest(*points):
    """Widest horizontal distance."""
    flat = [np.array([p[0], p[2]]) for p in points]
    if any(np.isnan(p).any() for p in flat):
        return NAN
    return max(math.dist(p, q) for p in flat for q in flat)


def turning(a, b, rate_hz):
    """Degrees per second between the directions of a frame and the next, 0 at the last."""
    directions = [
        unit(np.array([q[0] - p[0], 0.0, q[2] - p[2]])) for p, q in zip(a, b, strict=True)
    ]
    if len(directions) == 1:
        return np.array([NAN])
    turns = [angle_or_nan(v, w) * rate_hz for v, w in pairwise(directions)]
    return np.array([*turns, NAN if np.isnan(directions[-1]).any() else 0.0])


def passes(value, test, threshold):
    if math.isnan(value):
        return False
    if test == "in":
        return abs(value - 90) <= threshold
    return {
        ">": value > threshold,
        ">=": value >= threshold,
        "<": value < threshold,
        "<=": value <= threshold,
    }[test]


def features(P, rate_hz=120):
    """Features and which are known, (frames, 40) each."""
    features, known = [], []
    for values, test, weak, strong in table(P, rate_hz).values():
        seen = ~np.isnan(values)
        strongly = [passes(v, test, strong) for v in values]
        weakly = [passes(v, test, weak) for v in values]
        features.append(hysteresis(strongly, weakly, seen))
        known.append(seen)
    return np.array(features).T, np.array(known).T


# -- a figure to plant poses on ---------------------------------------------------------


def standing():
    """A symmetric figure that faces +z, left at +x; lengths are exact in binary.

    Humerus, hip width .25; shoulder width .5; chest to neck .125; body height 1.625.
    """
    middle = {"root": 1.0, "belly": 1.125, "chest": 1.25, "neck": 1.375, "head": 1.5,
              "headtop": 1.75}  # fmt: skip
    left = {
        "hip": (0.125, 1.0, 0.0), "knee": (0.125, 0.5, 0.0), "ankle": (0.125, 0.125, 0.0),
        "toes": (0.125, 0.0, 0.125), "clavicle": (0.0625, 1.375, 0.0),
        "shoulder": (0.25, 1.375, 0.0), "elbow": (0.25, 1.125, 0.0),
        "wrist": (0.25, 0.875, 0.0), "fingers": (0.25, 0.75, 0.0),
    }  # fmt: skip
    pose = {joint: np.array([0.0, y, 0.0]) for joint, y in middle.items()}
    for joint, (x, y, z) in left.items():
        pose["l" + joint] = np.array([x, y, z])
        pose["r" + joint] = np.array([-x, y, z])
    return pose


def as_array(poses):
    """Array (frames, 24, 3) of a list of poses."""
    return np.array([[pose[joint] for joint in GENERIC_JOINTS] for pose in poses])


def as_tracks(positions):
    """Dict of joint to (frames, 3) of an array (frames, 24, 3)."""
    return {joint: positions[:, i] for i, joint in enumerate(GENERIC_JOINTS)}
