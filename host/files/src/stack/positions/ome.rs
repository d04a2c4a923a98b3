//! OME-XML: <https://docs.openmicroscopy.org/ome-model>

use std::{
    borrow::Cow,
    collections::{HashMap, HashSet},
};

use super::{Planes, even, finite, moving, one_series, step_um, unescaped, unit_um};
use crate::{image_file::Page, order::composed};

/// The first image of a file's OME-XML.
pub(super) struct Metadata<'a>(Cow<'a, str>);

impl<'a> Metadata<'a> {
    pub fn of(description: &'a str) -> Option<Self> {
        let root = description.match_indices("OME").find_map(|(at, _)| {
            let begin = description[..at].rfind('<')? + 1;
            let prefix = &description[begin..at];
            let after = description[at + 3..].starts_with([' ', '>', '\n', '\r', '\t']);
            (after && (prefix.is_empty() || prefix.ends_with(':'))).then_some(prefix)
        })?;
        let xml: Cow<'_, str> = match root {
            "" => description.into(),
            prefix => {
                description.replace(&format!("<{prefix}"), "<").replace(&format!("</{prefix}"), "</").into()
            }
        };
        elements(&xml, "Pixels").next()?;
        Some(Self(xml))
    }

    fn pixels(&self) -> &str {
        elements(&self.0, "Pixels").next().unwrap_or_default()
    }

    /// Elements in the image's `Pixels`.
    fn within(&self, name: &'static str) -> impl Iterator<Item = &str> {
        elements(self.0.split("</Pixels").next().unwrap_or_default(), name)
    }

    fn length_um(&self, name: &str) -> Option<f64> {
        let unit = attribute(self.pixels(), &format!("{name}Unit")).map_or(Some(1.0), unit_um)?;
        Some(finite(attribute(self.pixels(), name)?)? * unit)
    }

    /// Width and height of a pixel.
    pub fn pixel_um(&self) -> [Option<f64>; 2] {
        ["PhysicalSizeX", "PhysicalSizeY"].map(|name| self.length_um(name))
    }

    pub fn planes(&self, pages: &[Page]) -> Result<Planes, String> {
        let count = |name| number(self.pixels(), name).unwrap_or(1);
        let samples = pages.first().map_or(1, |page| page.directory.samples_per_pixel.max(1) as usize);
        one_series(count("SizeC") / samples.min(count("SizeC").max(1)), count("SizeT"))?;
        let (planes, images) = (count("SizeZ"), elements(&self.0, "Pixels").count());
        if images > 1 && pages.len() > planes {
            return Err(format!(
                "it holds {images} images, such as positions of a stage: a stack is one focus series; save one of them (ImageJ: File > \
                 Import > Bio-Formats)"
            ));
        }
        if planes != pages.len() {
            return Err(format!(
                "its OME metadata have {planes} planes and the file has {}: give the file with all of them, or a folder of \
                 single images",
                pages.len()
            ));
        }
        let order = self.order(pages)?;
        let (positions_um, remark) = if planes > 1 { self.positions_um(planes) } else { (None, None) };
        Ok(Planes { pages: order, positions_um, remarks: Vec::from_iter(remark) })
    }

    /// The planes of a focus series with one file each, from the names that `TiffData` has for them. `None` if the metadata are of
    /// one file. Fails for other names, channels and times.
    pub fn files(&self, names: &[String]) -> Result<Option<Planes>, String> {
        let mut of_name: HashMap<String, [usize; 3]> = HashMap::new();
        let mut at = [0; 3];
        for tag in self.0.split("</Pixels").next().unwrap_or_default().split('<') {
            if tag.starts_with("TiffData") {
                at = ["FirstZ", "FirstC", "FirstT"].map(|name| number(tag, name).unwrap_or(0));
            } else if let (true, Some(name)) = (tag.starts_with("UUID"), attribute(tag, "FileName")) {
                of_name.insert(composed(&unescaped(name)), at);
            }
        }
        if of_name.len() < 2 {
            return Ok(None);
        }
        let known: Vec<[usize; 3]> =
            names.iter().filter_map(|name| of_name.get(&composed(name)).copied()).collect();
        if known.len() < names.len() {
            let name = names.iter().find(|name| !of_name.contains_key(&composed(name)));
            return Err(format!(
                "the OME metadata of its files are of {} files with other names, without {}: rename the files as they were, or save \
                 the stack again without them (Bio-Formats: bfconvert)",
                of_name.len(),
                name.map_or("", String::as_str)
            ));
        }
        let distinct = |axis: usize| known.iter().map(|at| at[axis]).collect::<HashSet<_>>().len();
        one_series(distinct(1), distinct(2))?;
        let count = number(self.pixels(), "SizeZ").unwrap_or(1);
        if distinct(0) < names.len() || known.iter().any(|at| at[0] >= count) {
            return Err("the OME metadata of its files have one plane (FirstZ) for several of them".into());
        }
        if count > of_name.len() {
            return Err(format!(
                "its OME metadata have {count} planes in {} files: expected a file for each",
                of_name.len()
            ));
        }
        let mut pages: Vec<usize> = (0..names.len()).collect();
        pages.sort_by_key(|index| known[*index][0]);
        let (positions_um, of_positions) = self.positions_um(count);
        let positions_um =
            positions_um.map(|positions| pages.iter().map(|index| positions[known[*index][0]]).collect());
        let missing = count - names.len();
        let remark = (missing > 0)
            .then(|| format!("{missing} of {count} planes of the OME metadata are not in the folder"));
        let remarks = remark.into_iter().chain(of_positions).collect();
        Ok(Some(Planes { pages, positions_um, remarks }))
    }

    /// Index of the page of each plane, by the elements `TiffData`.
    fn order(&self, pages: &[Page]) -> Result<Vec<usize>, String> {
        let planes = pages.len();
        if self.within("TiffData").next().is_none() {
            return Ok((0..planes).collect());
        }
        let mut of_planes = vec![None; planes];
        for data in self.within("TiffData") {
            let directory = number(data, "IFD");
            let count = number(data, "PlaneCount").unwrap_or(if directory.is_some() { 1 } else { planes });
            let (plane, directory) = (number(data, "FirstZ").unwrap_or(0), directory.unwrap_or(0));
            for step in 0..count.min(planes) {
                if let Some(of_plane) = of_planes.get_mut(plane.saturating_add(step)) {
                    *of_plane = pages.iter().position(|page| page.index == directory.saturating_add(step));
                }
            }
        }
        let mut distinct: Vec<usize> = of_planes.iter().copied().flatten().collect();
        distinct.sort_unstable();
        distinct.dedup();
        if distinct.len() < planes {
            return Err(format!(
                "its OME metadata (TiffData) have pages for {} of {planes} planes: save it again (Bio-Formats: bfconvert), or give a \
                 folder of single images",
                distinct.len()
            ));
        }
        Ok(of_planes.into_iter().flatten().collect())
    }

    /// Positions in um, and a remark on those that are not used.
    fn positions_um(&self, planes: usize) -> (Option<Vec<f64>>, Option<String>) {
        let mut stated = vec![None; planes];
        for plane in self.within("Plane") {
            let at = number(plane, "TheZ").and_then(|at| stated.get_mut(at));
            if let (Some(at), Some(z)) = (at, attribute(plane, "PositionZ").and_then(finite)) {
                *at = Some((z, attribute(plane, "PositionZUnit").unwrap_or("um")));
            }
        }
        let stated = stated.into_iter().collect::<Option<Vec<(f64, &str)>>>().unwrap_or_default();
        let unit = stated.first().map_or("um", |(_, unit)| *unit);
        let in_um = stated.iter().map(|(z, unit)| Some(z * unit_um(unit)?)).collect::<Option<Vec<f64>>>();
        if let Some(positions) = in_um.filter(|all| moving(all)) {
            return (Some(positions), None);
        }
        if let Some(size) = attribute(self.pixels(), "PhysicalSizeZ") {
            let unit = attribute(self.pixels(), "PhysicalSizeZUnit").unwrap_or("um");
            let remedy = "set PhysicalSizeZ and PhysicalSizeZUnit and save it again";
            let (step, remark) = step_um(size, unit, remedy);
            return (step.map(|step| even(step, planes)), remark);
        }
        let stated: Vec<f64> = stated.into_iter().map(|(z, _)| z).collect();
        let remark = (unit_um(unit).is_none() && moving(&stated)).then(|| {
            format!(
                "the file states positions of the planes and no unit of length ({unit}): they are not used; set the unit \
                 (PositionZUnit) and save it again"
            )
        });
        (None, remark)
    }
}

