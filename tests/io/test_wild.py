"""Real files of many sources: read right, right with a note, or refused with what to do.

The files lie in `wild/` of the recordings, one folder per source with its origin.
"""

from pathlib import Path

import pytest

from reading_cases import Case, Read, Refused, case, check_case

ADULT_M = (0.65, 1.05)
LEFT_OUT = r"(?i)no label|unlabel|without (a )?(name|label)|unnamed|no name"

WILD = [
    case(
        "wild/20tab+bvh-python/test_mocapbank.bvh",
        Read(frames=455, joints=24, rate_hz=30, features=40, leg_m=ADULT_M, notes=("unit cm",)),
    ),
    case(
        "wild/AnyBody+ammr/S01_T02.bvh",
        Read(frames=114, joints=30, rate_hz=60, features=40, leg_m=ADULT_M),
    ),
    # Qualisys says Y_SCREEN = -Z of bodies that stand along +z.
    case(
        "wild/AnyBody+ammr/S1_StandingRef.c3d",
        Read(
            frames=100,
            joints=26,
            rate_hz=100,
            height_m=(1.4, 1.9),
            upper="LSHO",
            lower="LASI",
            notes=(r"\bz up",),
        ),
    ),
    case(
        "wild/kineticstoolkit+kineticstoolkit/FP_Type3.c3d",
        Read(
            frames=2,
            joints=34,
            rate_hz=250,
            height_m=(1.0, 1.3),
            upper="LPSIS",
            lower="LH",
            notes=(r"\bz up",),
        ),
    ),
    case(
        "wild/kineticstoolkit+kineticstoolkit/kinematics_tennis_serve_nan.c3d",
        Read(frames=1092, joints=39, rate_hz=50, features=40, notes=(r"\bz up",)),
    ),
    # Times are printed with three decimals: 0.007 is 1/150 as well.
    case(
        "wild/BMClab+BMC/walk.trc",
        Read(
            frames=184,
            joints=55,
            rate_hz=150,
            features=14,
            generic=("root", "lhip", "rhip", "lknee", "rknee", "lankle", "rankle"),
        ),
    ),
    case(
        "wild/Biomechanical-ToolKit+BTKData/UpperLimbStatic.trc",
        Read(frames=146, joints=34, rate_hz=100, farthest_m=3, notes=(LEFT_OUT,)),
    ),
    # Places by ezc3d: x -0.121 to 0.194, y -0.042 to 1.857, z -0.818 to 0.201 m.
    case(
        "wild/Biomechanical-ToolKit+BTKData/MotionMonitorC3D.c3d",
        Read(frames=840, joints=7, rate_hz=140, farthest_m=1.9),
    ),
    case(
        "wild/CreativeInquiry+BVH-Examples/Brekel_03_11_2016_15_47_42_body1.bvh",
        Read(
            frames=120,
            joints=62,
            rate_hz=30,
            features=40,
            generic=("belly", "chest"),
            leg_m=ADULT_M,
        ),
    ),
    case(
        "wild/EricGuo5513+HumanML3D/012314.npy",
        Read(frames=170, joints=22, rate_hz=20, features=34, leg_m=ADULT_M),
    ),
    case(
        "wild/FORTH-ModelBasedTracker+MocapNET/waveright.bvh",
        Read(
            frames=19,
            joints=212,
            rate_hz=25,
            features=40,
            leg_m=ADULT_M,
            notes=("no known skeleton",),
        ),
    ),
    case(
        "wild/JLPM22+MotionMatching/HipHopDancing.fbx",
        Read(frames=135, joints=65, rate_hz=30, features=40, leg_m=ADULT_M),
    ),
    # Frame Time: 1.
    case(
        "wild/PeizhuoLi+ganimator/Baseball-Milling-Idle-edited-keyframes.bvh",
        Read(
            frames=21,
            joints=24,
            features=34,
            notes=(r"\b1 (Hz|frames? (a|per) second).*(--rate|rate_hz)",),
        ),
        Refused(r"\b1 (Hz|frames? (a|per) second).*(--rate|rate_hz)"),
    ),
    case(
        "wild/_made/legs.bvh",
        Read(frames=40, rate_hz=30, generic=("lknee", "rknee"), leg_m=(0.3, 1.4)),
    ),
    case(
        "wild/_made/legs_torso.bvh",
        Read(frames=40, rate_hz=30, generic=("lknee", "rknee"), leg_m=(0.3, 1.4)),
    ),
    case("wild/_made/rate120.trc", Read(joints=2, rate_hz=120, frames=60)),
    case("wild/_made/rate150.trc", Read(joints=2, rate_hz=150, frames=60)),
    case("wild/_made/unlabelled.trc", Read(frames=60, joints=2, rate_hz=100, notes=(LEFT_OUT,))),
    case(
        "wild/cadop+pyCGM/Sample_Static.c3d",
        Read(frames=275, joints=111, rate_hz=100, features=40, notes=("are angles, forces",)),
    ),
    # Bones inherit scale as Rrs; the first of two takes does not move.
    case(
        "wild/danielrmz18+threejs-3d-model-personalized/Flair.fbx",
        Read(
            frames=31,
            joints=65,
            rate_hz=30,
            features=40,
            leg_m=ADULT_M,
            height_m=(1.5, 2.3),
            notes=(r"mixamo\.com.*Take 001|Take 001.*mixamo\.com",),
        ),
    ),
    case(
        "wild/keijiro+CMUMocap/Base.fbx",
        # One pose: it has no velocities.
        Read(frames=1, features=20, leg_m=ADULT_M, height_m=(1.4, 1.9), notes=("no take",)),
        Refused(r"(?i)no take|no animation|no motion|one pose"),
    ),
    case(
        "wild/keenon+nimblephysics/motion_capture_walk_trimmed.trc",
        Read(
            frames=131,
            joints=41,
            rate_hz=100,
            features=20,
            generic=(
                "root",
                "lhip",
                "rhip",
                "lknee",
                "rknee",
                "lankle",
                "rankle",
                "lelbow",
                "relbow",
            ),
        ),
    ),
    case(
        "wild/keenon+nimblephysics/squat.c3d",
        Read(
            frames=2539,
            joints=53,
            rate_hz=120,
            features=30,
            generic=("lshoulder", "rshoulder", "lelbow", "relbow", "lwrist", "rwrist"),
        ),
    ),
    case(
        "wild/kevinxie4c+motion-viewer/walk.bvh",
        Read(frames=299, joints=24, rate_hz=120, features=40, generic=("root",), leg_m=ADULT_M),
    ),
    # MakeHuman counts in decimetres.
    case(
        "wild/makehumancommunity+makehuman/walk1.bvh",
        Read(
            frames=14,
            joints=91,
            rate_hz=24,
            features=33,
            leg_m=ADULT_M,
            notes=(r"unit dm|decimet|0\.1 m",),
        ),
    ),
    case("wild/makehumancommunity+makehuman/tpose.bvh", Read(frames=1, rate_hz=24, leg_m=ADULT_M)),
    case(
        "wild/nghorbani+amass/dmpl_sample.npz",
        Read(frames=235, joints=25, rate_hz=120, features=40),
    ),
    case(
        "wild/omimo+PyMO/AV_8Walk_Meredith_HVHA_Rep1.bvh",
        Read(
            frames=1064,
            joints=28,
            rate_hz=120,
            features=35,
            generic=("chest", "neck"),
            leg_m=ADULT_M,
        ),
    ),
    case(
        "wild/opensim-org+opensim-models/static_run.trc",
        Read(frames=397, joints=64, rate_hz=100, features=18, notes=("joint centres",)),
    ),
    # jambe gauche, bras droit, pied, tête, bassin.
    case(
        "wild/ufbx+ufbx/blender_293_barbarian_7400_binary.fbx",
        Read(frames=63, rate_hz=24, features=14, generic=("root", "lankle", "rankle", "head")),
        # Legs of two bones, arms of one and a half, five metres tall: to be mapped by its owner.
        Read(frames=63, rate_hz=24, notes=("no features: no known skeleton.*--save-mapping",)),
    ),
    case(
        "wild/ufbx+ufbx/maya_character_7500_binary.fbx",
        Read(frames=120, joints=63, rate_hz=24, features=38, leg_m=ADULT_M),
    ),
]


@pytest.mark.parametrize("one", WILD, ids=str)
def test_real_file_is_read_right_told_or_refused(data: Path, one: Case) -> None:
    check_case(data, one)


def test_every_real_file_has_a_case(data: Path) -> None:
    there = {
        path.relative_to(data).as_posix()
        for path in (data / "wild").rglob("*")
        if path.is_file() and path.name != "README"
    }
    assert there == {one.file for one in WILD}
