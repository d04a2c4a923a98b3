//! TIFF variants of microscopes, cameras and scientific software.

use ndarray::{Array2, array};

use super::super::*;
use super::made::{CLASSIC, Layout, Page, tiff};

fn ramp() -> Vec<u8> {
    (0..12).map(|i| 20 * i).collect()
}

fn read(bytes: &[u8]) -> Array2<f32> {
    decode_grey(bytes).unwrap().pixels.mapv(|v| (255.0 * v).round())
}

#[test]
fn both_byte_orders_and_big_tiff_are_read() {
    for (little, big) in [(true, false), (false, false), (true, true), (false, true)] {
        let bytes = tiff(Layout { little, big }, &[Page::grey(4, 3, 8, ramp())]);
        let image = read(&bytes);
        assert_eq!((image.dim(), image[(2, 3)], image[(0, 1)]), ((3, 4), 220.0, 20.0), "{little} {big}");
    }
}

#[test]
fn palettes_are_read_as_their_colours() {
    let ramp = |shift: u16| (0..3 * 256).map(|at| at % 256 * shift).collect::<Vec<u16>>();
    for (little, big) in [(true, false), (false, false), (true, true), (false, true)] {
        for shift in [1, 256, 257] {
            let page = Page::grey(2, 1, 8, vec![7, 200]).with(262, &[3]).with(320, &ramp(shift));
            let bytes = tiff(Layout { little, big }, &[page]);
            assert_eq!(read(&bytes), array![[7.0, 200.0]], "{little} {big} {shift}");
            assert!(!decode_grey(&bytes).unwrap().colour);
        }
    }
    let mut colours = [0_u16; 3 * 16];
    [colours[2], colours[16 + 2], colours[32 + 2]] = [60 << 8, 90 << 8, 120 << 8];
    let page = Page::grey(3, 1, 4, vec![0x20, 0x20]).with(262, &[3]).with(320, &colours);
    let bytes = tiff(CLASSIC, &[page]);
    assert_eq!(read(&bytes), array![[90.0, 0.0, 90.0]]);
    assert!(decode_grey(&bytes).unwrap().colour);
}

#[test]
fn palettes_of_image_j_are_for_display_only() {
    let inverse: Vec<u16> = (0..3 * 256).map(|at| if at < 256 { 65535 - 257 * at } else { 0 }).collect();
    let page = Page::grey(2, 1, 8, vec![7, 200]).with(262, &[3]).with(320, &inverse);
    for program in ["ImageJ=1.54f\nimages=2\n", "SCIFIO=0.46.0\nimages=2\n"] {
        let first = Page { texts: vec![(270, program.into())], ..page.clone() };
        let bytes = tiff(CLASSIC, &[first, page.clone()]);
        for number in [1, 2] {
            let decoded = decode_with(&bytes, Some(number), Signed::Refused).unwrap();
            let pixels = decoded.grey(&ReadSettings::default()).unwrap().pixels;
            assert_eq!(pixels.mapv(|v| (255.0 * v).round()), array![[7.0, 200.0]], "{program} {number}");
        }
    }
    // Of a picture: in no order, each channel in another.
    let leaping: Vec<u16> =
        (0..3 * 256_u32).map(|at| (at * (97 + 2 * (at / 256)) % 256 * 257) as u16).collect();
    let colours = Page { texts: vec![(270, "ImageJ=1.54f\n".into())], ..page }.with(320, &leaping);
    assert!(decode_grey(&tiff(CLASSIC, &[colours])).unwrap().colour);
}

#[test]
fn a_tiff_may_hold_the_mark_of_another_format() {
    for (at, mark) in [(128, b"DICM".as_slice()), (208, b"MAP DA\0\0")] {
        let mut bytes = tiff(CLASSIC, &[Page::grey(16, 16, 8, vec![7; 256])]);
        bytes[at..at + mark.len()].copy_from_slice(mark);
        assert_eq!(read(&bytes).dim(), (16, 16), "{at}");
    }
}

