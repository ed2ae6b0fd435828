"""Rigs by the names that programs give them, on the body of the synthetic figure.

A line is a joint, the joint above it, and where it stands: at a generic joint, part of the way
from one to another, or beside one, by metres. Of a line with @ there is one for each side.
"""

from dataclasses import replace

import numpy as np

from motionary.motion import GENERIC_JOINTS, Motion, Skeleton, forward_kinematics
from motionary.recording import Recording
from motionary.rotations import euler_to_quaternions, quaternions_to_matrices
from motionary.samples import Proportions, figure_skeleton

LIMBS = """
{clavicle} {top} $clavicle
{shoulder} {clavicle} $shoulder
{elbow} {shoulder} $elbow
{wrist} {elbow} $wrist
{hip} {root} $hip
{knee} {hip} $knee
{ankle} {knee} $ankle
"""


def limbs(**names):
    return LIMBS.format(**names).strip()


HUMAN_IK = dict(
    root="Hips", clavicle="@Shoulder", shoulder="@Arm", elbow="@ForeArm", wrist="@Hand",
    hip="@UpLeg", knee="@Leg", ankle="@Foot",
)  # fmt: skip

SMPL = f"""
pelvis - root
spine1 pelvis belly
spine2 spine1 belly>chest .5
spine3 spine2 chest
neck spine3 neck
head neck head
{
    limbs(
        root="pelvis",
        top="spine3",
        clavicle="@_collar",
        shoulder="@_shoulder",
        elbow="@_elbow",
        wrist="@_wrist",
        hip="@_hip",
        knee="@_knee",
        ankle="@_ankle",
    )
}
@_foot @_ankle $toes
"""

HANDS = """
@_index1 @_wrist $wrist>$fingers .5 0 0 .02
@_index2 @_index1 $wrist>$fingers .7 0 0 .02
@_index3 @_index2 $wrist>$fingers .85 0 0 .02
@_middle1 @_wrist $wrist>$fingers .5
@_middle2 @_middle1 $wrist>$fingers .7
@_middle3 @_middle2 $wrist>$fingers .85
@_thumb1 @_wrist $wrist>$fingers .2 0 0 .03
@_thumb2 @_thumb1 $wrist>$fingers .4 0 0 .05
@_thumb3 @_thumb2 $wrist>$fingers .5 0 0 .06
"""

