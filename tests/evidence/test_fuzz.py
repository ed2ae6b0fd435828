"""Are inputs of every kind made, and opened without a fault where they are whole?"""

import pytest
from evidence.common.fuzzed import KINDS, Bench


@pytest.mark.parametrize("name", sorted(set(KINDS) - {"fbx"}))
def test_every_kind_is_made_and_opened(tmp_path, name):
    bench = Bench(name, tmp_path / "bench")
    assert bench.targets
    for target in bench.targets:
        bench.kind.open(bench.folder, target)
    for seed in range(2):
        bench.try_one(seed)


# Inputs that once ended in an exception, a warning or a text that is none for people.
FOUND = (
    ("asf", 26), ("amc", 328), ("c3d", 67), ("mvnx", 59), ("mvnx", 628), ("csv", 13), ("csv", 26),
    ("csv", 485), ("sto", 290), ("sto", 2602), ("bvh", 5037), ("npz", 22), ("npz", 164),
    ("npz", 465), ("npz", 500), ("npz", 570), ("npz", 1805), ("npz", 2374), ("npz", 2890),
    ("npy", 17), ("npy", 748), ("npy", 865), ("csv", 8889), ("index", 7803), ("index", 7940),
    ("index", 7966), ("labels-xlsx", 8476), ("library", 56), ("library", 471), ("library", 1116),
    ("library", 3595), ("library", 9218), ("library", 10544), ("library", 15834),
    ("mapping", 16836), ("index", 12), ("index", 4028), ("index", 17751), ("queries", 8),
    ("queries", 6141), ("template", 77), ("labels-csv", 1535), ("labels-csv", 3530),
    ("labels-jsonl", 204),
    ("labels-jsonl", 1460), ("labels-elan", 1522), ("labels-elan", 2722), ("labels-praat", 36),
    ("labels-srt", 18), ("labels-srt", 548), ("labels-boris", 5973),
    ("labels-boris-tabular", 4758), ("labels-label-studio", 635),
    ("labels-label-studio-video", 62), ("labels-babel", 201), ("labels-blender", 43),
    ("labels-c3d", 1761),
)  # fmt: skip


@pytest.mark.parametrize("name", sorted({name for name, _ in FOUND}))
def test_what_was_found_is_read_or_refused(tmp_path, name):
    bench = Bench(name, tmp_path / "bench")
    for kind, seed in FOUND:
        if kind == name:
            bench.try_one(seed)
