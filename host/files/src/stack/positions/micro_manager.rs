//! Tag 51123: JSON of Micro-Manager and NDTiff on each page.

use std::collections::BTreeMap;

use super::{Planes, finite, moving};
use crate::image_file::Page;

/// Numbers of a page along an axis other than focus.
const INDICES: [&str; 4] = ["ChannelIndex", "PositionIndex", "FrameIndex", "Frame"];
const POSITIONS: [&str; 2] = ["ZPositionUm", "ZPosition_um_Intended"];

/// Fails if the pages differ along another axis than z.
pub(super) fn one_series(pages: &[Page]) -> Result<(), String> {
    let mut values: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for json in pages.iter().filter_map(|page| page.directory.micro_manager.as_deref()) {
        let indices = INDICES.into_iter().filter_map(|index| Some((index, value(json, index)?)));
        for (axis, value) in indices.chain(axes(json)).filter(|(axis, _)| *axis != "z") {
            let values = values.entry(axis).or_default();
            if !values.contains(&value) {
                values.push(value);
            }
        }
    }
    let several = values.iter().filter(|(_, values)| values.len() > 1);
    let several: Vec<String> = several
        .map(|(axis, values)| format!("{} of {axis} ({}, ...)", values.len(), values[..2].join(", ")))
        .collect();
    if several.is_empty() {
        return Ok(());
    }
    Err(format!(
        "the metadata of its pages have {}: a stack is one focus series; save one of them (ImageJ: Image > Hyperstacks > Make Subset)",
        several.join(" and ")
    ))
}

pub(super) fn planes(pages: &[Page]) -> Planes {
    let of_pages = |number: &dyn Fn(&str) -> Option<f64>| {
        pages
            .iter()
            .map(|page| number(page.directory.micro_manager.as_deref()?))
            .collect::<Option<Vec<f64>>>()
    };
    let position = |json: &str| POSITIONS.iter().find_map(|key| finite(value(json, key)?));
    let positions_um = of_pages(&position).filter(|all| moving(all));
    let mut order: Vec<usize> = (0..pages.len()).collect();
    let plane = |json: &str| axes(json).find(|(axis, _)| *axis == "z").and_then(|(_, z)| finite(z));
    if let Some(planes) = of_pages(&plane).filter(|_| positions_um.is_none()) {
        order.sort_by(|a, b| planes[*a].total_cmp(&planes[*b]));
    }
    Planes { pages: order, positions_um, remarks: Vec::new() }
}

/// Of NDTiff: `"Axes": {"z": 3, "channel": "DAPI"}`.
fn axes(json: &str) -> impl Iterator<Item = (&str, &str)> {
    let object = json.split_once("\"Axes\"").and_then(|(_, rest)| rest.split_once('{')?.1.split('}').next());
    object.unwrap_or_default().split(',').filter_map(|pair| {
        let (key, value) = pair.split_once(':')?;
        Some((key.trim().trim_matches('"'), value.trim().trim_matches('"')))
    })
}

/// A number or text.
fn value<'a>(json: &'a str, key: &str) -> Option<&'a str> {
    let rest = json.split_once(&format!("\"{key}\""))?.1.trim_start().strip_prefix(':')?.trim_start();
    Some(rest.split([',', '}', '\n']).next()?.trim().trim_matches('"'))
}

#[cfg(test)]
mod tests {
    use super::super::{
        of,
        tests::{pages, positions},
    };
    use crate::image_file::Page;

    #[test]
    fn micro_manager_gives_a_position_for_each_page() {
        let mut pages = pages(3, "");
        for (page, z) in pages.iter_mut().zip([-1.0, 0.5, 2.0]) {
            page.directory.micro_manager =
                Some(format!("{{\"Slice\": 1, \"ZPositionUm\": {z}, \"Width\": 8}}"));
        }
        assert_eq!(positions(&pages), Ok(Some(vec![-1.0, 0.5, 2.0])));
        for same in ["2.0", "NaN", "\"NaN\""] {
            for page in &mut pages {
                page.directory.micro_manager = Some(format!("{{\"ZPositionUm\": {same}}}"));
            }
            assert_eq!(positions(&pages), Ok(None), "{same}");
        }
    }

    fn described(texts: &[&str]) -> Vec<Page> {
        let mut pages = pages(texts.len(), "");
        for (page, text) in pages.iter_mut().zip(texts) {
            page.directory.micro_manager = Some((*text).into());
        }
        pages
    }

    #[test]
    fn pages_of_several_channels_or_positions_are_refused() {
        for (texts, phrase) in [
            (
                [
                    r#"{"Axes":{"z":0,"channel":0},"ZPositionUm":0}"#,
                    r#"{"Axes":{"z":0,"channel":1},"ZPositionUm":0.01}"#,
                ],
                "2 of channel (0, 1",
            ),
            (
                [r#"{"ChannelIndex": 0, "ZPositionUm": 1}"#, r#"{"ChannelIndex": 1, "ZPositionUm": 2}"#],
                "2 of ChannelIndex",
            ),
            ([r#"{"Axes": {"position": "a"}}"#, r#"{"Axes": {"position": "b"}}"#], "2 of position (a, b"),
        ] {
            let error = of(&described(&texts)).unwrap_err();
            assert!(error.contains(phrase), "{error}");
        }
    }

    #[test]
    fn intended_positions_and_the_axis_z_are_read() {
        let intended = [
            r#"{"Axes":{"z":0},"ZPosition_um_Intended":2.5}"#,
            r#"{"Axes":{"z":1},"ZPosition_um_Intended":5}"#,
        ];
        assert_eq!(positions(&described(&intended)), Ok(Some(vec![2.5, 5.0])));
        let planes =
            of(&described(&[r#"{"Axes":{"z":1,"channel":0}}"#, r#"{"Axes":{"z":0,"channel":0}}"#])).unwrap();
        assert_eq!((planes.pages, planes.positions_um), (vec![1, 0], None));
    }
}
