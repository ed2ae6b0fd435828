"""Which synthetic motions are there, and how do they go?

Each starts and ends in an upright stand. See `phrases` for how to read them. The foot
stays flat where ankles = knees + root pitch - hips.
"""

_SQUAT = """
    0.0-0.7 s: hips 120, knees 130, ankles 40, root pitch 30, shoulders 80
    1.0-1.7 s: hips 0, knees 0, ankles 0, root pitch 0, shoulders 0
"""

_KICK = """
    0.0-0.3 s: {side} hip -20, {side} knee 45, {other} shoulder -10
    0.3-0.6 s: {side} hip 90, {side} knee 5, spine -10, {other} shoulder 45
    0.7-1.2 s: {side} hip 0, {side} knee 0, spine 0, {other} shoulder 0
"""

_RAISE_ARMS = """
    0.0-0.7 s: shoulders aside 165
    1.1-1.8 s: shoulders aside 0
"""

# Up in front of the body, down behind it.
_ROTATE_ARMS = """
    0.0-1.3 s: shoulders 360
"""

_JUMP = """
    0.0-0.4 s: hips 70, knees 85, ankles 40, root pitch 25, shoulders -45
    0.4-0.6 s: hips 0, knees 0, ankles -35, root pitch 0, shoulders 130
    0.55-0.8 s: root up 0.35
    0.8-1.05 s: root up 0.0
    0.8-1.0 s: ankles 0
    1.0-1.2 s: hips 50, knees 60, ankles 30, root pitch 20, shoulders 30
    1.2-1.6 s: hips 0, knees 0, ankles 0, root pitch 0, shoulders 0
"""

# A step: the thigh swings first, then the shank, the foot last, so that it clears the floor.
_WALK = """
    0.0-0.25 s: right hip 32, left shoulder 22, right shoulder -20
    0.0-0.18 s: right knee 65, right ankle 10
    0.22-0.4 s: right knee 3
    0.25-0.4 s: right ankle -25
    0.1-0.5 s: left hip -18, left ankle 16
    0.4-1.0 s: right hip -22, right ankle 18
    0.5-0.75 s: left hip 32, left shoulder -20, right shoulder 22
    0.5-0.68 s: left knee 65, left ankle 10
    0.72-0.9 s: left knee 3
    0.75-0.9 s: left ankle -25
    0.9-1.5 s: left hip -22, left ankle 18
    1.0-1.25 s: right hip 32, left shoulder 22, right shoulder -20
    1.0-1.18 s: right knee 65, right ankle 10
    1.22-1.4 s: right knee 3
    1.25-1.4 s: right ankle -25
    1.4-1.9 s: right hip 0, right ankle 0, right knee 0
    1.5-1.7 s: left hip 15, left knee 60, left ankle 15
    1.55-1.8 s: shoulders 0
    1.7-1.95 s: left hip 0, left knee 0, left ankle 0
"""

_BOW = """
    0.0-0.8 s: root pitch 75, hips 75, spine 25, neck 15
    1.2-2.0 s: root pitch 0, hips 0, spine 0, neck 0
"""

_PICK_UP = """
    0.0-0.9 s: root pitch 50, hips 108, knees 102, ankles 44, spine 30, {side} shoulder 75
    1.2-2.0 s: root pitch 0, hips 0, knees 0, ankles 0, spine 0, {side} shoulder 30, {side} elbow 80
    2.2-2.6 s: {side} shoulder 0, {side} elbow 0
"""

_WAVE = """
    0.0-0.5 s: {side} shoulder aside 95, {side} shoulder twist 85, {side} elbow 90
    0.5-0.75 s: {side} elbow 40
    0.75-1.0 s: {side} elbow 110
    1.0-1.25 s: {side} elbow 40
    1.25-1.5 s: {side} elbow 110
    1.5-2.0 s: {side} shoulder aside 0, {side} shoulder twist 0, {side} elbow 0
"""

_PUNCH = """
    0.0-0.35 s: shoulders 30, elbows 125, {other} hip 12, {other} ankle -12
    0.45-0.7 s: {side} shoulder 88, {side} elbow 5
    0.8-1.05 s: {side} shoulder 30, {side} elbow 125
    1.15-1.5 s: shoulders 0, elbows 0, {other} hip 0, {other} ankle 0
"""

_SPIN_LEFT = """
    0.0-0.4 s: shoulders aside 75, right hip -10, right knee 90
    0.2-1.4 s: root turn 360
    1.2-1.6 s: shoulders aside 0, right hip 0, right knee 0
"""

_JUMPING_JACK = """
    0.0-0.15 s: hips 25, knees 45, ankles 20
    0.15-0.35 s: hips 0, knees 0, ankles -20
    0.2-0.5 s: shoulders aside 150, hips aside 25
    0.25-0.4 s: root up 0.12
    0.4-0.55 s: root up 0.0
    0.5-0.6 s: ankles 0
    0.7-0.85 s: root up 0.12
    0.7-1.0 s: shoulders aside 0, hips aside 0
    0.85-1.0 s: root up 0.0
"""


def _one_sided(text: str, side: str) -> str:
    return text.format(side=side, other="left" if side == "right" else "right")


PHRASES = {
    "squat": _SQUAT,
    "kick_left": _one_sided(_KICK, "left"),
    "kick_right": _one_sided(_KICK, "right"),
    "raise_arms": _RAISE_ARMS,
    "rotate_arms": _ROTATE_ARMS,
    "jump": _JUMP,
    "walk": _WALK,
    "bow": _BOW,
    "pick_up_right": _one_sided(_PICK_UP, "right"),
    "wave_right": _one_sided(_WAVE, "right"),
    "punch_right": _one_sided(_PUNCH, "right"),
    "spin_left": _SPIN_LEFT,
    "jumping_jack": _JUMPING_JACK,
}

SYNTHETIC_CLASSES = tuple(PHRASES)
