//! OpenEXR: maps as channels of one picture, in full precision, with texts in the header. One part, scan lines from the
//! top, uncompressed 32-bit float (noise in the low bits hardly compresses). Layout: "OpenEXR File Layout",
//! <https://openexr.com/en/latest/OpenEXRFileLayout.html>. Only tests use the crate `exr`, because of its compile time.

use std::io::{self, Write};

use ndarray::ArrayView2;

use crate::EncodeError;

const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
/// Version 2: one part, scan lines, short names.
const VERSION: i32 = 2;
const NAME_MAX: usize = 31;
const FLOAT: i32 = 2;

/// Encodes maps of one size as channels; NaN means no value. `texts` are header attributes: name (with namespace, e.g.
/// `farnear:units`) and value. Names must be unique, of 1 to 31 bytes.
pub fn write(channels: &[(&str, ArrayView2<f32>)], texts: &[(&str, &str)]) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Vec::new();
    write_to(channels, texts, &mut bytes).map_err(EncodeError::of("an EXR"))?;
    Ok(bytes)
}

/// [`write()`] into a file, row by row.
pub fn write_to(
    channels: &[(&str, ArrayView2<f32>)],
    texts: &[(&str, &str)],
    to: &mut impl Write,
) -> io::Result<()> {
    let refused = |reason: String| io::Error::new(io::ErrorKind::InvalidInput, reason);
    let (height, width) = channels.first().map_or((0, 0), |(_, map)| map.dim());
    if let Some((name, map)) = channels.iter().find(|(_, map)| map.dim() != (height, width)) {
        let (rows, columns) = map.dim();
        return Err(refused(format!("channel {name} is {columns}x{rows}, the first {width}x{height}")));
    }
    let (Ok(columns @ 1..), Ok(rows @ 1..)) = (i32::try_from(width), i32::try_from(height)) else {
        return Err(refused(format!("a picture of {width}x{height} px")));
    };
    let names: Vec<&str> =
        channels.iter().map(|(name, _)| *name).chain(texts.iter().map(|(name, _)| *name)).collect();
    if let Some(name) = names.iter().find(|name| !(1..=NAME_MAX).contains(&name.len()) || name.contains('\0'))
    {
        return Err(refused(format!("the name \"{name}\" does not have 1 to {NAME_MAX} bytes")));
    }
    // Readers expect channels ordered by name.
    let mut channels = channels.to_vec();
    channels.sort_by_key(|(name, _)| *name);
    if let Some(pair) = channels.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(refused(format!("two channels are called {}", pair[0].0)));
    }

    let mut bytes = header(&channels, texts, columns, rows);
    let row_bytes = channels.len() * width * size_of::<f32>();
    let block_bytes = 2 * size_of::<i32>() + row_bytes;
    let first_block = bytes.len() + height * size_of::<u64>();
    for row in 0..height {
        bytes.extend(((first_block + row * block_bytes) as u64).to_le_bytes());
    }
    to.write_all(&bytes)?;
    for row in 0..height {
        bytes.clear();
        bytes.extend((row as i32).to_le_bytes());
        bytes.extend((row_bytes as i32).to_le_bytes());
        for (_, map) in &channels {
            bytes.extend(map.row(row).iter().flat_map(|value| value.to_le_bytes()));
        }
        to.write_all(&bytes)?;
    }
    Ok(())
}

fn header(channels: &[(&str, ArrayView2<f32>)], texts: &[(&str, &str)], columns: i32, rows: i32) -> Vec<u8> {
    let integers = |values: &[i32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let window = integers(&[0, 0, columns - 1, rows - 1]);
    let one = 1f32.to_le_bytes();
    let mut list = Vec::new();
    for (name, _) in channels {
        list.extend(name.bytes());
        list.push(0);
        list.extend(integers(&[FLOAT]));
        // Flag for linear half floats (0) and three reserved bytes.
        list.extend([0; 4]);
        // No subsampling.
        list.extend(integers(&[1, 1]));
    }
    list.push(0);

    let mut bytes = [&MAGIC[..], &VERSION.to_le_bytes()].concat();
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        for text in [name, kind] {
            bytes.extend(text.bytes());
            bytes.push(0);
        }
        bytes.extend((value.len() as i32).to_le_bytes());
        bytes.extend(value);
    };
    attribute("channels", "chlist", &list);
    attribute("compression", "compression", &[0]);
    attribute("dataWindow", "box2i", &window);
    attribute("displayWindow", "box2i", &window);
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &one);
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &one);
    for (name, text) in texts {
        attribute(name, "string", text.as_bytes());
    }
    bytes.push(0);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, array};

    #[test]
    fn another_reader_returns_the_written_values() {
        use exr::prelude::*;
        let depth = array![[933.0f32, f32::NAN, -0.0], [887.5, 1e-30, f32::INFINITY]];
        let confidence = array![[1.0f32, 0.0, 0.25], [0.5, 0.125, 0.75]];
        // Not contiguous, and not in order of names.
        let turned = confidence.t().as_standard_layout().into_owned();
        let bytes = write(
            &[("confidence", turned.t()), ("Z", depth.view())],
            &[("farnear:units", "mm"), ("farnear:record", "far = \"Übung.png\"\n")],
        )
        .unwrap();
        let picture = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .pedantic()
            .non_parallel()
            .from_buffered(std::io::Cursor::new(bytes))
            .unwrap();
        let layer = picture.layer_data;
        assert_eq!(layer.size, Vec2(3, 2));
        for (channel, (name, map)) in
            layer.channel_data.list.iter().zip([("Z", &depth), ("confidence", &confidence)])
        {
            assert_eq!(channel.name.to_string(), name);
            let FlatSamples::F32(values) = &channel.sample_data else { panic!("{name} is not float") };
            assert!(values.iter().zip(map).all(|(a, b)| a.to_bits() == b.to_bits()), "{name}: {values:?}");
        }
        let text = |name: &str| match &layer.attributes.other[&Text::from(name)] {
            AttributeValue::Text(text) => String::from_utf8(text.bytes().to_vec()).unwrap(),
            other => panic!("{name}: {other:?}"),
        };
        assert_eq!(text("farnear:units"), "mm");
        assert_eq!(text("farnear:record"), "far = \"Übung.png\"\n");
    }

    #[test]
    fn rejects_values_that_the_format_cannot_hold() {
        let (map, other) = (Array2::<f32>::zeros((2, 3)), Array2::<f32>::zeros((3, 2)));
        let empty = Array2::<f32>::zeros((0, 3));
        for (channels, texts, phrase) in [
            (vec![], vec![], "0x0"),
            (vec![("Z", &empty)], vec![], "3x0"),
            (vec![("Z", &map), ("a", &other)], vec![], "channel a is 2x3, the first 3x2"),
            (vec![("Z", &map), ("Z", &map)], vec![], "two channels are called Z"),
            (vec![("", &map)], vec![], "1 to 31"),
            (vec![("Z", &map)], vec![("a name of more than thirty-one bytes", "")], "1 to 31"),
        ] {
            let channels: Vec<_> = channels.iter().map(|(name, map)| (*name, map.view())).collect();
            let error = write(&channels, &texts).unwrap_err();
            assert!(error.reason.contains(phrase), "{phrase}: {error}");
        }
    }
}
