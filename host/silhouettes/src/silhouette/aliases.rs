//! Other names of the points of built-in templates, which programs name after the joint, the segment that
//! begins there or the side. Conventions clash (`LeftShoulder` is the collar bone or the shoulder joint), so
//! the one that explains most of a recording's names is used for all, but for arms or legs that another one
//! explains better.

mod namings;

use std::collections::BTreeMap;

use super::{anatomy::without_prefix, template::Template};
use namings::{NAMINGS, Naming};

/// Text before the names of one body's points: of Mixamo, 3ds Max, Motive, Blender, VRoid, Character Creator and Rigify.
const PREFIXES: [&str; 9] =
    ["mixamorig", "bip001", "bip01", "skeleton", "armature", "jbipc", "jbip", "ccbase", "def"];
/// Text after them: of OpenCap.
const SUFFIXES: [&str; 1] = ["study"];
/// Fewer names are not those of a body.
const LEAST: usize = 6;
/// Words in the names of the parts of arms and of legs.
const LIMBS: [&[&str]; 2] = [&["arm", "hand"], &["thigh", "leg", "foot"]];

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Aliases {
    /// Index of the recording's name, and the name in the template.
    pub names: Vec<(usize, String)>,
    pub remark: String,
}

/// Indices of names, and names in a template.
type Matches = Vec<(usize, String)>;

/// `None` if a template fits as well without aliases, or none knows enough names to tell what they lack. A part of a body has no
/// remark.
pub fn find(names: &[String]) -> Option<Aliases> {
    let templates = Template::built_in();
    let covered =
        templates.iter().map(|template| (template.check(names).is_ok(), template.coverage(names).0));
    let covered: Vec<(bool, usize)> = covered.collect();
    // Whether they fit, and how many names one naming knows.
    let mut all: Vec<(bool, usize, Aliases)> = Vec::new();
    for template in templates {
        for Candidate { naming, own, names: found } in candidates(names, template) {
            let Some((place, known)) = found.first() else { continue };
            let about = naming.map_or("other spelling", |naming| naming.about);
            let remark = format!(
                "{} of {} names are matched by alias ({about}): `{}` is `{known}` of the template `{}`",
                found.len(),
                names.len(),
                names[*place],
                template.name
            );
            let theirs: Vec<String> = found.iter().map(|(_, name)| name.clone()).collect();
            all.push((template.check(&theirs).is_ok(), own, Aliases { names: found, remark }));
        }
    }
    // The first of equals.
    let best = |fits: bool| {
        let known =
            covered.iter().filter(|(own, _)| *own || !fits).map(|(_, known)| *known).max().unwrap_or(0);
        let of = all.iter().rev().filter(|(own, _, _)| *own == fits);
        of.max_by_key(|(_, own, _)| *own).filter(|(_, own, _)| *own > known).map(|(_, _, aliases)| aliases)
    };
    let is_fitting = covered.iter().any(|(fits, _)| *fits);
    let part = || {
        let found = best(false).filter(|aliases| !is_fitting && aliases.names.len() >= LEAST)?;
        Some(Aliases { names: found.names.clone(), remark: String::new() })
    };
    best(true).cloned().or_else(part)
}

/// Matches names to the template `keypoints` only; empty if it does not fit, unless four in five names of a part of a body do.
pub fn keypoints(names: &[String]) -> Matches {
    let Ok(template) = Template::named("keypoints") else { return Vec::new() };
    let best = known_keypoints(names, &template);
    let known: Vec<String> = best.iter().map(|(_, name)| name.clone()).collect();
    // Animals have a nose, shoulders and hips, too.
    let has_limb = known.iter().any(|name| name.ends_with("elbow") || name.ends_with("knee"));
    let are_most = has_limb && best.len() >= LEAST && 5 * best.len() >= 4 * names.len();
    if are_most || template.check(&known).is_ok() { best } else { Vec::new() }
}

/// Whether some names are those of a body, but too few of a person.
pub fn are_of_another_body(names: &[String]) -> bool {
    Template::named("keypoints").is_ok_and(|template| known_keypoints(names, &template).len() >= 3)
}

