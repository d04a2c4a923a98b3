//! Order and focus positions of TIFF pages by microscopes and ImageJ.

mod image_j;
mod micro_manager;
mod ome;

use crate::image_file::{Page, tiff_tags::Directory};

/// Sides of a pixel that differ by more than this part are not one size.
const SQUARE: f64 = 0.05;

/// The planes of a focus series.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct Planes {
    /// Index of each plane's page.
    pub pages: Vec<usize>,
    /// Along the axis; `None` if not stated.
    pub positions_um: Option<Vec<f64>>,
    pub remarks: Vec<String>,
}

/// Fails for channels, times or planes in other files.
pub(super) fn of(pages: &[Page]) -> Result<Planes, String> {
    let in_order =
        |positions_um| Planes { pages: (0..pages.len()).collect(), positions_um, ..Planes::default() };
    let Some(first) = pages.first() else { return Ok(in_order(None)) };
    let description = first.directory.description.as_deref().unwrap_or_default();
    micro_manager::one_series(pages)?;
    if let Some(description) = image_j::Description::of(description) {
        let (positions_um, remark) = description.positions_um(pages)?;
        return Ok(Planes { remarks: Vec::from_iter(remark), ..in_order(positions_um) });
    }
    if let Some(volume) = first.directory.volume() {
        return Err(volume);
    }
    if let Some(array) = Array::of(description) {
        return array.check(&first.directory, pages.len()).map(|()| in_order(None));
    }
    if let Some(metadata) = ome::Metadata::of(description) {
        return metadata.planes(pages);
    }
    Ok(micro_manager::planes(pages))
}

/// The planes in files of these names, of which the first one has `pages`; `None` if its metadata are of one file.
pub(super) fn of_files(pages: &[Page], names: &[String]) -> Result<Option<Planes>, String> {
    let description =
        pages.first().and_then(|page| page.directory.description.as_deref()).unwrap_or_default();
    ome::Metadata::of(description).map_or(Ok(None), |metadata| metadata.files(names))
}

/// Side of a square pixel at the object, if stated, and a remark on pixels that are not square.
pub(super) fn object_pixel_um(pages: &[Page]) -> (Option<f64>, Option<String>) {
    let sides = || {
        let directory = &pages.first()?.directory;
        let description = directory.description.as_deref()?;
        let sides = match image_j::Description::of(description) {
            Some(description) => description.pixel_um(directory),
            None => ome::Metadata::of(description)?.pixel_um(),
        };
        let [width, height] = sides.map(|side| side.filter(|side| side.is_finite() && *side > 0.0));
        Some((width?, height.unwrap_or(width?)))
    };
    match sides() {
        Some((width, height)) if (width - height).abs() > SQUARE * width.min(height) => {
            let remark = format!(
                "the metadata state pixels of {width:.4} x {height:.4} um, which are not square: their size is not used; resample \
                 the images to square pixels"
            );
            (None, Some(remark))
        }
        sides => (sides.map(|(width, _)| width), None),
    }
}

/// Some programs write the position of the first plane for all.
fn moving(positions: &[f64]) -> bool {
    positions.windows(2).any(|two| two[0] != two[1])
}

/// The step between planes that a file states, in um, or a remark that it is not used, with a remedy.
fn step_um(stated: &str, unit: &str, remedy: &str) -> (Option<f64>, Option<String>) {
    let Some(step) = finite(stated).filter(|step| *step != 0.0) else {
        let remark = format!(
            "the file states a spacing of the planes ({stated}) where a number other than 0 was expected: it is not used; \
             {remedy}"
        );
        return (None, Some(remark));
    };
    let um = unit_um(unit);
    // Without a unit, 1 is the default.
    let remark = (um.is_none() && step != 1.0).then(|| {
        format!(
            "the file states a spacing of the planes ({step}) and no unit of length ({unit}): it is not used; {remedy}"
        )
    });
    (um.map(|um| step * um), remark)
}

fn even(step: f64, planes: usize) -> Vec<f64> {
    (0..planes).map(|plane| plane as f64 * step).collect()
}

fn finite(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|value: &f64| value.is_finite())
}

/// An array in the pages, as `tifffile` describes it: `{"shape": [5, 300, 400], "axes": "ZYX"}`; axes are optional.
struct Array<'a> {
    shape: Vec<u64>,
    axes: Option<&'a str>,
}

impl<'a> Array<'a> {
    fn of(description: &'a str) -> Option<Self> {
        if !description.starts_with('{') {
            return None;
        }
        let value = |key| Some(description.split_once(key)?.1.trim_start().strip_prefix(':')?.trim_start());
        let shape = value("\"shape\"")?.strip_prefix('[')?.split(']').next()?;
        let shape: Vec<u64> = shape.split(',').map(|size| size.trim().parse().ok()).collect::<Option<_>>()?;
        let axes = value("\"axes\"").and_then(|text| text.strip_prefix('"')?.split('"').next());
        Some(Self { axes: axes.filter(|axes| axes.len() == shape.len()), shape })
    }