#[test]
fn lzw_data_without_an_end_have_one_remedy() {
    use tiff::encoder::{Compression, TiffEncoder, colortype::Gray8};
    let pixels: Vec<u8> = (0..40 * 30).map(|i| (i * i % 251) as u8).collect();
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut file = TiffEncoder::new(&mut bytes).unwrap().with_compression(Compression::Lzw);
    file.write_image::<Gray8>(40, 30, &pixels).unwrap();
    let mut bytes = bytes.into_inner();
    assert!(decode_grey(&bytes).is_ok());
    // Half of the strip's bytes (tag 279).
    let at = bytes.windows(4).rposition(|four| four == [23, 1, 4, 0]).unwrap() + 8;
    let length = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    bytes[at..at + 4].copy_from_slice(&(length / 2).to_le_bytes());
    let said = decode_grey(&bytes).unwrap_err();
    assert!(said.contains("LZW data have no end") && !said.contains("tiffcp"), "{said}");
}

#[test]
fn lzw_data_whose_pixels_are_whole_need_no_end() {
    // Clear, 10, 20, 30 and 40 in 9 bits each.
    let codes = vec![0x80, 0x02, 0x82, 0x81, 0xe1, 0x40];
    let bytes = tiff(CLASSIC, &[Page::grey(4, 1, 8, codes).with(259, &[5])]);
    assert_eq!(read(&bytes), ndarray::array![[10.0, 20.0, 30.0, 40.0]]);
}

#[test]
fn bytes_of_a_text_that_are_not_utf_8_are_latin_1() {
    let unit = |letter: &[u8]| {
        let page = Page { texts: vec![(270, "unit=~~m \u{b5}".into())], ..Page::grey(1, 1, 8, vec![7]) };
        let mut bytes = tiff(CLASSIC, &[page]);
        let at = bytes.windows(2).position(|two| two == b"~~").unwrap();
        bytes[at..at + 2].copy_from_slice(letter);
        tiff_tags::directories(&bytes[..]).unwrap()[0].description.clone().unwrap()
    };
    let units = [unit(b"\xb5m"), unit("\u{b5}".as_bytes())];
    assert_eq!(units, ["unit=\u{b5}mm \u{b5}", "unit=\u{b5}m \u{b5}"]);
}

#[test]
fn planar_colour_is_read_plane_by_plane() {
    let planes = [[30_u8, 60], [60, 90], [90, 30]].map(Vec::from).to_vec();
    let page = Page { strips: planes, ..Page::grey(2, 1, 8, Vec::new()) };
    let page = page.with(262, &[2]).with(277, &[3]).with(258, &[8, 8, 8]).with(284, &[2]);
    assert_eq!(read(&tiff(CLASSIC, std::slice::from_ref(&page))), array![[60.0, 60.0]]);
    let settings = ReadSettings { grey: Grey::Green, ..ReadSettings::default() };
    let green = decode(&tiff(CLASSIC, &[page])).unwrap().grey(&settings).unwrap();
    assert!(green.colour);
    assert_eq!(green.pixels.mapv(|v| (255.0 * v).round()), array![[60.0, 90.0]]);
}

#[test]
fn planes_in_tiles_are_read() {
    // Two tiles across, padded to the right, and two down.
    let (width, height) = (20, 32);
    let value = |x: usize, y: usize, plane: usize| (3 * x + 2 * y + 50 * plane) as u8;
    let tile = |index: usize| {
        let (plane, row, column) = (index / 4, index / 2 % 2, index % 2);
        (0..256).map(|at| value(16 * column + at % 16, 16 * row + at / 16, plane)).collect()
    };
    let page = Page { strips: (0..12).map(tile).collect(), ..Page::grey(width, height, 8, Vec::new()) };
    let page = page.with(262, &[2]).with(277, &[3]).with(258, &[8, 8, 8]).with(284, &[2]);
    let found = read(&tiff(CLASSIC, &[page.with(322, &[16]).with(323, &[16])]));
    assert_eq!(found, Array2::from_shape_fn((32, 20), |(y, x)| f32::from(value(x, y, 1))));
}

