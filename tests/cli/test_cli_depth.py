"""`motionary depth`: from images to a motion, and a database of recordings."""

import json

import numpy as np
import pytest

from cli_cases import documented_keys
from motionary.body import load_body, record_depth
from motionary.body.rendering import DepthSettings
from motionary.io import read, write
from motionary.samples import synthetic_motion


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A recording, and images of it as an npz with an empty one in between."""
    home = tmp_path_factory.mktemp("depth")
    motion = synthetic_motion("raise_arms", seed=1)
    write(motion, home / "motion.npz")
    camera, images = record_depth(load_body(), motion, DepthSettings("none", 2.6, 4.0))
    depth = np.array([image for _, image in zip(range(6), images, strict=False)])[:, ::2, ::2]
    depth[4] = np.nan
    told = {"focal": np.array(camera.focal) / 2, "centre": np.array(camera.centre) / 2}
    world = {"world_from_camera": camera.world_from_camera, "position": camera.position}
    np.savez_compressed(home / "images.npz", depth=depth, rate_hz=4.0, **told, **world)
    np.savez_compressed(home / "empty.npz", depth=depth[4:5], rate_hz=4.0, **told)
    return home


def test_images_become_a_motion(folder, motionary):
    out = folder / "out.npz"
    done = motionary("depth", "track", folder / "images.npz", "-o", out, "--json")
    told = json.loads(done.out)
    assert list(told) == documented_keys("`motionary depth track --json` gives")
    assert told["images"] == 6
    assert told["none"] == 1
    assert told["cost_m"] < 0.05
    motion = read(out)
    assert motion.n_frames == 6
    assert np.isnan(motion.positions[4]).all()
    assert "1 of 6 images: no person is seen" in done.err
    picture = folder / "out.png"
    done = motionary("depth", "track", folder / "images.npz", "-o", folder / "out.bvh",
                     "--picture", picture)  # fmt: skip
    assert "images 0 to 3 are written" in done.err
    assert read(folder / "out.bvh").n_frames == 4
    assert picture.stat().st_size > 5000


def test_wrong_use_and_wrong_images_are_told(folder, motionary):
    images = folder / "images.npz"
    done = motionary("depth", "track", folder / "empty.npz", "-o", folder / "no.npz")
    assert done.code == 1
    assert "no person is tracked" in done.err
    assert not (folder / "no.npz").exists()
    done = motionary("depth", "track", images, "-o", folder / "no.bvh", "--least-confidence", ".5")
    assert done.code == 2
    assert "BVH holds no unknown joints" in done.err
    # All that is seen was there before the person came.
    done = motionary("depth", "track", images, "-o", folder / "no.npz", "--background", images)
    assert done.code == 1
    assert "no person is tracked" in done.err
    both = ("--background", images, "--empty", "2")
    done = motionary("depth", "track", images, "-o", folder / "no.npz", *both)
    assert done.code == 2
    assert "already" in done.err
    done = motionary("depth", "track", images, "-o", folder / "no.npz", "--database", images)
    assert done.code == 1
    assert "motionary depth database" in done.err


def test_a_database_is_made_of_recordings(folder, motionary):
    out = folder / "poses.npz"
    done = motionary("depth", "database", folder / "motion.npz", "-o", out, "--apart", "0.03")
    assert done.code == 0
    assert "poses of 1 recording " in done.err + done.out
    tracked = motionary("depth", "track", folder / "images.npz", "-o", folder / "own.npz",
                        "--database", out, "--published", "--json")  # fmt: skip
    assert json.loads(tracked.out)["images"] == 6