    /// Fails if the pages are not images of one focus series.
    fn check(&self, page: &Directory, pages: usize) -> Result<(), String> {
        let shape = self.shape.iter().map(u64::to_string).collect::<Vec<_>>().join(" x ");
        if page.photometric == 2 && page.planar == 2 && !self.axes.is_some_and(|axes| axes.contains('S')) {
            return Err(format!(
                "it is an array of {shape} whose {} planes are marked as colours: write focus planes with photometric='minisblack', \
                 colours with metadata={{'axes': ...}} that has S for their axis",
                page.samples_per_pixel
            ));
        }
        let per_page = (page.width * page.height).saturating_mul(page.samples_per_pixel).max(1);
        let images = self.shape.iter().fold(1, |all: u64, size| all.saturating_mul(*size)) / per_page;
        if images > pages as u64 {
            return Err(format!(
                "it is an array of {shape} and lists {pages} of {images} images: write it without truncate=True"
            ));
        }
        let mut product = 1_u64;
        let series = self.shape.iter().take_while(|size| {
            let within = product < images;
            product = product.saturating_mul(**size);
            within
        });
        let axes: Vec<usize> =
            series.enumerate().filter(|(_, size)| **size > 1).map(|(axis, _)| axis).collect();
        if axes.len() > 1 {
            return Err(format!(
                "it is an array of {shape}, images along {} axes: a stack is one focus series; write one of them",
                axes.len()
            ));
        }
        let axis = self.axes.zip(axes.first()).and_then(|(axes, axis)| axes.chars().nth(*axis));
        let size = |letter| if axis == Some(letter) { images as usize } else { 1 };
        one_series(size('C'), size('T'))
    }
}

fn one_series(channels: usize, times: usize) -> Result<(), String> {
    if channels > 1 || times > 1 {
        return Err(format!(
            "it holds {channels} channels and {times} times: a stack is one focus series; split it (ImageJ: Image > Hyperstacks > \
             Make Subset). If they are focus planes, make them slices (ImageJ: Image > Properties)"
        ));
    }
    Ok(())
}

/// Text with character references of XML as characters.
fn unescaped(text: &str) -> String {
    replaced(text, "&", |rest| {
        let (name, _) = rest.split_once(';')?;
        Some((referenced(name)?, name.len() + 1))
    })
}

/// Text with escapes as characters; `escaped` gives the character and the bytes that it takes after `begin`.
fn replaced(text: &str, begin: &str, escaped: impl Fn(&str) -> Option<(char, usize)>) -> String {
    let mut parts = text.split(begin);
    let mut all = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        if let Some((found, length)) = escaped(part) {
            all.push(found);
            all.push_str(&part[length..]);
        } else {
            all.push_str(begin);
            all.push_str(part);
        }
    }
    all
}

/// The character of a reference `&name;` (XML 1.0, section 4.1).
fn referenced(name: &str) -> Option<char> {
    match name.strip_prefix('#') {
        Some(number) => match number.strip_prefix('x') {
            Some(digits) => character(digits, 16),
            None => character(number, 10),
        },
        None => Some(match name {
            "amp" => '&',
            "lt" => '<',
            "gt" => '>',
            "quot" => '"',
            "apos" => '\'',
            "micro" => '\u{b5}',
            _ => return None,
        }),
    }
}

fn character(digits: &str, radix: u32) -> Option<char> {
    u32::from_str_radix(digits, radix).ok().and_then(char::from_u32)
}