#[test]
fn colours_with_a_sample_of_unknown_meaning_are_read() {
    let pixels = vec![30, 60, 90, 7, 60, 90, 120, 8];
    let page = Page::grey(2, 1, 8, pixels).with(262, &[2]).with(277, &[4]).with(258, &[8; 4]);
    for extra in [0, 1, 2] {
        assert_eq!(
            read(&tiff(CLASSIC, &[page.clone().with(338, &[extra])])),
            array![[60.0, 90.0]],
            "{extra}"
        );
    }
    for (tag, value) in [(317, 2), (322, 16)] {
        let page = page.clone().with(338, &[0]).with(323, &[16]).with(tag, &[value]);
        let refused = decode_grey(&tiff(CLASSIC, &[page])).unwrap_err();
        assert!(refused.contains("ExtraSamples 0"), "{tag}: {refused}");
    }
    let planes = [[30_u8, 60], [60, 90], [90, 120], [0, 8]].map(Vec::from).to_vec();
    let page = Page { strips: planes, ..page.with(284, &[2]).with(338, &[0]) };
    assert_eq!(read(&tiff(CLASSIC, std::slice::from_ref(&page))), array![[60.0, 90.0]]);
    let with_alpha = read(&tiff(CLASSIC, &[page.with(338, &[2])]));
    assert!(with_alpha[(0, 0)].is_nan() && with_alpha[(0, 1)] == 90.0, "{with_alpha}");
}

#[test]
fn a_fourth_sample_counts_only_if_it_is_stated_as_alpha() {
    let page = Page { strips: vec![vec![30, 60, 90, 0, 60, 90, 120, 8]], ..Page::grey(2, 1, 8, Vec::new()) };
    let page = page.with(262, &[2]).with(258, &[8, 8, 8, 8]).with(277, &[4]);
    assert_eq!(read(&tiff(CLASSIC, std::slice::from_ref(&page))), array![[60.0, 90.0]]);
    assert!(read(&tiff(CLASSIC, &[page.with(338, &[2])]))[(0, 0)].is_nan());
}

