//! Refused files with their remedies.

use super::super::*;
use super::made::{CLASSIC, Page, bmp, jpeg, jpeg_turned, tiff};

fn refusal(bytes: &[u8]) -> String {
    decode_grey(bytes).expect_err("a refusal")
}

#[test]
fn rejects_a_truncated_jpeg() {
    let whole = jpeg(64, 48);
    assert!(decode_grey(&whole).is_ok());
    // Data after the end is ignored.
    assert!(decode_grey(&[&whole[..], b"preview"].concat()).is_ok());
    for end in [whole.len() - 2, whole.len() - 1, whole.len() * 3 / 4, whole.len() / 2] {
        assert!(refusal(&whole[..end]).contains("incomplete"), "{end}");
    }
    // The file ends properly although its data were cut.
    for end in [whole.len() / 2, whole.len() * 3 / 4] {
        let closed = [&whole[..end], &[0xff, 0xd9]].concat();
        assert!(refusal(&closed).contains("incomplete"), "{end}");
    }
}

#[test]
fn a_progressive_jpeg_needs_the_scans_of_all_bits() {
    let frame = [255, 0xc2, 0, 11, 8, 0, 8, 0, 8, 1, 1, 0x11, 0];
    let scan = |first: u8, last: u8, bits: u8| [255, 0xda, 0, 8, 1, 1, 0, first, last, bits, 0x55];
    let lacks = |scans: &[[u8; 11]]| {
        complete::lacks_data(&[&[255, 0xd8], &frame[..], scans.as_flattened(), &[255, 0xd9]].concat())
    };
    let all = [scan(0, 0, 1), scan(1, 63, 2), scan(1, 63, 0x21), scan(0, 0, 0x10), scan(1, 63, 0x10)];
    assert!(!lacks(&all));
    for count in 0..all.len() {
        assert!(lacks(&all[..count]), "{count}");
    }
}

#[test]
fn zeros_in_a_jpeg_are_a_hole_where_they_encode_coefficients() {
    let whole = jpeg(64, 48);
    assert!(!complete::lacks_data(&whole));
    let mut hole = whole.clone();
    let end = hole.len() - 2;
    hole[end - 200..end - 100].fill(0);
    assert!(complete::lacks_data(&hole) && refusal(&hole).contains("incomplete"));
    let padded = |bytes: usize| [&whole[..end], &vec![0; bytes], &[0xff, 0xd9]].concat();
    assert_eq!(decode_grey(&padded(100)).unwrap(), decode_grey(&whole).unwrap());
    assert!(complete::lacks_data(&padded(5000)));
    // In a table of a program, zeros may be the end of each block.
    let with_first_code = |value: u8| {
        let table = [&[255, 0xc4, 0, 20, 0x10, 0, 1][..], &[0; 14], &[value]].concat();
        let scan = [255, 0xda, 0, 8, 1, 1, 0, 0, 63, 0];
        [&[255, 0xd8], &table[..], &scan, &[0; 100], &[1, 255, 0xd9]].concat()
    };
    assert!(complete::lacks_data(&with_first_code(0x01)));
    assert!(!complete::lacks_data(&with_first_code(0x00)));
}

#[test]
fn rejects_truncated_files_of_every_format() {
    let grey = image::GrayImage::from_fn(40, 30, |x, y| image::Luma([(x * 5 + y) as u8]));
    let pixels = ndarray::Array2::from_shape_fn((30, 40), |(y, x)| (x * 5 + y) as u16);
    let pgm = [b"P5 40 30 255\n".as_slice(), grey.as_raw()].concat();
    let files = [
        encode_png(pixels.view(), 8).unwrap(),
        encode_tiff(pixels.view(), 12).unwrap(),
        tiff(CLASSIC, &[Page::grey(40, 30, 8, grey.as_raw().clone())]),
        pgm,
        bmp(grey.into()),
    ];
    for (number, whole) in files.iter().enumerate() {
        assert_eq!(decode_grey(whole).unwrap().pixels.dim(), (30, 40), "{number}");
        // The last chunk of a PNG has no pixels.
        for lost in [whole.len() / 10, whole.len() / 2, whole.len() - 20] {
            let said = refusal(&whole[..whole.len() - lost]);
            assert!(said.contains("incomplete"), "{number}, {lost} bytes lost: {said}");
        }
    }
}

