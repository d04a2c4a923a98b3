//! Sets a cfg for tests if `FARNEAR_IMAGE_CORPUS` names folders with images.

fn main() {
    println!("cargo::rustc-check-cfg=cfg(image_corpus)");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=FARNEAR_IMAGE_CORPUS");
    if std::env::var_os("FARNEAR_IMAGE_CORPUS").is_some() {
        println!("cargo::rustc-cfg=image_corpus");
    }
}
