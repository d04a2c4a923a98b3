//! A small image of each supported and each refused kind.

mod made;
mod refused;
mod tiffs;

use std::sync::LazyLock;

use super::*;
use std::io::Cursor;

use image::DynamicImage;
use ndarray::array;
use proptest::{prelude::*, sample::Index};
use tiff::encoder::TiffEncoder;

#[test]
fn pgm_and_colour_are_read() {
    let image = decode_grey(b"P5 3 2 255\n\x00\x33\xff\x01\x02\x03").unwrap();
    assert_eq!(image.pixels.dim(), (2, 3));
    assert_eq!(image.samples, Samples::Integer(8));
    assert_eq!(image.pixels[[0, 1]], 0.2);
    let colour = decode_grey(b"P6 1 1 255\n\x33\x66\x99").unwrap();
    assert!((colour.pixels[[0, 0]] - 0.4).abs() < 1e-7, "{colour:?}");
}

#[test]
fn transparent_pixels_have_no_value_unless_all_are() {
    let without_value = |alpha: [u8; 3]| {
        let image = image::RgbaImage::from_fn(3, 1, |x, _| image::Rgba([51, 51, 51, alpha[x as usize]]));
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        let pixels = decode_grey(bytes.get_ref()).unwrap().pixels;
        assert!(pixels.iter().all(|value| value.is_nan() || *value == 0.2), "{pixels}");
        [0, 1, 2].map(|x| pixels[[0, x]].is_nan())
    };
    assert_eq!(without_value([255, 0, 1]), [false, true, false]);
    assert_eq!(without_value([0; 3]), [false; 3]);
}

#[test]
fn tiff_keeps_its_values() {
    let pixels = array![[0u16, 1, 4095], [17, 200, 3000]];
    let back = decode_grey(&encode_tiff(pixels.view(), 12).unwrap()).unwrap();
    assert_eq!(back.samples, Samples::Integer(16));
    assert_eq!(back.pixels.mapv(|v| (v * 65535.0).round() as u16), pixels);
    let small = array![[0u16, 9], [255, 77]];
    let back = decode_grey(&encode_tiff(small.view(), 8).unwrap()).unwrap();
    assert_eq!(back.samples, Samples::Integer(8));
    assert_eq!(back.pixels.mapv(|v| (v * 255.0).round() as u16), small);
}

#[test]
fn png_keeps_its_bits() {
    let pixels = array![[0u16, 1, 4095], [17, 200, 3000]];
    let back = decode_grey(&encode_png(pixels.view(), 12).unwrap()).unwrap();
    assert_eq!(back.samples, Samples::Integer(16));
    assert_eq!(back.pixels.mapv(|v| (v * 65535.0).round() as u16 >> 4), pixels);
    let small = array![[0u16, 9], [255, 77]];
    let back = decode_grey(&encode_png(small.view(), 8).unwrap()).unwrap();
    assert_eq!(back.samples, Samples::Integer(8));
    assert_eq!(back.pixels.mapv(|v| (v * 255.0).round() as u16), small);
}

#[test]
fn tiff_with_16_bits_and_float_is_read() {
    use tiff::encoder::{
        TiffEncoder,
        colortype::{Gray16, Gray32Float},
    };
    let mut sixteen = Cursor::new(Vec::new());
    TiffEncoder::new(&mut sixteen).unwrap().write_image::<Gray16>(2, 1, &[65535, 0]).unwrap();
    assert_eq!(decode_grey(sixteen.get_ref()).unwrap().pixels, array![[1.0, 0.0]]);
    let mut float = Cursor::new(Vec::new());
    TiffEncoder::new(&mut float).unwrap().write_image::<Gray32Float>(1, 2, &[933.5, -2.0]).unwrap();
    let image = decode_grey(float.get_ref()).unwrap();
    assert_eq!((image.pixels, image.samples), (array![[933.5], [-2.0]], Samples::Float));
}

#[test]
fn names_files_that_are_not_images() {
    let missing = read_grey(Path::new("no-such.png")).unwrap_err();
    assert!(missing.to_string().starts_with("cannot read no-such.png"), "{missing}");
    let text = read_grey(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"))).unwrap_err();
    assert!(matches!(text, ImageError::Format { .. }), "{text}");
    let mut cut = encode_png(Array2::from_elem((9, 9), 7).view(), 8).unwrap();
    cut.truncate(cut.len() / 2);
    assert!(decode_grey(&cut).is_err());
}

proptest! {
    #[test]
    fn broken_files_do_not_panic(kind in 0..5usize, tail in proptest::collection::vec(any::<u8>(), 0..200)) {
        let heads: [&[u8]; 5] = [b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xe0", b"II*\0", b"MM\0*", b"P5 "];
        let bytes = [heads[kind], &tail].concat();
        let _ = decode_grey(&bytes);
    }

    #[test]
    fn damaged_pictures_are_read_or_refused(
        which in any::<Index>(),
        hits in proptest::collection::vec((any::<Index>(), any::<u8>()), 1..6),
        lost in proptest::option::of(any::<Index>()),
    ) {
        let mut bytes = which.get(&PICTURES).clone();
        for (place, byte) in hits {
            *place.get_mut(&mut bytes) = byte;
        }
        if let Some(lost) = lost {
            bytes.truncate(lost.index(bytes.len()));
        }
        if let Ok(image) = decode_grey(&bytes) {
            let right = |value: &f32| value.is_nan() || (0.0..=1.0).contains(value);
            prop_assert!(image.samples == Samples::Float || image.pixels.iter().all(right));
        }
    }
}

static PICTURES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    use image::{ImageFormat, Luma, Rgb, RgbImage, codecs::jpeg::JpegEncoder};
    use tiff::encoder::{Compression, colortype};
    let pixels = Array2::from_shape_fn((5, 7), |(row, column)| (500 * row + 70 * column) as u16);
    let colour = RgbImage::from_fn(7, 5, |x, y| Rgb([30 * x as u8, 40 * y as u8, 99]));
    let grey = image::GrayImage::from_fn(7, 5, |x, y| Luma([30 * x as u8 + y as u8]));
    let mut jpeg = Vec::new();
    JpegEncoder::new(&mut jpeg).encode_image(&colour).unwrap();
    let as_pnm = |image: DynamicImage| {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, ImageFormat::Pnm).unwrap();
        bytes.into_inner()
    };
    let packed = |compression| {
        let mut bytes = Cursor::new(Vec::new());
        let mut file = TiffEncoder::new(&mut bytes).unwrap().with_compression(compression);
        file.write_image::<colortype::RGB8>(7, 5, colour.as_raw()).unwrap();
        bytes.into_inner()
    };
    let mut pictures = vec![
        encode_png(pixels.view(), 12).unwrap(),
        encode_tiff(pixels.view(), 8).unwrap(),
        encode_tiff(pixels.view(), 12).unwrap(),
        crate::map::tiff(pixels.mapv(f32::from).view()).unwrap(),
        jpeg,
        as_pnm(colour.clone().into()),
        as_pnm(grey.into()),
    ];
    pictures.extend([Compression::Lzw, Compression::Packbits].map(packed));
    pictures
});