#[test]
fn rejects_a_pam_file_whose_samples_have_no_stated_kind() {
    let pam = |kind: &str, largest: u32, samples: &[u8]| {
        let header = format!("P7\nWIDTH 2\nHEIGHT 1\nDEPTH 1\nMAXVAL {largest}\n{kind}ENDHDR\n");
        [header.as_bytes(), samples].concat()
    };
    let wide = [0x0f, 0xff, 0x08, 0x00];
    assert!(refusal(&pam("", 4095, &wide)).contains("TUPLTYPE"));
    let pixels = |bytes: &[u8]| decode_grey(bytes).unwrap().pixels;
    assert_eq!(pixels(&pam("TUPLTYPE GRAYSCALE\n", 4095, &wide))[[0, 0]], 1.0);
    assert_eq!(pixels(&pam("", 255, &[255, 0]))[[0, 0]], 1.0);
}

#[test]
fn rejects_a_pgm_file_whose_pixels_do_not_begin_behind_its_header() {
    let pgm = |between: &str, padding: &[u8]| {
        [format!("P5\n2 1\n65535{between}").as_bytes(), &[0x80, 0x01, 0xff, 0xff], padding].concat()
    };
    for between in ["\r\n", "\n# a comment\n"] {
        let mut file = pgm(between, b"");
        assert!(refusal(&file).contains("data follow its pixels"), "{between:?}");
        // As padding would be.
        let count = file.len();
        file[count - between.len() + 1..].fill(0);
        assert!(refusal(&file).contains("data follow its pixels"), "{between:?}");
    }
    for padding in ["", "\n", "\r\n", "\0\0"] {
        let pixels = decode_grey(&pgm("\n", padding.as_bytes())).unwrap().pixels;
        assert_eq!(pixels[[0, 1]], 1.0, "{padding:?}");
    }
}

#[test]
fn rejects_reversed_bits_and_padded_tiles_of_planes() {
    let reversed = tiff(CLASSIC, &[Page::grey(4, 3, 8, vec![1; 12]).with(266, &[2])]);
    assert!(refusal(&reversed).contains("FillOrder"));
    let plain = tiff(CLASSIC, &[Page::grey(4, 3, 8, vec![1; 12]).with(266, &[1])]);
    assert!(decode_grey(&plain).is_ok());
    let planes = Page::grey(16, 17, 8, vec![1; 768]).with(258, &[8, 8, 8]).with(262, &[2]).with(277, &[3]);
    let tiled = planes.with(284, &[2]).with(322, &[16]).with(323, &[16]);
    assert!(refusal(&tiff(CLASSIC, &[tiled])).contains("separate planes in tiles"));
}

#[test]
fn rejects_raw_files_with_a_remedy() {
    let page = || Page::grey(4, 3, 8, vec![0; 12]);
    let dng = tiff(CLASSIC, &[page().with(254, &[1]).with(50706, &[0x0401])]);
    let mosaic = tiff(CLASSIC, &[page().with(262, &[32803])]);
    let mut cr2 = tiff(CLASSIC, &[page()]);
    cr2[8..10].copy_from_slice(b"CR");
    for raw in [
        dng,
        mosaic,
        cr2,
        b"FUJIFILMCCD-RAW 0201".to_vec(),
        b"\0\0\0\x18ftypcrx \0".to_vec(),
        b"IIU\0\x18".to_vec(),
        b"\0MRM\0\x01".to_vec(),
        b"II\x1a\0\0\0HEAPCCDR\x02\0".to_vec(),
    ] {
        let said = refusal(&raw);
        assert!(said.contains("raw file") && said.contains("develop"), "{said}");
    }
    // As in a NEF: a thumbnail first, the image in a sub-directory.
    let preview = refusal(&tiff(CLASSIC, &[page().with(254, &[1])]));
    assert!(preview.contains("preview of 4x3 px") && preview.contains("develop"), "{preview}");
}