#: Table, prefix of the names and words for the sides, and the joints.
RIGS = {
    "mixamo": ("mixamorig:", ("Left", "Right"), f"""
Hips - root
Spine Hips belly
Spine1 Spine belly>chest .5
Spine2 Spine1 chest
Neck Spine2 neck
Head Neck head
HeadTop_End Head headtop
@Eye Head head 0 .08 .08
{limbs(top="Spine2", **HUMAN_IK)}
@HandThumb1 @Hand $wrist>$fingers .2 0 0 .03
@HandThumb2 @HandThumb1 $wrist>$fingers .4 0 0 .05
@HandIndex1 @Hand $wrist>$fingers .5 0 0 .02
@HandIndex2 @HandIndex1 $wrist>$fingers .9 0 0 .02
@HandMiddle1 @Hand $wrist>$fingers .5
@HandMiddle2 @HandMiddle1 $wrist>$fingers .7
@HandMiddle3 @HandMiddle2 $wrist>$fingers .85
@HandMiddle4 @HandMiddle3 $fingers
@ToeBase @Foot $ankle>$toes .7
@Toe_End @ToeBase $toes
"""),
    "perception_neuron": ("", ("Left", "Right"), f"""
Hips - root
Spine Hips belly
Spine1 Spine belly>chest .5
Spine2 Spine1 chest
Neck Spine2 neck
Neck1 Neck neck>head .5
Head Neck1 head
End_of_Head Head headtop
{limbs(top="Spine2", **HUMAN_IK)}
End_of_@Foot @Foot $toes
@HandThumb1 @Hand $wrist>$fingers .2 0 0 .03
@HandThumb2 @HandThumb1 $wrist>$fingers .4 0 0 .05
@InHandIndex @Hand $wrist>$fingers .2 0 0 .02
@HandIndex1 @InHandIndex $wrist>$fingers .5 0 0 .02
@HandIndex2 @HandIndex1 $wrist>$fingers .9 0 0 .02
@InHandMiddle @Hand $wrist>$fingers .2
@HandMiddle1 @InHandMiddle $wrist>$fingers .5
@HandMiddle2 @HandMiddle1 $wrist>$fingers .7
@HandMiddle3 @HandMiddle2 $wrist>$fingers .85
End_of_@HandMiddle3 @HandMiddle3 $fingers
"""),
    "rokoko": ("", ("Left", "Right"), f"""
Root - root 0 -.9 0
Hips Root root
Spine1 Hips belly
Spine2 Spine1 belly>chest .3
Spine3 Spine2 belly>chest .6
Spine4 Spine3 chest
Neck Spine4 neck
Head Neck head
HeadTip Head headtop
{limbs(root="Hips", top="Spine4", clavicle="@Shoulder", shoulder="@Arm", elbow="@ForeArm",
       wrist="@Hand", hip="@Thigh", knee="@Shin", ankle="@Foot")}
@Toe @Foot $ankle>$toes .7
@ToeTip @Toe $toes
@Finger1Metacarpal @Hand $wrist>$fingers .2 0 0 .03
@Finger1Proximal @Finger1Metacarpal $wrist>$fingers .4 0 0 .05
@Finger2Metacarpal @Hand $wrist>$fingers .2 0 0 .02
@Finger2Proximal @Finger2Metacarpal $wrist>$fingers .8 0 0 .02
@Finger3Metacarpal @Hand $wrist>$fingers .2
@Finger3Proximal @Finger3Metacarpal $wrist>$fingers .5
@Finger3Medial @Finger3Proximal $wrist>$fingers .7
@Finger3Distal @Finger3Medial $wrist>$fingers .85
@Finger3Tip @Finger3Distal $fingers
"""),
    "optitrack": ("Skeleton 001:", ("L", "R"), f"""
Hip - root
Ab Hip belly
Chest Ab chest
Neck Chest neck
Head Neck head
{limbs(root="Hip", top="Chest", clavicle="@Shoulder", shoulder="@UArm", elbow="@FArm",
       wrist="@Hand", hip="@Thigh", knee="@Shin", ankle="@Foot")}
@Toe @Foot $toes
"""),
    "unreal": ("", ("l", "r"), f"""
root - root 0 -.9 0
pelvis root root
spine_01 pelvis belly
spine_02 spine_01 belly>chest .3
spine_03 spine_02 belly>chest .6
spine_04 spine_03 belly>chest .8
spine_05 spine_04 chest
neck_01 spine_05 neck
neck_02 neck_01 neck>head .5
head neck_02 head
{limbs(root="pelvis", top="spine_05", clavicle="clavicle_@", shoulder="upperarm_@",
       elbow="lowerarm_@", wrist="hand_@", hip="thigh_@", knee="calf_@", ankle="foot_@")}
upperarm_twist_01_@ upperarm_@ $shoulder>$elbow .5
lowerarm_twist_01_@ lowerarm_@ $elbow>$wrist .5
thigh_twist_01_@ thigh_@ $hip>$knee .5
ball_@ foot_@ $toes
thumb_01_@ hand_@ $wrist>$fingers .2 0 0 .03
thumb_02_@ thumb_01_@ $wrist>$fingers .4 0 0 .05
middle_metacarpal_@ hand_@ $wrist>$fingers .2
middle_01_@ middle_metacarpal_@ $wrist>$fingers .5
middle_02_@ middle_01_@ $wrist>$fingers .7
middle_03_@ middle_02_@ $fingers
index_01_@ hand_@ $wrist>$fingers .5 0 0 .02
ik_foot_root root root 0 -.9 0
ik_foot_@ ik_foot_root $ankle
ik_hand_root root root 0 -.9 0
ik_hand_gun ik_hand_root rwrist
ik_hand_@ ik_hand_gun $wrist
"""),
    "xsens": ("", ("Left", "Right"), f"""
Hips - root
Chest Hips belly
Chest2 Chest belly>chest .3
Chest3 Chest2 belly>chest .6
Chest4 Chest3 chest
Neck Chest4 neck
Head Neck head
End_of_Head Head headtop
{limbs(root="Hips", top="Chest4", clavicle="@Collar", shoulder="@Shoulder", elbow="@Elbow",
       wrist="@Wrist", hip="@Hip", knee="@Knee", ankle="@Ankle")}
Prop1 RightWrist rfingers 0 -.5 0
End_of_Prop1 Prop1 rfingers 0 -.9 .3
End_of_@Wrist @Wrist $fingers
@Toe @Ankle $ankle>$toes .7
End_of_@Toe @Toe $toes
"""),
    "vrm": ("", ("left", "right"), f"""
hips - root
spine hips belly
chest spine belly>chest .6
upperChest chest chest
neck upperChest neck
head neck head
@Eye head head 0 .07 .08
{limbs(root="hips", top="upperChest", clavicle="@Shoulder", shoulder="@UpperArm",
       elbow="@LowerArm", wrist="@Hand", hip="@UpperLeg", knee="@LowerLeg", ankle="@Foot")}
@MiddleProximal @Hand $wrist>$fingers .5
@MiddleIntermediate @MiddleProximal $wrist>$fingers .7
@MiddleDistal @MiddleIntermediate $fingers
@Toes @Foot $toes
"""),
    "xsens_segments": ("", ("Left", "Right"), f"""
Pelvis - root
L5 Pelvis belly
L3 L5 belly>chest .3
T12 L3 belly>chest .6
T8 T12 chest
Neck T8 neck
Head Neck head
{limbs(root="Pelvis", top="T8", clavicle="@Shoulder", shoulder="@UpperArm", elbow="@ForeArm",
       wrist="@Hand", hip="@UpperLeg", knee="@LowerLeg", ankle="@Foot")}
@Toe @Foot $toes
"""),
    "bandai": ("", ("L", "R"), f"""
joint_Root - root 0 -.9 0
Hips joint_Root root
Spine Hips belly
Chest Spine chest
Neck Chest neck
Head Neck head
{limbs(root="Hips", top="Chest", clavicle="Shoulder_@", shoulder="UpperArm_@",
       elbow="LowerArm_@", wrist="Hand_@", hip="UpperLeg_@", knee="LowerLeg_@", ankle="Foot_@")}
Toes_@ Foot_@ $ankle>$toes .7
End_of_Toes_@ Toes_@ $toes
"""),
    "cmu_bvh": ("", ("Left", "Right"), """
Hips - root
LHipJoint Hips root
RHipJoint Hips root
LowerBack Hips root
Spine LowerBack belly
Spine1 Spine neck
Neck Spine1 neck
Neck1 Neck neck>head .5
Head Neck1 head
End_of_Head Head headtop
LeftUpLeg LHipJoint lhip
RightUpLeg RHipJoint rhip
@Leg @UpLeg $knee
@Foot @Leg $ankle
@ToeBase @Foot $ankle>$toes .7
End_of_@ToeBase @ToeBase $toes
@Shoulder Spine1 neck
@Arm @Shoulder $shoulder
@ForeArm @Arm $elbow
@Hand @ForeArm $elbow>$wrist .7
@FingerBase @Hand $wrist
@HandIndex1 @FingerBase $wrist>$fingers .5
End_of_@HandIndex1 @HandIndex1 $fingers
LThumb LeftHand lwrist 0 0 .05
RThumb RightHand rwrist 0 0 .05
"""),
    "character_creator": ("", ("L", "R"), f"""
RL_BoneRoot - root 0 -.9 0
CC_Base_Hip RL_BoneRoot root
CC_Base_Pelvis CC_Base_Hip root
CC_Base_Waist CC_Base_Hip root>belly .3
CC_Base_Spine01 CC_Base_Waist belly
CC_Base_Spine02 CC_Base_Spine01 chest
CC_Base_NeckTwist01 CC_Base_Spine02 neck
CC_Base_NeckTwist02 CC_Base_NeckTwist01 neck>head .5
CC_Base_Head CC_Base_NeckTwist02 head
CC_Base_FacialBone CC_Base_Head head
CC_Base_UpperJaw CC_Base_FacialBone head 0 0 .08
CC_Base_@_Eye CC_Base_FacialBone head 0 .07 .08
{limbs(root="CC_Base_Pelvis", top="CC_Base_Spine02", clavicle="CC_Base_@_Clavicle",
       shoulder="CC_Base_@_Upperarm", elbow="CC_Base_@_Forearm", wrist="CC_Base_@_Hand",
       hip="CC_Base_@_Thigh", knee="CC_Base_@_Calf", ankle="CC_Base_@_Foot")}
CC_Base_@_ThighTwist01 CC_Base_@_Thigh $hip>$knee .5
CC_Base_@_KneeShareBone CC_Base_@_Calf $knee 0 .02 0
CC_Base_@_RibsTwist CC_Base_Spine02 chest 0 .05 .05
CC_Base_@_Breast CC_Base_@_RibsTwist chest 0 .05 .15
CC_Base_@_ToeBase CC_Base_@_Foot $ankle>$toes .7
CC_Base_@_BigToe1 CC_Base_@_ToeBase $toes 0 0 .01
CC_Base_@_MidToe1 CC_Base_@_ToeBase $toes
CC_Base_@_PinkyToe1 CC_Base_@_ToeBase $ankle>$toes .8
CC_Base_@_Mid1 CC_Base_@_Hand $wrist>$fingers .5
CC_Base_@_Mid3 CC_Base_@_Mid1 $fingers
CC_Base_@_Thumb1 CC_Base_@_Hand $wrist>$fingers .2 0 0 .03
CC_Base_@_Index1 CC_Base_@_Hand $wrist>$fingers .5 0 0 .02
"""),
    "smpl": ("", ("left", "right"), f"{SMPL}@_hand @_wrist $wrist>$fingers .5\n"),
    "humanml3d": ("", ("left", "right"), SMPL),
    "smplh": ("", ("left", "right"), f"{SMPL}{HANDS}"),
    "smplx": (
        "",
        ("left", "right"),
        f"{SMPL}jaw head head 0 0 .08\n@_eye_smplhf head head 0 .07 .08\n{HANDS}",
    ),
    "kinect_v2": ("", ("Left", "Right"), """
SpineBase - root
SpineMid SpineBase belly
SpineShoulder SpineMid neck
Neck SpineShoulder neck>head .5
Head Neck head
Shoulder@ SpineShoulder $shoulder
Elbow@ Shoulder@ $elbow
Wrist@ Elbow@ $wrist
Hand@ Wrist@ $wrist>$fingers .5
HandTip@ Hand@ $fingers
Thumb@ Hand@ $wrist>$fingers .4 0 0 .05
Hip@ SpineBase $hip
Knee@ Hip@ $knee
Ankle@ Knee@ $ankle
Foot@ Ankle@ $toes
"""),
    "kinect_azure": ("", ("LEFT", "RIGHT"), f"""
PELVIS - root
SPINE_NAVEL PELVIS belly
SPINE_CHEST SPINE_NAVEL chest
NECK SPINE_CHEST neck
HEAD NECK head
NOSE HEAD head 0 .03 .1
EYE_@ HEAD head 0 .07 .08
EAR_@ HEAD head 0 .05 0
{limbs(root="PELVIS", top="SPINE_CHEST", clavicle="CLAVICLE_@", shoulder="SHOULDER_@",
       elbow="ELBOW_@", wrist="WRIST_@", hip="HIP_@", knee="KNEE_@", ankle="ANKLE_@")}
FOOT_@ ANKLE_@ $toes
HAND_@ WRIST_@ $wrist>$fingers .5
HANDTIP_@ HAND_@ $fingers
THUMB_@ WRIST_@ $wrist>$fingers .4 0 0 .05
"""),
    # Motive's and others' names of BVH: joints, with collars.
    "collars": ("", ("Left", "Right"), """
Hips - root
Chest Hips belly
Neck Chest neck
Head Neck head
End_of_Head Head headtop
@Collar Chest $clavicle
@Shoulder @Collar $shoulder
@Elbow @Shoulder $elbow
@Wrist @Elbow $wrist
End_of_@Wrist @Wrist $fingers
@Hip Hips $hip
@Knee @Hip $knee
@Ankle @Knee $ankle
End_of_@Ankle @Ankle $toes
"""),
}  # fmt: skip