#[test]
fn bool_arrays_of_tifffile_are_white_where_true() {
    let page = Page::grey(3, 1, 1, vec![0b1010_0000]).with(262, &[0]);
    assert_eq!(read(&tiff(CLASSIC, std::slice::from_ref(&page))), array![[0.0, 255.0, 0.0]]);
    let texts = vec![(270, r#"{"shape": [1, 3]}"#.to_owned())];
    assert_eq!(read(&tiff(CLASSIC, &[Page { texts, ..page }])), array![[255.0, 0.0, 255.0]]);
}

#[test]
fn half_float_and_few_bits_are_read() {
    // 1.0 and -0.5 in half precision.
    let half = Page::grey(2, 1, 16, vec![0x00, 0x3c, 0x00, 0xb8]).with(339, &[3]);
    let image = decode_grey(&tiff(CLASSIC, &[half])).unwrap();
    assert_eq!((image.pixels, image.samples), (array![[1.0, -0.5]], Samples::Float));
    let bits = Page::grey(3, 2, 1, vec![0b1010_0000, 0b0110_0000]);
    assert_eq!(read(&tiff(CLASSIC, &[bits])), array![[255.0, 0.0, 255.0], [0.0, 255.0, 255.0]]);
    let nibbles = Page::grey(3, 1, 4, vec![0x0f, 0x30]);
    assert_eq!(read(&tiff(CLASSIC, &[nibbles])), array![[0.0, 255.0, 51.0]]);
    let long = Page::grey(1, 1, 32, u32::MAX.to_le_bytes().to_vec());
    assert_eq!(read(&tiff(CLASSIC, &[long])), array![[255.0]]);
}

#[test]
fn a_file_of_several_pages_needs_a_page_number() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stack.tif");
    let pages: Vec<Page> = (0..3).map(|i| Page::grey(1, 1, 8, vec![10 * i])).collect();
    fs::write(&path, tiff(CLASSIC, &pages)).unwrap();
    let refused = read_grey(&path).unwrap_err().to_string();
    assert!(refused.contains("3 images") && refused.ends_with("FILE#1 to FILE#3"), "{refused}");
    let page = |number: &str| read_grey(&folder.path().join(format!("stack.tif#{number}")));
    assert_eq!(page("3").unwrap().pixels[(0, 0)], 20.0 / 255.0);
    assert!(page("4").unwrap_err().to_string().contains("1 to 3"));
    assert!(page("0").is_err());
    assert_eq!(page_count(&path).unwrap(), 3);
    // A file whose name has such an ending is that file.
    fs::write(folder.path().join("odd#2"), tiff(CLASSIC, &pages[2..])).unwrap();
    assert_eq!(read_grey(&folder.path().join("odd#2")).unwrap().pixels[(0, 0)], 20.0 / 255.0);
}

#[test]
fn skips_previews_next_to_the_image() {
    let image = Page::grey(4, 3, 8, ramp());
    let preview = Page::grey(2, 1, 8, vec![1, 2]).with(254, &[1]);
    for pages in [[image.clone(), preview.clone()], [preview, image]] {
        assert_eq!(read(&tiff(CLASSIC, &pages)).dim(), (3, 4));
    }
}

#[test]
fn applies_the_orientation() {
    // 1 2 3
    // 4 5 6
    let stored = Page::grey(3, 2, 8, vec![1, 2, 3, 4, 5, 6]);
    let expected = [
        (2, array![[3., 2., 1.], [6., 5., 4.]]),
        (3, array![[6., 5., 4.], [3., 2., 1.]]),
        (4, array![[4., 5., 6.], [1., 2., 3.]]),
        (5, array![[1., 4.], [2., 5.], [3., 6.]]),
        (6, array![[4., 1.], [5., 2.], [6., 3.]]),
        (7, array![[6., 3.], [5., 2.], [4., 1.]]),
        (8, array![[3., 6.], [2., 5.], [1., 4.]]),
    ];
    for (orientation, expected) in expected {
        let bytes = tiff(CLASSIC, &[stored.clone().with(274, &[orientation])]);
        assert_eq!(read(&bytes), expected, "{orientation}");
    }
    // As libtiff does, integers of any size count, and nothing else does.
    let bytes = tiff(CLASSIC, &[stored.clone().with(274, &[6])]);
    let entry = bytes.windows(4).position(|four| four == [18, 1, 3, 0]).unwrap();
    for (kind, value, right) in [
        (1, 6, true),
        (4, 6, true),
        (9, 6, true),
        (2, 6, false),
        (5, 6, false),
        (11, 6, false),
        (4, 262, false),
    ] {
        let mut bytes = bytes.clone();
        bytes[entry + 2] = kind;
        bytes[entry + 8..entry + 12].copy_from_slice(&u32::to_le_bytes(value));
        let dim = if right { (3, 2) } else { (2, 3) };
        assert_eq!(read(&bytes).dim(), dim, "{kind} {value}");
    }
}

#[test]
fn finds_the_white_level_of_fewer_bits() {
    let codes = |codes: &[u16]| codes.iter().flat_map(|code| code.to_le_bytes()).collect::<Vec<u8>>();
    let white =
        |page: Page| decode_grey(&tiff(CLASSIC, &[page])).unwrap().white_level.map(|v| (v * 65535.0).round());
    let saturated = [4095, 4095, 4095, 4095, 17, 900];
    assert_eq!(white(Page::grey(6, 1, 16, codes(&saturated))), Some(4095.0));
    assert_eq!(white(Page::grey(6, 1, 16, codes(&saturated.map(|v| v << 4)))), Some(65520.0));
    assert_eq!(white(Page::grey(6, 1, 16, codes(&saturated.map(|v| v / 4)))), Some(1023.0));
    // A few defective pixels lie above.
    for (defective, expected) in [(0, Some(4095.0)), (4, Some(4095.0)), (40, None)] {
        let camera = (0..100_000 - defective).map(|i| if i < 400 { 4095 } else { i as u16 % 3000 });
        let pixels: Vec<u16> = camera.chain(vec![65535; defective]).collect();
        assert_eq!(white(Page::grey(50_000, 2, 16, codes(&pixels))), expected, "{defective}");
    }
    // A single pixel at that code may be chance; other codes are no camera's limit.
    assert_eq!(white(Page::grey(6, 1, 16, codes(&[4095, 4094, 1, 2, 3, 4]))), None);
    assert_eq!(white(Page::grey(6, 1, 16, codes(&[3000; 6]))), None);
    assert_eq!(white(Page::grey(6, 1, 16, codes(&[3, 4, 5, 6, 7, 8])).with(281, &[16383])), Some(16383.0));
    assert_eq!(white(Page::grey(6, 1, 16, codes(&[3, 4, 5, 6, 7, 3001])).with(281, &[3001])), None);
    let asked = ReadSettings { white_level: Some(3000), ..ReadSettings::default() };
    let bytes = tiff(CLASSIC, &[Page::grey(2, 1, 16, codes(&[3000, 1500]))]);
    let image = decode(&bytes).unwrap().grey(&asked).unwrap();
    let image = image.clone().relative_to(image.white_level.unwrap());
    assert_eq!(image.samples, Samples::Integer(12));
    assert!((image.pixels[(0, 1)] - 0.5).abs() < 1e-6 && image.pixels[(0, 0)] == 1.0);
    assert!(decode(&bytes).unwrap().grey(&ReadSettings { white_level: Some(70_000), ..asked }).is_err());
}

#[test]
fn written_files_keep_the_white_level() {
    let pixels = array![[0u16, 1, 1022], [17, 200, 300]];
    for bytes in [encode_tiff(pixels.view(), 10).unwrap(), encode_png(pixels.view(), 10).unwrap()] {
        let image = decode_grey(&bytes).unwrap();
        let image = image.clone().relative_to(image.white_level.expect("a white level"));
        assert_eq!(image.samples, Samples::Integer(10));
        assert_eq!(image.pixels.mapv(|v| (v * 1023.0).round() as u16), pixels);
    }
    assert_eq!(decode_grey(&encode_tiff(pixels.view(), 16).unwrap()).unwrap().white_level, None);
}

#[test]
fn deflate_data_end_in_their_checksum() {
    let pixels: Vec<u8> = (0..100).map(|index| index + 1).collect();
    let (mut sum, mut of_sums) = (1_u32, 0);
    for value in &pixels {
        sum += u32::from(*value);
        of_sums += sum;
    }
    // A stored block (RFC 1950 and 1951).
    let head = [0x78_u8, 1, 1, 100, 0, !100, 0xff];
    let mut strip = [&head, &pixels[..], &((of_sums % 65_521) << 16 | sum).to_be_bytes()].concat();
    let file = |strip: &[u8]| tiff(CLASSIC, &[Page::grey(10, 10, 8, strip.to_vec()).with(259, &[8])]);
    assert_eq!(read(&file(&strip))[(9, 9)], 100.0);
    // Padding that the directory follows.
    let padded = [&strip[..], &[0; 64]].concat();
    assert_eq!(read(&file(&padded))[(9, 9)], 100.0);
    let count = strip.len();
    strip[count - 64..].fill(0);
    let cut = [file(&strip), vec![0; 64]].concat();
    assert!(decode_grey(&cut).unwrap_err().contains("incomplete"));
}

#[test]
fn pixels_without_a_value_are_not_white() {
    assert_eq!([0.1, 0.25, 0.3].map(|value| relative(value, 0.25)), [0.4, 1.0, 1.0]);
    assert!(relative(f32::NAN, 0.25).is_nan());
}

#[test]
fn images_of_one_camera_share_the_lowest_white_level() {
    let image = |white_level, value| GreyImage {
        pixels: array![[value]],
        samples: Samples::Integer(16),
        colour: false,
        white_level,
        coding_variance: 0.0,
    };
    let of = |images: &[GreyImage]| shared_white_level(images.iter(), false);
    let white = 4095.0 / 65535.0;
    assert_eq!(of(&[image(Some(white), white), image(None, 0.05)]), Some(white));
    assert_eq!(of(&[image(Some(white), white), image(None, 0.3)]), None);
    assert_eq!(of(&[image(None, 0.25), image(None, 0.3)]), None);
    let mut stated = SharedWhiteLevel::default();
    [image(Some(0.25), 0.2), image(Some(0.25), 0.9)].iter().for_each(|image| stated.add(image));
    assert_eq!((stated.get(true), stated.get(false)), (Some(0.25), None));
}