/// A file whose second page is in a sub-directory of the first.
fn with_sub_image(page: Page, sub: Page) -> Vec<u8> {
    let mut file = tiff(CLASSIC, &[page.with(330, &[0]), sub]);
    // Point tag 330 of the first directory to the second, and end the chain after the first.
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    let first = word(4);
    let count = usize::from(u16::from_le_bytes([file[first], file[first + 1]]));
    let link = first + 2 + 12 * count;
    let second = word(link) as u32;
    let entry =
        (0..count).map(|i| first + 2 + 12 * i).find(|at| file[*at..at + 2] == 330_u16.to_le_bytes()).unwrap();
    file[entry + 2..entry + 4].copy_from_slice(&4_u16.to_le_bytes());
    file[entry + 8..entry + 12].copy_from_slice(&second.to_le_bytes());
    file[link..link + 4].fill(0);
    file
}

#[test]
fn rejects_a_page_whose_image_is_in_a_sub_directory() {
    let page = || Page::grey(2, 1, 8, vec![0; 2]);
    let sub = Page::grey(400, 300, 8, vec![0; 9]);
    let said = refusal(&with_sub_image(page(), sub.clone()));
    assert!(said.contains("preview of 2x1 px") && said.contains("400x300"), "{said}");
    // A thumbnail may be larger than its image.
    let thumbnail = sub.with(254, &[1]);
    assert_eq!(decode_grey(&with_sub_image(page(), thumbnail)).unwrap().pixels.dim(), (1, 2));
}

#[test]
fn names_unsupported_formats() {
    for (bytes, name) in [
        (&b"\0\0\0\x18ftypheic\0\0"[..], "HEIC"),
        (b"GIF89a\0\0", "GIF"),
        (b"RIFF\0\0\0\0WEBPVP8 ", "WebP"),
        (b"\xff\x0a\0\0", "JPEG XL"),
        (b"\0\0\0\x18ftyphevx\0\0\0\0", "HEIC"),
        (b"\0\0\0\x1cftypmif1\0\0\0\0mif1heic", "HEIC"),
        (b"\0\0\0\x1cftypmif1\0\0\0\0mif1avif", "AVIF"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "OLE"),
        (b"\0\0\0\x03\0\0\x10\0\0\0\0\x01", "microscope"),
        (b"NRRD0005\n", "NRRD"),
        (b"SDPX\0\0", "DPX"),
        (&[&[0_u8; 128][..], b"DICM"].concat(), "DICOM"),
        (&[&[1_u8; 208][..], b"MAP DA\0\0"].concat(), "MRC"),
    ] {
        assert!(refusal(bytes).contains(name) && refusal(bytes).contains("convert"), "{name}");
    }
    let jpeg_in_tiff = tiff(CLASSIC, &[Page::grey(4, 3, 8, vec![0; 12]).with(259, &[50000])]);
    assert!(refusal(&jpeg_in_tiff).contains("zstd compression"));
    let signed = tiff(CLASSIC, &[Page::grey(4, 3, 8, vec![0; 12]).with(339, &[2])]);
    assert!(refusal(&signed).contains("signed"));
    let huge = tiff(CLASSIC, &[Page::grey(65535, 65535, 16, vec![0; 12])]);
    assert!(refusal(&huge).contains("65535x65535"));
}

#[test]
fn names_unsupported_pixels_of_a_tiff() {
    let page = || Page::grey(4, 3, 8, vec![0; 96]);
    let float = || page().with(258, &[32]).with(339, &[3]);
    for (page, expected) in [
        (page().with(258, &[12]), "12 bits"),
        (page().with(258, &[64]), "64 bits"),
        (page().with(258, &[4; 3]).with(262, &[2]).with(277, &[3]), "4 bits"),
        (page().with(262, &[3]), "palette"),
        (page().with(262, &[6]), "YCbCr"),
        (page().with(258, &[64]).with(339, &[6]), "complex"),
        (float().with(262, &[0]), "white is 0"),
        (page().with(32997, &[5]), "volume of 5 slices"),
    ] {
        let refused = refusal(&tiff(CLASSIC, &[page]));
        assert!(refused.contains(expected) && !refused.contains("unsupported"), "{expected}: {refused}");
    }
    assert!(decode_grey(&tiff(CLASSIC, &[float()])).is_ok());
}

