//! Description of ImageJ: lines of `key=value`. ImageJ2 (SCIFIO) adds lists along its axes:
//! `axes=X,Y,Channel,Z`, `lengths=`, `scales=` and `units=`.

use super::{even, finite, one_series, step_um, unit_um};
use crate::image_file::{
    Page,
    tiff_tags::{self, Directory},
};

pub(super) struct Description<'a>(&'a str);

impl<'a> Description<'a> {
    pub fn of(description: &'a str) -> Option<Self> {
        tiff_tags::is_image_j(description).then_some(Self(description))
    }

    fn value(&self, key: &str) -> Option<&'a str> {
        self.0.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('=')).map(str::trim)
    }

    /// The entry of the list `key` for an axis.
    fn along(&self, axis: &str, key: &str) -> Option<&'a str> {
        let at = self.value("axes")?.split(',').position(|other| other.trim() == axis)?;
        self.value(key)?.split(',').nth(at).map(str::trim)
    }

    fn unit(&self, axis: &str) -> &'a str {
        let unit = if self.value("units").is_some() { self.along(axis, "units") } else { self.value("unit") };
        unit.unwrap_or("none")
    }

    /// Positions in um, and a remark on them. Fails for channels, times and missing planes.
    pub fn positions_um(&self, pages: &[Page]) -> Result<(Option<Vec<f64>>, Option<String>), String> {
        let count = |key| self.value(key).and_then(|text| text.parse::<usize>().ok()).unwrap_or(1);
        let other_axes = self.value("axes").unwrap_or_default().split(',').map(str::trim);
        let other_axes = other_axes.filter(|axis| !["X", "Y", "Z", "Channel", "Unknown"].contains(axis));
        let lengths = other_axes.filter_map(|axis| self.along(axis, "lengths")?.parse::<usize>().ok());
        let samples = pages.first().map_or(1, |page| page.directory.samples_per_pixel.max(1) as usize);
        let channels = count("channels");
        one_series(
            channels / samples.min(channels.max(1)),
            count("frames").max(lengths.fold(1, usize::saturating_mul)),
        )?;
        let images = count("images");
        if images != pages.len() && images > 1 {
            return Err(format!(
                "its description has {images} images and the file lists {}: open it in ImageJ and save it as an image sequence",
                pages.len()
            ));
        }
        if pages.len() < 2 {
            return Ok((None, None));
        }
        let unit = self.value("zunit").unwrap_or(self.unit("Z"));
        let spacing = self.value("spacing").or(self.along("Z", "scales"));
        let (step, remark) = step_um(spacing.unwrap_or("1"), unit, "set it in ImageJ (Image > Properties)");
        let assumed = (spacing.is_none() && step.is_some()).then(|| {
            format!(
                "the file states a unit ({unit}) and no spacing of the planes: it counts as 1 {unit}, as in ImageJ (Image > Properties)"
            )
        });
        Ok((step.map(|step| even(step, pages.len())), remark.or(assumed)))
    }

    /// Width and height of a pixel.
    pub fn pixel_um(&self, directory: &Directory) -> [Option<f64>; 2] {
        let side = |axis: &str, resolution: Option<f64>| match self.along(axis, "scales") {
            Some(scale) => finite(scale),
            None => resolution.map(|pixels| 1.0 / pixels),
        };
        let sides = [side("X", directory.x_resolution), side("Y", directory.y_resolution)];
        // One pixel per unit: the scale was never set.
        if sides.iter().all(|side| side.is_none_or(|side| side == 1.0)) {
            return [None, None];
        }
        let [width, height] = sides;
        [("X", width), ("Y", height)].map(|(axis, side)| Some(side? * unit_um(self.unit(axis))?))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{
        object_pixel_um, of,
        tests::{pages, positions},
    };

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
        for lines in ["unit=pixel\n", "unit=ms\n", "", "spacing=1.0\n"] {
            assert_eq!(spaced(lines), (None, none()), "{lines}");
        }
        for (lines, unit) in [("unit=pixel\nspacing=2\n", "(pixel)"), ("spacing=2.0\n", "(none)")] {
            let (positions, remark) = spaced(lines);
            assert_eq!(positions, None);
            assert!(remark.contains("planes (2)") && remark.contains(unit), "{remark}");
        }
    }

    #[test]
    fn a_spacing_that_is_no_number_gets_a_remark() {
        for spacing in ["0,5", "0.5um", "NaN", "inf", "0"] {
            let text = format!("ImageJ=1.54f\nimages=2\nunit=um\nspacing={spacing}\n");
            let planes = of(&pages(2, &text)).unwrap();
            assert_eq!(planes.positions_um, None, "{spacing}");
            assert!(planes.remarks[0].contains(&format!("({spacing})")), "{:?}", planes.remarks);
        }
    }

    #[test]
    fn image_j_2_states_scales_along_its_axes() {
        let text = "SCIFIO=0.46.0\naxes=X,Y,Z\nlengths=8,8,3\nscales=0.25,0.25,2.0\nunits=\\u00B5m,\\u00B5m,\\u00B5m\n\
                    bitsPerPixel=8\nimages=3\nchannels=1\nslices=3\nframes=1\nhyperstack=true\nunit=\\u00B5m\n";
        assert_eq!(positions(&pages(3, text)), Ok(Some(vec![0.0, 2.0, 4.0])));
        // Pixels per centimetre, as it writes them.
        let mut scaled = pages(3, text);
        (scaled[0].directory.x_resolution, scaled[0].directory.y_resolution) = (Some(4e4), Some(4e4));
        assert_eq!(object_pixel_um(&scaled), (Some(0.25), None));
        let unscaled = text.replace("0.25,0.25,2.0", "1.0,1.0,1.0").replace("\\u00B5m", "null");
        assert_eq!(positions(&pages(3, &unscaled)), Ok(None));
        assert_eq!(object_pixel_um(&pages(3, &unscaled)), (None, None));
        let without_z = text.replace("2.0", "1.0").replace("5m,\\u00B5m\n", "5m,null\n");
        let planes = of(&pages(3, &without_z)).unwrap();
        assert_eq!((planes.positions_um, planes.remarks), (None, Vec::new()));
        assert_eq!(object_pixel_um(&pages(3, &without_z)), (Some(0.25), None));
        let unknown = of(&pages(3, &text.replace("X,Y,Z", "X,Y,Unknown"))).unwrap();
        assert_eq!((unknown.pages.len(), unknown.positions_um), (3, None));
        let channels = text.replace("X,Y,Z", "X,Y,Channel").replace("channels=1", "channels=3");
        assert!(of(&pages(3, &channels)).unwrap_err().contains("3 channels"));
        let mut colour = pages(3, &text.replace("channels=1", "channels=3"));
        colour[0].directory.samples_per_pixel = 3;
        assert_eq!(positions(&colour), Ok(Some(vec![0.0, 2.0, 4.0])));
        for axis in ["Time", "Lifetime"] {
            let times = text.replace("X,Y,Z", &format!("X,Y,{axis}"));
            assert!(of(&pages(3, &times)).unwrap_err().contains("3 times"), "{axis}");
        }
    }
}