/// The begin tags of a name.
fn elements<'a>(xml: &'a str, name: &'static str) -> impl Iterator<Item = &'a str> {
    xml.split('<').filter_map(move |tag| {
        let attributes = tag.strip_prefix(name)?;
        attributes.starts_with([' ', '\n', '\r', '\t', '/', '>']).then(|| attributes.split('>').next())?
    })
}

fn number(tag: &str, name: &str) -> Option<usize> {
    attribute(tag, name)?.parse().ok()
}

fn attribute<'a>(tag: &'a str, name: &str) -> Option<&'a str> {
    tag.match_indices(name).find_map(|(at, _)| {
        let before = tag[..at].chars().next_back()?;
        let rest = tag[at + name.len()..].trim_start().strip_prefix('=')?.trim_start();
        let quote = rest.chars().next().filter(|c| matches!(c, '"' | '\''))?;
        before.is_ascii_whitespace().then(|| rest[1..].split(quote).next()).flatten()
    })
}

#[cfg(test)]
mod tests {
    use super::{
        super::{
            object_pixel_um, of,
            tests::{pages, positions},
        },
        Metadata,
    };

    #[test]
    fn ome_gives_uneven_positions_or_an_even_spacing() {
        let even = "<?xml?><OME><Image><Pixels DimensionOrder=\"XYZCT\" SizeC=\"1\" SizeT=\"1\" SizeZ=\"3\" SizeX=\"8\" \
                    PhysicalSizeZ=\"1.5\" PhysicalSizeZUnit=\"\u{b5}m\"></Pixels></Image></OME>";
        assert_eq!(positions(&pages(3, even)), Ok(Some(vec![0.0, 1.5, 3.0])));
        let planes = "<Plane TheZ='0' PositionZ='-3'/><Plane TheZ='2' PositionZ='5'/><Plane TheZ='1' PositionZ='0.5'/>";
        let uneven = even.replace("</Pixels>", &format!("{planes}</Pixels>"));
        assert_eq!(positions(&pages(3, &uneven)), Ok(Some(vec![-3.0, 0.5, 5.0])));
        // All planes at one place say nothing; two of them are refused where places are needed.
        let at_once = uneven.replace("'-3'", "'5'").replace("'0.5'", "'5'");
        assert_eq!(positions(&pages(3, &at_once)), Ok(Some(vec![0.0, 1.5, 3.0])));
        let twice = uneven.replace("'-3'", "'0.5'");
        assert_eq!(positions(&pages(3, &twice)), Ok(Some(vec![0.5, 0.5, 5.0])));
        assert!(of(&pages(1, even)).unwrap_err().contains("3 planes"));
        let times = even.replace("SizeT=\"1\"", "SizeT=\"3\"").replace("SizeZ=\"3\"", "SizeZ=\"1\"");
        assert!(of(&pages(3, &times)).unwrap_err().contains("3 times"));
        let two = even.replace("</OME>", "<Image><Pixels SizeZ='3'></Pixels></Image></OME>");
        assert!(of(&pages(6, &two)).unwrap_err().contains("holds 2 images"));
    }

