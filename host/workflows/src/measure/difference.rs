//! Difference of two maps of equal size.

use std::path::Path;

use ndarray::{Array2, Zip};
use serde::{Serialize, Serializer};

use super::{Entries, MapFile, Unit, read_map};
use crate::{context::Context, error::WorkflowError, figures::rounded_for, quantile};

/// Least ratio of depths in different units: centimetres and millimetres differ by 10.
const OTHER_UNIT: f64 = 5.0;

/// In the unit of the maps.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct DifferenceFigures {
    pub unit: Unit,
    pub pixels: usize,
    /// Mean of second minus first; `None` without pixels, as the next two.
    pub mean: Option<f64>,
    pub standard_deviation: Option<f64>,
    pub rms: Option<f64>,
}

impl Serialize for DifferenceFigures {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut to = Entries::new(to.serialize_map(None)?, self.unit);
        to.field("unit", &self.unit)?;
        to.field("pixels", &self.pixels)?;
        to.length("mean", self.mean)?;
        to.length("standard_deviation", self.standard_deviation)?;
        to.length("rms", self.rms)?;
        to.end()
    }
}

/// The second map minus the first, NaN without a value. Both are result folders or map files of equal size and unit.
pub fn difference(
    first: &Path,
    second: &Path,
    context: &Context<'_>,
) -> crate::Result<(Array2<f32>, DifferenceFigures)> {
    let ([first, second], unit) = read_two("second", [first, second], context)?;
    of_maps(&first, &second, unit)
}

/// Two maps of one part of the images, in one unit. Warns if that is unknown or seems to be another one.
pub(crate) fn read_two(
    name: &'static str,
    [first, second]: [&Path; 2],
    context: &Context<'_>,
) -> crate::Result<([Array2<f32>; 2], Unit)> {
    let maps = [read_map(first)?, read_map(second)?];
    let unit = shared_unit(name, &maps[0], &maps[1])?;
    // A map without a record adopts the other's unit.
    let mut remarks: Vec<String> = maps.iter().filter_map(MapFile::taken_as_mm).collect();
    let unknown = remarks.len();
    if unknown < maps.len() {
        remarks.clear();
    }
    let maps = maps.map(|map| map.depth(unit, &mut remarks));
    if unknown > 0 {
        remarks.extend(of_other_unit(name, &maps));
    }
    remarks.iter().for_each(|remark| context.progress.warn(remark));
    Ok((maps, unit))
}

fn of_other_unit(name: &str, maps: &[Array2<f32>; 2]) -> Option<String> {
    // Positions may have any sign.
    let size = |map: &Array2<f32>| quantile::of_map(map.mapv(f32::abs).view(), 0.5);
    let [first, second] = [size(&maps[0])?, size(&maps[1])?];
    (first.max(second) > OTHER_UNIT * first.min(second)).then(|| {
        let [first, second] = [first, second].map(|size| rounded_for(size, size, 3));
        format!(
            "the median of the first map's depths is {first}, of the {name}'s {second}: is one of them in another unit, or counted \
             from another zero?"
        )
    })
}

/// The unit of two maps of one part of the images; a map without a record adopts the other's.
fn shared_unit(name: &'static str, first: &MapFile, second: &MapFile) -> crate::Result<Unit> {
    if let (Some(a), Some(b)) = (first.part, second.part)
        && a != b
        && (a.bin == b.bin || (a.x, a.y) != (b.x, b.y))
    {
        let expected = format!("the first map begins at {},{}, and both must show one region", a.x, a.y);
        return Err(WorkflowError::parameter(name, format!("(begins at {},{})", b.x, b.y), expected));
    }
    match (first.unit, second.unit) {
        (Some(a), Some(b)) if a != b => {
            let expected = format!("the first map is in {}, and both must have one unit", a.words());
            Err(WorkflowError::parameter(name, format!("(in {})", b.words()), expected))
        }
        (a, b) => Ok(a.or(b).unwrap_or_default()),
    }
}

