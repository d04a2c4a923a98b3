//! Names of points as programs write them: one table, a naming per convention.

pub struct Naming {
    pub about: &'static str,
    pub template: &'static str,
    /// The template's names, in which `#` is `left` or `right` and `&` is `L` or `R`, and the program's simplified ones, in which `@`
    /// is `left`, `l`, `right` or `r`.
    pub names: &'static [(&'static str, &'static str)],
}

pub const NAMINGS: [Naming; 10] = [
    Naming {
        about: "joints named as Biovision and SMPL do",
        template: "bvh",
        names: &[
            ("Hips", "hips pelvis root"),
            ("Spine", "spine spine1 lowerback"),
            ("Spine1", "chest spine2 upperback"),
            ("Spine2", "chest2 spine3"),
            ("Spine3", "chest3"),
            ("Neck", "neck lowerneck"),
            ("Head", "head upperneck"),
            ("Head_End", "headend upperneckend"),
            ("#UpLeg", "@hip"),
            ("#Leg", "@knee"),
            ("#Foot", "@ankle"),
            ("#ToeBase", "@foot @ankleend @toe"),
            ("#ToeBase_End", "@toeend @footend"),
            ("#Arm", "@shoulder"),
            ("#ForeArm", "@elbow"),
            ("#Hand", "@wrist"),
            ("#Hand_End", "@wristend @hand"),
            ("#HandIndex1_End", "@handend"),
        ],
    },
    Naming {
        about: "segments named as DAZ, 3ds Max, Unreal, Unity, Xsens and Motive do",
        template: "bvh",
        names: &[
            ("Hips", "hip hips pelvis"),
            ("Spine", "abdomen ab abdomenlower spine spine01 l5"),
            ("Spine1", "abdomen2 abdomenupper spine1 spine02 l3"),
            ("Spine2", "chest chestlower spine2 spine03 t12"),
            ("Spine3", "chestupper upperchest spine3 t8"),
            ("Neck", "neck neck01 necklower"),
            ("Neck1", "neckupper"),
            ("Head", "head"),
            ("Head_End", "headend headnub"),
            ("#Arm", "@shldr @uarm @shldrbend @upperarm @uparm @arm"),
            ("#ForeArm", "@forearm @farm @forearmbend @lowerarm @lowarm"),
            ("#Hand", "@hand"),
            ("#Hand_End", "@handend"),
            ("#HandIndex1", "@index1"),
            ("#HandMiddle1", "@mid1"),
            ("#UpLeg", "@thigh @thighbend @upperleg @upleg"),
            ("#Leg", "@shin @calf @lowerleg @lowleg @leg"),
            ("#Foot", "@foot"),
            ("#ToeBase", "@toe @toe0 @ball @toes @toebase @footend"),
            ("#ToeBase_End", "@toeend"),
        ],
    },
    Naming {
        about: "joints without wrists and ankles, as of MakeHuman and MocapNET",
        template: "bvh",
        names: &[
            ("Hips", "hip hips"),
            ("Spine", "abdomen spine"),
            ("Spine1", "chest"),
            ("Neck", "neck"),
            ("Neck1", "neck1"),
            ("Head", "head"),
            ("#Arm", "@shoulder"),
            ("#ForeArm", "@elbow @arm"),
            ("#Hand", "@hand @wrist"),
            ("#UpLeg", "@hip @hipjoint"),
            ("#Leg", "@knee @leg"),
            ("#Foot", "@foot"),
        ],
    },
    Naming {
        about: "bones named as ASF files of Acclaim and CMU do",
        template: "bvh",
        names: &[
            ("Hips", "root pelvis"),
            ("Spine", "lowerback"),
            ("Spine1", "upperback"),
            ("Spine2", "thorax"),
            ("Neck", "lowerneck neck"),
            ("Neck1", "upperneck neck"),
            ("Head", "head"),
            ("Head_End", "headend"),
            ("#Arm", "@humerus"),
            ("#ForeArm", "@radius"),
            ("#Hand", "@wrist @hand"),
            ("#HandIndex1", "@hand"),
            ("#HandIndex1_End", "@fingers"),
            ("#Hand_End", "@handend"),
            ("#UpLeg", "@femur"),
            ("#Leg", "@tibia"),
            ("#Foot", "@foot"),
            ("#ToeBase", "@toes"),
            ("#ToeBase_End", "@toesend"),
        ],
    },
    Naming {
        about: "keypoints named as OpenPose, HALPE and Pose2Sim do",
        template: "keypoints",
        names: &[
            ("nose", "nose"),
            ("head top", "head headtop"),
            ("neck", "neck"),
            ("hip centre", "hip midhip chip hipcentre pelvis"),
            ("# eye", "@eye"),
            ("# ear", "@ear"),
            ("# shoulder", "@shoulder"),
            ("# elbow", "@elbow"),
            ("# wrist", "@wrist"),
            ("# hip", "@hip"),
            ("# knee", "@knee"),
            ("# ankle", "@ankle"),
            ("# heel", "@heel"),
            ("# big toe", "@bigtoe @footindex"),
            ("# small toe", "@smalltoe"),
            ("# hand", "@index @hand"),
        ],
    },
    Naming {
        about: "keypoints without wrists and ankles, as of MocapNET",
        template: "keypoints",
        names: &[
            ("nose", "head"),
            ("neck", "neck"),
            ("hip centre", "hip"),
            ("# shoulder", "@shoulder"),
            ("# elbow", "@elbow"),
            ("# wrist", "@hand"),
            ("# hip", "@hip"),
            ("# knee", "@knee"),
            ("# ankle", "@foot"),
        ],
    },
    Naming {
        about: "laboratory markers named as Helen Hayes sets and OpenSim's gait2392 do",
        template: "keypoints",
        names: &[
            ("head top", "tophead"),
            ("nose", "fronthead"),
            ("neck", "sternum c7"),
            ("hip centre", "vsacral sacral"),
            ("# shoulder", "@shoulder @acromium"),
            ("# elbow", "@elbow @elbowlat"),
            ("# wrist", "@wrist @wristlat"),
            ("# hip", "@asis"),
            ("# knee", "@knee @kneelat"),
            ("# ankle", "@ankle @anklelat"),
            ("# heel", "@heel"),
            ("# big toe", "@toe @toetip"),
            ("# small toe", "@toelat"),
        ],
    },
    Naming {
        about: "joints named as the Kinect SDK does",
        template: "kinect",
        names: &[
            ("hip centre", "hipcenter spinebase pelvis"),
            ("spine", "spine spinemid spinenavel"),
            ("shoulder centre", "shouldercenter spineshoulder spinechest"),
            ("neck", "neck"),
            ("head", "head"),
            ("# shoulder", "shoulder@"),
            ("# elbow", "elbow@"),
            ("# wrist", "wrist@"),
            ("# hand", "hand@"),
            ("# hand tip", "handtip@"),
            ("# thumb", "thumb@"),
            ("# hip", "hip@"),
            ("# knee", "knee@"),
            ("# ankle", "ankle@"),
            ("# foot", "foot@"),
        ],
    },
    Naming {
        about: "markers named as OptiTrack's baseline and Qualisys' sport sets do",
        template: "plug-in-gait",
        names: &[
            ("LFHD", "headl headtop"),
            ("RFHD", "headr headside"),
            ("LBHD", "headfront"),
            ("C7", "spinetop backtop tv2"),
            ("CLAV", "chest"),
            ("T10", "backl backleft"),
            ("RBAC", "backr backright"),
            ("&SHO", "@shouldertop"),
            ("&UPA", "@uarmhigh @arm"),
            ("&ELB", "@elbowout"),
            ("&WRA", "@wristin"),
            ("&WRB", "@wristout"),
            ("&FIN", "@handout"),
            ("&ASI", "waist@front"),
            ("&PSI", "waist@back"),
            ("&THI", "@thigh @thighfrontlow"),
            ("&KNE", "@kneeout"),
            ("&TIB", "@shin @shinfronthigh"),
            ("&ANK", "@ankleout"),
            ("&HEE", "@heel @heelback"),
            ("&MT5", "@toeout @forefoot5"),
            ("&TOE", "@toetip @toein @forefoot2"),
        ],
    },
    Naming {
        about: "laboratory markers named as OpenCap's augmenter does",
        template: "opencap",
        names: &[
            ("&_elbow_lat", "@lelbow"),
            ("&_elbow_med", "@melbow"),
            ("&_wrist_radius", "@lwrist"),
            ("&_wrist_ulna", "@mwrist"),
            ("&_HJC", "@hjc"),
        ],
    },
];

