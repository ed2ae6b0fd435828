"""The published numbers of one motion, a frame and a column at a time, as the table says."""

from itertools import pairwise
from math import acos, degrees, sqrt

NAMES = (
    "root", "lhip", "rhip", "belly", "lknee", "rknee", "spine", "lankle", "rankle", "chest",
    "ltoes", "rtoes", "neck", "linshoulder", "rinshoulder", "head", "lshoulder", "rshoulder",
    "lelbow", "relbow", "lwrist", "rwrist", "lhand", "rhand",
)  # fmt: skip
HL, SW, HW = 0.2568, 0.3908, 0.1192


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def norm(a):
    return sqrt(dot(a, a))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def along(line, a):
    return dot(line, a) / norm(line)


def angle(a, b):
    return degrees(acos(max(-1, min(1, dot(a, b) / (norm(a) * norm(b))))))


def columns_of(before, now):
    """32 truth values of one frame; both are dicts of joint to [x, y, z]."""
    p = now

    def line(a, b):
        return minus(p[b], p[a])

    def v(joint, relative=None):
        step = minus(now[joint], before[joint])
        if relative:
            step = minus(step, minus(now[relative], before[relative]))
        return [120 * x for x in step]

    low = min(point[1] for point in p.values())
    hand_forward_r = cross(line("neck", "lhip"), line("neck", "rhip"))
    hand_forward_l = cross(line("neck", "rhip"), line("neck", "lhip"))
    leg_l = cross(line("root", "ltoes"), line("root", "lhip"))
    leg_r = cross(line("root", "rtoes"), line("root", "rhip"))
    feet_neck = cross(line("rankle", "lankle"), line("rankle", "neck"))
    down = line("neck", "root")
    return [
        along(hand_forward_r, v("rwrist", "neck")) > 1.8 * HL,
        along(hand_forward_l, v("lwrist", "neck")) > 1.8 * HL,
        *(along(line("chest", "neck"), line("neck", s + "wrist")) > 0.2 * HL for s in "rl"),
        *(along(line("belly", "chest"), v("chest", "belly")) > 1.8 * HL for _ in "rl"),
        *(0 < angle(line(s + "elbow", s + "shoulder"), line(s + "elbow", s + "wrist")) < 110
          for s in "rl"),
        along(line("lshoulder", "rshoulder"), line("lwrist", "rwrist")) > 2.5 * SW,
        along(line("lwrist", "rwrist"), v("rwrist", "lwrist")) > 1.4 * HL,
        along(line("rwrist", "root"), v("lwrist", "rwrist")) > 1.4 * HL,
        along(line("lwrist", "root"), v("rwrist", "lwrist")) > 1.4 * HL,
        *(norm(v(s + "wrist")) > 2.5 * HL for s in "rl"),
        along(leg_l, line("root", "rankle")) > 0.38 * HL,
        along(leg_r, line("root", "lankle")) > 0.38 * HL,
        *(p[s + "ankle"][1] - low > 1.2 * HL for s in "rl"),
        along(line("lhip", "rhip"), line("lankle", "rankle")) > 2.1 * HW,
        *(0 < angle(line(s + "knee", s + "hip"), line(s + "knee", s + "ankle")) < 110
          for s in "rl"),
        *(norm(v(s + "ankle")) > 2.5 * HL for s in "rl"),
        *(25 < angle(down, line(s + "shoulder", s + "elbow")) < 180 for s in "rl"),
        *(50 < angle(down, line(s + "hip", s + "knee")) < 180 for s in "rl"),
        along(feet_neck, line("rankle", "root")) > 0.5 * HL,
        70 < angle(down, [0, 1, 0]) < 110,
        *(low - p[s + "wrist"][1] > -1.2 * HL for s in "rl"),
        norm(v("root")) > 2.3 * HL,
    ]  # fmt: skip


def fractions(positions):
    """Share of the frames after the first, for each column."""
    frames = [dict(zip(NAMES, frame, strict=True)) for frame in positions]
    rows = [columns_of(before, now) for before, now in pairwise(frames)]
    return [sum(column) / len(rows) for column in zip(*rows, strict=True)]


def pair_distance(rows):
    """Mean distance of all pairs of different rows."""
    n = len(rows)
    pairs = [(i, j) for i in range(n) for j in range(n) if i < j]
    return sum(norm(minus(rows[i], rows[j])) for i, j in pairs) / len(pairs)
