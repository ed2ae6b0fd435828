"""Sides and parts of the body in the names of joints.

People write `LeftUpLeg`, `thigh_l`, `Bip01 L Thigh`, `lShin`, `arm.L`, `LTHIGH`, or the words of
their language. A side counts only where the same name with the other side is there too.
"""

import re
import unicodedata
from collections.abc import Iterable, Mapping

# Camel case, runs of capitals, numbers, and letters of other scripts one run each.
_TOKEN = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+|[^\x00-\x7f]+")

_SIDES = (
    ("left", "right"), ("links", "rechts"), ("gauche", "droite"), ("gauche", "droit"),
    ("izquierda", "derecha"), ("izquierdo", "derecho"), ("esquerda", "direita"),
    ("esquerdo", "direito"), ("izq", "der"), ("sinistra", "destra"), ("sinistro", "destro"),
    ("lft", "rgt"), ("lt", "rt"), ("g", "d"), ("l", "r"),
)  # fmt: skip
_SIDE_LETTERS = ("左", "右")

# Words that name a joint where a bone of that name begins, by generic joint; sided ones
# without their side. Of each part, what says it clearest comes first.
_LIMBS: Mapping[str, tuple[str, ...]] = {
    "hip": (
        "hip", "hipjoint", "thigh", "upleg", "upperleg", "legupper", "femur", "oberschenkel",
        "huefte", "hüfte", "schenkel", "cuisse", "hanche", "muslo", "cadera", "coscia", "anca",
        "coxa", "太もも", "大腿", "足",
    ),
    "knee": (
        "knee", "shin", "calf", "lowerleg", "lowleg", "leglower", "shank", "tibia", "leg", "knie",
        "unterschenkel", "bein", "wade", "schienbein", "genou", "jambe", "mollet", "rodilla",
        "pierna", "pantorrilla", "ginocchio", "gamba", "joelho", "perna", "ひざ", "膝", "すね",
    ),
    "ankle": (
        "ankle", "foot", "fuss", "fuß", "knoechel", "knöchel", "cheville", "pied", "tobillo", "pie",
        "caviglia", "piede", "tornozelo", "pe", "足首",
    ),
    "toes": (
        "toeend", "toeendend", "toetip", "toes", "toe", "toebase", "ball", "footindex", "zehen",
        "zeh", "orteils", "orteil", "dedospie", "dita", "つま先",
    ),
    "clavicle": (
        "clavicle", "collar", "collarbone", "clav", "scapula", "schluesselbein", "schlüsselbein",
        "clavicule", "clavicula", "clavicola", "鎖骨", "肩",
    ),
    "shoulder": (
        "upperarm", "uparm", "upparm", "uarm", "armupper", "humerus", "shldr", "arm", "oberarm",
        "bras", "brazo", "braccio", "braco", "上腕", "腕",
    ),
    "elbow": (
        "elbow", "forearm", "lowerarm", "lowarm", "farm", "armlower", "ulna", "ellbogen",
        "ellenbogen", "unterarm", "coude", "avantbras", "codo", "antebrazo", "gomito",
        "avambraccio", "cotovelo", "antebraco", "ひじ", "肘", "前腕",
    ),
    "wrist": (
        "wrist", "hand", "handgelenk", "poignet", "main", "muneca", "muñeca", "mano", "polso",
        "pulso", "mao", "手首", "手",
    ),
    "fingers": (
        "handmiddleend", "middleend", "handtip", "handend", "fingers", "fingertip", "handmiddle",
        "middle", "mid", "finger",
    ),
}  # fmt: skip
#: "Shoulder" is the clavicle where the upper arm has a name of its own.
_SHOULDER = ("shoulder", "schulter", "epaule", "épaule", "hombro", "spalla", "ombro")

_ELBOWS = frozenset({"elbow", "ellbogen", "ellenbogen", "coude", "codo", "gomito", "ひじ", "肘"})