#[test]
fn names_codings_of_jpeg_that_are_not_read() {
    let whole = jpeg(16, 16);
    let frame = whole.windows(2).position(|two| two == [0xff, 0xc0]).unwrap();
    for (marker, bits, expected) in [
        (0xc9, 8, "arithmetic"),
        (0xc3, 16, "lossless"),
        (0xc5, 8, "hierarchical"),
        (0xc1, 12, "12 bits"),
        (0xf7, 8, "JPEG-LS"),
    ] {
        let mut other = whole.clone();
        (other[frame + 1], other[frame + 4]) = (marker, bits);
        let refused = refusal(&other);
        assert!(refused.contains(expected) && refused.contains("convert"), "{refused}");
    }
}

#[test]
fn rejects_subsampled_colours_in_separate_scans() {
    let frame = |sampling: u8| [255, 0xc0, 0, 17, 8, 0, 16, 0, 16, 3, 1, sampling, 0, 2, 17, 0, 3, 17, 0];
    for (sampling, refused) in [(0x22, true), (0x12, true), (0x21, false), (0x11, false)] {
        let scan = [255, 0xda, 0, 8, 1, 1, 0, 0, 63, 0, 255, 0xd9];
        let said = refusal(&[&[255, 0xd8], &frame(sampling)[..], &scan].concat());
        assert_eq!(said.contains("separate scans"), refused, "{sampling:x} {said}");
    }
}

#[test]
fn skips_stray_bytes_between_the_segments_of_a_jpeg() {
    let whole = jpeg_turned(48, 32, 6);
    let pixels = decode_grey(&whole).unwrap().pixels;
    let at = |marker: u8| whole.windows(2).position(|two| two == [0xff, marker]).unwrap();
    for place in [2, at(0xdb), at(0xc0), at(0xc4), at(0xda)] {
        for stray in [&[][..], &[0], &[0xff], &[1, 2, 3], &[0xff, 0, 7]] {
            let bytes = [&whole[..place], stray, &whole[place..]].concat();
            assert_eq!(decode_grey(&bytes).unwrap().pixels, pixels, "{place} {stray:?}");
            assert!(refusal(&bytes[..bytes.len() * 3 / 4]).contains("incomplete"));
        }
    }
    // Fill bytes before the end.
    let filled = [&whole[..whole.len() - 2], &[255, 255, 255, 0xd9]].concat();
    assert_eq!(decode_grey(&filled).unwrap().pixels, pixels);
    // What follows the end is no part of the image, whatever it looks like.
    assert_eq!(decode_grey(&[&whole[..], &[0xff, 0xd8, 0xff], &whole].concat()).unwrap().pixels, pixels);
    // A file that was cut and another one in its place.
    assert!(refusal(&[&whole[..whole.len() * 3 / 4], &whole].concat()).contains("incomplete"));
}

#[test]
fn rejects_several_images_in_a_pnm() {
    for (one, two) in [
        (&b"P5 2 1 255\n\x07\x08"[..], &b"P5 2 1 255\n\x09\x08"[..]),
        (b"P6 1 1 65535\n123456", b"\nP6 1 1 255\n123"),
        (b"P2 2 1 255\n1 2\n", b"P2 2 1 255\n3 2\n"),
        (b"P4 9 1\n\x80\x80", b"P4 9 1\n\x80\x80"),
    ] {
        assert!(decode_grey(one).is_ok());
        assert!(decode_grey(&[one, b"\n"].concat()).is_ok());
        assert!(refusal(&[one, two].concat()).contains("several images"));
    }
}

#[test]
fn rejects_an_animation() {
    let mut animated = Vec::new();
    let mut encoder = png::Encoder::new(&mut animated, 2, 1);
    encoder.set_animated(2, 0).unwrap();
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[1, 2]).unwrap();
    writer.write_image_data(&[3, 4]).unwrap();
    writer.finish().unwrap();
    assert!(refusal(&animated).contains("2 images"));
}