    #[test]
    fn positions_without_a_value_or_a_unit_are_not_used() {
        let planes = |pixels: &str, positions: [&str; 2]| {
            let planes = [0, 1].map(|z| format!("<Plane TheZ='{z}' PositionZ={}/>", positions[z])).concat();
            let xml = format!("<OME><Image><Pixels SizeZ='2' {pixels}>{planes}</Pixels></Image></OME>");
            let planes = of(&pages(2, &xml)).unwrap();
            (planes.positions_um, planes.remarks.join(""))
        };
        let (even, none) = (Some(vec![0.0, 0.5]), String::new());
        let in_frame = ["'1' PositionZUnit='reference frame'", "'2' PositionZUnit='reference frame'"];
        for positions in [["'NaN'", "'NaN'"], ["'1'", "'inf'"], in_frame] {
            assert_eq!(
                planes("PhysicalSizeZ='0.5'", positions),
                (even.clone(), none.clone()),
                "{positions:?}"
            );
        }
        let remark = |pixels: &str, positions: [&str; 2], part: &str| {
            let (found, remark) = planes(pixels, positions);
            assert!(found.is_none() && remark.contains(part), "{pixels} {positions:?}: {remark}");
        };
        remark("", in_frame, "(reference frame)");
        remark("PhysicalSizeZ='0,5'", ["''", "''"], "(0,5)");
        remark("PhysicalSizeZ='0,5'", ["''", "''"], "not used; set PhysicalSizeZ and PhysicalSizeZUnit");
        remark("PhysicalSizeZ='2' PhysicalSizeZUnit='pixel'", ["''", "''"], "(pixel)");
        assert_eq!(
            planes("PhysicalSizeZ='1' PhysicalSizeZUnit='pixel'", ["'1'", "'1'"]),
            (None, none.clone())
        );
        let micro = "PhysicalSizeZ='0.5' PhysicalSizeZUnit='&#x00B5;m'";
        assert_eq!(planes(micro, ["'1'", "'1'"]), (even, none));
    }

