//! Order and focus positions of TIFF pages by microscopes and ImageJ.

mod micro_manager;
mod ome;

use crate::image_file::{Page, tiff_tags::Directory};

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
    if description.starts_with("ImageJ=") {
        let (positions_um, remark) = image_j(description, pages.len())?;
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

/// Side of a pixel at the object; `None` if not stated.
pub(super) fn object_pixel_um(pages: &[Page]) -> Option<f64> {
    let directory = &pages.first()?.directory;
    let description = directory.description.as_deref()?;
    let side = if description.starts_with("ImageJ=") {
        let unit = description.lines().find_map(|line| line.strip_prefix("unit="))?;
        // One pixel per unit: the scale was never set.
        unit_um(unit)? / directory.x_resolution.filter(|resolution| *resolution != 1.0)?
    } else {
        ome::Metadata::of(description)?.pixel_um()?
    };
    (side.is_finite() && side > 0.0).then_some(side)
}

/// Some programs write the position of the first plane for all.
fn moving(positions: &[f64]) -> bool {
    positions.windows(2).any(|two| two[0] != two[1])
}

/// Positions in um, and a remark on them.
fn image_j(description: &str, pages: usize) -> Result<(Option<Vec<f64>>, Option<String>), String> {
    let value = |key: &str| {
        description.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('=')).map(str::trim)
    };
    let count = |key| value(key).and_then(|text| text.parse::<usize>().ok()).unwrap_or(1);
    one_series(count("channels"), count("frames"))?;
    let images = count("images");
    if images != pages && images > 1 {
        return Err(format!(
            "its description has {images} images and the file lists {pages}: open it in ImageJ and save it as an image sequence"
        ));
    }
    let unit = value("zunit").or(value("unit")).unwrap_or("none");
    let spacing = match value("spacing") {
        Some(text) => text.parse::<f64>().ok().filter(|spacing| spacing.is_finite() && *spacing != 0.0),
        None => Some(1.0),
    };
    let Some(spacing) = spacing.filter(|_| pages > 1) else { return Ok((None, None)) };
    let Some(um) = unit_um(unit) else {
        let remark = (spacing != 1.0).then(|| {
            format!(
                "the file states a spacing of the planes ({spacing}) and no unit of length ({unit}): it is not used; set the unit \
                 in ImageJ (Image > Properties)"
            )
        });
        return Ok((None, remark));
    };
    let remark = value("spacing").is_none().then(|| {
        format!(
            "the file states a unit ({unit}) and no spacing of the planes: it counts as 1 {unit}, as in ImageJ (Image > Properties)"
        )
    });
    Ok((Some((0..pages).map(|page| page as f64 * (spacing * um)).collect()), remark))
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

/// Micrometres per unit; `None` for pixels and unknown units.
pub(super) fn unit_um(unit: &str) -> Option<f64> {
    let mut unit = unit.trim().to_lowercase();
    for micro in ["\\u00b5", "\\u03bc", "&#181;", "&#xb5;", "&#956;", "&#x3bc;", "\u{b5}", "\u{3bc}"] {
        unit = unit.replace(micro, "u");
    }
    let unit = unit.replace("metre", "meter");
    // `ms` is a time.
    let singular = unit.strip_suffix('s').filter(|unit| unit.len() > 3).unwrap_or(&unit);
    Some(match singular {
        "um" | "micron" | "micrometer" | "umeter" => 1.0,
        "nm" | "nanometer" => 1e-3,
        "mm" | "millimeter" => 1e3,
        "cm" | "centimeter" => 1e4,
        "m" | "meter" => 1e6,
        "inch" | "inche" | "in" => 25_400.0,
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
    fn image_j_gives_the_spacing_with_its_unit() {
        let text = "ImageJ=1.54f\nimages=3\nslices=3\nunit=nm\nspacing=250.0\nloop=false\n";
        assert_eq!(positions(&pages(3, text)), Ok(Some(vec![0.0, 0.25, 0.5])));
        assert_eq!(
            positions(&pages(3, "ImageJ=1.54f\nimages=3\nunit=\\u00B5m\nspacing=-2")),
            Ok(Some(vec![0.0, -2.0, -4.0]))
        );
        assert_eq!(positions(&pages(3, "ImageJ=1.54f\nimages=3\nunit=pixel\nspacing=2")), Ok(None));
        assert!(
            of(&pages(6, "ImageJ=1.54f\nimages=6\nchannels=2\nslices=3")).unwrap_err().contains("2 channels")
        );
        assert!(of(&pages(1, "ImageJ=1.54f\nimages=900\nslices=900")).unwrap_err().contains("900 images"));
    }

    #[test]
    fn image_j_has_a_unit_for_z_and_leaves_a_spacing_of_one_out() {
        let spaced = |lines: &str| {
            let planes = of(&pages(2, &format!("ImageJ=1.54f\nimages=2\n{lines}"))).unwrap();
            (planes.positions_um.map(|positions| positions[1]), planes.remarks.join(""))
        };
        let none = String::new;
        assert_eq!(spaced("unit=mm\nzunit=um\nspacing=2.5\n"), (Some(2.5), none()));
        assert_eq!(spaced("unit=pixel\nzunit=\\u00B5m\nspacing=2.5\n"), (Some(2.5), none()));
        for (unit, um) in [
            ("millimeters", 1e3),
            ("micrometer", 1.0),
            ("Microns", 1.0),
            ("\\u00b5m", 1.0),
            ("micrometres", 1.0),
            ("inches", 25_400.0),
            ("nanometers", 1e-3),
        ] {
            assert_eq!(spaced(&format!("unit={unit}\nspacing=2\n")), (Some(2.0 * um), none()), "{unit}");
        }
        let (positions, remark) = spaced("unit=um\n");
        assert!(positions == Some(1.0) && remark.contains("counts as 1 um"), "{remark}");
        for lines in ["unit=pixel\n", "unit=ms\n", "unit=um\nspacing=0\n", "", "spacing=1.0\n"] {
            assert_eq!(spaced(lines), (None, none()), "{lines}");
        }
        for (lines, unit) in [("unit=pixel\nspacing=2\n", "(pixel)"), ("spacing=2.0\n", "(none)")] {
            let (positions, remark) = spaced(lines);
            assert_eq!(positions, None);
            assert!(remark.contains("planes (2)") && remark.contains(unit), "{remark}");
        }
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
        let ome = "<OME><Pixels SizeX=\"8\" PhysicalSizeX=\"650\" PhysicalSizeXUnit=\"nm\"></Pixels></OME>";
        assert_eq!(object_pixel_um(&pages(2, ome)), Some(0.65));
        assert_eq!(object_pixel_um(&pages(2, &ome.replace("650", "0"))), None);
        let mut image_j = pages(2, "ImageJ=1.54f\nimages=2\nunit=micron\n");
        assert_eq!(object_pixel_um(&image_j), None);
        image_j[0].directory.x_resolution = Some(4.0);
        assert_eq!(object_pixel_um(&image_j), Some(0.25));
    }
}