/// Micrometres per unit, also with escapes of XML or Java (`\u00B5`); `None` for pixels and unknown units.
pub(super) fn unit_um(unit: &str) -> Option<f64> {
    let unit = replaced(&unescaped(unit), "\\u", |rest| Some((character(rest.get(..4)?, 16)?, 4)));
    let unit = unit.trim().to_lowercase().replace(['\u{b5}', '\u{3bc}'], "u");
    let unit = unit.replace("metre", "meter");
    // `ms` is a time.
    let singular = unit.strip_suffix('s').filter(|unit| unit.len() > 3).unwrap_or(&unit);
    Some(match singular {
        "um" | "micron" | "micrometer" | "umeter" => 1.0,
        "nm" | "nanometer" => 1e-3,
        "mm" | "millimeter" => 1e3,
        "cm" | "centimeter" => 1e4,
        "dm" | "decimeter" => 1e5,
        "m" | "meter" => 1e6,
        "km" | "kilometer" => 1e9,
        "thou" | "mil" => 25.4,
        "inch" | "inche" | "in" => 25_400.0,
        "ft" | "foot" | "feet" => 304_800.0,
        "\u{e5}" | "angstrom" => 1e-4,
        "pm" | "picometer" => 1e-6,
        _ => return None,
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(super) fn pages(count: usize, description: &str) -> Vec<Page> {
        let directory = |index| Directory {
            description: (index == 0).then(|| description.to_owned()),
            ..Directory::default()
        };
        (0..count).map(|index| Page { index, directory: directory(index) }).collect()
    }

    pub(super) fn positions(pages: &[Page]) -> Result<Option<Vec<f64>>, String> {
        of(pages).map(|planes| planes.positions_um)
    }

    #[test]
    fn an_array_of_several_series_channels_or_colours_is_rejected() {
        let of_array = |count: usize, page: &Directory, description: &str| {
            let mut all = pages(count, description);
            for other in &mut all {
                other.directory =
                    Directory { description: other.directory.description.take(), ..page.clone() };
            }
            positions(&all).map_err(|error| error.split(':').next().unwrap_or_default().to_owned())
        };
        let grey =
            Directory { width: 8, height: 6, samples_per_pixel: 1, photometric: 1, ..Directory::default() };
        let planes = Directory { photometric: 2, planar: 2, samples_per_pixel: 4, ..grey.clone() };
        for shape in ["5, 6, 8", "1, 5, 6, 8", "5, 1, 6, 8, 1"] {
            assert_eq!(of_array(5, &grey, &format!("{{\"shape\": [{shape}]}}")), Ok(None), "{shape}");
        }
        assert_eq!(of_array(5, &grey, "{\"shape\": [5, 6, 8], \"axes\": \"ZYX\"}"), Ok(None));
        let refused = |count, page, text| of_array(count, page, text).unwrap_err();
        assert!(refused(5, &grey, "{\"shape\": [5, 6, 8], \"axes\": \"CYX\"}").contains("5 channels"));
        assert!(refused(5, &grey, "{\"shape\": [5, 6, 8], \"axes\": \"TYX\"}").contains("5 times"));
        assert!(refused(12, &grey, "{\"shape\": [3, 4, 6, 8]}").contains("along 2 axes"));
        assert!(
            refused(1, &grey, "{\"shape\": [5, 6, 8], \"truncated\": true}").contains("lists 1 of 5 images")
        );
        let volume = Directory { image_depth: 5, ..grey.clone() };
        assert!(refused(1, &volume, "{\"shape\": [5, 6, 8]}").contains("a volume of 5 slices"));
        assert!(refused(3, &planes, "{\"shape\": [3, 4, 6, 8]}").contains("4 planes are marked as colours"));
        assert_eq!(of_array(3, &planes, "{\"shape\": [3, 4, 6, 8], \"axes\": \"ZSYX\"}"), Ok(None));
        // Written one by one, each with its own description.
        assert_eq!(of_array(5, &grey, "{\"shape\": [6, 8]}"), Ok(None));
    }

    #[test]
    fn the_side_of_a_pixel_comes_from_ome_and_image_j() {
        let side = |pages: &[Page]| {
            let (side, remark) = object_pixel_um(pages);
            (side, remark.is_some())
        };
        let ome = "<OME><Pixels SizeX=\"8\" PhysicalSizeX=\"650\" PhysicalSizeXUnit=\"nm\"></Pixels></OME>";
        assert_eq!(side(&pages(2, ome)), (Some(0.65), false));
        assert_eq!(side(&pages(2, &ome.replace("650", "0"))), (None, false));
        let mut image_j = pages(2, "ImageJ=1.54f\nimages=2\nunit=micron\n");
        assert_eq!(side(&image_j), (None, false));
        image_j[0].directory.x_resolution = Some(4.0);
        assert_eq!(side(&image_j), (Some(0.25), false));
    }

    #[test]
    fn pixels_that_are_not_square_have_no_side_and_a_remark() {
        let ome = |height: &str| {
            let xml = format!("<OME><Pixels PhysicalSizeX='0.5' PhysicalSizeY='{height}'></Pixels></OME>");
            object_pixel_um(&pages(2, &xml))
        };
        let (side, remark) = ome("1.0");
        assert!(side.is_none() && remark.is_some_and(|remark| remark.contains("0.5000 x 1.0000 um")));
        assert_eq!(ome("0.51"), (Some(0.5), None));
        let mut image_j = pages(2, "ImageJ=1.54f\nimages=2\nunit=micron\n");
        let mut sides = |x, y| {
            (image_j[0].directory.x_resolution, image_j[0].directory.y_resolution) = (Some(x), Some(y));
            object_pixel_um(&image_j)
        };
        for (x, y, stated) in [
            (4.0, 2.0, "0.2500 x 0.5000 um"),
            (2.0, 1.0, "0.5000 x 1.0000 um"),
            (1.0, 2.0, "1.0000 x 0.5000 um"),
        ] {
            let (side, remark) = sides(x, y);
            assert!(side.is_none() && remark.is_some_and(|remark| remark.contains(stated)), "{stated}");
        }
        assert_eq!(sides(1.0, 1.0), (None, None));
    }

    #[test]
    fn units_may_have_escapes() {
        for micro in
            ["&#181;", "&#0181;", "&#xb5;", "&#x00B5;", "&#956;", "&micro;", "\\u00B5", "\u{b5}", "\u{3bc}"]
        {
            assert_eq!(unit_um(&format!("{micro}m")), Some(1.0), "{micro}");
        }
        assert_eq!([unit_um("thou"), unit_um("dm"), unit_um("&#xffffffff;m")], [Some(25.4), Some(1e5), None]);
        assert_eq!(unescaped("a&amp;b &lt; \\u03bc \\ & &x;"), "a&b < \\u03bc \\ & &x;");
    }
}