    #[test]
    fn tiff_data_give_the_order_of_pages() {
        let of_data = |data: &str| {
            let xml =
                format!("<OME><Image><Pixels SizeZ=\"3\" PhysicalSizeZ=\"2\">{data}</Pixels></Image></OME>");
            of(&pages(3, &xml)).map(|planes| planes.pages)
        };
        let one = |z: usize, page: usize| {
            format!("<TiffData FirstZ='{z}' FirstC='0' IFD='{page}' PlaneCount='1'/>")
        };
        assert_eq!(of_data(&[one(0, 2), one(1, 1), one(2, 0)].concat()), Ok(vec![2, 1, 0]));
        assert_eq!(
            of_data("<TiffData FirstZ='1' IFD='0' PlaneCount='2'/><TiffData IFD='2'/>"),
            Ok(vec![2, 0, 1])
        );
        for all in ["", "<TiffData/>", "<TiffData IFD='0' PlaneCount='3'></TiffData>"] {
            assert_eq!(of_data(all), Ok(vec![0, 1, 2]), "{all}");
        }
        for wrong in [
            one(0, 0),
            [one(0, 0), one(1, 0), one(2, 1)].concat(),
            "<TiffData IFD='1' PlaneCount='3'/>".into(),
        ] {
            assert!(of_data(&wrong).unwrap_err().contains("of 3 planes"), "{wrong}");
        }
    }

    #[test]
    fn files_of_one_plane_each_have_the_order_of_their_metadata() {
        let data = |z: usize, c: usize, name: &str| {
            format!(
                "<TiffData FirstZ='{z}' FirstC='{c}' IFD='0'><UUID FileName='{name}'>urn:uuid:1</UUID></TiffData>"
            )
        };
        let ome = |data: &str| {
            format!("<OME><Image><Pixels SizeZ='4' SizeC='2' PhysicalSizeZ='2'>{data}</Pixels></Image></OME>")
        };
        let of = |xml: &str, names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            Metadata::of(xml).unwrap().files(&names)
        };
        let all =
            ome(&[data(2, 0, "a1"), data(0, 0, "a&amp;2"), data(3, 0, "a3"), data(1, 1, "b1")].concat());
        let found = of(&all, &["a1", "a&2", "a3"]).unwrap().unwrap();
        assert_eq!((found.pages, found.positions_um), (vec![1, 0, 2], Some(vec![0.0, 4.0, 6.0])));
        assert!(found.remarks[0].contains("1 of 4 planes"), "{:?}", found.remarks);
        assert!(of(&all, &["a1", "a&2", "b1"]).unwrap_err().contains("2 channels"));
        assert!(of(&all, &["a1", "z9"]).unwrap_err().contains("without z9"));
        let twice = ome(&[data(2, 0, "a1"), data(2, 0, "a2")].concat());
        assert!(of(&twice, &["a1", "a2"]).unwrap_err().contains("one plane"));
        assert_eq!(of(&ome(&data(0, 0, "a1")), &["a1", "a2"]), Ok(None));
        let backslash = ome(&[data(0, 0, "a\\u0031"), data(1, 0, "a2")].concat());
        let backslash = backslash.replace("SizeZ='4'", "SizeZ='2'");
        assert_eq!(of(&backslash, &["a\\u0031", "a2"]).unwrap().unwrap().pages, [0, 1]);
        // As a Mac names them.
        let whole = backslash.replace("a\\u0031", "a\u{e4}1");
        assert_eq!(of(&whole, &["aa\u{308}1", "a2"]).unwrap().unwrap().pages, [0, 1]);
    }

    #[test]
    fn names_may_have_the_prefix_of_a_namespace() {
        let xml = "<?xml?><ome:OME xmlns:ome='u'><ome:Image><ome:Pixels SizeC='1' SizeZ='2' PhysicalSizeX='3' PhysicalSizeZ='1.5'>\
                   <ome:TiffData FirstZ='1'/><ome:TiffData FirstZ='0' IFD='1'/></ome:Pixels></ome:Image></ome:OME>";
        let planes = of(&pages(2, &xml.replace("FirstZ='1'/", "FirstZ='1' IFD='0'/"))).unwrap();
        assert_eq!((planes.pages, planes.positions_um), (vec![1, 0], Some(vec![0.0, 1.5])));
        assert_eq!(object_pixel_um(&pages(2, xml)), (Some(3.0), None));
        assert!(of(&pages(2, &xml.replace("SizeC='1'", "SizeC='2'"))).unwrap_err().contains("2 channels"));
    }
}