fn known_keypoints(names: &[String], template: &Template) -> Matches {
    let all = candidates(names, template).into_iter().rev();
    all.max_by_key(|candidate| candidate.own).map(|candidate| candidate.names).unwrap_or_default()
}

struct Candidate {
    naming: Option<&'static Naming>,
    /// Names that this naming knows.
    own: usize,
    /// With limbs of others.
    names: Matches,
}

/// Matches by the template's own names and by each naming, in each spelling.
fn candidates(names: &[String], template: &Template) -> Vec<Candidate> {
    let of_template = NAMINGS.iter().filter(|naming| naming.template == template.name);
    let namings: Vec<Option<&Naming>> = std::iter::once(None).chain(of_template.map(Some)).collect();
    let mut all = Vec::new();
    for simple in spellings(names) {
        let tables: Vec<Matches> = namings.iter().map(|naming| matched(&simple, template, *naming)).collect();
        all.extend(namings.iter().zip(&tables).map(|(naming, own)| Candidate {
            naming: *naming,
            own: own.len(),
            names: with_limbs(own, &tables, template),
        }));
    }
    all
}

/// Takes arms or legs from the naming that knows all of their points that this one knows, and more: some rigs name arms as one
/// program does and legs as another.
fn with_limbs(own: &[(usize, String)], tables: &[Matches], template: &Template) -> Matches {
    let mut found = own.to_vec();
    for words in LIMBS {
        let parts = template.parts.iter().filter(|part| words.iter().any(|word| part.name.contains(word)));
        let markers: Vec<&String> = parts.flat_map(|part| &part.markers).collect();
        let split = |all: &Matches| -> (Matches, Matches) {
            all.iter().cloned().partition(|(_, name)| markers.contains(&name))
        };
        let (limb, rest) = split(&found);
        let others = tables.iter().map(|table| split(table).0).filter(|other| {
            let is_free = |place: &usize| rest.iter().all(|(taken, _)| taken != place);
            let has = |name: &String| other.iter().any(|(_, known)| known == name);
            other.len() > limb.len()
                && limb.iter().all(|(_, name)| has(name))
                && other.iter().all(|(place, _)| is_free(place))
        });
        if let Some(other) = others.reduce(|best, other| if other.len() > best.len() { other } else { best })
        {
            found = [rest, other].concat();
        }
    }
    found
}

/// Each point of the template once, with the first matching name.
fn matched(simple: &[String], template: &Template, naming: Option<&Naming>) -> Matches {
    let mut found: Matches = Vec::new();
    let markers: Vec<&String> = template.parts.iter().flat_map(|part| &part.markers).collect();
    let mut add = |place: usize, name: &str| {
        if markers.iter().any(|marker| *marker == name)
            && found.iter().all(|(at, known)| *at != place && known != name)
        {
            found.push((place, name.to_owned()));
        }
    };
    for (place, name) in simple.iter().enumerate() {
        let all = naming.into_iter().flat_map(|naming| naming.names);
        for (ours, theirs) in all.flat_map(|(ours, all)| all.split(' ').map(move |theirs| (ours, theirs))) {
            for [side, short] in [["left", "l"], ["right", "r"]] {
                // `UpperLeg_L` is `LUpperLeg`.
                let turned = theirs.strip_prefix('@').map(|joint| format!("{joint}@"));
                let mut forms = std::iter::once(theirs).chain(turned.as_deref());
                if forms.any(|form| [side, short].iter().any(|side| *name == form.replace('@', side))) {
                    let capital = if side == "left" { "Left" } else { "Right" };
                    let side = if template.name == "bvh" { capital } else { side };
                    add(place, &ours.replace('#', side).replace('&', &short.to_uppercase()));
                }
            }
        }
        if naming.is_none_or(|naming| naming.template == "opencap")
            && let Some(marker) = markers.iter().find(|marker| simplified(marker) == *name)
        {
            add(place, marker);
        }
    }
    // Trunks have one to four joints; the hips and the neck of the template reach to `Spine`.
    let trunk = found.iter_mut().map(|(_, name)| name).filter(|name| name.starts_with("Spine"));
    if let Some(lowest) = trunk.min() {
        "Spine".clone_into(lowest);
    }
    found
}