#[cfg(test)]
mod tests {
    #[test]
    fn points_of_further_systems_are_matched() {
        for (names, template, count) in [
            (
                "Ann:HeadTop Ann:HeadFront Ann:HeadSide Ann:BackTop Ann:Chest Ann:BackLeft Ann:BackRight \
                 Ann:WaistLFront Ann:WaistRFront Ann:WaistLBack Ann:WaistRBack Ann:LShoulderBack \
                 Ann:LShoulderTop Ann:LElbowOut Ann:LUArmHigh Ann:LHandOut Ann:LWristOut Ann:LWristIn \
                 Ann:LKneeOut Ann:LThigh Ann:LAnkleOut Ann:LShin Ann:LToeOut Ann:LToeIn Ann:LHeel \
                 Ann:RShoulderBack Ann:RShoulderTop Ann:RElbowOut Ann:RUArmHigh Ann:RHandOut Ann:RWristOut \
                 Ann:RWristIn Ann:RKneeOut Ann:RThigh Ann:RAnkleOut Ann:RShin Ann:RToeOut Ann:RToeIn \
                 Ann:RHeel",
                "plug-in-gait",
                37,
            ),
            (
                "PELVIS SPINE_NAVEL SPINE_CHEST NECK CLAVICLE_LEFT SHOULDER_LEFT ELBOW_LEFT WRIST_LEFT \
                 HAND_LEFT HANDTIP_LEFT THUMB_LEFT CLAVICLE_RIGHT SHOULDER_RIGHT ELBOW_RIGHT WRIST_RIGHT \
                 HAND_RIGHT HANDTIP_RIGHT THUMB_RIGHT HIP_LEFT KNEE_LEFT ANKLE_LEFT FOOT_LEFT HIP_RIGHT \
                 KNEE_RIGHT ANKLE_RIGHT FOOT_RIGHT HEAD NOSE EYE_LEFT EAR_LEFT EYE_RIGHT EAR_RIGHT",
                "kinect",
                25,
            ),
            (
                "Armature|Hips Armature|Spine Armature|Neck Armature|Head Armature|LeftArm \
                 Armature|LeftForeArm Armature|LeftHand Armature|RightArm Armature|RightForeArm \
                 Armature|RightHand Armature|LeftUpLeg Armature|LeftLeg Armature|LeftFoot Armature|RightUpLeg \
                 Armature|RightLeg Armature|RightFoot",
                "bvh",
                16,
            ),
        ] {
            let names: Vec<String> = names.split_whitespace().map(str::to_owned).collect();
            let found = super::super::find(&names).unwrap_or_else(|| panic!("no template for {names:?}"));
            assert!(found.remark.ends_with(&format!("of the template `{template}`")), "{}", found.remark);
            assert!(found.names.len() >= count, "{} of {count}: {names:?}", found.names.len());
        }
    }
}
