"""Many motions at once: arrays, files, splits by person, tables, and the step of scikit-learn."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from motionary.batch import Failure
from motionary.errors import InvalidInput, WrongKind
from motionary.features import (
    FULL_BODY,
    LEGS,
    FeatureBatch,
    FeatureSet,
    MotionFeatures,
    compute_batch,
    compute_features,
    load_everyday_set,
    match_names,
    read_features,
    write_features,
)
from motionary.io import ReadOptions
from motionary.samples import synthetic_motion

KINDS = ("squat", "kick_left", "wave_right", "bow", "walk")
GIVEN = {"rate_hz": 20, "skeleton": "generic"}


@pytest.fixture(scope="module")
def array():
    motions = [synthetic_motion(kind, seed=2, rate_hz=20) for kind in KINDS]
    return np.stack([one.generic_positions()[:24] for one in motions])


@pytest.fixture(scope="module")
def batch(array):
    persons = ["ann", "bob", "ann", "cid", "dan"]
    return compute_batch(array, rate_hz=20, names=KINDS, persons=persons)


def test_a_batch_is_its_motions(array, batch):
    assert len(batch) == len(array)
    assert batch.names == KINDS
    for one, item in zip(array, batch, strict=True):
        alone = compute_features(one, rate_hz=20)
        np.testing.assert_array_equal(item.packed, alone.packed)
        np.testing.assert_array_equal(item.known, alone.known)

    class Tensor:
        def __array__(self, dtype=None, copy=None):
            return array

    tensor = compute_batch(Tensor(), rate_hz=20)
    assert all((a.packed == b.packed).all() for a, b in zip(tensor, batch, strict=True))
    unnamed = compute_batch(list(array), rate_hz=20)
    assert unnamed.names == ("001", "002", "003", "004", "005")
    assert unnamed.persons == ("",) * 5
    again = compute_batch(list(batch), feature_set=FULL_BODY)
    assert (again.names, again.persons) == (batch.names, batch.persons)


@pytest.mark.parametrize("feature_set", [FULL_BODY, load_everyday_set()], ids=len)
def test_short_and_long_motions_with_gaps_are_as_alone(array, feature_set):
    """Also motions shorter than a window, and bodies whose lengths are seen late or never."""
    motions = [array[0], array[1, :1], array[2, :3], array[3].copy(), np.tile(array[4], (9, 1, 1))]
    motions[3][:5] = np.nan
    motions.append(array[0].copy())
    motions[-1][:, [15, 16, 17, 21]] = np.nan
    motions[-1][7:12, 1:4] = np.nan
    together = compute_batch(motions, rate_hz=20, feature_set=feature_set)
    for one, item in zip(motions, together, strict=True):
        alone = compute_features(one, rate_hz=20, feature_set=feature_set)
        np.testing.assert_array_equal(item.packed, alone.packed)
        np.testing.assert_array_equal(item.known, alone.known)


def test_quantities_from_elsewhere_see_one_motion_at_a_time(array):
    def drift(body, window_s, joint):
        assert body.starts == (0,)
        return body[joint][0] - body[joint][0, 0]

    feature = replace(FULL_BODY.features[12], quantity=drift, mirror="", id="X")
    own = FeatureSet("own", (feature,))
    assert not own.is_of_package
    assert len(compute_batch(array, rate_hz=20, feature_set=own)) == len(array)


def test_files_read_together_are_those_alone_and_one_that_fails_is_alone(array, tmp_path):
    def high(body, window_s):
        if body.height("head").max() > 5:
            raise ZeroDivisionError("too high")
        return body.height("head")

    for i in range(40):
        np.save(tmp_path / f"{i:02}.npy", array[i % len(array)] + (0, 9.0 * (i in (3, 30)), 0))
    (tmp_path / "35.npy").write_bytes(b"nothing")
    files = [(path.name, path) for path in sorted(tmp_path.iterdir())]
    feature = FULL_BODY.features[0]
    own = FeatureSet("own", (replace(feature, quantity=high, joints=(), mirror="", id="X"),))
    options = ReadOptions(skeleton="generic", rate_hz=20.0)
    done = []
    items = list(read_features(files, options=options, feature_set=own, on_done=done.append))
    assert done == files
    failed = [i for i, item in enumerate(items) if isinstance(item, Failure)]
    assert failed == [3, 30, 35]
    assert [items[i].item for i in failed] == [files[i] for i in failed]
    published = list(read_features(files, options=options))
    for i in (0, 17, 36):
        (alone,) = read_features([files[i]], options=options)
        np.testing.assert_array_equal(published[i].packed, alone.packed)
        assert published[i].source == files[i][0]


@pytest.mark.usefixtures("two_processes")
def test_results_do_not_depend_on_processes(array, batch, tmp_path, monkeypatch):
    monkeypatch.setattr("motionary.features.batches._CHUNK", 2)
    done = compute_batch(array, rate_hz=20, names=KINDS, persons=batch.persons, jobs=2)
    for name, one in (("1", batch), ("2", done)):
        write_features(one, tmp_path / f"{name}.npz")
    assert (tmp_path / "1.npz").read_bytes() == (tmp_path / "2.npz").read_bytes()


def test_frames_that_fill_up_are_not_seen(array):
    filled = np.concatenate([array, np.full_like(array[:, :6], np.nan)], axis=1)
    filled = MotionFeatures(**GIVEN).fit_transform(filled)
    plain = MotionFeatures(**GIVEN).fit_transform(array)
    np.testing.assert_array_equal(np.isnan(filled), np.isnan(plain))
    # The last frames' velocities reach beyond the end.
    np.testing.assert_allclose(filled, plain, atol=0.25)


def test_people_are_split_whole_and_alike_in_any_order():
    persons = [f"p{i % 20}" for i in range(200)]
    (item,) = compute_batch([synthetic_motion("squat", seed=0).cut(0, 2)])
    batch = FeatureBatch((item,) * 200).with_persons(persons)
    split = batch.split_by_person(seed=3)
    part_of = dict(zip(persons, split.splits, strict=True))
    assert all(part_of[p] == s for p, s in zip(persons, split.splits, strict=True))
    counts = {part: split.splits.count(part) for part in ("train", "validation", "test")}
    assert counts == {"train": 160, "validation": 20, "test": 20}
    backward = FeatureBatch((item,) * 200).with_persons(persons[::-1]).split_by_person(seed=3)
    assert backward.splits == split.splits[::-1]
    assert batch.split_by_person(seed=4).splits != split.splits
    # Names of files may hold bytes that are no text.
    odd = FeatureBatch((item,) * 3).with_persons(["\udcff", "b", "c"]).split_by_person()
    assert sorted(odd.splits) == ["test", "train", "validation"]
    halves = batch.split_by_person(parts={"a": 1, "b": 1})
    assert halves.splits.count("a") == 100


def test_what_is_written_is_what_was_computed(batch, tmp_path):
    split = batch.split_by_person()
    write_features(split, tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        assert file["recordings"].tolist() == list(KINDS)
        assert file["persons"].tolist() == list(batch.persons)
        assert file["splits"].tolist() == list(split.splits)
        parts = np.split(file["features"], file["starts"][1:])
        for part, item in zip(parts, batch, strict=True):
            np.testing.assert_array_equal(part, item.features)
    write_features(split, tmp_path / "a.csv")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert lines[0].startswith("recording,person,split,time_s,right hand moves forward,")
    assert len(lines) == 1 + sum(map(len, batch))
    with pytest.raises(InvalidInput, match=r"written as \.npz, \.parquet or \.csv, got '\.txt'"):
        write_features(batch, tmp_path / "a.txt")
    with pytest.raises(WrongKind, match="the features come first"):
        write_features(tmp_path / "a.npz", batch)


def test_tables_of_other_programs_say_the_same(batch, tmp_path, monkeypatch):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    frame = batch.split_by_person().to_dataframe()
    assert len(frame) == sum(map(len, batch))
    squat = frame.loc["squat"]
    assert squat["person"].unique().tolist() == ["ann"]
    names = list(FULL_BODY.names)
    first = batch.sequences[0]
    np.testing.assert_array_equal(squat[names].fillna(0).to_numpy(int), first.features)
    np.testing.assert_array_equal(squat[names].notna(), first.known_features)
    # Several portions.
    monkeypatch.setattr("motionary.features.files._PORTION", 2)
    write_features(batch.split_by_person(), tmp_path / "a.parquet")
    read = pandas.read_parquet(tmp_path / "a.parquet", dtype_backend="numpy_nullable")
    assert list(read) == ["recording", "person", "split", "time_s", *names]
    read = read.astype({"recording": object, "person": object, "split": object})
    read = read.set_index(["recording", "time_s"])
    pandas.testing.assert_frame_equal(read, frame, check_dtype=False, check_index_type=False)


def clone(step):
    """A copy as scikit-learn makes it: by class and settings, which the copy keeps as they are."""
    settings = {name: deepcopy(value) for name, value in step.get_params(deep=False).items()}
    copy = type(step)(**settings)
    assert all(copy.get_params()[name] is value for name, value in settings.items())
    return copy


def test_the_step_keeps_the_conventions_of_scikit_learn(array):
    step = MotionFeatures(rate_hz=20, feature_set=LEGS)
    assert step.get_params() == {
        "rate_hz": 20, "skeleton": None, "feature_set": LEGS, "jobs": 1
    }  # fmt: skip
    copy = clone(step)
    assert copy is not step
    assert not hasattr(copy, "feature_set_")
    assert copy.set_params(rate_hz=30, jobs=1) is copy
    assert (copy.rate_hz, step.rate_hz) == (30, 20)
    with pytest.raises(ValueError, match="settings are rate_hz, skeleton, feature_set, jobs"):
        step.set_params(rate=5)
    table = step.fit_transform(array, y=KINDS)
    assert step.fit(array) is step
    assert step.feature_set_ is LEGS
    assert table.shape == (len(KINDS), len(LEGS))
    assert step.get_feature_names_out().tolist() == list(LEGS.names)
    np.testing.assert_array_equal(table, step.transform(list(array)))
    assert repr(MotionFeatures(rate_hz=20)) == "MotionFeatures(rate_hz=20, jobs=1)"


def test_bad_input_is_told(array, batch):
    with pytest.raises(InvalidInput, match=r"shape \(motions, frames, joints, 3\), got \(24"):
        compute_batch(array[0], rate_hz=20)
    some = [*array[:2], array[2][:, :5]]
    with pytest.raises(InvalidInput, match="motion 3: without skeleton= there must be 24 joints"):
        compute_batch(some, rate_hz=20)
    with pytest.raises(InvalidInput, match="c: without skeleton="):
        compute_batch(some, rate_hz=20, names=["a", "b", "c"])
    with pytest.raises(WrongKind, match="or a list of motions"):
        compute_batch(iter(array), rate_hz=20)
    with pytest.raises(InvalidInput, match="5 motions need as many names, got 1"):
        compute_batch(array, rate_hz=20, names=["a"])
    with pytest.raises(InvalidInput, match="needs rate_hz="):
        compute_batch(array)
    with pytest.raises(InvalidInput, match="at least one recording"):
        compute_batch([])
    with pytest.raises(InvalidInput, match="need a person for each recording, got none for '001'"):
        compute_batch(array, rate_hz=20).split_by_person()
    with pytest.raises(InvalidInput, match="5 parts need as many people, got 4: ann, bob"):
        batch.split_by_person(parts=dict.fromkeys("abcde", 1))
    with pytest.raises(InvalidInput, match="each part needs a fraction above 0"):
        batch.split_by_person(parts={"a": 0})
    legs = compute_batch(array[:1], rate_hz=20, feature_set=LEGS)
    with pytest.raises(InvalidInput, match="needs one feature set"):
        FeatureBatch((*legs, *batch))
    with pytest.raises(InvalidInput, match="5 recordings need as many splits, got 1"):
        FeatureBatch(batch.sequences, ("train",))


def test_an_optional_part_that_a_name_lacks_is_no_person():
    named = {"each": "recording", "has": "person"}
    assert match_names(["s1_a", "s2_b"], "^(s[0-9])?", **named) == ["s1", "s2"]
    with pytest.raises(InvalidInput, match=r"matches nothing in 'a_s1'; each recording needs a p"):
        match_names(["s1_a", "a_s1"], "^(s[0-9])?", **named)


def test_files_give_what_arrays_give(array, tmp_path):
    np.savez(tmp_path / "a.npz", positions=array, rate_hz=20.0)
    files = [(f"{i}", tmp_path / f"a.npz#{i}") for i in range(1, 6)]
    read = list(read_features(files))
    assert [item.source for item in read] == list("12345")
    assert all(item.feature_set is FULL_BODY for item in read)
    for one, item in zip(array, read, strict=True):
        np.testing.assert_array_equal(item.packed, compute_features(one, rate_hz=20).packed)
