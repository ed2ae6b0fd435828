"""Is a class that was learned from AMC found in a BVH and in a C3D of the same trial?"""

import pytest

import motionary as mo
from motionary.models.library import TrainingOptions

HOP = "hopBothLegs1hops"
#: As published: all relations weigh alike, and one threshold for all.
AS_PUBLISHED = TrainingOptions(by_self_information=False)
THRESHOLD = 0.06


@pytest.fixture(scope="module")
def hops(data):
    """A class of hops from all clips of HDM05, AMC."""
    clips = [mo.read(path) for path in sorted((data / "hdm05" / HOP).glob("*.amc"))]
    return mo.learn({HOP: clips}, training=AS_PUBLISHED)


def labels(path, hops, skip=0):
    motion = mo.read(path)
    track = mo.annotate(motion.cut(skip, motion.n_frames), hops, threshold=THRESHOLD)
    return [(label.start_s, label.end_s, label.cost) for label in track]


def test_hops_are_found_in_the_bvh_when_they_are_in_the_amc(data, hops):
    amc = labels(data / "cmu" / "01_01.amc", hops)
    bvh = labels(data / "cmu" / "01_01.bvh", hops, skip=1)
    assert len(amc) == len(bvh) == 10
    for one, other in zip(amc, bvh, strict=True):
        assert other[:2] == pytest.approx(one[:2], abs=0.2)
        assert other[2] == pytest.approx(one[2], abs=0.01)


def test_a_hop_is_found_in_the_c3d_when_it_is_in_the_amc(data, hops):
    takes = data / "hdm05_takes"
    ((*amc, amc_cost),) = labels(takes / "HDM_dg_06-03_03_120.amc", hops)
    ((*c3d, c3d_cost),) = labels(takes / "HDM_dg_06-03_03_120.c3d", hops)
    assert c3d == pytest.approx(amc, abs=0.1)
    assert c3d_cost == pytest.approx(amc_cost, abs=0.01)