#[test]
fn rotates_a_jpeg_by_its_orientation() {
    let plain = decode_grey(&jpeg(48, 32)).unwrap().pixels;
    let image = decode_grey(&jpeg(48, 32)).unwrap();
    let scaled = image.clone().relative_to(0.5).coding_variance;
    assert_eq!(scaled, 4.0 * image.coding_variance, "the variance has the units of the pixels");
    let turned = decode_grey(&jpeg_turned(48, 32, 6)).unwrap().pixels;
    assert_eq!(turned.dim(), (48, 32));
    assert_eq!(turned[(40, 10)], plain[(31 - 10, 40)]);
    assert_eq!(decode_grey(&jpeg_turned(48, 32, 1)).unwrap().pixels, plain);
    // EXIF of more than 64 KB continues in another segment.
    let file = jpeg_turned(48, 32, 6);
    let end = 4 + usize::from(u16::from_be_bytes([file[4], file[5]]));
    let continued = [&file[..end], b"\xff\xe1\0\x0cExif\0\0more", &file[end..]].concat();
    assert_eq!(decode_grey(&continued).unwrap().pixels, turned);
}

#[test]
fn bmp_is_read() {
    let image = image::RgbImage::from_fn(5, 4, |x, y| image::Rgb([x as u8 * 3, y as u8 * 3, 9]));
    let read = decode_grey(&bmp(image.into())).unwrap();
    assert_eq!((read.pixels.dim(), read.colour), ((4, 5), true));
    assert!((read.pixels[(3, 4)] - (12.0 + 9.0 + 9.0) / 3.0 / 255.0).abs() < 1e-6);
}

#[test]
fn grey_stored_in_colour_is_grey() {
    let grey = |blue: u8| {
        let image = image::RgbImage::from_fn(5, 4, |x, y| {
            let value = (20 * x + 3 * y) as u8;
            image::Rgb([value, value, if (x, y) == (4, 3) { blue } else { value }])
        });
        decode_grey(&bmp(image.into())).unwrap()
    };
    assert_eq!([grey(89).colour, grey(90).colour], [false, true]);
}

#[test]
fn a_deep_pgm_has_the_scale_of_its_header() {
    let pgm = decode_grey(b"P5 2 1 4095\n\x0f\xff\x07\xff").unwrap();
    assert!((pgm.pixels[(0, 0)] - 1.0).abs() < 1e-6 && (pgm.pixels[(0, 1)] - 0.5).abs() < 1e-3, "{pgm:?}");
}

#[test]
fn a_white_level_is_a_code_of_the_file() {
    let of = |bytes: &[u8], code| {
        let settings = ReadSettings { white_level: Some(code), ..ReadSettings::default() };
        decode(bytes).unwrap().grey(&settings).map(|image| image.white_level.unwrap())
    };
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 2, 1);
    encoder.set_depth(png::BitDepth::Four);
    encoder.write_header().unwrap().write_image_data(&[0x1f]).unwrap();
    for (bytes, largest) in [
        (b"P5 2 1 4095\n\x0f\xff\x07\xff".as_slice(), 4095),
        (b"P2 2 1 100\n100 50\n", 100),
        (&png, 15),
        (&tiff(CLASSIC, &[Page::grey(2, 1, 4, vec![0x1f])]), 15),
        (&tiff(CLASSIC, &[Page::grey(2, 1, 8, vec![1, 2])]), 255),
    ] {
        assert_eq!(of(bytes, largest), Ok(1.0), "{largest}");
        let half = of(bytes, largest / 2 + 1).unwrap();
        assert!((half - 0.5).abs() < 0.04, "{largest}: {half}");
        assert!(of(bytes, largest + 1).unwrap_err().contains(&format!("1 to {largest}")));
    }
}

#[test]
fn a_wrong_white_level_does_not_blame_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("far.png");
    fs::write(&path, encode_png(ndarray::array![[1, 2]].view(), 8).unwrap()).unwrap();
    let settings = ReadSettings { white_level: Some(4095), ..ReadSettings::default() };
    let error = read_grey_with(&path, &settings).unwrap_err().to_string();
    assert!(error.ends_with("far.png: a white level of 4095 is outside its codes, 1 to 255"), "{error}");
}