fn of_maps(
    first: &Array2<f32>,
    second: &Array2<f32>,
    unit: Unit,
) -> crate::Result<(Array2<f32>, DifferenceFigures)> {
    if first.dim() != second.dim() {
        let ((rows, columns), (other_rows, other_columns)) = (first.dim(), second.dim());
        let expected = format!("expected {columns}x{rows} pixels as the first map has");
        return Err(WorkflowError::parameter(
            "difference",
            format!("{other_columns}x{other_rows}"),
            expected,
        ));
    }
    let map = Zip::from(first).and(second).map_collect(|first, second| second - first);
    let values = || map.iter().filter(|value| value.is_finite()).map(|value| f64::from(*value));
    let count = values().count();
    let mean = values().sum::<f64>() / count as f64;
    let mean_square = values().map(|value| value * value).sum::<f64>() / count as f64;
    let some = count > 0;
    let figures = DifferenceFigures {
        unit,
        pixels: count,
        mean: some.then_some(mean),
        standard_deviation: some.then(|| (mean_square - mean * mean).max(0.0).sqrt()),
        rms: some.then(|| mean_square.sqrt()),
    };
    Ok((map, figures))
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;
    use crate::context::Heard;

    #[test]
    fn maps_of_two_regions_have_no_difference() {
        let folder = tempfile::tempdir().unwrap();
        let map = |name: &str, x: usize| {
            let map = folder.path().join(name);
            std::fs::create_dir(&map).unwrap();
            for file in ["depth.npy", "corrected.npy"] {
                std::fs::write(map.join(file), farnear_files::npy::write(array![[900.0]].view())).unwrap();
            }
            let optics = include_str!("../../../../examples/rig.toml").replace('[', "[optics.");
            let part = format!("[part]\nx = {x}\ny = 0\nimage_width = 9\nimage_height = 9\n");
            std::fs::write(map.join("depth.toml"), optics + &part).unwrap();
            ["depth.npy", "corrected.npy"].map(|file| read_map(&map.join(file)).unwrap())
        };
        let (a, b) = (map("a", 0), map("b", 4));
        assert_eq!(shared_unit("difference", &a[0], &a[1]).unwrap(), Unit::Mm);
        for (first, second) in a.iter().zip(&b) {
            let error = shared_unit("difference", first, second).unwrap_err();
            assert!(error.is_usage() && error.to_string().contains("begins at 4,0"), "{error}");
        }
    }

    #[test]
    fn maps_of_two_units_have_no_difference() {
        let folder = tempfile::tempdir().unwrap();
        let map = |unit: &str| {
            let map = folder.path().join(unit);
            std::fs::create_dir(&map).unwrap();
            std::fs::write(map.join("depth.npy"), farnear_files::npy::write(array![[3.0]].view())).unwrap();
            std::fs::write(map.join("stack.toml"), format!("unit = \"{unit}\"\n")).unwrap();
            read_map(&map).unwrap()
        };
        let error = shared_unit("truth", &map("mm"), &map("image")).unwrap_err();
        assert!(error.is_usage());
        let expected = "truth (in numbers of images): the first map is in mm, and both must have one unit";
        assert_eq!(error.to_string(), expected);
    }

    #[test]
    fn an_unknown_unit_and_one_that_seems_to_be_another_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let map = |name: &str, depth: f32| {
            let map = folder.path().join(name);
            let depth = Array2::from_shape_fn((4, 6), |(y, x)| depth * (1.0 + 0.01 * (x + y) as f32));
            std::fs::create_dir_all(map.parent().unwrap()).unwrap();
            std::fs::write(&map, farnear_files::npy::write(depth.view())).unwrap();
            map
        };
        let [mm, cm, m] = [("mm.npy", 900.0), ("cm.npy", 90.0), ("m.npy", 0.9)].map(|(name, z)| map(name, z));
        let known = map("known/depth.npy", 900.0);
        std::fs::write(known.with_file_name("stack.toml"), "unit = \"mm\"\n").unwrap();
        for (first, second, unknown, other) in [
            (&mm, &mm, 2, false),
            (&mm, &m, 2, true),
            (&cm, &mm, 2, true),
            (&known, &mm, 0, false),
            (&known, &m, 0, true),
            (&cm, &known, 0, true),
            (&known, &known, 0, false),
        ] {
            let heard = Heard::default();
            difference(first, second, &heard.context()).unwrap();
            let said = heard.said();
            let count = |text: &str| said.iter().filter(|said| said.contains(text)).count();
            assert_eq!(
                (count("taken as mm"), count("in another unit")),
                (unknown, usize::from(other)),
                "{said:?}"
            );
        }
        let heard = Heard::default();
        read_two("truth", [&mm, &m], &heard.context()).unwrap();
        let said = heard.said().join("\n");
        assert!(said.contains("first map's depths is 9") && said.contains("of the truth's 0.9"), "{said}");
    }

    #[test]
    fn values_that_one_lacks_do_not_count() {
        let (map, found) =
            of_maps(&array![[1.0, f32::NAN, 3.0]], &array![[2.0, 5.0, 6.0]], Unit::Mm).unwrap();
        assert!(map[[0, 1]].is_nan());
        assert_eq!((found.pixels, found.mean, found.standard_deviation), (2, Some(2.0), Some(1.0)));
        let (_, none) = of_maps(&array![[f32::NAN]], &array![[1.0]], Unit::Mm).unwrap();
        assert_eq!((none.pixels, none.rms), (0, None));
        assert!(of_maps(&array![[1.0]], &array![[1.0, 2.0]], Unit::Mm).unwrap_err().is_usage());
    }
}