#: Rigs without a table, as programs make them, and what they must be mapped to.
STRANGERS = {
    # 3ds Max: thighs hang on the spine, clavicles on the neck.
    "biped": ("", ("L", "R"), """
Bip01 - root 0 .05 0
Bip01_Pelvis Bip01 root
Bip01_Spine Bip01_Pelvis root
Bip01_@_Thigh Bip01_Spine $hip
Bip01_@_Calf Bip01_@_Thigh $knee
Bip01_@_Foot Bip01_@_Calf $ankle
Bip01_@_Toe0 Bip01_@_Foot $toes
Bip01_Spine1 Bip01_Spine belly
Bip01_Spine2 Bip01_Spine1 chest
Bip01_Neck Bip01_Spine2 neck
Bip01_Head Bip01_Neck head
Bip01_HeadNub Bip01_Head headtop
Bip01_@_Clavicle Bip01_Neck $clavicle
Bip01_@_UpperArm Bip01_@_Clavicle $shoulder
Bip01_@_Forearm Bip01_@_UpperArm $elbow
Bip01_@_Hand Bip01_@_Forearm $wrist
Bip01_@_Finger0 Bip01_@_Hand $wrist>$fingers .4 0 0 .05
Bip01_@_Finger1 Bip01_@_Hand $fingers
"""),
    # Daz: the upper half of a bone bends, the lower one twists.
    "daz": ("", ("l", "r"), """
hip - root
pelvis hip root
@ThighBend pelvis $hip
@ThighTwist @ThighBend $hip>$knee .5
@Shin @ThighTwist $knee
@Foot @Shin $ankle
@Metatarsals @Foot $ankle>$toes .5
@Toe @Metatarsals $toes
abdomenLower hip belly
abdomenUpper abdomenLower belly>chest .5
chestLower abdomenUpper belly>chest .7
chestUpper chestLower chest
@Pectoral chestUpper chest 0 0 .1
neckLower chestUpper neck
neckUpper neckLower neck>head .5
head neckUpper head
upperFaceRig head head 0 0 .05
lowerJaw head head 0 0 .05
@Eye head head 0 .06 .08
@Collar chestUpper $clavicle
@ShldrBend @Collar $shoulder
@ShldrTwist @ShldrBend $shoulder>$elbow .5
@ForearmBend @ShldrTwist $elbow
@ForearmTwist @ForearmBend $elbow>$wrist .5
@Hand @ForearmTwist $wrist
@Carpal1 @Hand $wrist>$fingers .3 0 0 .02
@Index1 @Carpal1 $wrist>$fingers .6 0 0 .02
@Carpal2 @Hand $wrist>$fingers .3
@Mid1 @Carpal2 $fingers
@Thumb1 @Hand $wrist>$fingers .2 0 0 .03
"""),
    # Blender's Rigify: the pelvis has bones of its own, the spine is numbered up to the head.
    "rigify": ("", ("L", "R"), """
spine - root
pelvis.@ spine root
thigh.@ spine $hip
shin.@ thigh.@ $knee
foot.@ shin.@ $ankle
toe.@ foot.@ $toes
heel.02.@ foot.@ $ankle 0 -.05 -.05
spine.001 spine belly
spine.002 spine.001 belly>chest .5
spine.003 spine.002 chest
breast.@ spine.003 chest 0 0 .1
shoulder.@ spine.003 $clavicle
upper_arm.@ shoulder.@ $shoulder
forearm.@ upper_arm.@ $elbow
hand.@ forearm.@ $wrist
palm.01.@ hand.@ $wrist>$fingers .3 0 0 .02
f_index.01.@ palm.01.@ $wrist>$fingers .6 0 0 .02
palm.02.@ hand.@ $wrist>$fingers .3
f_middle.01.@ palm.02.@ $fingers
thumb.01.@ hand.@ $wrist>$fingers .2 0 0 .03
neck spine.003 neck
head neck head
"""),
    # VRoid: J_Sec are hair and cloth.
    "vroid": ("", ("L", "R"), """
Root - root 0 -.9 0
J_Bip_C_Hips Root root
J_Bip_C_Spine J_Bip_C_Hips belly
J_Bip_C_Chest J_Bip_C_Spine belly>chest .5
J_Bip_C_UpperChest J_Bip_C_Chest chest
J_Sec_@_Bust1 J_Bip_C_UpperChest chest 0 0 .1
J_Bip_C_Neck J_Bip_C_UpperChest neck
J_Bip_C_Head J_Bip_C_Neck head
J_Adj_@_FaceEye J_Bip_C_Head head 0 .06 .08
J_Sec_Hair1_01 J_Bip_C_Head headtop
J_Sec_Hair2_01 J_Sec_Hair1_01 headtop 0 -.3 -.2
J_Bip_@_Shoulder J_Bip_C_UpperChest $clavicle
J_Bip_@_UpperArm J_Bip_@_Shoulder $shoulder
J_Bip_@_LowerArm J_Bip_@_UpperArm $elbow
J_Bip_@_Hand J_Bip_@_LowerArm $wrist
J_Bip_@_Index1 J_Bip_@_Hand $wrist>$fingers .6 0 0 .02
J_Bip_@_Middle1 J_Bip_@_Hand $wrist>$fingers .5
J_Bip_@_Middle2 J_Bip_@_Middle1 $fingers
J_Bip_@_Thumb1 J_Bip_@_Hand $wrist>$fingers .2 0 0 .03
J_Bip_@_UpperLeg J_Bip_C_Hips $hip
J_Bip_@_LowerLeg J_Bip_@_UpperLeg $knee
J_Bip_@_Foot J_Bip_@_LowerLeg $ankle
J_Bip_@_ToeBase J_Bip_@_Foot $toes
J_Sec_@_CoatSkirt_01 J_Bip_C_Hips $knee 0 0 -.1
"""),
    # MikuMikuDance.
    "mmd": ("", ("左", "右"), """
センター - root
下半身 センター root
@足 下半身 $hip
@ひざ @足 $knee
@足首 @ひざ $ankle
@つま先 @足首 $toes
上半身 センター belly
上半身2 上半身 chest
首 上半身2 neck
頭 首 head
@目 頭 head 0 .06 .08
@肩 上半身2 $clavicle
@腕 @肩 $shoulder
@腕捩 @腕 $shoulder>$elbow .5
@ひじ @腕捩 $elbow
@手首 @ひじ $wrist
@親指１ @手首 $wrist>$fingers .2 0 0 .03
@中指１ @手首 $fingers
"""),
}  # fmt: skip