_MIDDLE: Mapping[str, tuple[str, ...]] = {
    "root": (
        "hips", "pelvis", "hip", "becken", "bassin", "bacino", "cadera", "hüfte", "root", "骨盤",
        "下半身",
    ),
    "spine": (
        "spine", "chest", "abdomen", "ab", "torso", "thorax", "waist", "belly", "lowerback",
        "upperback", "spinenavel", "spinechest", "upperchest", "wirbelsaeule", "wirbelsäule",
        "bauch", "brust", "rumpf", "colonne", "torse", "tronc", "poitrine", "columna", "pecho",
        "tronco", "schiena", "torace", "背骨", "胸", "上半身",
    ),
    "neck": ("neck", "hals", "nacken", "cou", "cuello", "collo", "首"),
    "head": ("head", "kopf", "tete", "tête", "cabeza", "testa", "頭"),
    "headtop": ("headtop", "headtopend", "headend", "headnub", "headtip", "topofhead", "vertex"),
}  # fmt: skip


def _plain(word: str) -> str:
    """A word without accents, in whatever form of Unicode they are written."""
    return "".join(c for c in unicodedata.normalize("NFKD", word) if not unicodedata.combining(c))


_LIMB_WORDS = {part: tuple(map(_plain, words)) for part, words in _LIMBS.items()}
_MIDDLE_WORDS = {part: tuple(map(_plain, words)) for part, words in _MIDDLE.items()}
_SHOULDER_WORDS = tuple(map(_plain, _SHOULDER))

# What hangs on a body and is none of its joints; a twist bone is one on a limb only.
_EXTRAS = frozenset({
    "prop", "weapon", "sword", "shield", "item", "attach", "socket", "ik", "camera", "cam", "hair",
    "cloth", "skirt", "cape", "target", "pole", "ctrl", "control", "eye", "eyes", "jaw", "teeth",
    "tongue", "facial", "face", "brow", "eyebrow", "lip", "lips", "ear", "ears", "cheek", "nose",
    "mouth", "tail", "wing", "wings", "breast", "helper", "share",
})  # fmt: skip
_KINDS = {
    "extra": _EXTRAS,
    "twist": frozenset({"twist", "roll"}),
    "tail": frozenset({"tail", "schwanz", "queue", "cola", "coda"}),
    "paw": frozenset({"paw", "hoof", "pfote", "huf", "fetlock", "hock"}),
    "end": frozenset({"end", "nub", "tip", "top", "site"}),
    "middle": frozenset({"middle", "mid", "mittel"}),
}
# Scripts without spaces have no words: these stand anywhere in a name.
_LETTERS = {"twist": "捩", "middle": "中指"}

# Parts that a long bone begins at.
_BONES = frozenset({"hip", "knee", "shoulder", "elbow"})
# Limbs by the words of their joints.
LEG_PARTS = frozenset({"hip", "knee", "ankle", "toes"})
ARM_PARTS = frozenset({"clavicle", "shoulder", "elbow", "wrist", "fingers"})