/// Names simplified as they are, and without the text up to `_` that most of them begin with: that of a rig, which helper joints lack.
fn spellings(names: &[String]) -> Vec<Vec<String>> {
    /// Texts of a name that are counted.
    const MOST: usize = 4;
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for own in names.iter().map(|name| without_prefix(name)) {
        for (at, _) in own.match_indices('_').take(MOST) {
            *counts.entry(&own[..=at]).or_default() += 1;
        }
    }
    let is_side = |text: &str| ["left", "right", "l", "r"].contains(&simplified(text).as_str());
    let shared = counts.into_iter().filter(|(text, count)| 2 * count > names.len() && !is_side(text));
    let shared = shared.max_by_key(|(text, count)| (*count, text.len()));
    let simple: Vec<String> = names.iter().map(|name| simplified(name)).collect();
    let without: Option<Vec<String>> = shared.map(|(text, _)| {
        let own = |(name, simple): (&String, &String)| {
            without_prefix(name).strip_prefix(text).map_or_else(|| simple.clone(), simplified)
        };
        names.iter().zip(&simple).map(own).collect()
    });
    std::iter::once(simple).chain(without).collect()
}

/// Lower-case letters and digits, without a subject's name.
fn simplified(name: &str) -> String {
    let mut simple: String = without_prefix(name)
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .map(|c| c.to_ascii_lowercase())
        .collect();
    for prefix in PREFIXES {
        if let Some(rest) = simple.strip_prefix(prefix).filter(|rest| !rest.is_empty()) {
            simple = rest.to_owned();
        }
    }
    for suffix in SUFFIXES {
        if let Some(rest) = simple.strip_suffix(suffix).filter(|rest| !rest.is_empty()) {
            simple = rest.to_owned();
        }
    }
    simple
}

#[cfg(test)]
mod tests {
    use super::*;

    fn template_of(names: &str) -> (String, usize) {
        let names: Vec<String> = names.split_whitespace().map(str::to_owned).collect();
        let found = find(&names).unwrap_or_else(|| panic!("no template for {names:?}"));
        let template = found.remark.rsplit('`').nth(1).expect("a name").to_owned();
        (template, found.names.len())
    }

