"""Which recordings did people label, and what do they call the classes of the clips?

The labels are those of Müller, Baak and Seidel (2009); several classes of clips have one
name there.
"""

#: Recordings and their names in the table of truth.
LABELLED = {
    "cmu/01_01.amc": "01_01",
    "cmu/49_08.amc": "49_08",
    "cmu/86_01.amc": "86_01",
    "hdm05_takes/HDM_bd_03-03_01_120.amc": "HDM_bd_03-03_01_120",
}
#: The actor of the last.
UNSEEN = "bd"
#: What the authors of the truth call the classes of the clips.
NAMES = {
    "depositFloorR": "grabDepR",
    "grabHighR": "grabDepR",
    "elbowToKnee1RepsLelbowStart": "exercise",
    "squat1Reps": "exercise",
    "hopBothLegs1hops": "jump",
    "jogLeftCircle4StepsRstart": "move",
    "sneak2StepsLStart": "move",
    "kickLFront1Reps": "kick",
    "lieDownFloor": "sitLieDown",
    "rotateArmsBothBackward1Reps": "rotateArms",
    "throwBasketball": "throwR",
}