def find_partners(names: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Sides of the joints that have one: for a name, "l" or "r" and the other side's name."""
    there = set(names)
    found: dict[str, tuple[str, str]] = {}
    for name in sorted(there):
        for other in _swapped(name):
            if other in there and name not in found:
                found[name], found[other] = ("l", other), ("r", name)
    return found


def _swapped(name: str) -> list[str]:
    """The names that a left joint of this name may have on the right, likeliest first."""
    result = [name.replace(*_SIDE_LETTERS)] if _SIDE_LETTERS[0] in name else []
    tokens = list(_TOKEN.finditer(name))
    for left, right in _SIDES:
        for token in tokens:
            if token.group().lower() == left:
                swap = _in_case(token.group(), right)
                result.append(name[: token.start()] + swap + name[token.end() :])
    # `lthigh`, `LTHIGH`, `thighl`, `leftarm`: no border tells where the side ends.
    for left, right in (("left", "right"), ("l", "r")):
        lower = name.lower()
        at = name.rfind(":") + 1
        if lower.startswith(left, at):
            head = name[at : at + len(left)]
            result.append(name[:at] + _in_case(head, right) + name[at + len(left) :])
        if lower.endswith(left):
            result.append(name[: -len(left)] + _in_case(name[-len(left) :], right))
    return [other for other in result if other != name]


def _in_case(pattern: str, word: str) -> str:
    if pattern.isupper():
        return word.upper()
    return word.capitalize() if pattern[0].isupper() else word


def stems(names: Iterable[str], partners: Mapping[str, tuple[str, str]]) -> dict[str, str]:
    """What each name says without its side, its numbers and what most names share."""
    tokens = {name: _tokens(name, partners.get(name)) for name in names}
    counts: dict[str, int] = {}
    for words in tokens.values():
        for word in set(words):
            counts[word] = counts.get(word, 0) + 1
    shared = {word for word, n in counts.items() if n > 4 and n > 0.6 * len(tokens)}
    return {
        name: "".join(word for word in words if word not in shared)
        for name, words in tokens.items()
    }


def _tokens(name: str, partner: tuple[str, str] | None) -> list[str]:
    """Words of a name, lower case, without numbers and side."""
    last = unicodedata.normalize("NFC", name.rpartition(":")[2])
    words = [word.lower() for word in _TOKEN.findall(last) if not word.isdigit()]
    if last.startswith("End of "):
        words = [*words[2:], "end"]
    if partner is None:
        return words
    sides = {word for pair in _SIDES for word in pair}
    if any(word in sides for word in words):
        first = next(i for i, word in enumerate(words) if word in sides)
        return words[:first] + words[first + 1 :]
    # The side stands without a border: what both names share is the rest.
    other = unicodedata.normalize("NFC", partner[1].rpartition(":")[2])
    same_end = len(_common_start(last[::-1], other[::-1]))
    rest = last[-same_end:] if same_end else _common_start(last, other)
    return [word.lower() for word in _TOKEN.findall(rest) if not word.isdigit()]


def _common_start(a: str, b: str) -> str:
    n = next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))
    return a[:n]


def limb_part(stem: str, *, has_arm: bool) -> str | None:
    """Which part of a limb a sided stem names; "" for none.

    Parameters
    ----------
    has_arm : whether the upper arm has a name of its own
    """
    plain = _plain(stem)
    if plain in _SHOULDER_WORDS:
        return "clavicle" if has_arm else "shoulder"
    return next((part for part, words in _LIMB_WORDS.items() if plain in words), None)


def rank(stem: str, part: str) -> int:
    """How clearly a stem says a part of a limb; 0 is clearest."""
    words = _LIMB_WORDS[part]
    plain = _plain(stem)
    return words.index(plain) if plain in words else len(words)


def names_upper_arm(stem: str) -> bool:
    """Whether a sided stem names the upper arm as no shoulder does."""
    return _plain(stem) in _LIMB_WORDS["shoulder"]


def names_joint(stem: str) -> bool:
    """Whether a stem is the name of the joint of the elbow, not of the bone below it."""
    return stem in _ELBOWS


def middle_part(stem: str) -> str | None:
    """Which part of the middle of the body a stem names, the spine as one part."""
    plain = _plain(stem)
    return next((part for part, words in _MIDDLE_WORDS.items() if plain in words), None)


def find_clusters(names: Iterable[str], stems: Mapping[str, str]) -> set[str]:
    """Names of markers that stand together on one bone: `LThigh1`, `LThigh2`, `R.TH1`.

    A limb's bone has but one joint at its start.
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        base = name.rstrip("0123456789")
        if base != name and limb_part(stems[name], has_arm=True) in _BONES:
            groups.setdefault(base, []).append(name)
    return {name for group in groups.values() if len(group) > 1 for name in group}


def is_a(kind: str, name: str) -> bool:
    """Whether a name says that a joint is of a kind.

    Parameters
    ----------
    kind : "extra" hangs on the body: a prop, hair, an eye, a handle of the rig; "twist" only
        turns the skin along a bone; "tail"; "paw" is an animal's foot; "end" of a bone;
        "middle" finger or toe
    """
    if kind in _LETTERS and _LETTERS[kind] in name:
        return True
    if kind == "end" and name.rpartition(":")[2].startswith("End of "):
        return True
    return not _KINDS[kind].isdisjoint(words_of(name))


def words_of(name: str) -> frozenset[str]:
    """Words of a name, lower case, without what stands before a colon."""
    last = name.rpartition(":")[2].removeprefix("End of ")
    return frozenset(word.lower() for word in _TOKEN.findall(last))