    #[test]
    fn classic_names_of_other_programs_are_matched() {
        for (names, template, count) in [
            (
                "Hips LeftHip LeftKnee LeftAnkle LeftAnkle_End RightHip RightKnee RightAnkle RightAnkle_End Chest LeftCollar \
                 LeftShoulder LeftElbow LeftWrist LeftWrist_End RightCollar RightShoulder RightElbow RightWrist \
                 RightWrist_End Neck Head Head_End",
                "bvh",
                21,
            ),
            (
                "hip abdomen chest neck head leftEye rightEye rCollar rShldr rForeArm rHand lCollar lShldr lForeArm lHand \
                 rThigh rShin rFoot lThigh lShin lFoot",
                "bvh",
                17,
            ),
            (
                "hip pelvis lThighBend lThighTwist lShin lFoot lToe rThighBend rShin rFoot rToe abdomenLower abdomenUpper \
                 chestLower chestUpper neckLower neckUpper head lCollar lShldrBend lForearmBend lHand rCollar rShldrBend \
                 rForearmBend rHand",
                "bvh",
                22,
            ),
            (
                "pelvis spine_01 spine_02 spine_03 neck_01 head upperarm_l lowerarm_l hand_l upperarm_r lowerarm_r hand_r \
                 thigh_l calf_l foot_l ball_l thigh_r calf_r foot_r ball_r",
                "bvh",
                20,
            ),
            (
                "root lhipjoint lfemur ltibia lfoot ltoes rhipjoint rfemur rtibia rfoot rtoes lowerback upperback thorax \
                 lowerneck upperneck head lclavicle lhumerus lradius lwrist lhand lfingers lthumb rclavicle rhumerus \
                 rradius rwrist rhand rfingers rthumb",
                "bvh",
                25,
            ),
            (
                "pelvis lfemur ltibia lfoot ltoes rfemur rtibia rfoot rtoes thorax head lclavicle lhumerus lradius lhand \
                 rclavicle rhumerus rradius rhand",
                "bvh",
                17,
            ),
            (
                "joint_Root Hips Spine Chest Neck Head Shoulder_L UpperArm_L LowerArm_L Hand_L Shoulder_R UpperArm_R LowerArm_R \
                 Hand_R UpperLeg_L LowerLeg_L Foot_L Toes_L UpperLeg_R LowerLeg_R Foot_R Toes_R",
                "bvh",
                19,
            ),
            (
                "hip abdomen chest neck neck1 head jaw rcollar rshoulder relbow rhand lcollar lshoulder lelbow lhand rbuttock rhip \
                 rknee rfoot lbuttock lhip lknee lfoot",
                "bvh",
                18,
            ),
            (
                "spine spine.001 spine.002 spine.004 head upper_arm.L forearm.L hand.L upper_arm.R forearm.R hand.R thigh.L shin.L \
                 foot.L toe.L thigh.R shin.R foot.R toe.R",
                "bvh",
                16,
            ),
            (
                "Hips Spine Spine1 Spine2 Spine3 Spine4 Neck Head LeftShoulder LeftArm LeftForeArm LeftHand RightShoulder RightArm \
                 RightForeArm RightHand LeftThigh LeftShin LeftFoot LeftToe RightThigh RightShin RightFoot RightToe",
                "bvh",
                21,
            ),
            (
                "Robot_Hips Robot_Spine Robot_Spine1 Robot_Spine2 Robot_Neck Robot_Head Robot_LeftShoulder Robot_LeftArm \
                 Robot_LeftForeArm Robot_LeftHand Robot_RightShoulder Robot_RightArm Robot_RightForeArm Robot_RightHand \
                 Robot_LeftUpLeg Robot_LeftLeg Robot_LeftFoot Robot_LeftToeBase Robot_RightUpLeg Robot_RightLeg \
                 Robot_RightFoot Robot_RightToeBase",
                "bvh",
                20,
            ),
            (
                "J_Bip_C_Hips J_Bip_C_Spine J_Bip_C_Chest J_Bip_C_UpperChest J_Bip_C_Neck J_Bip_C_Head J_Bip_L_UpperArm \
                 J_Bip_L_LowerArm J_Bip_L_Hand J_Bip_R_UpperArm J_Bip_R_LowerArm J_Bip_R_Hand J_Bip_L_UpperLeg J_Bip_L_LowerLeg \
                 J_Bip_L_Foot J_Bip_R_UpperLeg J_Bip_R_LowerLeg J_Bip_R_Foot",
                "bvh",
                18,
            ),
            (
                "Top.Head Front.Head Rear.Head R.Shoulder R.Elbow R.Wrist L.Shoulder L.Elbow L.Wrist R.ASIS L.ASIS V.Sacral \
                 R.Thigh R.Knee R.Shank R.Ankle R.Heel R.Toe L.Thigh L.Knee L.Shank L.Ankle L.Heel L.Toe",
                "keypoints",
                19,
            ),
            (
                "Sternum R.Acromium L.Acromium Top.Head R.Bicep R.Elbow R.Wrist.Med R.Wrist.Lat L.Bicep L.Elbow L.Wrist.Med \
                 L.Wrist.Lat R.ASIS L.ASIS V.Sacral R.Thigh.Upper R.Thigh.Front R.Knee.Lat R.Knee.Med R.Shank.Upper \
                 R.Ankle.Lat R.Ankle.Med R.Heel R.Midfoot.Sup R.Toe.Tip R.Toe.Lat R.Toe.Med L.Thigh.Upper L.Thigh.Front \
                 L.Knee.Lat L.Knee.Med L.Shank.Upper L.Ankle.Lat L.Ankle.Med L.Heel L.Midfoot.Sup L.Toe.Tip L.Toe.Lat L.Toe.Med",
                "keypoints",
                21,
            ),
            (
                "Hips LHipJoint LLeg LFoot LFoot_End RHipJoint RLeg RFoot RFoot_End Chest Neck Head Head_End LShoulder LArm LWrist \
                 LWrist_End RShoulder RArm RWrist RWrist_End",
                "bvh",
                16,
            ),
            (
                "root lhip lknee lankle ltoe ltoe_End rhip rknee rankle rtoe rtoe_End lowerback upperback chest lowerneck upperneck \
                 upperneck_End lclavicle lshoulder lelbow lwrist rclavicle rshoulder relbow rwrist",
                "bvh",
                22,
            ),
            (
                "Hips Spine Neck Head Left_UpperArm Left_LowerArm Left_Hand Right_UpperArm Right_LowerArm Right_Hand Left_Thigh \
                 Left_Calf Left_Foot Right_Thigh Right_Calf Right_Foot",
                "bvh",
                16,
            ),
            (
                "Hips Spine Neck Head LShoulder LArm LForeArm LHand RShoulder RArm RForeArm RHand LUpLeg LLeg LFoot LToe RUpLeg \
                 RLeg RFoot RToe",
                "bvh",
                18,
            ),
            (
                "Ann:Hip Ann:Ab Ann:Chest Ann:Neck Ann:Head Ann:LShoulder Ann:LUArm Ann:LFArm Ann:LHand Ann:RShoulder Ann:RUArm \
                 Ann:RFArm Ann:RHand Ann:LThigh Ann:LShin Ann:LFoot Ann:LToe Ann:RThigh Ann:RShin Ann:RFoot Ann:RToe",
                "bvh",
                19,
            ),
            (
                "Hip RHip RKnee RAnkle RBigToe RSmallToe RHeel LHip LKnee LAnkle LBigToe LSmallToe LHeel Neck Head Nose \
                 RShoulder RElbow RWrist LShoulder LElbow LWrist",
                "keypoints",
                22,
            ),
            (
                "Neck RShoulder LShoulder RHip LHip midHip RKnee LKnee r.ASIS_study L.ASIS_study r.PSIS_study L.PSIS_study \
                 r_knee_study L_knee_study r_mknee_study r_ankle_study L_ankle_study r_toe_study L_toe_study r_5meta_study \
                 L_5meta_study r_calc_study L_calc_study C7_study r_shoulder_study L_shoulder_study r_thigh1_study \
                 L_thigh1_study r_thigh2_study L_thigh2_study r_sh2_study L_sh2_study r_sh3_study L_sh3_study \
                 RHJC_study LHJC_study r_lelbow_study L_lelbow_study r_melbow_study L_melbow_study r_lwrist_study \
                 L_lwrist_study r_mwrist_study L_mwrist_study",
                "opencap",
                35,
            ),
        ] {
            let (found, matched) = template_of(names);
            assert_eq!(found, template, "{names}");
            assert!(matched >= count, "{matched} of {count}: {names}");
        }
    }

