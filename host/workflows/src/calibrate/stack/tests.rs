use super::*;

#[test]
fn a_path_in_a_command_is_one_word() {
    for (path, word) in [
        ("slices/05.png", "slices/05.png"),
        ("sl mit (Klammer)/05.png", "'sl mit (Klammer)/05.png'"),
        ("it's", r"'it'\''s'"),
        ("größe/$x", "'größe/$x'"),
    ] {
        assert_eq!(shell_word(Path::new(path)), word);
    }
}

#[test]
fn a_gap_is_named_by_the_slices_on_its_sides() {
    let folder = tempfile::tempdir().unwrap();
    for number in (1..8_u8).chain(18..25) {
        std::fs::write(folder.path().join(format!("{number:02}.png")), [number]).unwrap();
    }
    let stack = folder.path().to_path_buf();
    let request = CalibrateStackRequest { stack, step_mm: Some(0.1), ..CalibrateStackRequest::default() };
    let error = Listed::of(&request).err().unwrap().to_string();
    let phrases = ["at least one is missing between", "07.png", "18.png"];
    assert!(phrases.iter().all(|phrase| error.contains(phrase)), "{error}");
}

#[test]
fn positions_in_names_give_the_step() {
    let folder = tempfile::tempdir().unwrap();
    for number in -4..=4_i8 {
        let name = format!("z{}um.png", 83 * i32::from(number));
        std::fs::write(folder.path().join(name), number.to_le_bytes()).unwrap();
    }
    let stack = folder.path().to_path_buf();
    let listed = Listed::of(&CalibrateStackRequest { stack, ..CalibrateStackRequest::default() }).unwrap();
    assert!((listed.step_mm - 0.083).abs() < 1e-9 && listed.images[0].ends_with("z-332um.png"));
    assert!(listed.remarks.iter().any(|remark| remark.contains("0.083 mm")), "{:?}", listed.remarks);
}

#[test]
fn a_step_below_0_is_refused_with_the_remedy() {
    let of = |step_mm| CalibrateStackRequest { step_mm: Some(step_mm), ..CalibrateStackRequest::default() };
    let error = of(-0.083).check().unwrap_err();
    assert!(error.is_usage() && error.to_string().contains("step-mm -0.083: expected a positive number"));
    assert!(error.to_string().contains("--near-first"), "{error}");
    for step_mm in [0.0, f64::NAN] {
        assert!(!of(step_mm).check().unwrap_err().to_string().contains("--near-first"));
    }
    of(0.083).check().unwrap();
}

#[test]
fn a_given_step_unlike_the_stated_one_has_a_remark() {
    assert_eq!(contradiction(0.1, None), None);
    assert_eq!(contradiction(0.1, Some(Ok(101.0))), None);
    let remark = contradiction(0.5, Some(Ok(100.0))).unwrap();
    assert!(remark.contains("0.1 mm") && remark.contains("--step-mm 0.5"), "{remark}");
    let um_as_mm = contradiction(0.5, Some(Ok(0.5))).unwrap();
    assert!(um_as_mm.contains("a step of 0.0005 mm") && agrees(0.0005, &Ok(0.5)), "{um_as_mm}");
    let uneven = even_step(&[0.0, 100.0, 230.0, 300.0], &CalibrateStackRequest::default(), "");
    assert!(contradiction(0.1, Some(uneven)).unwrap().contains("uneven"));
}

#[test]
fn uneven_positions_are_refused_by_the_slices_between_which_they_are() {
    let request = CalibrateStackRequest::default();
    assert!((even_step(&[5.0, 4.0, 3.02, 2.0], &request, "").unwrap() - 1.0).abs() < 1e-12);
    let error = even_step(&[0.0, 1.0, 2.0, 3.5], &request, "").unwrap_err().to_string();
    assert!(error.contains("slices 3 and 4 are 1.5"), "{error}");
    let microscope = even_step(&[0.0, 2e-5, 4e-5, 8e-5], &request, "").unwrap_err().to_string();
    assert!(microscope.contains("slices 3 and 4 are 0.00004 apart, 0.00002 is usual"), "{microscope}");
    let standing = even_step(&[1.0, 1.0, 2.0], &request, "").unwrap_err().to_string();
    assert!(standing.contains("slices 1 and 2 are 0"), "{standing}");
}