#[test]
fn pixels_that_a_bmp_skips_have_its_first_colour() {
    let read = |size: [u32; 2], used: u32, palette: &[[u8; 4]], runs: &[u8]| {
        let [width, height] = size;
        let header = [40, width, height, 1 | 8 << 16, 1, runs.len() as u32, 0, 0, used, 0];
        let header = header.map(u32::to_le_bytes).concat();
        let begin = 14 + 40 + 4 * palette.len() as u32;
        let file = [begin + runs.len() as u32, 0, begin].map(u32::to_le_bytes).concat();
        let bytes = [b"BM".as_slice(), &file, &header, palette.as_flattened(), runs, &[0_u8; 1024]].concat();
        decode_grey(&bytes).unwrap().pixels.mapv(|value| (255.0 * value).round())
    };
    let palette = [[9, 6, 3, 0], [90, 60, 30, 0], [255, 255, 255, 0]];
    // Two pixels of colour 1; one skipped, one of colour 2, end of the row; the rest skipped.
    let runs = [2, 1, 0, 2, 1, 0, 1, 2, 0, 0, 0, 1];
    let expected = ndarray::array![[6.0, 6.0, 6.0, 6.0, 6.0], [60.0, 60.0, 6.0, 255.0, 6.0]];
    assert_eq!(read([5, 2], 3, &palette, &runs), expected);
    // 256 colours are stated, by 0, and two are stored.
    let few = read([2, 2], 0, &palette[..2], &[2, 1, 0, 0, 1, 1, 0, 1]);
    assert_eq!(few, ndarray::array![[60.0, 6.0], [60.0, 60.0]]);
    read([2, 1], 0, &palette[..2], &[2, 200, 0, 1]);
}

/// Mean of the squared steps of T.81, table K.1, over 0.08 to 0.3 cycles per pixel, a twelfth of it: 39.88.
#[test]
fn quantisation_tables_give_the_error_of_a_jpeg() {
    let of_quality = |quality| {
        let image = image::GrayImage::from_fn(64, 48, |x, y| image::Luma([(x * 3 + y * 5) as u8]));
        let mut bytes = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality).encode_image(&image).unwrap();
        decode_grey(&bytes).unwrap().coding_variance * 255.0 * 255.0
    };
    assert!((of_quality(50) - 39.88).abs() < 0.01, "{}", of_quality(50));
    assert!((of_quality(95) - 0.4035).abs() < 0.001, "{}", of_quality(95));
    let turned = decode_grey(&jpeg_turned(48, 32, 6)).unwrap().coding_variance;
    assert_eq!(turned, decode_grey(&jpeg(48, 32)).unwrap().coding_variance);
    assert_eq!(
        decode_grey(&tiff(CLASSIC, &[Page::grey(4, 3, 8, vec![7; 12])])).unwrap().coding_variance,
        0.0
    );
}

#[test]
fn other_programs_files_are_refused_by_format() {
    for (head, phrase) in [
        (b"RIFF\x10\0\0\0AVI LIST".as_slice(), "a video"),
        (b"\0\0\0\x20ftypisom\0\0\x02\0", "a video"),
        (b"ZISRAWFILE\0\0", "bfconvert"),
        (b"\xda\xce\xbe\x0a\0\0", "bfconvert"),
        (b"\x70\0\0\0\x10\0", "bfconvert"),
        (b"\x89HDF\r\n\x1a\n", "numpy.save"),
        (b"MATLAB 5.0 MAT-file, Platform", "numpy.save"),
        (b"PK\x03\x04\x14\0", ".npz"),
        (b"Pf\n2 1\n-1.0\n", "PFM"),
        (b"PIEH\x02\0\0\0", ".dpt"),
        (b"DIGITAL SURF", ".sur"),
        (b"8BPS\0\x01", "save it as PNG"),
        (b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
    ] {
        let error = decode_grey(head).unwrap_err();
        assert!(error.contains(phrase), "{error}");
    }
}

#[test]
fn a_metamorph_stack_is_refused_with_its_planes() {
    let page = Page::grey(4, 3, 8, vec![7; 12]).with(33629, &[1; 5]);
    let error = refusal(&tiff(CLASSIC, &[page]));
    assert!(error.contains("MetaMorph stack of 5 planes"), "{error}");
}