    #[test]
    fn helper_joints_without_the_prefix_of_a_rig_do_not_hide_it() {
        let bones = "Hips Spine Spine1 LeftArm LeftForeArm LeftHand RightArm RightForeArm RightHand Neck Head LeftUpLeg LeftLeg \
                     LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase";
        let rig: Vec<String> = bones.split_whitespace().map(|bone| format!("Character1_{bone}")).collect();
        let helpers = "L_Radius_MESH L_Radius_MESH_End L_Tibia_MESH R_Radius_MESH R_Radius_MESH_End R_Tibia_MESH Neck_MESH";
        assert_eq!(template_of(&format!("{} {helpers}", rig.join(" "))), ("bvh".into(), 19));
        // A prefix that half of the names have is not that of all.
        let other = bones.split_whitespace().map(|bone| format!("Character2_{bone}"));
        assert_eq!(find(&rig.into_iter().chain(other).collect::<Vec<String>>()), None);
    }

    #[test]
    fn arms_and_legs_may_be_named_by_two_conventions() {
        let names = "hip Chest Chest2 Neck neck1 Head jaw RightCollar RightShoulder RightElbow RightWrist LeftCollar LeftShoulder \
                     LeftElbow LeftWrist rButtock rThigh rShin rFoot lButtock lThigh lShin lFoot";
        let names: Vec<String> = names.split_whitespace().map(str::to_owned).collect();
        let found = find(&names).expect("a template").names;
        for (name, known) in [
            ("LeftShoulder", "LeftArm"),
            ("RightElbow", "RightForeArm"),
            ("LeftWrist", "LeftHand"),
            ("rThigh", "RightUpLeg"),
            ("lShin", "LeftLeg"),
            ("lFoot", "LeftFoot"),
            ("hip", "Hips"),
        ] {
            let of = found.iter().find(|(place, _)| names[*place] == name).map(|(_, known)| known.as_str());
            assert_eq!(of, Some(known), "{name}");
        }
        let mut places: Vec<usize> = found.iter().map(|(place, _)| *place).collect();
        places.sort_unstable();
        places.dedup();
        assert_eq!(places.len(), found.len());
    }