#[test]
fn the_record_of_a_rig_gives_order_and_scale() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("capture.toml"), include_bytes!("../../sessions/capture.toml"))
        .unwrap();
    let stack = || CalibrateStackRequest { stack: folder.path().into(), ..CalibrateStackRequest::default() };
    assert_eq!(Listed::of(&stack()).unwrap().images.len(), 2);
    for request in [
        CalibrateStackRequest { near_first: true, ..stack() },
        CalibrateStackRequest { object_pixel_um: Some(3.0), ..stack() },
        CalibrateStackRequest { step_mm: Some(0.1), ..stack() },
    ] {
        let error = Listed::of(&request).err().unwrap();
        assert!(error.is_usage() && error.to_string().contains("--near-first"), "{error}");
    }
}

#[test]
fn single_pixels_without_a_value_are_filled_and_rows_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("1.tif");
    let read_with = |holes: &[(usize, usize)]| {
        let mut slice = Array2::from_elem((9, 9), 0.5_f32);
        holes.iter().for_each(|at| slice[*at] = f32::NAN);
        std::fs::write(&path, farnear_files::map::tiff(slice.view()).unwrap()).unwrap();
        read(std::slice::from_ref(&path), &CalibrateStackRequest::default(), &Context::unattended())
    };
    assert_eq!(read_with(&[(4, 4), (6, 2), (0, 0)]).unwrap().0, [Array2::from_elem((9, 9), 0.5_f32)]);
    let row: Vec<(usize, usize)> = (0..9).map(|x| (0, x)).collect();
    let error = read_with(&row).unwrap_err().to_string();
    assert!(error.contains("1.tif") && error.contains("9 have none"), "{error}");
}

#[test]
fn camera_frames_even_out_the_slices_and_white_stays_white() {
    use farnear_files::{image_file::encode_png, npy};

    let folder = tempfile::tempdir().unwrap();
    let (path, frames) = (folder.path().join("1.png"), folder.path().join("camera"));
    std::fs::create_dir(&frames).unwrap();
    let response = Array2::from_shape_fn((9, 10), |(_, x)| [1.0_f32, 1.25][x % 2]);
    for (name, map) in [("dark.npy", &Array2::zeros(response.dim())), ("response.npy", &response)] {
        std::fs::write(frames.join(name), npy::write(map.view())).unwrap();
    }
    let none_bad = Array2::<u16>::zeros(response.dim());
    std::fs::write(frames.join("bad.png"), encode_png(none_bad.view(), 8).unwrap()).unwrap();
    let mut codes = response.mapv(|response| (100.0 * response) as u16);
    codes[(4, 5)] = 255;
    std::fs::write(&path, encode_png(codes.view(), 8).unwrap()).unwrap();
    let request = CalibrateStackRequest { camera_frames: Some(frames), ..CalibrateStackRequest::default() };
    let (slices, _) = read(std::slice::from_ref(&path), &request, &Context::unattended()).unwrap();
    for (at, value) in slices[0].indexed_iter() {
        let expected = if at == (4, 5) { 1.0 } else { 100.0 / 255.0 };
        assert!((value - expected).abs() < 1e-5, "{at:?}: {value}");
    }
}

#[test]
fn slices_of_integers_and_of_floats_have_no_common_scale() {
    let folder = tempfile::tempdir().unwrap();
    let slices = ["1.tif", "2.tif"].map(|name| folder.path().join(name));
    let pixels = Array2::from_shape_fn((4, 5), |(y, x)| (5 * y + x) as u16);
    let codes = farnear_files::image_file::encode_tiff(pixels.view(), 16).unwrap();
    std::fs::write(&slices[0], codes).unwrap();
    let values = farnear_files::map::tiff(pixels.mapv(f32::from).view()).unwrap();
    std::fs::write(&slices[1], values).unwrap();
    let error = read(&slices, &CalibrateStackRequest::default(), &Context::unattended()).unwrap_err();
    assert!(error.is_usage() && error.to_string().contains("2.tif: expected pixels of one kind"), "{error}");
}