def rig_lines(name):
    """Joints of a rig: name, parent or "", words of the place."""
    prefix, sides, text = (RIGS | STRANGERS)[name]
    lines = [line.split() for line in text.splitlines() if line.strip()]
    done = []
    for packed in lines:
        both = any("@" in word or "$" in word for word in packed)
        for letter, side in zip("lr", sides, strict=True) if both else [("", "")]:
            joint, parent, *place = (w.replace("@", side).replace("$", letter) for w in packed)
            full = [full_name(part, prefix) for part in (joint, parent)]
            done.append((full[0], full[1], place))
    return done


def full_name(joint, prefix):
    if joint == "-":
        return ""
    if joint.startswith("End_of_"):
        return f"End of {prefix}{joint.removeprefix('End_of_')}"
    return prefix + joint


def standing():
    """Places of the 24 generic joints of the figure at rest."""
    skeleton = figure_skeleton(Proportions())
    places = np.zeros((len(GENERIC_JOINTS), 3))
    for joint, parent in enumerate(skeleton.parents):
        places[joint] = skeleton.offsets[joint] + (places[parent] if parent >= 0 else 0)
    return dict(zip(GENERIC_JOINTS, places, strict=True))


def place_of(packed, places):
    first, _, second = packed[0].partition(">")
    rest = [float(word) for word in packed[1:]]
    place = places[first]
    if second:
        place = place + rest.pop(0) * (places[second] - places[first])
    return place + np.array(rest or [0.0, 0.0, 0.0])


