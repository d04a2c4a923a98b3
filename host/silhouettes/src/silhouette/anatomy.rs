//! Points of a recording that the built-in templates name: markers of the body, of its head and of its feet.

use std::collections::HashSet;

use super::{aliases, template::Template};

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Anatomy {
    /// Names without a prefix (`LASI` of `Nick:LASI`) and names of built-in templates, with the point's index.
    pub aliases: Vec<(usize, String)>,
    /// How names were matched to a template's.
    pub remark: Option<String>,
    pub body: Vec<usize>,
    pub head: Vec<usize>,
    pub feet: Vec<usize>,
}

impl Anatomy {
    pub fn of(names: &[String]) -> Self {
        let mut taken: HashSet<&str> = names.iter().map(String::as_str).collect();
        let short = names.iter().enumerate().map(|(place, name)| (place, without_prefix(name)));
        let mut aliases: Vec<(usize, String)> = short
            .filter(|(_, short)| taken.insert(short))
            .map(|(place, short)| (place, short.into()))
            .collect();
        let found = aliases::find(names).unwrap_or_default();
        aliases.extend(found.names);
        let templates = Template::built_in();
        let places = |wanted: &dyn Fn(&str) -> bool| {
            let parts = templates.iter().flat_map(|template| &template.parts);
            let markers: HashSet<&str> = parts
                .filter(|part| wanted(&part.name))
                .flat_map(|part| &part.markers)
                .map(String::as_str)
                .collect();
            let all = names.iter().enumerate().chain(aliases.iter().map(|(place, name)| (*place, name)));
            let mut places: Vec<usize> =
                all.filter(|(_, name)| markers.contains(name.as_str())).map(|(place, _)| place).collect();
            places.sort_unstable();
            places.dedup();
            places
        };
        let body = places(&|_| true);
        let (head, feet) = (places(&|part| part == "head"), places(&|part| part.ends_with("foot")));
        let head = if head.is_empty() { places(&|part| part == "upper torso") } else { head };
        let remark = Some(found.remark).filter(|remark| !remark.is_empty());
        Self { aliases, remark, body, head, feet }
    }
}

pub fn prefix(name: &str) -> &str {
    name.rsplit_once(':').map_or("", |(prefix, _)| prefix)
}

pub fn without_prefix(name: &str) -> &str {
    name.rsplit_once(':').map_or(name, |(_, own)| own)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markers_of_the_body_its_head_and_its_feet_are_found_by_name_and_alias() {
        let names = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<String>>();
        let suit = Anatomy::of(&names("Ann:LFHD Ann:LHipAngles Ann:LTOE Ann:C7"));
        assert_eq!((suit.body, suit.head, suit.feet), (vec![0, 2, 3], vec![0], vec![2]));
        let joints = Anatomy::of(&names(
            "pelvis left_hip right_hip spine1 left_knee right_knee left_ankle right_ankle left_foot right_foot neck \
             head left_shoulder right_shoulder left_elbow right_elbow left_wrist right_wrist",
        ));
        assert_eq!((joints.head, joints.feet), (vec![11], vec![6, 7, 8, 9]));
        assert!(joints.remark.is_some());
    }

    #[test]
    fn the_end_site_of_mixamos_head_is_of_the_head() {
        let names: Vec<String> =
            "mixamorig:Hips mixamorig:Spine mixamorig:Neck mixamorig:Head mixamorig:HeadTop_End mixamorig:LeftFoot"
                .split_whitespace()
                .map(str::to_owned)
                .collect();
        assert_eq!(Anatomy::of(&names).head, [3, 4]);
    }
}
