//! Sets cfgs for tests: `image_corpus` if `FARNEAR_IMAGE_CORPUS` names folders with images, and one per program on the PATH.

fn main() {
    farnear_test_data::declare_programs();
    println!("cargo::rustc-check-cfg=cfg(image_corpus)");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=FARNEAR_IMAGE_CORPUS");
    if std::env::var_os("FARNEAR_IMAGE_CORPUS").is_some() {
        println!("cargo::rustc-cfg=image_corpus");
    }
}
