//! Focus positions of TIFF pages by microscopes and ImageJ.

use crate::image_file::{Page, tiff_tags::Directory};

/// Positions along the axis, um; `None` if not stated. Fails for channels, times or planes in other files.
pub(super) fn of(pages: &[Page]) -> Result<Option<Vec<f64>>, String> {
    let Some(first) = pages.first() else { return Ok(None) };
    let description = first.directory.description.as_deref().unwrap_or_default();
    if description.starts_with("ImageJ=") {
        return image_j(description, pages.len());
    }
    if let Some(array) = Array::of(description) {
        return array.check(&first.directory, pages.len()).map(|()| None);
    }
    if let Some(pixels) = description.contains("<OME").then(|| element(description, "Pixels")).flatten() {
        return ome(description, pixels, pages);
    }
    let of_pages =
        pages.iter().map(|page| json_number(page.directory.micro_manager.as_deref()?, "ZPositionUm"));
    Ok(of_pages.collect::<Option<Vec<f64>>>().filter(|all| moving(all)))
}

/// Side of a pixel at the object; `None` if not stated.
pub(super) fn object_pixel_um(pages: &[Page]) -> Option<f64> {
    let directory = &pages.first()?.directory;
    let description = directory.description.as_deref()?;
    let side = if description.starts_with("ImageJ=") {
        let unit = description.lines().find_map(|line| line.strip_prefix("unit="))?;
        unit_um(unit)? / directory.x_resolution?
    } else {
        let pixels = element(description, "Pixels")?;
        let unit = attribute(pixels, "PhysicalSizeXUnit").map_or(Some(1.0), unit_um)?;
        attribute(pixels, "PhysicalSizeX")?.parse::<f64>().ok()? * unit
    };
    (side.is_finite() && side > 0.0).then_some(side)
}

/// Some programs write the position of the first plane for all.
fn moving(positions: &[f64]) -> bool {
    positions.windows(2).any(|two| two[0] != two[1])
}

fn image_j(description: &str, pages: usize) -> Result<Option<Vec<f64>>, String> {
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
    let micrometres = value("unit").and_then(unit_um);
    let spacing = value("spacing").and_then(|text| text.parse::<f64>().ok()).filter(|v| *v != 0.0);
    let (Some(spacing), Some(micrometres)) = (spacing, micrometres) else { return Ok(None) };
    Ok((pages > 1).then(|| (0..pages).map(|page| page as f64 * spacing * micrometres).collect()))
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

fn ome(xml: &str, pixels: &str, pages: &[Page]) -> Result<Option<Vec<f64>>, String> {
    let count = |name| attribute(pixels, name).and_then(|text| text.parse::<usize>().ok()).unwrap_or(1);
    let samples = pages.first().map_or(1, |page| page.directory.samples_per_pixel.max(1) as usize);
    one_series(count("SizeC") / samples.min(count("SizeC").max(1)), count("SizeT"))?;
    let planes = count("SizeZ");
    if planes != pages.len() {
        return Err(format!(
            "its OME metadata have {planes} planes and the file has {}: give the file with all of them, or a folder of \
             single images",
            pages.len()
        ));
    }
    if planes < 2 {
        return Ok(None);
    }
    let mut positions = vec![None; planes];
    for plane in xml.split("<Plane").skip(1).map(|rest| rest.split('>').next().unwrap_or_default()) {
        let at = attribute(plane, "TheZ").and_then(|text| text.parse::<usize>().ok());
        let unit = attribute(plane, "PositionZUnit").map_or(Some(1.0), unit_um);
        let z = attribute(plane, "PositionZ").and_then(|text| text.parse::<f64>().ok());
        if let (Some(at), Some(unit), Some(z)) = (at.filter(|at| *at < planes), unit, z) {
            positions[at] = Some(z * unit);
        }
    }
    if let Some(all) = positions.into_iter().collect::<Option<Vec<f64>>>().filter(|all| moving(all)) {
        return Ok(Some(all));
    }
    let unit = attribute(pixels, "PhysicalSizeZUnit").map_or(Some(1.0), unit_um);
    let spacing = attribute(pixels, "PhysicalSizeZ").and_then(|text| text.parse::<f64>().ok());
    let spacing = spacing.zip(unit).map(|(z, unit)| z * unit).filter(|v| v.is_finite() && *v != 0.0);
    Ok(spacing.map(|spacing| (0..planes).map(|plane| plane as f64 * spacing).collect()))
}

/// Micrometres per unit; `None` for pixels and unknown units.
fn unit_um(unit: &str) -> Option<f64> {
    let unit = unit.replace("\\u00B5", "u").replace("&#181;", "u").replace("&#xB5;", "u");
    let unit = unit.replace(['\u{b5}', '\u{3bc}'], "u");
    Some(match unit.trim().to_lowercase().as_str() {
        "um" | "micron" | "microns" | "micrometer" | "micrometre" | "micrometers" => 1.0,
        "nm" | "nanometer" | "nanometre" => 1e-3,
        "mm" | "millimeter" | "millimetre" => 1e3,
        "cm" | "centimeter" | "centimetre" => 1e4,
        "m" | "meter" | "metre" => 1e6,
        "inch" | "in" => 25_400.0,
        "\u{c5}" | "\u{e5}" | "angstrom" => 1e-4,
        _ => return None,
    })
}

fn element<'a>(xml: &'a str, name: &str) -> Option<&'a str> {
    let begin = xml.find(&format!("<{name} "))?;
    let end = xml[begin..].find('>')?;
    Some(&xml[begin..begin + end])
}