def rest_places(name):
    """Where the joints of a rig stand at rest, in the order of its lines."""
    return np.array([place_of(packed, standing()) for *_, packed in rig_lines(name)])


def rig_motion(name, *, rename=lambda joint: joint, n_frames=60, seed=0):
    """The rig in a motion: every joint turns a little to and fro, the whole walks."""
    lines = rig_lines(name)
    # Parents first, each branch after its parent.
    places, index = standing(), {}
    parents, where = [], []
    for joint, parent, packed in lines:
        index[joint] = len(parents)
        parents.append(index[parent] if parent else -1)
        where.append(place_of(packed, places))
    where = np.array(where)
    offsets = np.array(
        [p - where[above] if above >= 0 else p for p, above in zip(where, parents, strict=True)]
    )
    names = tuple(rename(joint) for joint, *_ in lines)
    skeleton = Skeleton(names, np.array(parents, dtype=np.intp), offsets)
    rng = np.random.default_rng(seed)
    phase = np.linspace(0, 4 * np.pi, n_frames)[:, None, None]
    swing = rng.uniform(-12, 12, (1, len(names), 3)) * np.sin(
        phase + rng.uniform(0, 6, (1, len(names), 1))
    )
    swing[:, [joint.startswith("End of") for joint, *_ in lines]] = 0
    rotations = euler_to_quaternions(np.radians(swing.reshape(-1, 3)), "ZXY").reshape(
        n_frames, -1, 4
    )
    root = np.stack(
        [np.zeros(n_frames), np.full(n_frames, 0.9), np.linspace(0, 1, n_frames)], axis=1
    )
    positions = forward_kinematics(skeleton, quaternions_to_matrices(rotations), root)
    return Motion(names, positions, Recording(rate_hz=60.0), skeleton=skeleton, rotations=rotations)


def dog():
    """A body on four legs under the names of a person, as motion capture of dogs has them."""
    made = rig_motion("optitrack", n_frames=40)
    places = made.positions.copy()
    index = {name.rpartition(":")[2]: i for i, name in enumerate(made.names)}
    rest = {
        "Hip": (0, 0.6, 0), "Ab": (0, 0.6, 0.2), "Chest": (0, 0.6, 0.5), "Neck": (0, 0.65, 0.6),
        "Head": (0, 0.8, 0.75),
        "Shoulder": (0.08, 0.6, 0.5), "UArm": (0.1, 0.5, 0.5), "FArm": (0.1, 0.3, 0.47),
        "Hand": (0.1, 0.05, 0.5), "Thigh": (0.1, 0.55, 0), "Shin": (0.1, 0.35, 0.05),
        "Foot": (0.1, 0.1, -0.05), "Toe": (0.1, 0.0, 0.03),
    }  # fmt: skip
    for name, joint in index.items():
        side = -1 if name.startswith("R") else 1
        place = rest.get(name) or rest[name[1:]]
        places[:, joint] = np.array(place) * (side, 1, 1)
    return replace(made, positions=places, mapping=None)