    #[test]
    fn a_part_of_a_body_has_aliases_that_tell_what_it_lacks() {
        let names = "V_Sacral R_ASIS L_ASIS R_Knee_Lat R_Thigh_Upper L_Knee_Lat L_Thigh_Upper R_Ankle_Lat L_Ankle_Lat R_Heel R_MTP1 \
                     L_Heel L_MTP1 Clavicle R_Acromium L_Acromium";
        let mut names: Vec<String> = names.split_whitespace().map(str::to_owned).collect();
        let Aliases { names: found, remark } = find(&names).expect("a part");
        assert_eq!(remark, "", "a template of one's own may fit");
        assert!(found.iter().any(|(_, known)| known == "left knee") && found.len() == 11, "{found:?}");
        names.extend(found.into_iter().map(|(_, known)| known));
        let error = Template::named("keypoints").expect("built in").check(&names).expect_err("no head");
        assert!(
            error
                .to_string()
                .starts_with("the recording has only shoulders, trunk, hips, left thigh, left leg"),
            "{error}"
        );
    }

    #[test]
    fn a_trunk_of_one_joint_reaches_from_the_hips_to_the_neck() {
        for (names, limbs) in [
            (
                "Hips Chest Neck Head Head_End LeftCollar LeftShoulder LeftElbow LeftWrist LeftWrist_End RightCollar \
                 RightShoulder RightElbow RightWrist RightWrist_End LeftHip LeftKnee LeftAnkle LeftAnkle_End RightHip \
                 RightKnee RightAnkle RightAnkle_End",
                ["LeftShoulder", "RightElbow", "LeftKnee"],
            ),
            (
                "Hips Chest Neck Head Head_End LeftCollar LeftUpArm LeftLowArm LeftHand LeftHand_End RightCollar RightUpArm \
                 RightLowArm RightHand RightHand_End LeftUpLeg LeftLowLeg LeftFoot LeftFoot_End RightUpLeg RightLowLeg \
                 RightFoot RightFoot_End",
                ["LeftUpArm", "RightLowArm", "LeftLowLeg"],
            ),
        ] {
            let names: Vec<String> = names.split_whitespace().map(str::to_owned).collect();
            let found = find(&names).expect("a template").names;
            let of = |name: &str| {
                let known = found.iter().find(|(place, _)| names[*place] == name);
                known.map(|(_, known)| known.as_str())
            };
            assert_eq!(of("Chest"), Some("Spine"));
            assert_eq!(limbs.map(of), [Some("LeftArm"), Some("RightForeArm"), Some("LeftLeg")]);
        }
    }

    #[test]
    fn parts_of_people_have_limbs_and_a_shared_prefix_is_not_a_side_or_a_subject() {
        let keypoints = |names: &str| {
            let names: Vec<String> = names.split_whitespace().map(str::to_owned).collect();
            keypoints(&names).len()
        };
        let mouse = "nose left_ear right_ear left_shoulder right_shoulder left_hip right_hip tail_base";
        assert_eq!(keypoints(mouse), 0);
        assert_eq!(keypoints("left_shoulder left_elbow left_wrist left_hip left_knee left_ankle"), 6);
        let names = "hip abdomen chest neck head rCollar rShldr rForeArm rHand lCollar lShldr lForeArm lHand rThigh rShin rFoot \
                     lThigh lShin lFoot";
        let of_subject: Vec<String> = names.split_whitespace().map(|name| format!("S_1:{name}")).collect();
        assert_eq!(template_of(&of_subject.join(" ")), template_of(names));
    }

    #[test]
    fn names_that_fit_as_they_are_and_strange_ones_have_no_aliases() {
        let kinect: Vec<String> =
            super::super::super::readers::kinect::JOINTS_25.iter().map(|n| (*n).into()).collect();
        assert_eq!(find(&kinect), None);
        assert_eq!(find(&["A".into(), "B".into(), "Head".into()]), None);
    }
}