fn attribute<'a>(tag: &'a str, name: &str) -> Option<&'a str> {
    tag.match_indices(name).find_map(|(at, _)| {
        let before = tag[..at].chars().next_back()?;
        let rest = tag[at + name.len()..].trim_start().strip_prefix('=')?.trim_start();
        let quote = rest.chars().next().filter(|c| matches!(c, '"' | '\''))?;
        before.is_ascii_whitespace().then(|| rest[1..].split(quote).next()).flatten()
    })
}

fn json_number(json: &str, key: &str) -> Option<f64> {
    let rest = json.split(&format!("\"{key}\"")).nth(1)?.trim_start().strip_prefix(':')?.trim_start();
    let end = rest.find([',', '}', '\n']).unwrap_or(rest.len());
    rest[..end].trim().trim_matches('"').parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pages(count: usize, description: &str) -> Vec<Page> {
        let directory = |index| Directory {
            description: (index == 0).then(|| description.to_owned()),
            ..Directory::default()
        };
        (0..count).map(|index| Page { index, directory: directory(index) }).collect()
    }

    #[test]
    fn image_j_gives_the_spacing_with_its_unit() {
        let text = "ImageJ=1.54f\nimages=3\nslices=3\nunit=nm\nspacing=250.0\nloop=false\n";
        assert_eq!(of(&pages(3, text)), Ok(Some(vec![0.0, 0.25, 0.5])));
        assert_eq!(
            of(&pages(3, "ImageJ=1.54f\nimages=3\nunit=\\u00B5m\nspacing=-2")),
            Ok(Some(vec![0.0, -2.0, -4.0]))
        );
        assert_eq!(of(&pages(3, "ImageJ=1.54f\nimages=3\nunit=pixel\nspacing=2")), Ok(None));
        assert!(
            of(&pages(6, "ImageJ=1.54f\nimages=6\nchannels=2\nslices=3")).unwrap_err().contains("2 channels")
        );
        assert!(of(&pages(1, "ImageJ=1.54f\nimages=900\nslices=900")).unwrap_err().contains("900 images"));
    }

    #[test]
    fn an_array_of_several_series_channels_or_colours_is_rejected() {
        let of_array = |count: usize, page: &Directory, description: &str| {
            let mut all = pages(count, description);
            for other in &mut all {
                other.directory =
                    Directory { description: other.directory.description.take(), ..page.clone() };
            }
            of(&all).map_err(|error| error.split(':').next().unwrap_or_default().to_owned())
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
        assert!(refused(3, &planes, "{\"shape\": [3, 4, 6, 8]}").contains("4 planes are marked as colours"));
        assert_eq!(of_array(3, &planes, "{\"shape\": [3, 4, 6, 8], \"axes\": \"ZSYX\"}"), Ok(None));
        // Written one by one, each with its own description.
        assert_eq!(of_array(5, &grey, "{\"shape\": [6, 8]}"), Ok(None));
    }

    #[test]
    fn ome_gives_uneven_positions_or_an_even_spacing() {
        let even = "<?xml?><OME><Image><Pixels DimensionOrder=\"XYZCT\" SizeC=\"1\" SizeT=\"1\" SizeZ=\"3\" SizeX=\"8\" \
                    PhysicalSizeZ=\"1.5\" PhysicalSizeZUnit=\"\u{b5}m\"></Pixels></Image></OME>";
        assert_eq!(of(&pages(3, even)), Ok(Some(vec![0.0, 1.5, 3.0])));
        let planes = "<Plane TheZ='0' PositionZ='-3'/><Plane TheZ='2' PositionZ='5'/><Plane TheZ='1' PositionZ='0.5'/>";
        let uneven = even.replace("</Pixels>", &format!("{planes}</Pixels>"));
        assert_eq!(of(&pages(3, &uneven)), Ok(Some(vec![-3.0, 0.5, 5.0])));
        // All planes at one place say nothing; two of them are refused where places are needed.
        let at_once = uneven.replace("'-3'", "'5'").replace("'0.5'", "'5'");
        assert_eq!(of(&pages(3, &at_once)), Ok(Some(vec![0.0, 1.5, 3.0])));
        let twice = uneven.replace("'-3'", "'0.5'");
        assert_eq!(of(&pages(3, &twice)), Ok(Some(vec![0.5, 0.5, 5.0])));
        assert!(of(&pages(1, even)).unwrap_err().contains("3 planes"));
        let times = even.replace("SizeT=\"1\"", "SizeT=\"3\"").replace("SizeZ=\"3\"", "SizeZ=\"1\"");
        assert!(of(&pages(3, &times)).unwrap_err().contains("3 times"));
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

    #[test]
    fn micro_manager_gives_a_position_for_each_page() {
        let mut pages = pages(3, "");
        for (page, z) in pages.iter_mut().zip([-1.0, 0.5, 2.0]) {
            page.directory.micro_manager =
                Some(format!("{{\"Slice\": 1, \"ZPositionUm\": {z}, \"Width\": 8}}"));
        }
        assert_eq!(of(&pages), Ok(Some(vec![-1.0, 0.5, 2.0])));
        for page in &mut pages {
            page.directory.micro_manager = Some("{\"ZPositionUm\": 2.0}".into());
        }
        assert_eq!(of(&pages), Ok(None));
    }
}
